//! The proof that nothing panics (`firmware/src/proof.rs` and the files of `firmware/src/proof`) calls every
//! public function of the decoder, and every method of a public type. Both lists are found by walking: the
//! modules of the core from its root, the proof by its folder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use syn::{ImplItem, Item, UseTree, Visibility};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What `pub use` gives at the crate's root.
fn leaves(tree: &UseTree, names: &mut BTreeSet<String>) {
    match tree {
        UseTree::Path(path) => leaves(&path.tree, names),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, names)),
        UseTree::Name(name) => drop(names.insert(name.ident.to_string())),
        _ => {}
    }
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// A module of the core with a file of its own.
struct Module {
    name: String,
    /// Whether it and all above it are public.
    open: bool,
    file: syn::File,
}

/// The module of a file and all below it.
fn walk(path: &Path, folder: &Path, name: &str, open: bool, found: &mut Vec<Module>) {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let file = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    for item in &file.items {
        let Item::Mod(module) = item else { continue };
        if module.content.is_some() {
            continue;
        }
        let child = module.ident.to_string();
        let (flat, deep) = (folder.join(format!("{child}.rs")), folder.join(&child).join("mod.rs"));
        let path = if flat.exists() { flat } else { deep };
        walk(&path, &folder.join(&child), &child, open && is_public(&module.vis), found);
    }
    found.push(Module { name: name.to_owned(), open, file });
}

/// How the public functions of a module are written where they are called: the alternatives of each.
fn calls_of(module: &Module, root: &BTreeSet<String>, calls: &mut Vec<Vec<String>>) {
    let public_types: BTreeSet<String> = module
        .file
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Struct(item) if is_public(&item.vis) => Some(item.ident.to_string()),
            Item::Enum(item) if is_public(&item.vis) => Some(item.ident.to_string()),
            _ => None,
        })
        .filter(|name| module.open || root.contains(name))
        .collect();
    for item in &module.file.items {
        match item {
            Item::Fn(function) if is_public(&function.vis) => {
                let name = function.sig.ident.to_string();
                let at_root = root.contains(&name).then(|| format!("selvedge::{name}("));
                let in_module = module.open.then(|| format!("{}::{name}(", module.name));
                let ways: Vec<String> = at_root.into_iter().chain(in_module).collect();
                calls.extend(Some(ways).filter(|ways| !ways.is_empty()));
            }
            Item::Impl(block) if block.trait_.is_none() => {
                let syn::Type::Path(path) = &*block.self_ty else { continue };
                let name = path.path.segments.last().expect("a name").ident.to_string();
                if !public_types.contains(&name) && !root.contains(&name) {
                    continue;
                }
                for item in &block.items {
                    if let ImplItem::Fn(method) = item
                        && is_public(&method.vis)
                    {
                        let method = method.sig.ident.to_string();
                        calls.push(vec![format!(".{method}("), format!("{name}::{method}(")]);
                    }
                }
            }
            _ => {}
        }
    }
}

/// How each public function of the core is written where it is called: the alternatives of one.
fn calls() -> Vec<Vec<String>> {
    let source = root().join("decoder-core/src");
    let mut modules = Vec::new();
    walk(&source.join("lib.rs"), &source, "selvedge", true, &mut modules);
    let library = modules.last().expect("the root is found last");
    let mut at_root = BTreeSet::new();
    for item in &library.file.items {
        if let Item::Use(item) = item
            && is_public(&item.vis)
        {
            leaves(&item.tree, &mut at_root);
        }
    }
    let mut calls = Vec::new();
    for module in &modules {
        calls_of(module, &at_root, &mut calls);
    }
    // Written by macros: the methods of a rule, and the dispatch over the methods.
    calls.extend(["id", "title", "name", "family"].map(|name| vec![format!("rule.{name}(")]));
    calls.push(vec!["method::textures_q20(".to_owned()]);
    calls
}

/// The text of the proof, all files.
fn proof() -> String {
    let mut text = String::new();
    let mut paths = vec![root().join("firmware/src/proof.rs"), root().join("firmware/src/proof")];
    while let Some(path) = paths.pop() {
        if path.is_dir() {
            paths.extend(
                std::fs::read_dir(&path).expect("a folder").map(|entry| entry.expect("entry").path()),
            );
        } else {
            text += &std::fs::read_to_string(&path).expect("text");
        }
    }
    text
}

#[test]
fn the_proof_calls_every_public_function() {
    let (proof, calls) = (proof(), calls());
    let missing: Vec<_> =
        calls.iter().filter(|ways| !ways.iter().any(|way| proof.contains(way.as_str()))).collect();
    assert!(missing.is_empty(), "not in the proof of the firmware: {missing:?}");
    assert!(calls.len() > 110, "{}", calls.len());
    println!("{} public functions and methods", calls.len());
}
