//! A crate's package builds alone: what its code includes lies in its folder, and its dependencies have
//! versions.

use std::path::{Component, Path, PathBuf};

/// Crates that are packaged, and the folders of their packages that have code.
const CRATES: [&str; 4] = ["decoder-core", "shaders", "host-tools", "c-interface"];
const FOLDERS: [&str; 3] = ["src", "examples", "benches"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Whether a path climbs out of a crate from a folder `depth` folders below it.
fn leaves(depth: usize, path: &str) -> bool {
    let mut depth = depth as i64;
    Path::new(path).components().any(|part| {
        depth += if part == Component::ParentDir { -1 } else { 1 };
        depth < 0
    })
}

#[test]
fn nothing_is_included_from_outside_of_a_crate() {
    assert!(leaves(1, "../../tests/data/x") && !leaves(1, "../tests/data/x") && leaves(0, "../x"));
    let mut climbing = 0;
    for name in CRATES {
        let of_crate = root().join(name);
        let mut files = Vec::new();
        FOLDERS.iter().for_each(|folder| sources(&of_crate.join(folder), &mut files));
        assert!(!files.is_empty(), "{name} has no code");
        for file in files {
            let depth = file.strip_prefix(&of_crate).expect("below it").components().count() - 1;
            let text = std::fs::read_to_string(&file).expect("text");
            for line in text.lines() {
                // What is joined to the manifest's folder is relative to that.
                let depth = if line.contains("CARGO_MANIFEST_DIR") { 0 } else { depth };
                for literal in line.split('"').skip(1).step_by(2).filter(|l| l.starts_with("../")) {
                    assert!(!leaves(depth, literal), "{}: {literal}", file.display());
                    climbing += 1;
                }
            }
        }
    }
    assert!(climbing > 0, "the example of the core includes a file");
}

#[test]
fn manifests_name_what_a_registry_needs() {
    let workspace = std::fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    for line in workspace.lines().filter(|line| line.contains("path = ")) {
        assert!(line.contains("version = "), "a dependency without a version: {line}");
    }
    for name in CRATES {
        let manifest = std::fs::read_to_string(root().join(name).join("Cargo.toml")).expect("a manifest");
        assert!(
            !manifest.contains("path = \"../"),
            "{name} has a dependency outside of the workspace's list"
        );
        assert!(manifest.contains("readme = \"README.md\""), "{name} has no readme of its own");
        assert!(root().join(name).join("README.md").is_file(), "{name}/README.md");
    }
}
