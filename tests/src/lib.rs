//! What several tests share: where the data are, loud messages about what is skipped, third-party files, and the
//! bodies of the fuzz targets.

pub mod foreign;
pub mod targets;

use std::path::{Path, PathBuf};

/// The excerpt in the repository.
pub fn excerpt_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools/data/sparsebtf")
}

/// The file that is imported from it.
pub fn excerpt_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../decoder-core/tests/data/carpet07-excerpt.selv")
}

/// The full data, if `SELVEDGE_DATA` names them; says so loudly if not.
pub fn full_data_folder(what_is_skipped: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("SELVEDGE_DATA")
        .map(|data| PathBuf::from(data).join("sparsebtf"))
        .filter(|folder| folder.is_dir());
    if folder.is_none() {
        eprintln!("SKIPPED: {what_is_skipped}: SELVEDGE_DATA DOES NOT NAME A FOLDER WITH sparsebtf/ IN IT");
    }
    folder
}

/// A number from the environment, for longer runs.
pub fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// The program, built beside these tests.
pub fn program() -> PathBuf {
    let mut folder = std::env::current_exe().expect("a test has a path");
    folder.pop();
    if folder.ends_with("deps") {
        folder.pop();
    }
    let path = folder.join(format!("selvedge{}", std::env::consts::EXE_SUFFIX));
    assert!(path.exists(), "{} is built by `cargo build --workspace`", path.display());
    path
}

/// Seeds and regressions of a fuzz target, by name.
pub fn seeds(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for kind in ["seeds", "regressions"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz").join(kind).join(target);
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        found.extend(entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).map(|path| {
            let bytes = std::fs::read(&path).expect("a seed");
            (path, bytes)
        }));
    }
    found.sort();
    found
}
