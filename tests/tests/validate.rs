//! The validator: it agrees with `open`, tells everything, and says the same as text, JSON and SARIF.

use selvedge::{Limits, Rule};
use selvedge_tools::check::extreme::extreme;
use selvedge_tools::check::validate::{
    ADVICE, Options, Reports, Severity, files_of, sarif, schema, text, validate, validate_files,
};
use selvedge_tools::check::vectors::{Answer, read};
use selvedge_tools::format::container::repair_checksums;
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::format::write::write_material;
use selvedge_tools::methods::sparse_ensemble;
use selvedge_tools::methods::sparse_ensemble::example::example_model;
use selvedge_tools::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, EnsembleModel, FactorModel, ensembles_mut,
};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn check(bytes: &[u8]) -> selvedge_tools::check::validate::FileReport {
    validate("file", bytes, None, &Options { limits: Limits::NONE, ..Options::default() })
}

#[test]
fn findings_of_the_suite_are_those_of_open() {
    let suite = read(&root().join("spec/vectors")).expect("suite");
    for vector in &suite {
        let dictionary = vector
            .dictionary
            .as_ref()
            .map(|path| &suite.iter().find(|v| v.path == *path).expect("there").bytes[..]);
        let options = Options { limits: vector.limits(), ..Options::default() };
        let report = validate(&vector.path, &vector.bytes, dictionary, &options);
        match &vector.answer {
            Answer::Broken(rule, part, offset, found) => {
                let first = &report.findings[0];
                assert_eq!(
                    (first.rule, first.part, first.offset, first.found),
                    (rule.as_str(), part.as_str(), *offset, *found),
                    "{}",
                    vector.path
                );
                assert!(!report.valid && report.exit_code != 0);
            }
            Answer::Digest(_) | Answer::Legal => {
                assert!(report.valid && report.exit_code == 0, "{}: {:?}", vector.path, report.findings)
            }
        }
    }
}

/// Two defects far apart are both told, many of one kind are counted and cut.
#[test]
fn all_findings_are_told_and_counted() {
    let mut file = write_material(&example_model());
    file[88] = 1;
    // Every entry of the first table of means becomes -32768: 25 of them, rows of five in three words.
    for entry in 0..25 {
        let at = 0x270 + 16 + entry / 5 * 12 + entry % 5 * 2;
        file[at..at + 2].copy_from_slice(&0x8000u16.to_le_bytes());
    }
    let last = 0x41c;
    file[last + 3] |= 0x80;
    repair_checksums(&mut file);
    let report = check(&file);
    let counts: Vec<(&str, usize)> = report.counts.iter().map(|(rule, count)| (*rule, *count)).collect();
    assert_eq!(counts, [("10.4-9", 1), ("3.1-18", 1), ("8.1-7", 25)]);
    assert_eq!((report.count(), report.findings.len()), (27, 22));
    assert_eq!(report.findings[0].rule, "3.1-18", "in the order of checks");
    let text_of_all = text(&report);
    assert!(text_of_all.contains("25 findings of 8.1-7 in all"));
    // Its checksums hold, so that it may be of an earlier draft; a damaged file is none.
    assert!(text_of_all.contains(selvedge_tools::format::draft::FORMAT), "{text_of_all}");
    file[0x270] ^= 1;
    let damaged = text(&check(&file));
    assert!(!damaged.is_empty() && !damaged.contains("draft"), "{damaged}");
}

fn advised(model: &MaterialModel) -> Vec<&'static str> {
    let report = check(&write_material(model));
    assert!(report.valid && report.exit_code == 0, "{report:?}");
    report.findings.iter().map(|f| f.rule).collect()
}

#[test]
fn unwise_files_are_told_what_is_unwise() {
    assert_eq!(advised(&example_model()), Vec::<&str>::new());
    let changed = |edit: &dyn Fn(&mut MaterialModel)| {
        let mut model = example_model();
        edit(&mut model);
        advised(&model)
    };
    fn ensemble(model: &mut MaterialModel) -> &mut EnsembleModel {
        ensembles_mut(model).next().expect("full")
    }
    assert_eq!(changed(&|m| ensemble(m).coefficients[0][0].records[1].coefficients[0].0 = 0), ["W1"]);
    let two = |m: &mut MaterialModel| {
        let e = ensemble(m);
        e.dictionaries.push(e.dictionaries[0].clone());
        e.atoms.push(Vec::new());
    };
    assert_eq!(changed(&two), ["W2"]);
    assert_eq!(changed(&|m| m.lights[2] = [5, 4]), ["W3"]);
    assert_eq!(changed(&|m| m.metadata.texts[2].clear()), ["W6"]);
    // 64 x 1 blocks; one of them has all coefficients, the others one of the same value.
    let wide = |largest: u32| {
        let mut model = example_model();
        model.size = [128, 2];
        model.level_count = 1;
        let e = ensemble(&mut model);
        e.dictionaries[0].view = FactorModel { columns: 200, entries: (0..1000).map(|i| i as i16).collect() };
        e.atoms[0] = (0..largest).map(|view| AtomModel { view, step: 9, ..AtomModel::default() }).collect();
        let mut one = e.coefficients[0][0].records[0].clone();
        one.coefficients = vec![(0, 3)];
        let mut records = vec![one.clone(); 64];
        records[7].coefficients = (0..largest).map(|i| (i, (i % 16) as u16)).collect();
        e.coefficients = vec![vec![CoefficientsModel { value_bits: 4, records }]];
        advised(&model)
    };
    assert_eq!((wide(150), wide(20)), (vec!["W4", "W5"], vec!["W4"]));
    assert_eq!(ADVICE.len(), 6, "a new advice needs a case here");
}

