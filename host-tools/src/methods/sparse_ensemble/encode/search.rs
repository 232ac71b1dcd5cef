//! The search of one threshold that meets a criterion, on candidates that were collected.

use super::assemble::{self, Setting};
use super::candidates::Candidates;
use super::options::{COEFFICIENT_BITS, Encoded, Options};
use super::prepare::Prepared;
use super::select::{Channel, Selection};
use crate::error::{Result, ToolError};
use crate::format::write::{write_material, write_with_dictionary};
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use rayon::prelude::*;
use selvedge::method::sparse_ensemble::check::SPATIAL;
use selvedge::method::sparse_ensemble::cost::record_operations;

/// Halvings of the part of the largest record that a cap of operations allows.
const CAP_HALVINGS: usize = 20;
/// Files that are made while a size is looked for, at most.
const SIZE_ATTEMPTS: usize = 40;
/// First and further steps of the logarithm of the threshold while no file is small enough.
const SIZE_STEP: f64 = 0.7;
/// Logarithms of thresholds lie within this above that of the candidates.
const LOG_RANGE: f64 = 25.0;
/// A file whose logarithm of size is this near to the budget is near enough.
const SIZE_NEAR: f64 = 2e-3;
/// Logarithms of thresholds that are this near have the same files.
const LOG_NEAR: f64 = 1e-4;
/// The side of a secant that stays has its distance to the budget halved, so that it moves too (Illinois).
const SECANT_DAMPING: f64 = 0.5;
/// Files that are made while an error is looked for, at most.
const RMS_ATTEMPTS: usize = 4;
/// Halvings of the interval of logarithms of thresholds for an error.
const RMS_HALVINGS: usize = 14;
/// Error that rounding of values makes, over that of what is left out, before a file was measured.
const FIRST_ROUNDING: f64 = 0.2;
/// Growth of that share after a miss, so that the next file is on the right side.
const ROUNDING_SPARE: f64 = 1.01;
/// A squared error is near enough within this part of its limit.
const RMS_NEAR: f64 = 0.01;

/// Candidates of all levels, and thresholds tried on them.
pub(super) struct Search<'a> {
    prepared: &'a Prepared<'a>,
    ensembles: &'a [Ensemble; 3],
    options: &'a Options,
    candidates: &'a [[Candidates; 3]],
    channels: [Channel<'a>; 3],
}

