//! The encoder of the sparse ensemble: a dataset becomes a file for a goal in error, bytes or coefficients.
//!
//! Two passes over the data: [`crate::methods::sparse_ensemble::blocks::moments`] gives means and bases, [`candidates::collect`] the
//! coefficients that may matter. The goal is then met by one threshold over all blocks, channels and levels
//! ([`select`]), since with orthonormal dictionaries and channels the square of a coefficient is the error of
//! leaving it out.

pub mod assemble;
pub mod candidates;
pub mod driver;
pub mod select;

use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::error::{Result, ToolError};
use crate::format::model::{MaterialModel, PairTableModel, TransferModel};
use crate::format::write::{write_material, write_with_dictionary};
use crate::math::linear::{Basis, eigenbasis};
use crate::methods::means::mean_tables;
use crate::methods::sparse_ensemble::blocks::{Blocks, Moments, moments};
use crate::methods::sparse_ensemble::dictionary::{Ensemble, Turn};
use assemble::Setting;
use candidates::{Candidates, Keep, collect};
use rayon::prelude::*;
use select::{Channel, Selection};
use selvedge::cost::record_operations;
use selvedge::directory::SPATIAL;
use std::f64::consts::LN_2;
use std::sync::Arc;

/// What a file has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Coefficients of a block in each channel.
    Coefficients([usize; 3]),
    /// Root of the mean squared error in the domain of the channels: of `ln(x + offset)`, or of linear
    /// values.
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
    /// Bits of a value in each channel; chosen by their worth if `None`.
    pub value_bits: Option<[u32; 3]>,
    /// A dictionary file that the material shall name instead of carrying its columns. The ensembles are
    /// those that were read from it, with their own spatial bases where the edge is another.
    pub external: Option<Arc<[u8]>>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            edge: 4,
            goal: Goal::Rms(0.2),
            operations: None,
            layers: 1,
            value_bits: None,
            external: None,
        }
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
    /// Energy of the coefficients of level 0 that were left out.
    pub lost: f64,
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
    pub means: [PairTableModel; 3],
    /// Means that the decoder will add, in floats.
    pub decoded_means: [Vec<f32>; 3],
    /// Second moments.
    pub moments: Moments,
}

/// The first pass.
pub fn prepare<'a>(
    levels: Vec<&'a Dataset>,
    transfer: TransferModel,
    progress: &dyn Fn(usize, usize),
) -> Result<Prepared<'a>> {
    let forward = Forward::new(transfer);
    let moments = moments(levels[0], forward, progress)?;
    let (means, decoded_means) = mean_tables(&moments.means)?;
    Ok(Prepared { levels, forward, means, decoded_means, moments })
}

