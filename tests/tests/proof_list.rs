//! The proof that nothing panics (`firmware/src/proof.rs`) calls every public entry of the decoder.

use std::collections::BTreeSet;
use std::path::Path;
use syn::{ImplItem, Item, UseTree, Visibility};

fn source(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)).expect(name)
}

/// Public methods of the types that a caller meets, and the functions that the crate gives at its root.
fn entries() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for module in ["open", "image", "batch", "result", "header", "sha256", "error", "limits", "metadata", "colour"] {
        let file = syn::parse_file(&source(&format!("decoder-core/src/{module}.rs"))).expect("Rust");
        for item in file.items {
            let Item::Impl(block) = item else { continue };
            for item in block.items {
                if let ImplItem::Fn(method) = item
                    && matches!(method.vis, Visibility::Public(_))
                {
                    names.insert(method.sig.ident.to_string());
                }
            }
        }
    }
    // Lower-case names of `pub use` in lib.rs are functions.
    let library = syn::parse_file(&source("decoder-core/src/lib.rs")).expect("Rust");
    fn leaves(tree: &UseTree, names: &mut BTreeSet<String>) {
        match tree {
            UseTree::Path(path) => leaves(&path.tree, names),
            UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, names)),
            UseTree::Name(name) => drop(names.insert(name.ident.to_string())),
            _ => {}
        }
    }
    for item in library.items {
        if let Item::Use(item) = item {
            leaves(&item.tree, &mut names);
        }
    }
    names.retain(|name| name.starts_with(|c: char| c.is_ascii_lowercase()));
    names
}

#[test]
fn the_proof_calls_every_public_entry() {
    let proof = source("firmware/src/proof.rs");
    let entries = entries();
    // Called by `check_header` within `open`, with a closure that reads the file.
    let inside = ["read"];
    let missing: Vec<&String> = entries.iter().filter(|name| !inside.contains(&name.as_str()) && !proof.contains(&format!("{name}("))).collect();
    assert!(missing.is_empty(), "not in firmware/src/proof.rs: {missing:?}");
    assert!(entries.len() > 30, "{}", entries.len());
    println!("{} public entries", entries.len());
}
