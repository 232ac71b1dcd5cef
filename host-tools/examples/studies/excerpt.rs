//! Cuts the excerpt of the authors' data that the repository holds from their full files.
//!
//!     SELVEDGE_DATA=... cargo run -p selvedge-tools --example excerpt -- host-tools/data/sparsebtf
//!
//! Blocks and dictionaries are the authors' bytes, unchanged; only the dictionaries that the chosen
//! blocks use are kept, and numbered anew.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// First block along x and y, and blocks along each axis.
const WINDOW: ([usize; 2], usize) = ([3, 22], 6);
const BLOCKS_X: usize = 40;

fn main() {
    let data = std::env::var("SELVEDGE_DATA").expect("SELVEDGE_DATA names the folder with sparsebtf/ in it");
    let from = Path::new(&data).join("sparsebtf");
    let to = std::env::args().nth(1).expect("usage: excerpt FOLDER");
    let to = Path::new(&to);
    fs::create_dir_all(to).expect("folder");
    let ([x0, y0], side) = WINDOW;
    let blocks: Vec<usize> = (0..side * side).map(|i| (y0 + i / side) * BLOCKS_X + x0 + i % side).collect();
    let count = 1600;
    for letter in ["U", "V"] {
        let mut files = Vec::new();
        let mut used = BTreeSet::new();
        for material in ["carpet07", "felt05"] {
            let name = format!("Coeffs_BTF_{material}_1e-05_{letter}.bin");
            let words: Vec<u16> = fs::read(from.join(&name))
                .expect("coefficients")
                .as_chunks::<2>()
                .0
                .iter()
                .map(|&b| u16::from_le_bytes(b))
                .collect();
            let n = (words.len() - 4 - 2 * count) / 5;
            used.extend(blocks.iter().map(|&block| words[4 + 4 * n + block]));
            files.push((name, words, n));
        }
        let kept: Vec<u16> = used.into_iter().collect();
        for (name, words, n) in files {
            let (membership, counts) =
                (&words[4 + 4 * n..4 + 4 * n + count], &words[4 + 4 * n + count..4 + 4 * n + 2 * count]);
            let starts: Vec<usize> =
                (0..count).map(|block| counts[..block].iter().map(|&c| c as usize).sum()).collect();
            let ranges: Vec<std::ops::Range<usize>> =
                blocks.iter().map(|&b| starts[b]..starts[b] + counts[b] as usize).collect();
            let mut out = words[..4].to_vec();
            ranges.iter().for_each(|r| out.extend(&words[4 + 4 * r.start..4 + 4 * r.end]));
            out.extend(
                blocks.iter().map(|&b| kept.iter().position(|&k| k == membership[b]).expect("kept") as u16),
            );
            out.extend(blocks.iter().map(|&b| counts[b]));
            let values = 4 + 4 * n + 2 * count;
            ranges.iter().for_each(|r| out.extend(&words[values + r.start..values + r.end]));
            fs::write(to.join(name), out.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>())
                .expect("write");
        }
        let dictionary = fs::read(from.join(format!("DictEnsOrth4D{letter}.bin"))).expect("dictionary");
        let mut out = Vec::new();
        let mut at = 0;
        for m in [10usize, 10, 151, 151] {
            kept.iter().for_each(|&k| {
                out.extend(&dictionary[at + k as usize * m * m * 2..at + (k as usize + 1) * m * m * 2])
            });
            at += 8 * m * m * 2;
        }
        fs::write(to.join(format!("DictEnsOrth4D{letter}.bin")), out).expect("write");
    }
    for name in ["carpet07_mean_std.bin", "felt05_mean_std.bin", "xyz_loc.bin", "LICENSE-SparseBTF.txt"] {
        fs::copy(from.join(name), to.join(name)).expect("copy");
    }
}
