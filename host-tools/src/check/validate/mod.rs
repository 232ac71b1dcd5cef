//! `validate`: every finding of a file, as the core's own checker reports it, and what is legal but wasteful.
//!
//! There is no second parser: [`selvedge::open_reporting`] is `open` with a sink that continues after a
//! finding. This module adds severities, hints, counts, and reports as text, JSON ([`Reports`] is the
//! published schema) and SARIF.

mod advice;
mod hints;
mod report;
mod sarif;

pub use advice::ADVICE;
pub use hints::hint;
pub use report::{FileReport, Report, Reports, Severity};
pub use sarif::sarif;

use crate::error::{Result, ToolError, exit_code_of};
use crate::files;
use crate::format::container::is_dictionary;
use crate::format::draft;
use crate::methods::advice::Advice;
use rayon::prelude::*;
use selvedge::{Family, Finding, Limits, Part, Rule};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most findings that are kept in words for one rule; all are counted.
const KEPT: usize = 20;

/// How to check.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Limits of the caller.
    pub limits: Limits,
    /// Warnings count as errors.
    pub warnings_as_errors: bool,
    /// Other severities, by the number or name of a rule or advice.
    pub severities: BTreeMap<String, Severity>,
}

impl Options {
    /// Severity of a rule or advice.
    fn severity(&self, id: &str, name: &str, usual: Severity) -> Severity {
        let severity =
            self.severities.get(id).or_else(|| self.severities.get(name)).copied().unwrap_or(usual);
        if severity == Severity::Warning && self.warnings_as_errors { Severity::Error } else { severity }
    }

    /// # Errors
    /// If a severity is given for what is no rule and no advice.
    pub fn check(&self) -> Result<()> {
        let known = |key: &str| {
            Rule::ALL.iter().any(|r| r.id() == key || r.name() == key)
                || ADVICE.iter().any(|a| a.id == key || a.name == key)
        };
        match self.severities.keys().find(|key| !known(key)) {
            Some(key) => {
                Err(ToolError::Usage(format!("--severity: `{key}` is no rule that is checked and no advice")))
            }
            None => Ok(()),
        }
    }
}

fn family_name(family: Family) -> &'static str {
    match family {
        Family::Invalid => "invalid",
        Family::Unsupported => "unsupported",
        Family::Limits => "limits",
        Family::Usage => "usage",
    }
}

/// Checks one file.
pub fn validate(name: &str, bytes: &[u8], dictionary: Option<&[u8]>, options: &Options) -> FileReport {
    let mut report = FileReport { file: name.to_owned(), ..FileReport::default() };
    let mut tell = |id: &'static str, severity: Severity, code: u8, make: &dyn Fn() -> Report| {
        if severity == Severity::Off {
            return;
        }
        if severity == Severity::Error && report.exit_code == 0 {
            report.exit_code = code;
        }
        let count = report.counts.entry(id).or_default();
        *count += 1;
        if *count <= KEPT {
            report.findings.push(make());
        }
    };
    let mut sink = |finding: Finding| {
        let rule = finding.rule;
        let severity = options.severity(rule.id(), rule.name(), Severity::Error);
        tell(rule.id(), severity, exit_code_of(rule), &|| Report {
            rule: rule.id(),
            name: rule.name(),
            severity,
            family: family_name(rule.family()),
            part: if finding.part == Part::File { "file" } else { "dictionary" },
            offset: finding.offset,
            found: finding.found,
            expected: rule.title(),
            hint: hint(rule),
        });
        true
    };
    let (valid, opened) = if is_dictionary(bytes) {
        (selvedge::validate(bytes, dictionary, &options.limits, &mut sink), None)
    } else {
        let opened = selvedge::open_reporting(bytes, dictionary, &options.limits, &mut sink);
        (opened.is_some(), opened)
    };
    if let Some(opened) = opened {
        let walked = advice::walk(&opened, &mut |advice: &'static Advice, offset, found| {
            let severity = options.severity(advice.id, advice.name, Severity::Warning);
            tell(advice.id, severity, 3, &|| Report {
                rule: advice.id,
                name: advice.name,
                severity,
                family: "unwise",
                part: "file",
                offset,
                found,
                expected: advice.expected,
                hint: advice.hint,
            });
        });
        if let Err(finding) = walked {
            report.unreadable = Some(finding.to_string());
            report.exit_code = exit_code_of(finding.rule);
        }
    }
    report.valid = valid;
    report
}

/// The files that paths name: themselves, and the `.selv` files of folders at any depth, by name.
///
/// # Errors
/// If a folder cannot be read.
pub fn files_of(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        if path.is_dir() { folder_files(path, &mut all)? } else { all.push(path.clone()) }
    }
    Ok(all)
}

fn folder_files(folder: &Path, all: &mut Vec<PathBuf>) -> Result<()> {
    let entries: std::io::Result<Vec<_>> =
        std::fs::read_dir(folder).map_err(ToolError::io(folder))?.collect();
    let mut entries = entries.map_err(ToolError::io(folder))?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let kind = entry.file_type().map_err(ToolError::io(&path))?;
        // Links are followed to files, not to folders, so that a walk ends.
        if kind.is_dir() {
            folder_files(&path, all)?;
        } else if path.extension().is_some_and(|ending| ending == "selv") && path.is_file() {
            all.push(path);
        }
    }
    Ok(())
}

/// Checks files on all cores; `each` gets their reports in order.
///
/// # Errors
/// Those of `each`.
pub fn validate_files(
    paths: &[PathBuf],
    dictionary: Option<&[u8]>,
    options: &Options,
    each: &mut dyn FnMut(FileReport) -> Result<()>,
) -> Result<()> {
    let check = |path: &PathBuf| match files::read(path) {
        Ok(bytes) => {
            let own = dictionary.filter(|_| !is_dictionary(&bytes));
            validate(&path.display().to_string(), &bytes, own, options)
        }
        Err(error) => {
            let (file, exit_code) = (path.display().to_string(), error.exit_code());
            FileReport { file, unreadable: Some(error.to_string()), exit_code, ..FileReport::default() }
        }
    };
    // Waves, so that the reports of many files are not held at once.
    for wave in paths.chunks(256) {
        wave.par_iter().map(check).collect::<Vec<_>>().into_iter().try_for_each(&mut *each)?;
    }
    Ok(())
}

/// A report for people: a line a finding, nothing where all is well.
pub fn text(report: &FileReport) -> String {
    let mut text = String::new();
    for f in &report.findings {
        let part = if f.part == "dictionary" { " (dictionary)" } else { "" };
        let severity = format!("{:?}", f.severity).to_lowercase();
        text += &format!(
            "{}{part}: {severity} {} at byte {}: {}; found {} ({:#x})",
            report.file, f.rule, f.offset, f.expected, f.found, f.found
        );
        if !f.hint.is_empty() {
            text += &format!("; {}", f.hint);
        }
        text.push('\n');
    }
    let cut = report.counts.iter().filter(|(_, count)| **count > KEPT);
    cut.for_each(|(rule, count)| text += &format!("{}: {count} findings of {rule} in all\n", report.file));
    // Damage explains what follows from it.
    let mut broken = Rule::ALL.iter().filter(|rule| report.counts.contains_key(rule.id())).peekable();
    if broken.peek().is_some() && broken.all(|rule| draft::may_be_of_a_draft(*rule)) {
        text += &format!("{}: note: {}\n", report.file, draft::note());
    }
    text
}

/// The published schema of [`Reports`].
pub fn schema() -> String {
    let schema = schemars::schema_for!(Reports);
    serde_json::to_string_pretty(&schema).expect("plain data") + "\n"
}
