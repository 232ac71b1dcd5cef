//! What a case of stability is, and what comes of it.

use crate::error::Result;
use serde::Serialize;
use std::path::Path;

/// What a case measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Condition number, dynamic range, or how extreme the case is.
    pub condition: f64,
    /// Largest error that is allowed.
    pub bound: f64,
    /// Error that was measured.
    pub measured: f64,
}

impl Outcome {
    /// Whether the bound holds; a NaN does not.
    pub fn holds(&self) -> bool {
        self.measured <= self.bound
    }
}

/// A case and its outcome.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// Group of cases.
    pub group: &'static str,
    /// The case.
    pub name: String,
    /// What its condition is.
    pub condition_is: &'static str,
    /// Where the bound comes from, and its unit.
    pub source: &'static str,
    /// What was measured, or why nothing could be.
    pub outcome: std::result::Result<Outcome, String>,
}

impl Verdict {
    /// Whether the case was measured and keeps its bound.
    pub fn holds(&self) -> bool {
        self.outcome.as_ref().is_ok_and(Outcome::holds)
    }
}

/// Measures a case; the folder holds its data.
pub(super) type Run = Box<dyn Fn(&Path) -> Result<Outcome>>;

/// A case before it was measured.
pub(super) struct Case {
    pub(super) group: &'static str,
    pub(super) name: String,
    pub(super) condition_is: &'static str,
    pub(super) source: &'static str,
    pub(super) run: Run,
}

/// A case of a group.
pub(super) fn case(
    group: &'static str,
    name: impl Into<String>,
    condition_is: &'static str,
    source: &'static str,
    run: impl Fn(&Path) -> Result<Outcome> + 'static,
) -> Case {
    Case { group, name: name.into(), condition_is, source, run: Box::new(run) }
}
