//! Which module uses which, and that none uses itself by way of others.
//!
//! A module is a file. It uses another if it names it, or an item of it, in code that is not of tests: by `use`,
//! or by a path. That a parent declares its children is no use.

use crate::{CRATES, parse, relative, root};
use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens as _;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::{Item, UseTree};

type Name = Vec<String>;

/// A word of a path that a macro fills in.
const FILLED_IN: &str = "$";

/// The modules of a crate by their paths from its root, each with its code.
type Modules = BTreeMap<Name, Vec<Item>>;

fn of_tests(item: &Item) -> bool {
    let attributes = match item {
        Item::Mod(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        _ => return false,
    };
    attributes.iter().any(|attribute| attribute.to_token_stream().to_string().contains("cfg (test)"))
}

/// Reads a module and all below it.
fn collect(path: &Path, folder: &Path, name: Name, modules: &mut Modules) {
    let items: Vec<Item> = parse(path).items.into_iter().filter(|item| !of_tests(item)).collect();
    for item in &items {
        let Item::Mod(module) = item else { continue };
        let child = module.ident.to_string();
        let (flat, deep) = (folder.join(format!("{child}.rs")), folder.join(&child).join("mod.rs"));
        let path = if flat.exists() { flat } else { deep };
        // A module with its text inside is part of its file; one by a written path is found elsewhere.
        if module.content.is_none() && path.exists() {
            let name: Name = name.iter().cloned().chain([child.clone()]).collect();
            collect(&path, &folder.join(&child), name, modules);
        }
    }
    modules.insert(name, items);
}

/// The paths of a `use`, from its first word.
fn leaves(tree: &UseTree, before: &[String], paths: &mut Vec<Name>) {
    let with = |word: &syn::Ident| before.iter().cloned().chain([word.to_string()]).collect::<Name>();
    match tree {
        UseTree::Path(path) => leaves(&path.tree, &with(&path.ident), paths),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, before, paths)),
        UseTree::Name(name) => paths.push(with(&name.ident)),
        UseTree::Rename(name) => paths.push(with(&name.ident)),
        UseTree::Glob(_) => paths.push(before.to_vec()),
    }
}

/// The words of paths in code: runs of names between double colons. A name that a macro fills in is [`FILLED_IN`].
fn paths_in(tokens: TokenStream, paths: &mut Vec<Name>) {
    let mut run: Name = Vec::new();
    // Colons since the last word of the run.
    let mut colons = 0;
    let mut end = |run: &mut Name| {
        if run.len() > 1 {
            paths.push(std::mem::take(run));
        }
        run.clear();
    };
    let mut groups = Vec::new();
    let mut filled_in = false;
    for token in tokens {
        match token {
            TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
            TokenTree::Punct(punct) if punct.as_char() == '$' => {
                filled_in = true;
                if colons != 2 {
                    end(&mut run);
                }
            }
            TokenTree::Ident(word) => {
                if colons != 2 {
                    end(&mut run);
                }
                run.push(if filled_in { FILLED_IN.into() } else { word.to_string() });
                (colons, filled_in) = (0, false);
            }
            other => {
                end(&mut run);
                (colons, filled_in) = (0, false);
                if let TokenTree::Group(group) = other {
                    groups.push(group.stream());
                }
            }
        }
    }
    end(&mut run);
    groups.into_iter().for_each(|group| paths_in(group, paths));
}

/// The modules that a path of a module names: none of other crates, several where a macro fills in the name.
fn resolved(path: &[String], from: &Name, modules: &Modules) -> Vec<Name> {
    let with = |base: &Name, word: &str| base.iter().cloned().chain([word.to_owned()]).collect::<Name>();
    let steps = path.iter().take_while(|word| ["crate", "self", "super"].contains(&word.as_str())).count();
    let (first, rest) = path.split_at(steps);
    let mut base = match first.first().map(String::as_str) {
        Some("crate") => Name::new(),
        None if rest.first().is_none_or(|word| !modules.contains_key(&with(from, word))) => {
            return Vec::new();
        }
        _ => from.clone(),
    };
    for _ in first.iter().filter(|word| *word == "super") {
        base.pop();
    }
    below(base, rest, modules)
}

