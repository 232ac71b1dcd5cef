//! Findings as SARIF 2.1.0, the form in which code hosts and editors show what checkers found.

use super::advice::ADVICE;
use super::hints::hint;
use super::report::{FileReport, Severity};
use selvedge::Rule;
use serde_json::{Value, json};

/// One run over some files.
pub fn sarif(files: &[FileReport]) -> Value {
    let of_rule = |rule: &Rule| {
        let help = hint(*rule);
        let help = if help.is_empty() { rule.title() } else { help };
        described(rule.id(), rule.name(), rule.title(), help)
    };
    let of_advice = ADVICE.iter().map(|a| described(a.id, a.name, a.expected, a.hint));
    let rules: Vec<Value> = Rule::ALL.iter().map(of_rule).chain(of_advice).collect();
    let index_of = |id: &str| rules.iter().position(|rule| rule["id"] == id).unwrap_or(0);
    let mut results = Vec::new();
    let mut troubles = Vec::new();
    for file in files {
        let artifact = json!({ "artifactLocation": { "uri": uri(&file.file) } });
        results.extend(file.findings.iter().map(|f| {
            let level = match f.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
                Severity::Note | Severity::Off => "note",
            };
            let part = if f.part == "dictionary" { " of the dictionary" } else { "" };
            let message =
                format!("byte {}{part}: {}; found {} ({:#x})", f.offset, f.expected, f.found, f.found);
            json!({
                "ruleId": f.rule,
                "ruleIndex": index_of(f.rule),
                "level": level,
                "message": { "text": message },
                "locations": [{ "physicalLocation": {
                    "artifactLocation": artifact["artifactLocation"],
                    "region": { "byteOffset": f.offset }
                } }],
            })
        }));
        if let Some(why) = &file.unreadable {
            troubles.push(json!({
                "level": "error",
                "message": { "text": why },
                "locations": [{ "physicalLocation": artifact }],
            }));
        }
    }
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": {
                "driver": { "name": "selvedge", "version": env!("CARGO_PKG_VERSION"), "rules": rules }
            },
            "invocations": [{
                "executionSuccessful": troubles.is_empty(),
                "toolExecutionNotifications": troubles,
            }],
            "results": results,
        }],
    })
}

/// A rule or a piece of advice.
fn described(id: &str, name: &str, short: &str, help: &str) -> Value {
    json!({
        "id": id,
        "name": name,
        "shortDescription": { "text": short },
        "help": { "text": help },
    })
}

/// A path as a relative reference: what URIs do not allow is escaped.
fn uri(path: &str) -> String {
    let kept = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    path.bytes()
        .map(|b| {
            if b == b'\\' {
                "/".to_owned()
            } else if kept(b) {
                (b as char).to_string()
            } else {
                format!("%{b:02X}")
            }
        })
        .collect()
}
