//! The house stays easy to walk: no circle of modules in any crate, no long function, parameter list or file
//! without a stated reason, and checking modules whose arithmetic says what it does beyond its range.

mod circles;
mod sizes;

use std::path::{Path, PathBuf};

/// Folders of crates.
const CRATES: [&str; 7] =
    ["decoder-core", "shaders", "c-interface", "host-tools", "tests", "firmware", "fuzz"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn parse(path: &Path) -> syn::File {
    syn::parse_file(&read(path)).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A path as it is from the repository's root.
fn relative(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// Files below a folder that end in `.rs`, builds left out.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() && !path.ends_with("target") {
            found.extend(rust_files(&path));
        } else if path.extension().is_some_and(|end| end == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Rust files of all crates.
fn all_files() -> Vec<PathBuf> {
    CRATES.iter().flat_map(|folder| rust_files(&root().join(folder))).collect()
}

/// What walks bytes that nobody vouches for.
#[test]
fn checking_modules_deny_silent_overflow() {
    let core = root().join("decoder-core/src");
    let mut modules = vec![core.join("open.rs"), core.join("container/mod.rs"), core.join("walk/mod.rs")];
    let methods = rust_files(&core.join("method"));
    let of_checks = |path: &PathBuf| path.ends_with("check.rs") || path.ends_with("cost.rs");
    modules.extend(methods.into_iter().filter(of_checks));
    for path in &modules {
        let denied = read(path).contains("#![deny(clippy::arithmetic_side_effects)]");
        assert!(denied, "{}: arithmetic may overflow in silence", relative(path));
    }
    assert!(modules.len() > 5, "{}", modules.len());
}