/// The modules that the words of a path lead to from a module on.
fn below(mut base: Name, words: &[String], modules: &Modules) -> Vec<Name> {
    for (n, word) in words.iter().enumerate() {
        if word == FILLED_IN {
            let is_child = |name: &&Name| name.len() == base.len() + 1 && name.starts_with(&base);
            let next = words.get(n + 1).filter(|word| *word != FILLED_IN);
            let has_next =
                |name: &&Name| next.is_none_or(|next| modules[*name].iter().any(|item| is_named(item, next)));
            let children = modules.keys().filter(is_child).filter(has_next);
            // The last of several is an item of the module.
            let rest = if words[n + 1..] == [FILLED_IN] { &[] } else { &words[n + 1..] };
            return children.flat_map(|child| below(child.clone(), rest, modules)).collect();
        }
        base.push(word.clone());
        if !modules.contains_key(&base) {
            base.pop();
            break;
        }
    }
    vec![base]
}

/// Whether an item declares a name.
fn is_named(item: &Item, name: &str) -> bool {
    match item {
        Item::Mod(item) => item.ident == name,
        Item::Static(item) => item.ident == name,
        Item::Const(item) => item.ident == name,
        Item::Fn(item) => item.sig.ident == name,
        _ => false,
    }
}

/// Which modules each module uses.
fn uses(modules: &Modules) -> BTreeMap<Name, BTreeSet<Name>> {
    let of_module = |(name, items): (&Name, &Vec<Item>)| {
        let mut paths = Vec::new();
        for item in items {
            match item {
                Item::Use(item) => leaves(&item.tree, &[], &mut paths),
                Item::Mod(item) if item.content.is_none() => {}
                item => paths_in(item.to_token_stream(), &mut paths),
            }
        }
        let used = paths.iter().flat_map(|path| resolved(path, name, modules));
        (name.clone(), used.filter(|used| used != name).collect())
    };
    modules.iter().map(of_module).collect()
}

/// A way from a module back to it, if there is one.
fn circle(from: &Name, uses: &BTreeMap<Name, BTreeSet<Name>>) -> Option<Vec<Name>> {
    let mut before: BTreeMap<&Name, &Name> = BTreeMap::new();
    let mut open = vec![from];
    while let Some(at) = open.pop() {
        for next in &uses[at] {
            if next == from {
                let mut way = vec![from.clone(), at.clone()];
                let mut step = at;
                while let Some(&earlier) = before.get(step) {
                    way.push(earlier.clone());
                    step = earlier;
                }
                way.reverse();
                return Some(way);
            }
            if !before.contains_key(next) {
                before.insert(next, at);
                open.push(next);
            }
        }
    }
    None
}

fn text(way: &[Name]) -> String {
    way.iter().map(|name| name.join("::")).collect::<Vec<_>>().join(" -> ")
}

#[test]
fn no_crate_has_a_circle_of_modules() {
    let mut circles = BTreeSet::new();
    for folder in CRATES {
        let source = root().join(folder).join("src");
        let library = source.join("lib.rs");
        if !library.exists() {
            continue;
        }
        let mut modules = Modules::new();
        collect(&library, &source, Name::new(), &mut modules);
        let uses = uses(&modules);
        let arrows: usize = uses.values().map(BTreeSet::len).sum();
        println!("{}: {} modules, {arrows} arrows", relative(&source), modules.len());
        assert!(modules.len() < 3 || arrows >= modules.len() / 2, "{folder}: so few uses are found");
        let mut found: Vec<Vec<Name>> = modules.keys().filter_map(|name| circle(name, &uses)).collect();
        found.sort_by_key(Vec::len);
        circles.extend(found.iter().take(9).map(|way| format!("{folder}: {}", text(way))));
    }
    assert!(circles.is_empty(), "circles:\n{}", circles.into_iter().collect::<Vec<_>>().join("\n"));
}

/// A circle is found, so that the test above can fail.
#[test]
fn a_planted_circle_is_found() {
    let items = |text: &str| syn::parse_file(text).expect("Rust").items;
    let name = |text: &str| text.split("::").map(str::to_owned).collect::<Name>();
    let modules = Modules::from([
        (Name::new(), items("mod a; mod b;")),
        (name("a"), items("use crate::b::{C, d::E};")),
        (name("b"), items("fn f() { m!(super::a::g()) }")),
    ]);
    let uses = uses(&modules);
    let way = circle(&name("a"), &uses).expect("a circle");
    assert_eq!(text(&way), "a -> b -> a");
    assert!(circle(&Name::new(), &uses).is_none());
}