#[test]
fn severities_can_be_changed() {
    let mut model = example_model();
    model.metadata.texts[2].clear();
    let file = write_material(&model);
    let with = |warnings_as_errors: bool, severities: &[(&str, Severity)]| {
        let severities = severities.iter().map(|(rule, severity)| ((*rule).to_owned(), *severity)).collect();
        let report =
            validate("file", &file, None, &Options { limits: Limits::NONE, warnings_as_errors, severities });
        (report.count(), report.exit_code)
    };
    assert_eq!(with(false, &[]), (1, 0));
    assert_eq!(with(true, &[]), (1, 3));
    assert_eq!(with(true, &[("W6", Severity::Off)]), (0, 0));
    assert_eq!(with(true, &[("NoLicence", Severity::Note)]), (1, 0));
    assert_eq!(with(false, &[("W6", Severity::Error)]), (1, 3));
    let unknown = Options { severities: [("W66".to_owned(), Severity::Off)].into(), ..Options::default() };
    assert!(unknown.check().is_err());
}

#[test]
fn the_published_schema_is_that_of_the_reports() {
    let published = std::fs::read_to_string(root().join("spec/validation.schema.json")).expect("published");
    assert!(published == schema(), "selvedge validate --schema > spec/validation.schema.json");
    let report = check(&write_material(&extreme(&sparse_ensemble::METHOD, 3))[..500]);
    let reports =
        serde_json::to_value(Reports { format: "selvedge-validation-1", version: "0", files: vec![report] })
            .expect("plain");
    let schema: serde_json::Value = serde_json::from_str(&published).expect("JSON");
    // Every field that is written is described, and every required one is written.
    let describes = |value: &serde_json::Value, schema: &serde_json::Value| {
        let (value, properties) =
            (value.as_object().expect("object"), schema["properties"].as_object().expect("properties"));
        assert!(value.keys().all(|key| properties.contains_key(key)), "{value:?}");
        let required = schema["required"].as_array().expect("required");
        assert!(required.iter().all(|key| value.contains_key(key.as_str().expect("name"))), "{value:?}");
    };
    describes(&reports, &schema);
    describes(&reports["files"][0], &schema["$defs"]["FileReport"]);
    describes(&reports["files"][0]["findings"][0], &schema["$defs"]["Report"]);
}

#[test]
fn sarif_names_rules_that_it_lists() {
    let file = write_material(&example_model());
    let log = sarif(&[check(&file[..1000]), check(b"no material")]);
    let (rules, results) =
        (&log["runs"][0]["tool"]["driver"]["rules"], log["runs"][0]["results"].as_array().expect("results"));
    assert_eq!(rules.as_array().expect("rules").len(), Rule::ALL.len() + ADVICE.len());
    assert!(results.len() >= 2);
    for result in results {
        let index = result["ruleIndex"].as_u64().expect("index") as usize;
        assert_eq!(rules[index]["id"], result["ruleId"]);
        assert!(result["locations"][0]["physicalLocation"]["region"]["byteOffset"].is_u64());
    }
}

/// Folders are walked, many files come in order, and standard input is a file.
#[test]
fn folders_and_standard_input() {
    let folder = tempfile::tempdir().expect("folder");
    let good = write_material(&example_model());
    std::fs::create_dir(folder.path().join("deep")).expect("folder");
    for i in 0..600 {
        let name = format!("{}{i:03}.selv", if i % 2 == 0 { "" } else { "deep/" });
        std::fs::write(folder.path().join(name), if i == 77 { &good[..50] } else { &good }).expect("write");
    }
    std::fs::write(folder.path().join("other.txt"), b"not looked at").expect("write");
    let paths = files_of(&[folder.path().to_owned()]).expect("walk");
    assert_eq!(paths.len(), 600);
    let mut seen = Vec::new();
    let mut each = |report: selvedge_tools::check::validate::FileReport| {
        seen.push((report.file.clone(), report.exit_code));
        Ok(())
    };
    validate_files(&paths, None, &Options::default(), &mut each).expect("read");
    assert!(seen.iter().map(|(file, _)| file).eq(paths.iter().map(|p| p.to_str().expect("UTF-8"))));
    assert_eq!(
        seen.iter()
            .filter(|(_, code)| *code != 0)
            .map(|(file, _)| file.ends_with("deep/077.selv"))
            .collect::<Vec<_>>(),
        [true]
    );
    let run = |input: &[u8], arguments: &[&str]| {
        use std::io::Write;
        let mut child = Command::new(selvedge_tests::program())
            .args(arguments)
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("runs");
        // It may answer without reading all.
        let _ = child.stdin.take().expect("input").write_all(input);
        let output = child.wait_with_output().expect("ends");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    assert_eq!(run(&good, &["validate", "-"]), (Some(0), String::new()));
    let (code, told) = run(&good[..60], &["validate", "-", "--severity", "3.1-1=error"]);
    assert!(code == Some(3) && told.starts_with("-: error 3.1-1 at byte 0"), "{told}");
    assert_eq!(run(&good, &["validate", "-", "--severity", "nothing=off"]).0, Some(1));
    assert_eq!(run(b"", &["validate", "--rules"]).1.lines().count(), Rule::ALL.len() + ADVICE.len());
}
