//! Numerical stability on stiff and extreme cases: a table of cases, each with a bound that is stated before
//! anything is measured.
//!
//! A case states its condition (a condition number, a dynamic range, or how extreme it is) and where its
//! bound comes from, and measures. Nothing is left out silently: a case that cannot be made is a failure.
//! `selvedge report --stability` puts the table on a page.

mod algebra;
mod arithmetic;
mod case;
mod ends;
mod files;
mod legal;
mod materials;
mod pursuit;
mod weights;

pub use case::{Outcome, Verdict};

use case::Case;
use std::path::Path;

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
