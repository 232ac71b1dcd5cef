//! Writes a suite of damaged and random files with this decoder's answers, for another decoder to be held
//! against.
//!
//! `damaged FOLDER COUNT SEED`.

use selvedge::Limits;
use selvedge_tests::targets::suite;
use selvedge_tools::check::extreme::extreme_of_any_method;
use selvedge_tools::check::vectors::{Answer, Vector, answer, manifest};
use selvedge_tools::files;
use selvedge_tools::format::container::repair_checksums;
use selvedge_tools::format::write::write_material;
use selvedge_tools::math::random::Random;
use std::path::Path;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, count, seed] = arguments.as_slice() else {
        eprintln!("damaged FOLDER COUNT SEED");
        std::process::exit(1);
    };
    let (count, seed): (u64, u64) = (count.parse().expect("a number"), seed.parse().expect("a number"));
    let mut random = Random::new(seed);
    let valid: Vec<&Vector> = suite()
        .iter()
        .filter(|v| matches!(v.answer, Answer::Digest(_)) && v.dictionary.is_none() && v.bytes.len() < 20_000)
        .collect();
    let mut vectors = Vec::new();
    for i in 0..count {
        let mut bytes = if random.once_in(6) {
            write_material(&extreme_of_any_method(seed << 32 | i))
        } else {
            random.pick(&valid).bytes.clone()
        };
        for _ in 0..random.range(0, 3) {
            let at = random.range(0, bytes.len() as i64 / 4 - 1) as usize * 4;
            let old = u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
            let any = random.word();
            let new = random.pick(&[
                0,
                1,
                old.wrapping_add(1),
                old.wrapping_sub(1),
                old ^ 1 << (any & 31),
                any,
                any & 0xff,
                0x8000,
            ]);
            bytes[at..at + 4].copy_from_slice(&new.to_le_bytes());
        }
        repair_checksums(&mut bytes);
        let answer = answer(&bytes, None, &Limits::NONE);
        let kind = if matches!(answer, Answer::Broken(..)) { "invalid" } else { "valid" };
        vectors.push(Vector {
            path: format!("{kind}-{i}.selv"),
            note: String::new(),
            bytes,
            dictionary: None,
            limits: None,
            answer,
        });
    }
    for vector in &vectors {
        files::write(&Path::new(folder).join(&vector.path), &vector.bytes).expect("written");
    }
    files::write(&Path::new(folder).join("manifest.tsv"), manifest(&vectors).as_bytes()).expect("written");
    let broken = vectors.iter().filter(|v| matches!(v.answer, Answer::Broken(..))).count();
    eprintln!("{} files, {broken} of them broken", vectors.len());
}
