//! What can go wrong on the host, and the exit code that each kind has.

use std::path::{Path, PathBuf};

/// Any failure of a tool.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// The command line does not make sense.
    #[error("{0}")]
    Usage(String),
    /// A goal that a method cannot reach, though its options make sense; another method may.
    #[error("{goal} cannot be reached: {least}")]
    Unreachable {
        /// What was asked for.
        goal: String,
        /// The nearest that was or can be reached, or why it is none.
        least: String,
    },
    /// Reading or writing failed.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A Selvedge file breaks a rule.
    #[error("{path}: {finding}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The first broken rule.
        finding: selvedge::Finding,
    },
    /// A third-party file breaks its layout.
    #[error("{path}, byte {offset}: {what}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Byte offset.
        offset: u64,
        /// What is wrong there.
        what: String,
    },
    /// A picture or a set of pictures is not as it should be, or could not be encoded.
    #[error("{path}: {what}")]
    Picture {
        /// The file.
        path: PathBuf,
        /// The library's message.
        what: String,
    },
    /// Two materials cannot be compared: their sizes or directions differ.
    #[error("{0}")]
    Different(String),
    /// The kernel could not be translated or run.
    #[error("kernel: {0}")]
    Kernel(String),
    /// What is asked for needs a feature of the crate that this build is without.
    #[error("{what}: this build is without the feature `{feature}`")]
    Feature {
        /// The command, the file or the option.
        what: String,
        /// Name of the feature.
        feature: &'static str,
    },
    /// A check that the tool makes of its own results failed.
    #[error("{0}")]
    Mismatch(String),
}

impl ToolError {
    /// From an I/O error at a path.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> ToolError + '_ {
        move |source| ToolError::Io { path: path.to_owned(), source }
    }

    /// That `what` needs a feature which this build is without.
    pub fn lacking(what: &str, feature: &'static str) -> ToolError {
        ToolError::Feature { what: what.to_owned(), feature }
    }

    /// The program's exit code: 1 usage or a goal out of reach, 2 I/O, 3 invalid, 4 over limits,
    /// 5 unsupported.
    pub fn exit_code(&self) -> u8 {
        match self {
            ToolError::Usage(_) | ToolError::Unreachable { .. } => 1,
            ToolError::Io { .. } => 2,
            ToolError::Foreign { .. }
            | ToolError::Picture { .. }
            | ToolError::Mismatch(_)
            | ToolError::Different(_) => 3,
            ToolError::Kernel(_) | ToolError::Feature { .. } => 5,
            ToolError::Invalid { finding, .. } => exit_code_of(finding.rule),
        }
    }
}

/// The exit code of a broken rule.
pub fn exit_code_of(rule: selvedge::Rule) -> u8 {
    match rule.family() {
        selvedge::Family::Invalid => 3,
        selvedge::Family::Unsupported => 5,
        selvedge::Family::Limits => 4,
        selvedge::Family::Usage => 1,
    }
}

/// Results of tools.
pub type Result<T> = std::result::Result<T, ToolError>;
