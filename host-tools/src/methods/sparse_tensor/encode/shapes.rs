//! Sizes of dictionaries, fibres and lists for a target, estimated from a few trial decompositions.

use super::coder::encode_fit;
use super::fit::{Fit, Shape, Training, fit};
use super::options::{Encoded, Options, STIFF, cost};
use crate::data::dataset::Dataset;
use crate::encode::goal::Target;
use crate::error::{Result, ToolError};
use crate::math::pca::Pca;

/// Sizes of dictionaries that are tried: light atoms and ABRDF atoms.
pub const SIZES: [[usize; 2]; 4] = [[16, 32], [32, 64], [64, 128], [128, 256]];
/// Entries of fibres and coefficients of lists of a trial, from which their lengths are chosen.
const TRIAL: [usize; 2] = [12, 20];
/// Iterations of a trial at most, and its rounds: errors are compared, not atoms kept.
const TRIAL_ITERATIONS: usize = 6;
const TRIAL_ROUNDS: usize = 1;
/// Shortest fibres and lists that are considered.
const SHORTEST: usize = 2;
/// Entries and coefficients beyond the estimate, which is rough: the target takes what it needs of them.
const MORE_ENTRIES: usize = 1;
const MORE_COEFFICIENTS: usize = 3;
/// Cost of a shape that misses the target, times how far it misses: above that of any shape that meets it.
const MISSES: f64 = 1e30;
/// An error beyond this times the estimate is not taken for granted: other sizes of the dictionaries are
/// tried.
const NEAR: f64 = 1.5;
/// The shape without any trial.
const FALLBACK: Shape = Shape { light_atoms: 64, abrdf_atoms: 128, entries: 8, coefficients: 10 };

/// Bytes that a file of this shape will have, about: its lists full, seven bits a value.
fn estimated_bytes(data: &Dataset, levels: usize, shape: Shape) -> u64 {
    let description = data.description();
    let [lights, views] = [&description.lights, &description.views].map(Vec::len);
    let fixed = 600
        + 6 * (lights * views + lights)
        + 60 * (lights + if description.lights == description.views { 0 } else { views });
    let texels: usize = (0..levels as u32)
        .map(|level| description.size.iter().map(|&n| n.div_ceil(1 << level)).product::<usize>())
        .sum();
    let index = (shape.abrdf_atoms as f64 / shape.coefficients as f64).log2().max(0.0) + 2.0;
    let list = (shape.coefficients as f64 * (7.0 + index) + 9.0) / 8.0;
    (fixed + 4 * lights * shape.light_atoms + 2 * views * shape.abrdf_atoms * shape.entries) as u64
        + (texels as f64 * list) as u64
}

/// Errors of shorter fibres and lists of one trial decomposition.
struct Trial {
    light_atoms: usize,
    abrdf_atoms: usize,
    of_texels: Vec<f64>,
    of_fibres: Vec<f64>,
}

/// The search of a shape for a target: for some sizes of the dictionaries one decomposition with long fibres
/// and lists. The same for all targets.
pub struct ShapeSearch<'a, 'd> {
    pca: &'a Pca<'d>,
    trials: Vec<Trial>,
}

impl<'a, 'd> ShapeSearch<'a, 'd> {
    /// Makes the decompositions.
    pub fn new(pca: &'a Pca<'d>, training: Training, mut report: impl FnMut(&str, usize, usize)) -> Self {
        let training = Training {
            iterations: training.iterations.min(TRIAL_ITERATIONS),
            rounds: TRIAL_ROUNDS,
            ..training
        };
        let trial = |[light_atoms, abrdf_atoms]: [usize; 2]| {
            let [entries, coefficients] = TRIAL;
            let fitted =
                fit(pca, Shape { light_atoms, abrdf_atoms, entries, coefficients }, training, &mut report);
            Trial { light_atoms, abrdf_atoms, of_texels: fitted.of_texels, of_fibres: fitted.of_fibres }
        };
        ShapeSearch { pca, trials: SIZES.map(trial).into() }
    }

