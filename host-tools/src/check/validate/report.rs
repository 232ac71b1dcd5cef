//! The report of a check, as it is published in JSON.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// How much a finding weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Not told.
    Off,
    /// Told.
    Note,
    /// Told; an error where warnings are.
    Warning,
    /// The file is refused.
    Error,
}

impl std::str::FromStr for Severity {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Severity, String> {
        match text {
            "off" => Ok(Severity::Off),
            "note" => Ok(Severity::Note),
            "warning" => Ok(Severity::Warning),
            "error" => Ok(Severity::Error),
            _ => Err(format!("`{text}` is none of off, note, warning, error")),
        }
    }
}

/// One finding.
#[derive(Clone, Debug, Serialize, JsonSchema, PartialEq, Eq)]
pub struct Report {
    /// Number of the rule in the specification, or of an advice (W1 and on).
    pub rule: &'static str,
    /// Its name.
    pub name: &'static str,
    /// How much it weighs.
    pub severity: Severity,
    /// `invalid`, `unsupported`, `limits`, `usage` or `unwise`.
    pub family: &'static str,
    /// `file` or `dictionary`.
    pub part: &'static str,
    /// Byte offset in that file (1.4-4).
    pub offset: u32,
    /// What was found there (1.4-4).
    pub found: u32,
    /// What is expected.
    pub expected: &'static str,
    /// What to do about it.
    pub hint: &'static str,
}

/// Everything found in one file.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct FileReport {
    /// The file, as it was named.
    pub file: String,
    /// No rule of the format is broken.
    pub valid: bool,
    /// How many findings there were of each rule or advice that is told.
    pub counts: BTreeMap<&'static str, usize>,
    /// The findings in the order in which they were made, at most twenty of a rule.
    pub findings: Vec<Report>,
    /// Why the file could not be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unreadable: Option<String>,
    /// Exit code: that of the first error.
    #[serde(skip)]
    pub exit_code: u8,
}

impl FileReport {
    /// Findings in all.
    pub fn count(&self) -> usize {
        self.counts.values().sum()
    }
}

/// What `validate --format json` prints.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Reports {
    /// `selvedge-validation-1`.
    pub format: &'static str,
    /// Version of the tool.
    pub version: &'static str,
    /// The files in the order in which they were named; those of a folder by name.
    pub files: Vec<FileReport>,
}
