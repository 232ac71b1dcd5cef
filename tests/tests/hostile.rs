//! Bad files beyond the conformance suite: truncations, flipped bits and absurd values give a typed error or
//! a legal file, never a panic.

use selvedge::{Finding, First, Limits};
use selvedge_tests::setting;
use selvedge_tools::check::extreme::extreme_of_any_method;
use selvedge_tools::format::container::{lay_out, repair_checksums, take_apart};
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::example::example_model;

fn example() -> Vec<u8> {
    write_material(&example_model())
}

fn word(file: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]])
}

fn set_word(file: &mut [u8], at: usize, value: u32) {
    file[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// What every answer to a file must be: an error inside the file, or a material that answers.
fn open_and_use(file: &[u8], dictionary: Option<&[u8]>) -> Option<Finding> {
    let limits = Limits { bytes: 1 << 24, operations: 1 << 24, texels: 1 << 20 };
    match selvedge::open_with(file, dictionary, &limits) {
        Err(finding) => {
            let part = if finding.part == selvedge::Part::File { file } else { dictionary.unwrap_or(&[]) };
            assert!(finding.offset as usize <= part.len().max(128), "{finding}");
            let mut first = First::default();
            selvedge::validate(file, dictionary, &limits, &mut first);
            assert_eq!(first.0.map(|f| f.rule), Some(finding.rule));
            Some(finding)
        }
        Ok(material) => {
            let mut random = Random::new(file.len() as u64);
            for _ in 0..4 {
                let mut direction = || selvedge::Direction {
                    x_q18: random.word() as i32,
                    y_q18: random.range(-262_144, 262_144) as i32,
                    z_q15: random.word() as i32,
                };
                let (light, view) = (direction(), direction());
                material.trilinear(random.word() >> 12, random.word(), random.word(), light, view);
                material.point(random.word(), random.word() >> 22, random.word(), random.word() >> 22);
            }
            material.metadata();
            None
        }
    }
}

#[test]
fn truncated_at_every_byte() {
    let file = example();
    for length in 0..file.len() {
        assert!(open_and_use(&file[..length], None).is_some(), "{length}");
        // With the length stated as it is, as far as the header is there.
        let mut shorter = file[..length].to_vec();
        if length >= 128 {
            set_word(&mut shorter, 12, length as u32);
            repair_checksums(&mut shorter);
            assert!(open_and_use(&shorter, None).is_some(), "{length}");
        }
    }
}

#[test]
fn every_bit_flipped() {
    let (split, dictionary) = write_split(&example_model());
    let mut legal = 0;
    for (file, dictionary) in [(example(), None), (split, Some(dictionary))] {
        for bit in 0..file.len() * 8 {
            let mut flipped = file.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            // Only the minor version and nothing else may change unseen, and that needs the checksum.
            assert!(open_and_use(&flipped, dictionary.as_deref()).is_some(), "bit {bit}");
            repair_checksums(&mut flipped);
            legal += open_and_use(&flipped, dictionary.as_deref()).is_none() as usize;
        }
    }
    println!("{legal} of the flips with repaired checksums are legal files");
    assert!(legal > 1000);
}

#[test]
fn absurd_values_in_every_field() {
    let mut random = Random::new(3);
    for seed in [0u64, 1, 2, 3] {
        let file = if seed == 0 { example() } else { write_material(&extreme_of_any_method(seed)) };
        let step = (file.len() / 4 / setting("SELVEDGE_FIELDS", 700)).max(1);
        for at in (0..file.len() / 4).filter(|at| *at < 512 || at % step == 0).map(|at| at * 4) {
            let old = word(&file, at);
            let any = random.word();
            for value in [
                0,
                1,
                old.wrapping_add(1),
                old.wrapping_sub(1),
                0x7fff_ffff,
                0x8000_0000,
                0xffff_ffff,
                0x8000,
                0xffff,
                any,
                old ^ 0x8000_8000,
            ] {
                let mut changed = file.clone();
                set_word(&mut changed, at, value);
                repair_checksums(&mut changed);
                open_and_use(&changed, None);
            }
        }
    }
}

/// Many bytes at once, with checksums repaired.
#[test]
fn random_damage() {
    let mut legal = 0;
    let count = setting("SELVEDGE_DAMAGE", 30_000);
    let files: Vec<Vec<u8>> = (0..40)
        .map(|seed| write_material(&extreme_of_any_method(seed)))
        .filter(|file| file.len() < 40_000)
        .chain([example()])
        .collect();
    let mut random = Random::new(11);
    for i in 0..count {
        let mut file = files[i % files.len()].clone();
        for _ in 0..random.range(1, 6) {
            let at = random.range(0, file.len() as i64 - 1) as usize;
            file[at] = random.word() as u8;
        }
        repair_checksums(&mut file);
        legal += open_and_use(&file, None).is_none() as usize;
    }
    println!("{legal} of {count} damaged files are legal");
    assert!(legal > 0);
}

/// Taking a file apart and laying it out again gives the same bytes.
#[test]
fn layout_is_canonical() {
    for seed in 0..60 {
        let file = write_material(&extreme_of_any_method(seed));
        let (header, parts) = take_apart(&file);
        assert!(lay_out(header, parts) == file, "{seed}");
    }
}
