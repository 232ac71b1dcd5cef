//! Every seed and every regression of the fuzz targets goes through its body, and the bodies can fail.

use selvedge_tests::targets::{self, TARGETS};
use selvedge_tests::{seeds, setting};
use selvedge_tools::math::random::Random;
use std::path::Path;

#[test]
fn seeds_and_regressions_pass() {
    for target in &TARGETS {
        let all = seeds(target.name);
        assert!(!all.is_empty(), "{} has no seeds", target.name);
        for (path, bytes) in &all {
            let result = std::panic::catch_unwind(|| (target.run)(bytes));
            assert!(result.is_ok(), "{}", path.display());
        }
        println!("{}: {} files", target.name, all.len());
    }
}

/// A short run on random bytes, so that CI sees new ones.
#[test]
fn random_bytes_pass() {
    let mut random = Random::new(setting("SELVEDGE_FUZZ_SEED", 1) as u64);
    for target in &TARGETS {
        let count = setting("SELVEDGE_FUZZ", 2000) / if target.name == "importers" { 10 } else { 1 };
        for _ in 0..count {
            let length = random.range(0, 120) as usize;
            let bytes: Vec<u8> = (0..length).map(|_| random.word() as u8).collect();
            (target.run)(&bytes);
        }
    }
}

/// Random bytes reach legal files, so that the targets assert something of samples.
#[test]
fn targets_reach_legal_files() {
    let mut legal = 0;
    for vector in targets::suite() {
        let dictionary =
            vector.dictionary.as_ref().and_then(|path| targets::suite().iter().find(|v| v.path == *path));
        legal += targets::open_and_sample(&vector.bytes, dictionary.map(|d| &d.bytes[..])) as usize;
    }
    assert!(legal >= 30, "{legal}");
}

/// Every target of the folder is one of the list and the reverse.
#[test]
fn the_fuzz_folder_has_the_targets() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/fuzz_targets");
    let mut there: Vec<String> = std::fs::read_dir(folder)
        .expect("fuzz_targets")
        .map(|entry| entry.expect("entry").path().file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    there.sort();
    let mut listed: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
    listed.sort_unstable();
    assert_eq!(there, listed);
}