impl<'a> Search<'a> {
    pub(super) fn new(
        prepared: &'a Prepared<'a>,
        ensembles: &'a [Ensemble; 3],
        options: &'a Options,
        candidates: &'a [[Candidates; 3]],
    ) -> Search<'a> {
        let channels = std::array::from_fn(|c| {
            Channel::new(candidates.iter().map(|level| &level[c]).collect(), &ensembles[c])
        });
        Search { prepared, ensembles, options, candidates, channels }
    }

    /// Whether a dictionary can hold no more atoms than it has at a threshold.
    pub(super) fn is_full(&self, threshold: f64) -> bool {
        self.channels.iter().any(|channel| channel.is_full(threshold as f32, COEFFICIENT_BITS))
    }

    /// Selections at a threshold, within the cap of operations.
    fn select(&self, threshold: f64) -> Result<[Selection; 3]> {
        self.capped(|channel, most| channel.select(threshold as f32, COEFFICIENT_BITS, most))
    }

    /// The largest records shrink together until the cap holds.
    fn capped(&self, select: impl Fn(&Channel<'a>, usize) -> Selection) -> Result<[Selection; 3]> {
        let selections = self.channels.each_ref().map(|channel| select(channel, usize::MAX));
        let Some(cap) = self.options.operations else { return Ok(selections) };
        let largest = selections.each_ref().map(Channel::largest_record);
        let edge = self.options.edge as u32;
        let fixed = assemble::fixed_operations(self.prepared.levels[0].description());
        let cost = |part: f64| {
            let of = |n: usize| record_operations((n as f64 * part) as u32, edge);
            // A channel without coefficients has no records.
            fixed + 4 * largest.into_iter().filter(|&n| n > 0).map(of).sum::<u64>()
        };
        if cost(1.0) <= cap as u64 {
            return Ok(selections);
        }
        if cost(0.0) > cap as u64 {
            return Err(ToolError::Unreachable {
                goal: format!("a cap of {cap} operations"),
                least: format!("without a coefficient a sample states {}", cost(0.0)),
            });
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..CAP_HALVINGS {
            let middle = (low + high) / 2.0;
            if cost(middle) <= cap as u64 { low = middle } else { high = middle }
        }
        Ok(std::array::from_fn(|c| select(&self.channels[c], (largest[c] as f64 * low) as usize)))
    }

    /// The file of all candidates.
    pub(super) fn all(&self) -> Result<Encoded> {
        let selections = self.capped(|channel, most| channel.all(most))?;
        // The smallest coefficients that are kept, on average, set the price of a bit.
        let squares: Vec<f64> = self.candidates[0].iter().flat_map(Candidates::least_squares).collect();
        let threshold = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        finish(self.prepared, self.ensembles, self.options, self.candidates, &selections, threshold)
    }

    /// The file of a threshold.
    pub(super) fn at(&self, threshold: f64) -> Result<Encoded> {
        finish(
            self.prepared,
            self.ensembles,
            self.options,
            self.candidates,
            &self.select(threshold)?,
            threshold,
        )
    }

    /// The largest file within `bytes`, or `None` if all candidates make a smaller one.
    pub(super) fn for_size(&self, least: f64, bytes: u64) -> Result<Option<Encoded>> {
        let everything = self.at(least)?;
        if everything.bytes.len() as u64 <= bytes {
            return Ok(None);
        }
        // Log of size over log of threshold is nearly straight, so a secant between the two sides finds the
        // goal soon.
        let goal = (bytes as f64).ln();
        let (mut low, mut low_value) = (least.ln(), (everything.bytes.len() as f64).ln());
        let (mut high, mut high_value) = (low + SIZE_STEP, f64::NAN);
        let mut best: Option<Encoded> = None;
        for _ in 0..SIZE_ATTEMPTS {
            let next = if high_value.is_nan() {
                high
            } else {
                (low + (low_value - goal) / (low_value - high_value) * (high - low)).clamp(low, high)
            };
            let encoded = self.at(next.exp())?;
            let value = (encoded.bytes.len() as f64).ln();
            if value <= goal {
                (high, high_value) = (next, value);
                let near = goal - value < SIZE_NEAR;
                best = Some(encoded);
                if near || high - low < LOG_NEAR {
                    break;
                }
                // From inside, so that the other side moves too.
                low_value = goal + (low_value - goal) * SECANT_DAMPING;
            } else {
                (low, low_value) = (next, value);
                match high_value.is_nan() {
                    true if next > least.ln() + LOG_RANGE => break,
                    true => high = next + SIZE_STEP,
                    false => high_value = goal + (high_value - goal) * SECANT_DAMPING,
                }
            }
        }
        let too_few = || ToolError::Unreachable {
            goal: format!("a size of {bytes} bytes"),
            least: "these are too few even without texture".into(),
        };
        best.map(Some).ok_or_else(too_few)
    }

    /// The smallest file of at most this error, or `None` if all candidates leave a larger one.
    pub(super) fn for_rms(&self, least: f64, rms: f64) -> Result<Option<Encoded>> {
        let goal = (rms / self.prepared.unit()).powi(2) * self.prepared.values(self.options.edge);
        let lost = |threshold: f64| -> Result<f64> {
            if self.options.operations.is_none() {
                let of: Vec<f64> = self
                    .channels
                    .par_iter()
                    .map(|channel| channel.lost_at_0(threshold as f32, COEFFICIENT_BITS))
                    .collect();
                return Ok(of.iter().sum());
            }
            Ok(self.select(threshold)?.iter().map(|s| s.lost_at_0).sum())
        };
        // Learnt from the file before.
        let mut rounding = FIRST_ROUNDING;
        let mut best: Option<Encoded> = None;
        for _ in 0..RMS_ATTEMPTS {
            let target = goal / (1.0 + rounding);
            if lost(least)? > target {
                return Ok(best);
            }
            let (mut low, mut high) = (least.ln(), least.ln() + LOG_RANGE);
            for _ in 0..RMS_HALVINGS {
                let middle = (low + high) / 2.0;
                if lost(middle.exp())? <= target { low = middle } else { high = middle }
            }
            let encoded = self.at(low.exp())?;
            let total = (encoded.predicted_rms / self.prepared.unit()).powi(2)
                * self.prepared.values(self.options.edge);
            rounding = if encoded.lost > 0.0 { (total - encoded.lost) / encoded.lost } else { 0.0 };
            let (reached, near) = (total <= goal, (total - goal).abs() < RMS_NEAR * goal);
            if reached {
                best = Some(encoded);
                if near {
                    break;
                }
            } else {
                // A little to spare, so that the next one is on the right side.
                rounding *= ROUNDING_SPARE;
            }
        }
        Ok(best)
    }
}

fn finish(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    options: &Options,
    candidates: &[[Candidates; 3]],
    selections: &[Selection; 3],
    threshold: f64,
) -> Result<Encoded> {
    let setting = Setting { prepared, options, threshold };
    let (model, rounding) = assemble::material(&setting, ensembles, candidates, selections)?;
    let bytes = match &options.external {
        Some(dictionary) => {
            let same_edge = ensembles.iter().all(|e| {
                e.tables.as_ref().is_some_and(|t| t[0].x.entries.len() == options.edge * options.edge)
            });
            write_with_dictionary(&model, dictionary, if same_edge { &[] } else { &[SPATIAL] })
        }
        None => write_material(&model),
    };
    let lost: f64 = selections.iter().map(|selection| selection.lost_at_0).sum();
    let predicted_rms = prepared.unit() * ((lost + rounding) / prepared.values(options.edge)).sqrt();
    let coefficients = selections.each_ref().map(|selection| selection.kept[0].iter().map(Vec::len).sum());
    Ok(Encoded { model, bytes, coefficients, threshold, lost, predicted_rms })
}
