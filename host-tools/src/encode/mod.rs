//! The encoder of the sparse ensemble: a dataset becomes a file for a goal in error, bytes or coefficients.
//!
//! Two passes over the data: [`crate::blocks::moments`] gives means and bases, [`candidates::collect`] the coefficients
//! that may matter. The goal is then met by one threshold over all blocks, channels and levels ([`select`]), since
//! with orthonormal dictionaries and channels the square of a coefficient is the error of leaving it out.

pub mod assemble;
pub mod candidates;
pub mod select;

use crate::blocks::{Blocks, Moments, moments};
use crate::dataset::Dataset;
use crate::dictionary::{Ensemble, Turn};
use crate::error::{Result, ToolError};
use crate::linear::{Basis, eigenbasis};
use crate::model::{MaterialModel, TransferModel};
use crate::transfer::Forward;
use crate::write::write_material;
use assemble::{MeanTable, Setting, mean_tables};
use candidates::{Candidates, Keep, collect};
use select::{Channel, Selection};
use std::f64::consts::LN_2;

/// What a file has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Coefficients of a block in each channel.
    Coefficients([usize; 3]),
    /// Root of the mean squared error in the domain of the channels: of `ln(x + offset)`, or of linear values.
    Rms(f64),
    /// Bytes of the whole file.
    Size(u64),
    /// Magnitude below which a coefficient is not kept, in units of the channel.
    Threshold(f64),
}

/// How to encode.
#[derive(Clone, Debug)]
pub struct Options {
    /// Texels along the side of a block.
    pub edge: usize,
    /// What to reach.
    pub goal: Goal,
    /// Most operations of a filtered sample that the file may state.
    pub operations: Option<u32>,
    /// Quality layers.
    pub layers: usize,
    /// Levels of detail.
    pub levels: usize,
    /// Bits of a value in each channel; chosen by their worth if `None`.
    pub value_bits: Option<[u32; 3]>,
}

impl Default for Options {
    fn default() -> Options {
        Options { edge: 4, goal: Goal::Rms(0.2), operations: None, layers: 1, levels: 1, value_bits: None }
    }
}

/// A finished file and what is known of it without decoding it.
pub struct Encoded {
    /// The material.
    pub model: MaterialModel,
    /// Its file.
    pub bytes: Vec<u8>,
    /// Coefficients of level 0 in each channel.
    pub coefficients: [usize; 3],
    /// The threshold.
    pub threshold: f64,
    /// Predicted root mean squared error over level 0, in the domain of the channels (`ln`, or linear).
    pub predicted_rms: f64,
}

/// Everything about a dataset that does not depend on the goal.
pub struct Prepared<'a> {
    /// The levels of detail, finest first.
    pub levels: Vec<&'a Dataset>,
    /// Radiance to channels.
    pub forward: Forward,
    /// Means as the file holds them.
    pub means: [MeanTable; 3],
    /// Means that the decoder will add, in floats.
    pub decoded_means: [Vec<f32>; 3],
    /// Second moments.
    pub moments: Moments,
}

/// The first pass.
pub fn prepare<'a>(levels: Vec<&'a Dataset>, transfer: TransferModel, progress: &dyn Fn(usize, usize)) -> Result<Prepared<'a>> {
    let forward = Forward::new(transfer);
    let moments = moments(levels[0], forward, progress)?;
    let (means, decoded_means) = mean_tables(&moments.means)?;
    Ok(Prepared { levels, forward, means, decoded_means, moments })
}

impl Prepared<'_> {
    /// The material's own bases: eigenvectors between lights and between views (HOSVD), cosines over texels; one
    /// dictionary a channel.
    pub fn own_ensembles(&self, edge: usize) -> [Ensemble; 3] {
        std::array::from_fn(|c| {
            let description = self.levels[0].description();
            let (light, _) = eigenbasis(&self.moments.lights[c], description.lights.len());
            let (view, _) = eigenbasis(&self.moments.views[c], description.views.len());
            Ensemble { light, view, turns: vec![Turn { light: None, view: None, x: Basis::cosine(edge), y: Basis::cosine(edge) }], tables: None }
        })
    }

    /// Values of level 0: texels of all blocks, pairs and channels.
    fn values(&self, edge: usize) -> f64 {
        let description = self.levels[0].description();
        let texels: usize = description.size.iter().map(|n| n.div_ceil(edge) * edge).product();
        (texels * description.pairs() * 3) as f64
    }

    /// Blocks of a level.
    pub fn blocks(&self, level: usize, edge: usize) -> Blocks<'_> {
        Blocks { dataset: self.levels[level], forward: self.forward, edge, means: &self.decoded_means }
    }

    /// Errors are told of natural logarithms, channels are of base two.
    fn unit(&self) -> f64 {
        match self.forward.transfer {
            TransferModel::Log2 { .. } => LN_2,
            TransferModel::Linear { exponent } => 2f64.powi(exponent),
        }
    }
}

