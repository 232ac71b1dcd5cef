//! Specification, conformance table, code and example agree.

use selvedge::Rule;
use selvedge_tools::check::example::hex_dump;
use selvedge_tools::methods::{METHODS, Method};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn path_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

fn read(name: &str) -> String {
    std::fs::read_to_string(path_of(name)).expect(name)
}

/// The entries of a folder, in the order of their names.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = listed.map(|entry| entry.expect("entry").path()).collect();
    paths.sort();
    paths
}

/// The files of a folder and of all folders in it that end with one of `extensions`.
fn files_below(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for path in entries(folder) {
        if path.is_dir() {
            files.extend(files_below(&path, extensions));
        } else if path.extension().is_some_and(|end| extensions.iter().any(|wanted| end == *wanted)) {
            files.push(path);
        }
    }
    files
}

/// The specification: the shared chapters, then the chapters of the methods by their numbers.
fn specification() -> String {
    let mut text = read("spec/selvedge-1.md");
    for (_, chapter) in selvedge_tests::method_chapters() {
        text.push('\n');
        text.push_str(&chapter);
    }
    text
}

/// Rule numbers such as 5.4-2 at the start of a line in bold.
fn stated_rules() -> Vec<String> {
    let spec = specification();
    let numbers = spec
        .lines()
        .filter_map(|line| line.strip_prefix("**")?.split_once("**").map(|(number, _)| number.to_owned()));
    numbers
        .filter(|n| {
            n.contains('.')
                && n.contains('-')
                && n.chars().all(|c| c.is_ascii_digit() || c == '.' || c == '-')
        })
        .collect()
}

#[test]
fn every_rule_of_the_code_is_in_the_specification_once() {
    let stated = stated_rules();
    let unique: BTreeSet<_> = stated.iter().collect();
    assert_eq!(unique.len(), stated.len(), "a number is used twice");
    let missing: Vec<_> =
        Rule::ALL.iter().map(|rule| rule.id()).filter(|id| !unique.contains(&(*id).to_owned())).collect();
    assert!(missing.is_empty(), "{missing:?}");
    println!("{} rules, {} of them checked by open", stated.len(), Rule::ALL.len());
}

/// Citations that each tree of sources has at least.
const CITED: usize = 60;

/// The rule numbers among the words of a comment.
fn cited_rules(comment: &str) -> impl Iterator<Item = &str> {
    comment
        .split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .map(|word| word.trim_end_matches(['.', '-']))
        .filter(|word| {
            let parts: Vec<&str> = word.split(['.', '-']).collect();
            word.contains('.')
                && word.contains('-')
                && parts.len() == 3
                && word.find('.') < word.find('-')
                && parts.iter().all(|part| !part.is_empty())
        })
}

#[test]
fn every_rule_that_a_comment_cites_is_in_the_specification() {
    let stated: BTreeSet<_> = stated_rules().into_iter().collect();
    for folder in ["decoder-core/src", "shaders/wgsl", "host-tools/src"] {
        let mut cited = 0;
        for path in files_below(&path_of(folder), &["rs", "wgsl"]) {
            let text = std::fs::read_to_string(&path).expect("source");
            let comments = text.lines().filter_map(|line| line.split_once("//").map(|(_, comment)| comment));
            for word in comments.flat_map(cited_rules) {
                cited += 1;
                assert!(stated.contains(word), "{}: {word} is cited and not stated", path.display());
            }
        }
        assert!(cited > CITED, "{folder}: {cited}");
    }
}

#[test]
fn the_conformance_table_has_a_row_for_every_rule() {
    let table = selvedge_tests::conformance_table();
    let rows: Vec<Vec<String>> = table
        .lines()
        .filter(|line| line.starts_with("| ") && line.as_bytes().get(2).is_some_and(u8::is_ascii_digit))
        .map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect())
        .collect();
    let numbers: Vec<_> = rows.iter().map(|row| row[0].clone()).collect();
    assert_eq!(numbers, stated_rules(), "rows in the order of the specification");
    for row in &rows {
        assert_eq!(row.len(), 5, "{row:?}");
        if let Some(rule) = Rule::ALL.iter().find(|rule| rule.id() == row[0]) {
            assert!(row[1].contains(&format!("`{}`", rule.name())), "{row:?} is {}", rule.name());
        }
    }
}

/// What begins a block of an example's bytes: `hex` alone of the first method's, which shows the shared
/// chapters too, and with the last word of its name of another's.
fn fence_of(method: &Method) -> String {
    if method == METHODS[0] {
        return "```hex".into();
    }
    format!("```hex {}", method.name.rsplit('-').next().expect("a word"))
}

/// Holds the blocks of an example against its file; gives the bytes that are shown.
fn shown_bytes(spec: &str, fence: &str, file: &[u8]) -> BTreeSet<usize> {
    let mut shown = BTreeSet::new();
    let mut inside = false;
    for line in spec.lines() {
        if line.starts_with("```") {
            inside = line == fence;
            continue;
        }
        if !inside || line.trim().is_empty() {
            continue;
        }
        let mut words = line.split_whitespace();
        let offset = usize::from_str_radix(words.next().expect("an offset"), 16).expect("hex");
        let bytes: Vec<u8> = words.map(|byte| u8::from_str_radix(byte, 16).expect("hex")).collect();
        let found = &file[offset..offset + bytes.len()];
        assert_eq!(found, bytes, "{line}\nis\n{}", hex_dump(found, offset));
        shown.extend(offset..offset + bytes.len());
    }
    shown
}

#[test]
fn the_worked_example_is_what_the_writer_makes() {
    let spec = specification();
    for &method in METHODS {
        let file = selvedge_tools::format::write::write_material(&(method.example)());
        let shown = shown_bytes(&spec, &fence_of(method), &file);
        let opened = selvedge::open(&file, &selvedge::Limits::NONE).expect("legal");
        assert!(
            spec.contains(&selvedge_tools::format::bits::hex(&opened.decode_digest())),
            "the decode digest of the example of {method:?} is another"
        );
        // Every byte but padding: a stranger can put the first example together from the text. Those of other
        // methods show what the first has not.
        let own = format!("section {:02x}", method.number);
        let parts = selvedge_tools::check::example::parts(&file);
        for (name, bytes, offset) in
            parts.iter().filter(|(name, ..)| method == METHODS[0] || name.starts_with(&own))
        {
            let is_shown = (*offset..offset + bytes.len()).all(|at| shown.contains(&at));
            assert!(is_shown, "{method:?}: {name} is not shown whole");
        }
    }
}
