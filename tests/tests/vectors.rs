//! The conformance suite: recipes make the files that are in the repository, and all of them are answered as
//! stated.

use selvedge::{First, Limits, Rule};
use selvedge_tools::check::conform::{run_own, run_program};
use selvedge_tools::check::vectors::{Answer, Vector, make, manifest, read};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/vectors")
}

fn suite() -> Vec<Vector> {
    read(&folder()).expect("the suite of the repository")
}

/// Name of a vector without folder and ending.
fn name(vector: &Vector) -> &str {
    vector
        .path
        .split('/')
        .next_back()
        .and_then(|file| file.strip_suffix(".selv"))
        .expect("a path of the suite")
}

#[test]
fn recipes_make_the_files_of_the_suite() {
    let made = make(&folder()).expect("recipes");
    let text = std::fs::read_to_string(folder().join("manifest.tsv")).expect("manifest");
    assert!(
        manifest(&made) == text,
        "the manifest is not that of the recipes: selvedge conform --make spec/vectors"
    );
    let mut listed = BTreeSet::new();
    for vector in &made {
        assert!(
            std::fs::read(folder().join(&vector.path)).expect("a file of the suite") == vector.bytes,
            "{} is not what its recipe makes",
            vector.path
        );
        assert!(!vector.note.is_empty());
        listed.insert(vector.path.clone());
    }
    for kind in ["valid", "invalid"] {
        for entry in std::fs::read_dir(folder().join(kind)).expect("folder") {
            let file = format!("{kind}/{}", entry.expect("entry").file_name().to_string_lossy());
            assert!(listed.contains(&file), "{file} is in no recipe");
        }
    }
}

#[test]
fn every_vector_is_answered_as_stated() {
    let suite = suite();
    let found = run_own(&suite).expect("complete");
    assert!(found.is_empty(), "{found:#?}");
    // The validator's first finding is that of `open`, and where it finds nothing the file opens.
    let by_path: BTreeMap<_, _> = suite.iter().map(|v| (v.path.clone(), v)).collect();
    for vector in &suite {
        let dictionary = vector.dictionary.as_ref().map(|path| &by_path[path].bytes[..]);
        let mut first = First::default();
        let clean = selvedge::validate(&vector.bytes, dictionary, &vector.limits(), &mut first);
        let mut all = Vec::new();
        let mut sink = |finding| {
            all.push(finding);
            true
        };
        selvedge::validate(&vector.bytes, dictionary, &vector.limits(), &mut sink);
        assert_eq!((clean, first.0), (all.is_empty(), all.first().copied()), "{}", vector.path);
        if let (Answer::Broken(rule, _, offset, found), Some(finding)) = (&vector.answer, first.0) {
            assert_eq!(
                (rule.as_str(), *offset, *found),
                (finding.rule.id(), finding.offset, finding.found),
                "{}",
                vector.path
            );
        } else {
            assert_eq!(first.0, None, "{}", vector.path);
        }
    }
    println!("{} vectors", suite.len());
}

/// The decoder that was written from the text alone, over its standard streams.
#[test]
fn the_naive_decoder_answers_as_stated() {
    let python = std::process::Command::new("python3").arg("--version").output();
    if !python.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: NO python3: THE NAIVE DECODER WAS NOT RUN");
        return;
    }
    let script = folder().join("../naive/selvedge_naive.py");
    let program = ["python3".to_owned(), script.to_str().expect("UTF-8").to_owned(), "serve".to_owned()];
    let suite = suite();
    let found = run_program(&suite, &program).expect("answers");
    assert!(found.is_empty(), "{found:#?}");
    println!("{} vectors, 0 answered otherwise by the naive decoder", suite.len());
}

/// A suite with one wrong answer is found out, so that the tests above can fail.
#[test]
fn a_wrong_statement_is_found() {
    let mut suite = suite();
    suite.retain(|v| name(v) == "example" || name(v) == "3.1-3-later");
    let mut wrong = suite.clone();
    wrong[0].answer = Answer::Digest("00".repeat(32));
    assert_eq!(run_own(&wrong).expect("complete").len(), 1);
    wrong[1].answer = Answer::Broken("3.1-3".into(), "file".into(), 8, 3);
    assert_eq!(run_own(&wrong).expect("complete").len(), 2);
}

#[test]
fn table_code_and_vectors_name_the_same_rules() {
    let suite = suite();
    let mut rejects: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let accepted: BTreeSet<&str> = suite.iter().filter(|v| v.path.starts_with("valid/")).map(name).collect();
    for vector in &suite {
        if let Answer::Broken(rule, ..) = &vector.answer {
            rejects.entry(rule).or_default().push(name(vector));
        }
    }
    for rule in Rule::ALL {
        assert!(rejects.contains_key(rule.id()), "no vector breaks {}", rule.id());
    }
    assert_eq!(rejects.len(), Rule::ALL.len(), "a vector states a rule that `open` does not check");
    let table = selvedge_tests::conformance_table();
    let names = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    let mut rows = 0;
    for line in table
        .lines()
        .filter(|line| line.starts_with("| ") && line.as_bytes().get(2).is_some_and(u8::is_ascii_digit))
    {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let wanted = rejects.get(cells[0]).cloned().unwrap_or_default();
        assert_eq!(names(cells[3]), wanted, "{}: vectors that break it", cells[0]);
        for accepts in names(cells[2]) {
            let there = accepted.contains(accepts.as_str())
                || accepts == "extreme" && accepted.iter().any(|name| name.starts_with("extreme-"));
            assert!(there, "{}: {accepts} is no valid vector", cells[0]);
        }
        let says_why = cells[4].starts_with("not tested");
        assert!(
            !names(cells[2]).is_empty() || says_why || !names(cells[4]).is_empty(),
            "{}: neither a vector nor a reason",
            cells[0]
        );
        rows += 1;
    }
    println!(
        "{rows} rules, {} of them broken by {} vectors, {} valid vectors",
        Rule::ALL.len(),
        suite.len() - accepted.len(),
        accepted.len()
    );
}

/// The vectors are within what a careful caller allows, so that everyone can run them.
#[test]
fn vectors_are_small() {
    for vector in suite() {
        assert!(vector.bytes.len() <= 1 << 17, "{}", vector.path);
        if matches!(vector.answer, Answer::Digest(_)) && vector.dictionary.is_none() {
            selvedge::open(&vector.bytes, &Limits::default())
                .unwrap_or_else(|finding| panic!("{}: {finding}", vector.path));
        }
    }
}