/// Encodes for a goal.
///
/// # Errors
/// If the data cannot be read, or the goal is beyond what the format can hold.
pub fn encode(prepared: &Prepared<'_>, ensembles: &[Ensemble; 3], options: &Options, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Encoded> {
    if let Goal::Coefficients(counts) = options.goal {
        let candidates = collect_levels(prepared, ensembles, options, Keep::Largest(counts), progress)?;
        let channels: [Channel<'_>; 3] = std::array::from_fn(|c| Channel::new(candidates.iter().map(|level| &level[c]).collect(), &ensembles[c]));
        let selections = channels.each_ref().map(Channel::all);
        return finish(prepared, ensembles, options, &candidates, &selections, 0.0);
    }
    let guess = match options.goal {
        Goal::Threshold(threshold) => threshold,
        _ => guess_threshold(prepared, ensembles, options)?,
    };
    let mut least = if matches!(options.goal, Goal::Threshold(_)) { guess } else { guess * 0.6 };
    for _ in 0..8 {
        let candidates = collect_levels(prepared, ensembles, options, Keep::Above(least as f32, guess as f32), progress)?;
        let channels: [Channel<'_>; 3] = std::array::from_fn(|c| Channel::new(candidates.iter().map(|level| &level[c]).collect(), &ensembles[c]));
        let at = |threshold: f64| -> Result<Encoded> {
            let selections = channels.each_ref().map(|channel| channel.select(threshold as f32, COEFFICIENT_BITS, usize::MAX));
            finish(prepared, ensembles, options, &candidates, &selections, threshold)
        };
        if let Goal::Threshold(_) = options.goal {
            return at(guess);
        }
        let good = |encoded: &Encoded| match options.goal {
            Goal::Size(bytes) => encoded.bytes.len() as u64 <= bytes,
            Goal::Rms(rms) => encoded.predicted_rms > rms,
            Goal::Coefficients(_) | Goal::Threshold(_) => true,
        };
        // With everything that was kept, is the file still too small (or too far from the data)?
        let everything = at(least)?;
        if good(&everything) {
            if least < 1e-7 {
                return Ok(everything);
            }
            least *= 0.5;
            continue;
        }
        let (mut low, mut high) = (least.ln(), least.ln() + 20.0);
        let mut best = None;
        for _ in 0..22 {
            let middle = (low + high) / 2.0;
            let encoded = at(middle.exp())?;
            // Sizes have a largest that is good, errors a smallest that is bad: the last file on the right side counts.
            match (good(&encoded), options.goal) {
                (true, Goal::Size(_)) => {
                    high = middle;
                    best = Some(encoded);
                }
                (true, _) => high = middle,
                (false, Goal::Size(_)) => low = middle,
                (false, _) => {
                    low = middle;
                    best = Some(encoded);
                }
            }
            if high - low < 2e-3 && best.is_some() {
                break;
            }
        }
        return best.ok_or_else(|| match options.goal {
            Goal::Size(bytes) => ToolError::Usage(format!("{bytes} bytes are too few even without texture")),
            _ => ToolError::Usage("this error cannot be reached".into()),
        });
    }
    Err(ToolError::Usage("the goal is beyond the data".into()))
}

/// What a coefficient costs on average: its value and its position.
const COEFFICIENT_BITS: f64 = 10.0;

fn collect_levels(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    options: &Options,
    keep: Keep,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<[Candidates; 3]>> {
    (0..prepared.levels.len()).map(|level| collect(&prepared.blocks(level, options.edge), ensembles, keep, 1, progress)).collect()
}

/// A threshold near the goal, from a few blocks.
fn guess_threshold(prepared: &Prepared<'_>, ensembles: &[Ensemble; 3], options: &Options) -> Result<f64> {
    let blocks = prepared.blocks(0, options.edge);
    let sample = (12_000_000 / (blocks.block_len() * 3)).clamp(4, 4096);
    let stride = blocks.total().div_ceil(sample).max(1);
    let candidates = collect(&blocks, ensembles, Keep::Above(0.0, 0.0), stride, &|_, _| ())?;
    let mut squares: Vec<f32> = candidates.iter().flat_map(|c| c.values.iter().map(|v| v * v)).collect();
    squares.sort_unstable_by(f32::total_cmp);
    let sampled = candidates[0].dictionaries.len() as f64;
    let all = blocks.total() as f64;
    let rank_from_top = match options.goal {
        Goal::Size(bytes) => {
            let coefficients = bytes as f64 * 8.0 / COEFFICIENT_BITS / all * sampled;
            coefficients as usize
        }
        Goal::Rms(rms) => {
            let lost = (rms / prepared.unit()).powi(2) * prepared.values(options.edge) / all * sampled;
            let mut sum = 0.0;
            squares.len()
                - squares
                    .iter()
                    .take_while(|&&s| {
                        sum += s as f64;
                        sum < lost
                    })
                    .count()
        }
        Goal::Coefficients(_) | Goal::Threshold(_) => 0,
    };
    let square = if squares.is_empty() { 0.0 } else { squares[squares.len() - rank_from_top.clamp(1, squares.len())] };
    Ok((square as f64).sqrt().max(1e-6))
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
    let bytes = write_material(&model);
    let lost: f64 = selections.iter().map(|selection| selection.lost_at_0).sum();
    let predicted_rms = prepared.unit() * ((lost + rounding) / prepared.values(options.edge)).sqrt();
    let coefficients = selections.each_ref().map(|selection| selection.kept[0].iter().map(Vec::len).sum());
    Ok(Encoded { model, bytes, coefficients, threshold, predicted_rms })
}
