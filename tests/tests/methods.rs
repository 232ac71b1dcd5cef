//! A method is whole: core, tools, shaders, specification, features and suite have the same ones. What one
//! of them lacks is named.

use selvedge_tools::check::extreme::extreme;
use selvedge_tools::format::write::write_material;
use selvedge_tools::methods::{METHODS, by_name, by_number, of};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Features of the core that are no method, and what they are.
const OTHER_FEATURES: &[(&str, &str)] = &[
    ("default", "what is there without asking"),
    ("all-methods", "every method"),
    ("batch", "the fast paths"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Files below a folder with an ending, at any depth.
fn files(folder: &str, ending: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == ending) {
                let text = std::fs::read_to_string(&path).expect("text");
                found.push((path, text));
            }
        }
    }
    assert!(!found.is_empty(), "nothing ends in {ending} below {folder}");
    found
}

/// Names and numbers of the tools' methods.
fn of_tools() -> BTreeMap<String, u32> {
    METHODS.iter().map(|method| (method.name.to_owned(), method.number)).collect()
}

/// `METHOD_SPARSE_TENSOR: u32 = 2` of constants in source, by name.
fn constants(folder: &str, ending: &str) -> BTreeMap<String, u32> {
    let mut found = BTreeMap::new();
    for (_, text) in files(folder, ending) {
        for line in text.lines().filter_map(|line| line.split_once("const METHOD_").map(|(_, rest)| rest)) {
            let Some((name, rest)) = line.split_once(": u32 = ") else { continue };
            let digits: String = rest.chars().take_while(char::is_ascii_alphanumeric).collect();
            let digits = digits.trim_end_matches('u');
            let number = match digits.strip_prefix("0x") {
                Some(digits) => u32::from_str_radix(digits, 16),
                None => digits.parse(),
            };
            found.insert(name.to_lowercase().replace('_', "-"), number.expect("a number"));
        }
    }
    found
}

/// What the first has and the second has not.
fn lacks<'a>(all: &'a BTreeMap<String, u32>, some: &BTreeMap<String, u32>) -> Vec<(&'a String, &'a u32)> {
    all.iter().filter(|(name, number)| some.get(*name) != Some(*number)).collect()
}

fn hold_equal(what: &str, found: &BTreeMap<String, u32>) {
    let tools = of_tools();
    let (missing, other) = (lacks(&tools, found), lacks(found, &tools));
    assert!(missing.is_empty(), "{what} lacks the tools' {missing:?}");
    assert!(other.is_empty(), "methods::METHODS lacks {other:?} of {what}");
}

#[test]
fn names_and_numbers_are_of_one_method_each() {
    let numbers: BTreeSet<u32> = METHODS.iter().map(|method| method.number).collect();
    assert_eq!((numbers.len(), of_tools().len()), (METHODS.len(), METHODS.len()));
    for &method in METHODS {
        assert_eq!(by_name(method.name).expect("its own name"), method);
        assert_eq!(by_number(method.number), Ok(method));
    }
    let unknown = numbers.last().expect("methods") + 1;
    let finding = by_number(unknown).expect_err("no method has this number");
    assert_eq!((finding.rule, finding.found), (selvedge::Rule::Method, unknown));
    let error = by_name("sparse").expect_err("no method has this name").to_string();
    assert!(METHODS.iter().all(|method| error.contains(method.name)), "{error}");
}

#[test]
fn core_and_kernel_have_the_tools_methods() {
    hold_equal("the core", &constants("decoder-core/src", "rs"));
    hold_equal("the kernel", &constants("shaders/wgsl", "wgsl"));
    let plain = |text: &str| text.to_lowercase().replace(['-', '_'], "");
    let listed = plain(&format!("{:?}", selvedge_shaders::METHODS));
    assert_eq!(selvedge_shaders::METHODS.len(), METHODS.len(), "selvedge_shaders::METHODS: {listed}");
    for method in METHODS {
        assert!(listed.contains(&plain(method.name)), "selvedge_shaders::METHODS lacks {}", method.name);
    }
}