    /// The best shape of each size of the dictionaries for a target, the best of all first, and the error
    /// that is estimated for it.
    ///
    /// By the estimate of Ruiters and Klein (section 4.2): errors of shorter fibres and lists are read from a
    /// decomposition as sums of those of both steps.
    fn ranked(&self, levels: usize, target: Target) -> Vec<(f64, Shape)> {
        let values = (self.pca.dataset.description().texels() * self.pca.mean.len()) as f64;
        let best_of = |trial: &Trial| {
            let &Trial { light_atoms, abrdf_atoms, ref of_texels, ref of_fibres } = trial;
            let mut best: Option<(f64, f64, Shape)> = None;
            for (entries, of_fibres) in of_fibres.iter().enumerate().skip(SHORTEST) {
                for (coefficients, of_texels) in of_texels.iter().enumerate().skip(SHORTEST) {
                    let shape = Shape { light_atoms, abrdf_atoms, entries, coefficients };
                    let error = ((of_texels + of_fibres) / values).sqrt();
                    let bytes = estimated_bytes(self.pca.dataset, levels, shape);
                    // What misses the target is worse than all that meet it, by how far it misses.
                    let cost = match target {
                        Target::Bytes(most) if bytes > most => MISSES * bytes as f64,
                        Target::Rms(rms) if error > rms => MISSES * error,
                        _ => cost(target, error, bytes as f64),
                    };
                    if best.is_none_or(|(least, ..)| cost < least) {
                        best = Some((cost, error, shape));
                    }
                }
            }
            best
        };
        let mut all: Vec<(f64, f64, Shape)> = self.trials.iter().filter_map(best_of).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Lists can be shortened to a size, fibres cannot.
        let longer = |(_, error, shape): (f64, f64, Shape)| {
            let long = Shape { entries: shape.entries + MORE_ENTRIES, ..shape };
            let fits = |bytes| estimated_bytes(self.pca.dataset, levels, long) <= bytes;
            let entries = if matches!(target, Target::Bytes(bytes) if !fits(bytes)) {
                shape.entries
            } else {
                long.entries
            };
            (error, Shape { entries, coefficients: shape.coefficients + MORE_COEFFICIENTS, ..shape })
        };
        if all.is_empty() {
            return vec![(f64::INFINITY, FALLBACK)];
        }
        all.into_iter().map(longer).collect()
    }

    /// Encodes with the shape that is estimated to be best, and with those of other sizes of the dictionaries
    /// where the error comes out far from the estimate or the target is not reached, as it may with data
    /// whose energy is in a few of their values. Gives the decomposition too.
    ///
    /// # Errors
    /// If the data cannot be read; [`ToolError::Unreachable`] if no shape reaches the target.
    pub fn encode(
        &self,
        coarser: &[&Dataset],
        target: Target,
        value_bits: Option<u32>,
        training: Training,
        mut report: impl FnMut(&str, usize, usize),
    ) -> Result<(Shape, Fit, Encoded)> {
        let mut best: Option<(Shape, Fit, Encoded)> = None;
        let mut missed = None;
        for (estimate, shape) in self.ranked(1 + coarser.len(), target) {
            let fitted = fit(self.pca, shape, training, &mut report);
            let options = Options { shape, target, value_bits, training };
            let encoded = match encode_fit(self.pca, &fitted, coarser, &options) {
                Ok(encoded) => encoded,
                Err(error @ ToolError::Unreachable { .. }) => {
                    missed.get_or_insert(error);
                    continue;
                }
                Err(error) => return Err(error),
            };
            let is_near = matches!(target, Target::Rms(_))
                || encoded.predicted_rms <= NEAR * estimate && encoded.trained.condition <= STIFF;
            let cost = |encoded: &Encoded| cost(target, encoded.predicted_rms, encoded.bytes.len() as f64);
            if best.as_ref().is_none_or(|(.., least)| cost(&encoded) < cost(least)) {
                best = Some((shape, fitted, encoded));
            }
            if is_near {
                break;
            }
        }
        best.ok_or_else(|| {
            missed.unwrap_or_else(|| ToolError::Unreachable {
                goal: "a file".into(),
                least: "no shape of a sparse tensor was tried".into(),
            })
        })
    }
}
