//! A module for each file of `tests/extremes/methods`, and the list of what they must reach: adding a method
//! adds a file.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let folder = root.join("tests/extremes/methods");
    println!("cargo:rerun-if-changed={}", folder.display());
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    let (mut modules, mut own) = (String::new(), String::new());
    for file in files {
        let name = file.file_stem().expect("a name").to_string_lossy().into_owned();
        writeln!(modules, "#[path = {file:?}]\nmod {name};").expect("text");
        write!(own, "{name}::OWN, ").expect("text");
    }
    let text = format!(
        "{modules}\n/// The methods' own lists, by file.\nconst OWN: &[Own] = &[{}];\n",
        own.trim_end()
    );
    let out = std::env::var("OUT_DIR").expect("set by cargo");
    std::fs::write(Path::new(&out).join("extremes.rs"), text).expect("the list is written");
}
