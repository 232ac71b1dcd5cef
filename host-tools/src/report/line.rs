//! What a report is asked for, and the lines that it is made of.

use crate::check::count;
use crate::measure::compare::Metrics;
use crate::measure::speed::{self, Speed};
use selvedge::{FilteredQuery, Selvedge};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What a report is of.
#[derive(Clone, Debug)]
pub struct Request {
    /// Datasets.
    pub datasets: Vec<PathBuf>,
    /// Folder of the results.
    pub out: PathBuf,
    /// Budgets of the sweep, as ratios of the data's bytes in binary16 to those of a file.
    pub ratios: Vec<f64>,
    /// Components that decompositions are made with.
    pub rank: usize,
    /// Whether directions are held out as well.
    pub held_out: bool,
    /// Methods whose names contain one of these; all if empty.
    pub methods: Vec<String>,
    /// Errors are taken at every N-th light of each view, the first of them moving from view to view; chosen
    /// by the amount of data if `None`.
    pub every: Option<usize>,
}

/// Texels times pairs that a setting is compared at, about, if [`Request::every`] is not given.
pub(super) const COMPARED: usize = 9_000_000;

impl Default for Request {
    fn default() -> Request {
        Request {
            datasets: Vec::new(),
            out: PathBuf::new(),
            ratios: vec![1600.0, 800.0, 400.0, 200.0],
            rank: 160,
            held_out: true,
            methods: Vec::new(),
            every: None,
        }
    }
}

/// Whether a line is of this format or of a baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A file of this format.
    File,
    /// A baseline in floats.
    Baseline,
}

/// Operations of a filtered sample: 32-bit multiplications of values, over random samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Mean.
    pub mean: f64,
    /// Largest of a sample.
    pub largest: u64,
    /// What a file states for the worst sample.
    pub stated: Option<u32>,
}

impl Operations {
    /// Of random samples of a file's level 0.
    pub fn of_file(file: &Selvedge<'_>) -> Operations {
        Operations::of_random(Some(file.header().operations), |q| {
            let counted = count::filtered(file, 0, q.u_q32, q.v_q32, q.light, q.view);
            counted.expect("a method of these tools").operations
        })
    }

    pub(super) fn of_random(stated: Option<u32>, count: impl Fn(&FilteredQuery) -> u64) -> Operations {
        let counts: Vec<u64> = speed::random_queries(2000).iter().map(count).collect();
        Operations {
            mean: counts.iter().sum::<u64>() as f64 / counts.len() as f64,
            largest: counts.into_iter().max().unwrap_or(0),
            stated,
        }
    }
}

/// A measured setting of a method on a dataset.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line {
    /// What it is found by in a later run.
    pub key: String,
    /// The dataset's name.
    pub dataset: String,
    /// The picture of its data in the folder, which distinguishes datasets of one name.
    pub reference: String,
    /// Adapter of the kernel's rate, or why there is none.
    pub adapter: String,
    /// Cores of the rates of all cores.
    pub cores: usize,
    /// The method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// File or baseline.
    pub kind: Kind,
    /// Bytes.
    pub bytes: u64,
    /// Errors are of every N-th light of each view.
    pub every: usize,
    /// Errors over all texels and views.
    pub metrics: Metrics,
    /// Mean SSIM of the list of pairs.
    pub ssim: f64,
    /// Mean FLIP of the list of pairs.
    pub flip: f64,
    /// Operations.
    pub operations: Operations,
    /// Rates.
    pub speed: Speed,
    /// Seconds of encoding, what a sweep shares between its settings included once for each.
    pub encode_seconds: f64,
    /// Seconds of `open`, for files.
    pub open_seconds: Option<f64>,
    /// Largest resident memory since the work began that its method shares between settings, bytes, where
    /// the system reports it.
    pub peak_memory: Option<u64>,
    /// What training or encoding found and a user should know.
    pub found: String,
    /// Its picture in the folder, if it has one.
    pub picture: Option<String>,
}

/// Part of every key: changes with what is measured or how, so that older lines are measured again.
pub(super) const REVISION: u32 = 2;

/// Errors of an encoding that did not see some directions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HeldOut {
    /// What it is found by in a later run.
    pub key: String,
    /// The dataset's name.
    pub dataset: String,
    /// The method.
    pub method: String,
    /// Bytes.
    pub bytes: u64,
    /// At pairs that were encoded.
    pub seen: Metrics,
    /// At pairs of a light and a view that were both held out.
    pub unseen: Metrics,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A line of a file with this error.
    pub(in crate::report) fn line(bytes: u64, rms: f64) -> Line {
        let metrics = Metrics { linear_rms: rms, ..Metrics::default() };
        Line {
            key: format!("{bytes} {rms}"),
            dataset: "d".into(),
            reference: String::new(),
            adapter: String::new(),
            cores: 2,
            method: "m".into(),
            setting: String::new(),
            kind: Kind::File,
            bytes,
            every: 1,
            metrics,
            ssim: 0.0,
            flip: 0.0,
            operations: Operations::default(),
            speed: Speed::default(),
            encode_seconds: 0.0,
            open_seconds: None,
            peak_memory: None,
            found: String::new(),
            picture: None,
        }
    }
}
