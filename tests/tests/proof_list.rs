//! The proof that nothing panics (`firmware/src/proof.rs`) calls every public function of the decoder, and
//! every method of a public type.

use std::collections::BTreeSet;
use std::path::Path;
use syn::{ImplItem, Item, UseTree, Visibility};

fn source(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)).expect(name)
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

/// How each public function is written where it is called: the alternatives of one.
fn calls() -> Vec<Vec<String>> {
    let library = syn::parse_file(&source("decoder-core/src/lib.rs")).expect("Rust");
    let (mut root, mut modules) = (BTreeSet::new(), Vec::new());
    for item in &library.items {
        match item {
            Item::Use(item) if matches!(item.vis, Visibility::Public(_)) => leaves(&item.tree, &mut root),
            Item::Mod(module) if !module.ident.to_string().starts_with("no_") => {
                modules.push((module.ident.to_string(), matches!(module.vis, Visibility::Public(_))))
            }
            _ => {}
        }
    }
    let mut calls = Vec::new();
    for (module, is_public) in modules {
        let file = syn::parse_file(&source(&format!("decoder-core/src/{module}.rs"))).expect("Rust");
        let is_type_public = |name: &str| {
            root.contains(name)
                || is_public
                    && file.items.iter().any(|item| match item {
                        Item::Struct(item) => item.ident == name && matches!(item.vis, Visibility::Public(_)),
                        Item::Enum(item) => item.ident == name && matches!(item.vis, Visibility::Public(_)),
                        _ => false,
                    })
        };
        for item in &file.items {
            match item {
                Item::Fn(function) if matches!(function.vis, Visibility::Public(_)) => {
                    let name = function.sig.ident.to_string();
                    let at_root = root.contains(&name).then(|| format!("selvedge::{name}("));
                    let in_module = is_public.then(|| format!("{module}::{name}("));
                    calls.extend(
                        Some(at_root.into_iter().chain(in_module).collect::<Vec<_>>())
                            .filter(|ways| !ways.is_empty()),
                    );
                }
                Item::Impl(block) if block.trait_.is_none() => {
                    let syn::Type::Path(path) = &*block.self_ty else { continue };
                    let name = path.path.segments.last().expect("a name").ident.to_string();
                    if !is_type_public(&name) {
                        continue;
                    }
                    for item in &block.items {
                        if let ImplItem::Fn(method) = item
                            && matches!(method.vis, Visibility::Public(_))
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
    // The methods of a rule are written by a macro.
    calls.extend(["id", "title", "name", "family"].map(|name| vec![format!("rule.{name}(")]));
    calls
}

#[test]
fn the_proof_calls_every_public_function() {
    let proof = source("firmware/src/proof.rs");
    let calls = calls();
    let missing: Vec<_> =
        calls.iter().filter(|ways| !ways.iter().any(|way| proof.contains(way.as_str()))).collect();
    assert!(missing.is_empty(), "not in firmware/src/proof.rs: {missing:?}");
    assert!(calls.len() > 110, "{}", calls.len());
    println!("{} public functions and methods", calls.len());
}