/// `[features]` of a manifest, each with what it switches on.
fn features(manifest: &str) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(root().join(manifest)).expect("a manifest");
    let (_, rest) = text.split_once("[features]").expect("features");
    let section = rest.split("\n[").next().unwrap_or(rest);
    let lines = section.lines().filter(|line| !line.starts_with('#'));
    lines
        .filter_map(|line| line.split_once(" = "))
        .map(|(name, on)| (name.to_owned(), on.to_owned()))
        .collect()
}

#[test]
fn every_method_is_a_feature() {
    let manifest = "decoder-core/Cargo.toml";
    let features = features(manifest);
    for method in METHODS {
        let all = features.get("all-methods").expect("all-methods");
        assert!(features.contains_key(method.name), "{manifest}: no feature {}", method.name);
        assert!(all.contains(&format!("{:?}", method.name)), "{manifest}: all-methods lacks {}", method.name);
    }
    for feature in features.keys() {
        let other = OTHER_FEATURES.iter().any(|(name, why)| name == feature && !why.is_empty());
        assert!(other || by_name(feature).is_ok(), "{manifest}: {feature} is no method of the tools");
    }
}

/// Each method has a chapter, and each file of `spec/methods` is a method's.
#[test]
fn every_method_is_specified() {
    let texts = files("spec", "md");
    let headings: Vec<String> = texts
        .iter()
        .flat_map(|(_, text)| text.lines())
        .filter_map(|line| line.strip_prefix("# ").map(str::to_lowercase))
        .collect();
    for method in METHODS {
        let has = headings.iter().any(|heading| heading.contains(method.title));
        assert!(has, "no chapter of the specification is headed {}", method.title);
    }
    for (path, _) in texts.iter().filter(|(path, _)| path.parent().is_some_and(|p| p.ends_with("methods"))) {
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("a name");
        assert!(by_name(name).is_ok(), "{}: no method of the tools", path.display());
    }
}

/// The kinds of the core whose upper byte is a method's number are that method's, by name.
#[test]
fn every_section_of_a_method_has_a_name() {
    let mut kinds = BTreeSet::new();
    for (_, text) in files("decoder-core/src", "rs") {
        for line in text.lines().filter(|line| line.trim_start().starts_with("pub const ")) {
            let Some((_, value)) = line.split_once(": u32 = 0x") else { continue };
            let Some(digits) = value.strip_suffix(';').filter(|digits| digits.len() == 4) else { continue };
            kinds.extend(u32::from_str_radix(digits, 16));
        }
    }
    for &method in METHODS {
        let own: BTreeSet<u32> = kinds.iter().copied().filter(|kind| kind >> 8 == method.number).collect();
        let named: BTreeSet<u32> = method.sections.iter().map(|section| section.kind).collect();
        assert!(!own.is_empty() && own == named, "{method:?}: the core has {own:x?}, the tools {named:x?}");
        assert!(method.sections.iter().all(|section| !section.name.is_empty()), "{method:?}");
    }
}

/// Example and extremes are of their method and read back; colours and advice are told apart.
#[test]
fn every_method_has_its_parts() {
    let mut colours = BTreeSet::new();
    for &method in METHODS {
        for model in [(method.example)(), extreme(method, 1), extreme(method, 2)] {
            assert_eq!((model.method(), model.texture.name()), (method.number, method.name));
            let file = write_material(&model);
            let opened = selvedge::open(&file, &selvedge::Limits::NONE).expect("legal");
            assert_eq!(of(&opened), Ok(method));
            assert!(*(method.read)(&opened) == *model.texture, "{method:?} is not read back");
            let back = (method.from_json)(model.texture.to_json()).expect("its own JSON");
            assert!(*back == *model.texture, "{method:?} is not read back from JSON");
        }
        assert!((method.example)().has_texture(), "{method:?}: the example shows no texture");
        assert!(colours.insert(method.colour), "{method:?} has the colour of another method");
        assert!(!method.paper.is_empty() && !method.advice.is_empty(), "{method:?}");
    }
}

/// The suite has an example of each method.
#[test]
fn every_method_is_in_the_suite() {
    let suite = selvedge_tests::targets::suite();
    for method in METHODS {
        let example = write_material(&(method.example)());
        assert!(suite.iter().any(|vector| vector.bytes == example), "{method:?}: no vector is its example");
    }
}