impl Prepared<'_> {
    /// The material's own bases: eigenvectors between lights and between views (HOSVD), cosines over texels;
    /// one dictionary a channel.
    pub fn own_ensembles(&self, edge: usize) -> [Ensemble; 3] {
        std::array::from_fn(|c| {
            let description = self.levels[0].description();
            let (light, _) = eigenbasis(&self.moments.lights[c], description.lights.len());
            let (view, _) = eigenbasis(&self.moments.views[c], description.views.len());
            Ensemble {
                light,
                view,
                turns: vec![Turn { light: None, view: None, x: Basis::cosine(edge), y: Basis::cosine(edge) }],
                tables: None,
            }
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
pub fn encode(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    options: &Options,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Encoded> {
    let guess = match options.goal {
        Goal::Coefficients(counts) => {
            let candidates = collect_levels(prepared, ensembles, options, Keep::Largest(counts), progress)?;
            return Search::new(prepared, ensembles, options, &candidates).all();
        }
        Goal::Threshold(threshold) => {
            let candidates = collect_levels(
                prepared,
                ensembles,
                options,
                Keep::Above(threshold as f32, threshold as f32),
                progress,
            )?;
            return Search::new(prepared, ensembles, options, &candidates).at(threshold);
        }
        Goal::Rms(_) | Goal::Size(_) => guess_threshold(prepared, ensembles, options)?,
    };
    let mut least = guess * 0.6;
    loop {
        let candidates =
            collect_levels(prepared, ensembles, options, Keep::Above(least as f32, guess as f32), progress)?;
        let search = Search::new(prepared, ensembles, options, &candidates);
        let found = match options.goal {
            Goal::Size(bytes) => search.for_size(least, bytes)?,
            Goal::Rms(rms) => search.for_rms(least, rms)?,
            Goal::Coefficients(_) | Goal::Threshold(_) => None,
        };
        // Nothing is found where even all that was kept leaves room: keep more, down to what is no
        // information.
        match found {
            Some(encoded) => return Ok(encoded),
            None if least < 1e-7 => return search.at(0.0),
            // Where there is no room for atoms, what a lower threshold adds is little, and to look for it
            // would not end.
            None if least < guess * 0.05 && search.has_no_room(least) => {
                let why = "needs more atoms than a dictionary has room for: choose a smaller edge or more dictionaries";
                return Err(ToolError::Usage(format!("this goal in blocks of {} {why}", options.edge)));
            }
            None => least *= 0.5,
        }
    }
}

/// Candidates of all levels, and thresholds tried on them.
struct Search<'a> {
    prepared: &'a Prepared<'a>,
    ensembles: &'a [Ensemble; 3],
    options: &'a Options,
    candidates: &'a [[Candidates; 3]],
    channels: [Channel<'a>; 3],
}

impl<'a> Search<'a> {
    fn new(
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

    fn has_no_room(&self, threshold: f64) -> bool {
        self.channels.iter().any(|channel| channel.has_no_room(threshold as f32, COEFFICIENT_BITS))
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
            return Err(ToolError::Usage(format!(
                "{cap} operations are too few: without a coefficient a sample states {}",
                cost(0.0)
            )));
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = (low + high) / 2.0;
            if cost(middle) <= cap as u64 { low = middle } else { high = middle }
        }
        Ok(std::array::from_fn(|c| select(&self.channels[c], (largest[c] as f64 * low) as usize)))
    }

    fn all(&self) -> Result<Encoded> {
        let selections = self.capped(|channel, most| channel.all(most))?;
        // What the least kept coefficient is worth, on average, sets the price of a bit.
        let squares: Vec<f64> = self.candidates[0].iter().flat_map(Candidates::least_squares).collect();
        let threshold = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        finish(self.prepared, self.ensembles, self.options, self.candidates, &selections, threshold)
    }

    fn at(&self, threshold: f64) -> Result<Encoded> {
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
    fn for_size(&self, least: f64, bytes: u64) -> Result<Option<Encoded>> {
        let everything = self.at(least)?;
        if everything.bytes.len() as u64 <= bytes {
            return Ok(None);
        }
        // Log of size over log of threshold is nearly straight, so a secant between the two sides finds the
        // goal soon.
        let goal = (bytes as f64).ln();
        let (mut low, mut low_value) = (least.ln(), (everything.bytes.len() as f64).ln());
        let (mut high, mut high_value) = (low + 0.7, f64::NAN);
        let mut best: Option<Encoded> = None;
        for _ in 0..40 {
            let next = if high_value.is_nan() {
                high
            } else {
                (low + (low_value - goal) / (low_value - high_value) * (high - low)).clamp(low, high)
            };
            let encoded = self.at(next.exp())?;
            let value = (encoded.bytes.len() as f64).ln();
            if value <= goal {
                (high, high_value) = (next, value);
                let near = goal - value < 2e-3;
                best = Some(encoded);
                if near || high - low < 1e-4 {
                    break;
                }
                // From inside, so that the other side moves too.
                low_value = goal + (low_value - goal) * 0.5;
            } else {
                (low, low_value) = (next, value);
                match high_value.is_nan() {
                    true if next > least.ln() + 25.0 => break,
                    true => high = next + 0.7,
                    false => high_value = goal + (high_value - goal) * 0.5,
                }
            }
        }
        let too_few = || ToolError::Usage(format!("{bytes} bytes are too few even without texture"));
        best.map(Some).ok_or_else(too_few)
    }

    /// The smallest file of at most this error, or `None` if all candidates leave a larger one.
    fn for_rms(&self, least: f64, rms: f64) -> Result<Option<Encoded>> {
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
        // Share of the error that rounding of values makes; learnt from the file before.
        let mut rounding = 0.2;
        let mut best: Option<Encoded> = None;
        for _ in 0..4 {
            let target = goal / (1.0 + rounding);
            if lost(least)? > target {
                return Ok(best);
            }
            let (mut low, mut high) = (least.ln(), least.ln() + 25.0);
            for _ in 0..14 {
                let middle = (low + high) / 2.0;
                if lost(middle.exp())? <= target { low = middle } else { high = middle }
            }
            let encoded = self.at(low.exp())?;
            let total = (encoded.predicted_rms / self.prepared.unit()).powi(2)
                * self.prepared.values(self.options.edge);
            rounding = if encoded.lost > 0.0 { (total - encoded.lost) / encoded.lost } else { 0.0 };
            let (reached, near) = (total <= goal, (total - goal).abs() < 0.01 * goal);
            if reached {
                best = Some(encoded);
                if near {
                    break;
                }
            } else {
                // A little to spare, so that the next one is on the right side.
                rounding *= 1.01;
            }
        }
        Ok(best)
    }
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
    (0..prepared.levels.len())
        .map(|level| collect(&prepared.blocks(level, options.edge), ensembles, keep, 1, progress))
        .collect()
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
    let square =
        if squares.is_empty() { 0.0 } else { squares[squares.len() - rank_from_top.clamp(1, squares.len())] };
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
