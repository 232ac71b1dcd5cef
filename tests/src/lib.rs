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

/// The chapters of the methods by their numbers: the name of the method, and its text.
///
/// The number is in the first line, such as `# 10 Sparse ensemble`.
pub fn method_chapters() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/methods");
    let listed = std::fs::read_dir(&folder).expect("spec/methods");
    let mut chapters: Vec<(u32, String, String)> = listed
        .map(|entry| {
            let path = entry.expect("an entry").path();
            let text = std::fs::read_to_string(&path).expect("a method's chapter");
            let number = text.strip_prefix("# ").and_then(|rest| rest.split(' ').next()?.parse().ok());
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            (number.unwrap_or_else(|| panic!("{name}: no chapter number")), name, text)
        })
        .collect();
    chapters.sort();
    assert!(chapters.windows(2).all(|pair| pair[0].0 < pair[1].0), "a chapter number is used twice");
    chapters.into_iter().map(|(_, name, text)| (name, text)).collect()
}

/// The conformance table: that of the shared chapters, then those of the methods' chapters by their numbers.
pub fn conformance_table() -> String {
    let spec = Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec");
    let read = |path: PathBuf| {
        std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let mut table = read(spec.join("conformance.md"));
    for (name, _) in method_chapters() {
        table += &read(spec.join("conformance").join(name + ".md"));
    }
    table
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
