//! Numerical stability on stiff and extreme cases: a table of cases, each with a bound that is stated before
//! anything is measured.
//!
//! A case states its condition (a condition number, a dynamic range, or how extreme it is) and where its
//! bound comes from, and measures. Nothing is left out silently: a case that cannot be made is a failure.
//! `selvedge report --stability` puts the table on a page.

mod algebra;
mod arithmetic;
mod ends;
mod files;
mod legal;
mod materials;
mod pursuit;
mod weights;

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
type Run = Box<dyn Fn(&Path) -> Result<Outcome>>;

struct Case {
    group: &'static str,
    name: String,
    condition_is: &'static str,
    source: &'static str,
    run: Run,
}

fn case(
    group: &'static str,
    name: impl Into<String>,
    condition_is: &'static str,
    source: &'static str,
    run: impl Fn(&Path) -> Result<Outcome> + 'static,
) -> Case {
    Case { group, name: name.into(), condition_is, source, run: Box::new(run) }
}

/// Runs all cases; `folder` holds their data while they run. `progress` gets the cases done and their count.
pub fn run(folder: &Path, mut progress: impl FnMut(usize, usize)) -> Vec<Verdict> {
    let cases = all();
    let count = cases.len();
    let verdict = |(i, Case { group, name, condition_is, source, run }): (usize, Case)| {
        progress(i, count);
        Verdict { group, name, condition_is, source, outcome: run(folder).map_err(|error| error.to_string()) }
    };
    cases.into_iter().enumerate().map(verdict).collect()
}

fn all() -> Vec<Case> {
    let groups = [
        arithmetic::cases(),
        weights::cases(),
        ends::cases(),
        legal::cases(),
        algebra::cases(),
        pursuit::cases(),
        materials::cases(),
    ];
    groups.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nan_does_not_hold() {
        assert!(!Outcome { condition: 1.0, bound: 1.0, measured: f64::NAN }.holds());
        assert!(Outcome { condition: 1.0, bound: 1.0, measured: 1.0 }.holds());
    }

    #[test]
    fn every_case_keeps_its_bound() {
        let folder = tempfile::tempdir().expect("a folder");
        let verdicts = run(folder.path(), |_, _| ());
        assert!(verdicts.len() >= 40, "{}", verdicts.len());
        let broken: Vec<String> = verdicts
            .iter()
            .filter(|v| !v.holds())
            .map(|v| format!("{}: {}: {:?}", v.group, v.name, v.outcome))
            .collect();
        assert!(broken.is_empty(), "{} of {} cases:\n{}", broken.len(), verdicts.len(), broken.join("\n"));
    }
}
