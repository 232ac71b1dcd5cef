//! The whole way from a dataset to a verified file: the edge chosen, the goal met by what the core decodes.
//!
//! [`super::encode`] predicts errors of the channels. This module decodes what it made, with the core, at
//! every texel and pair of directions, and encodes again until the goal holds in the domain that was asked
//! for.

use super::{Encoded, Goal, Options, Prepared, encode};
use crate::data::dataset::Dataset;
use crate::error::{Result, ToolError};
use crate::format::model::TransferModel;
use crate::measure::compare::{Metrics, Source, compare_every};
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use selvedge::{Limits, Selvedge};

/// An error to be met, as decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Root mean squared error of `ln(x + offset)`.
    LogRms(f64),
    /// Root mean squared error of linear radiance.
    LinearRms(f64),
    /// Peak signal to noise ratio of linear radiance, decibels, against the largest value of the data.
    Psnr(f64),
    /// Bytes of the file, at most.
    Size(u64),
    /// Coefficients of a block in each channel.
    Coefficients([usize; 3]),
}

/// Edges of blocks that are tried if none is given.
pub const EDGES: [usize; 3] = [2, 4, 8];
/// How much worse a file may be that needs fewer operations.
const ALLOWANCE: f64 = 1.1;

/// A file and what was measured of it.
pub struct Verified {
    /// The file.
    pub encoded: Encoded,
    /// Texels along the side of a block.
    pub edge: usize,
    /// Decoded against the data, over all texels and pairs of level 0.
    pub metrics: Metrics,
    /// Operations of a filtered sample that it states.
    pub operations: u32,
}

/// What the driver says while it works.
pub enum Event<'a> {
    /// A pass over the data: what it is for, parts done and in all.
    Pass(&'a str, usize, usize),
    /// A finished attempt.
    Attempt(usize, &'a Encoded, &'a Metrics),
}

/// Encodes until the wish holds. `edge` 0 chooses among [`EDGES`]: of the files at most 10 % worse than the
/// best (in error for a size, in bytes for an error), that with the fewest operations.
///
/// # Errors
/// As [`encode`]; and if the wish cannot be met.
pub fn encode_verified(
    prepared: &Prepared<'_>,
    ensembles: &dyn Fn(usize) -> [Ensemble; 3],
    wish: Wish,
    options: &Options,
    tell: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Verified> {
    let edges: Vec<usize> = match (options.edge, wish) {
        (0, Wish::Coefficients(_)) => vec![8],
        (0, _) => EDGES.to_vec(),
        (edge, _) => vec![edge],
    };
    let mut tried: Vec<Verified> = Vec::new();
    let mut failed = None;
    for edge in edges {
        let options = Options { edge, ..options.clone() };
        match meet(prepared, &ensembles(edge), wish, &options, tell) {
            Ok(verified) => tried.push(verified),
            Err(error @ ToolError::Usage(_)) => failed = Some(error),
            Err(error) => return Err(error),
        }
    }
    let worth = |v: &Verified| match wish {
        Wish::Size(_) | Wish::Coefficients(_) => v.metrics.log_rms,
        Wish::LogRms(_) | Wish::LinearRms(_) | Wish::Psnr(_) => v.encoded.bytes.len() as f64,
    };
    let best = tried.iter().map(worth).fold(f64::MAX, f64::min);
    let good = tried.into_iter().filter(|v| worth(v) <= best * ALLOWANCE);
    good.min_by_key(|v| (v.operations, v.edge))
        .ok_or_else(|| failed.unwrap_or_else(|| ToolError::Usage("no edge of blocks meets the goal".into())))
}

/// What a wish measures, smaller being better, and what it may be at most.
fn measured(wish: Wish, metrics: &Metrics) -> Option<(f64, f64)> {
    match wish {
        Wish::LogRms(rms) => Some((metrics.log_rms, rms)),
        Wish::LinearRms(rms) => Some((metrics.linear_rms, rms)),
        Wish::Psnr(db) => Some((metrics.linear_rms, metrics.peak / 10f64.powf(db / 20.0))),
        Wish::Size(_) | Wish::Coefficients(_) => None,
    }
}

fn meet(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    wish: Wish,
    options: &Options,
    tell: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Verified> {
    let edge = options.edge;
    let verifying = |done, all| tell(Event::Pass("verifying", done, all));
    let attempt = |goal: Goal, sampled: bool| -> Result<(Verified, bool)> {
        let encoded = encode(prepared, ensembles, &Options { goal, ..options.clone() }, &|done, all| {
            tell(Event::Pass("projecting", done, all))
        })?;
        let every = if sampled { sampling(prepared, &encoded) } else { 1 };
        let (metrics, operations) =
            verify(prepared.levels[0], &encoded.bytes, options.external.as_deref(), every, &verifying)?;
        tell(Event::Attempt(edge, &encoded, &metrics));
        Ok((Verified { encoded, edge, metrics, operations }, every > 1))
    };
    match wish {
        Wish::Size(bytes) => return Ok(attempt(Goal::Size(bytes), false)?.0),
        Wish::Coefficients(counts) => return Ok(attempt(Goal::Coefficients(counts), false)?.0),
        Wish::LogRms(_) | Wish::LinearRms(_) | Wish::Psnr(_) => {}
    }
    // In the domain of the channels the prediction is near; in the other the way goes by ratios.
    let log = matches!(prepared.forward.transfer, TransferModel::Log2 { .. });
    let same_domain =
        matches!((wish, log), (Wish::LogRms(_), true) | (Wish::LinearRms(_) | Wish::Psnr(_), false));
    let mut goal = match wish {
        // A little below, so that the first attempt is on the right side.
        Wish::LogRms(rms) | Wish::LinearRms(rms) if same_domain => rms * 0.997,
        Wish::Psnr(db) if !log => prepared.levels[0].statistics().largest as f64 / 10f64.powf(db / 20.0),
        _ => {
            if log {
                0.2
            } else {
                prepared.levels[0].statistics().mean[1].max(1e-6) * 0.1
            }
        }
    };
    let mut best: Option<Verified> = None;
    for _ in 0..8 {
        let (mut verified, sampled) = attempt(Goal::Rms(goal), true)?;
        let Some((mut found, most)) = measured(wish, &verified.metrics) else { return Ok(verified) };
        let worth_it =
            best.as_ref().is_none_or(|best| verified.encoded.bytes.len() < best.encoded.bytes.len());
        // A sample can only refuse: what is kept was decoded as a whole.
        if sampled && found <= most && worth_it {
            (verified.metrics, verified.operations) = verify(
                prepared.levels[0],
                &verified.encoded.bytes,
                options.external.as_deref(),
                1,
                &verifying,
            )?;
            found = measured(wish, &verified.metrics).map_or(found, |(found, _)| found);
        }
        let (reached, near) = (found <= most, found > most * 0.97);
        if reached && worth_it {
            best = Some(verified);
        }
        if reached && near || found <= 0.0 {
            break;
        }
        if goal < 1e-9 {
            break;
        }
        // A little below, so that rounding does not leave it above again.
        goal *= (most / found * if reached { 0.998 } else { 0.995 }).clamp(0.05, 20.0);
    }
    best.ok_or_else(|| ToolError::Usage("this error cannot be reached".into()))
}

/// Coefficients times images that a verification may cost while a goal is still looked for.
const TRIAL: u64 = 4_000_000_000;

/// Of how many lights one is decoded while a goal is still looked for.
fn sampling(prepared: &Prepared<'_>, encoded: &Encoded) -> usize {
    let coefficients: usize = encoded.coefficients.iter().sum();
    (coefficients as u64 * prepared.levels[0].description().pairs() as u64 / TRIAL).clamp(1, 16) as usize
}

/// Opens what an encoder made: that it breaks a rule is the encoder's fault.
///
/// # Errors
/// If it does.
pub fn open_made<'a>(bytes: &'a [u8], dictionary: Option<&'a [u8]>) -> Result<Selvedge<'a>> {
    let opened = selvedge::open_with(bytes, dictionary, &Limits::NONE);
    opened.map_err(|finding| {
        ToolError::Mismatch(format!("the encoder wrote a file that breaks a rule: {finding}"))
    })
}

/// Decodes what an encoder made of some data, at every texel and every so many-th light: errors, and the
/// operations that it states.
///
/// # Errors
/// If it breaks a rule, or data cannot be read.
pub fn verify(
    data: &Dataset,
    bytes: &[u8],
    dictionary: Option<&[u8]>,
    every: usize,
    progress: &dyn Fn(usize, usize),
) -> Result<(Metrics, u32)> {
    let file = open_made(bytes, dictionary)?;
    let (offset, peak) = (data.statistics().log_offset(), Some(data.statistics().largest as f64));
    let metrics = compare_every(
        every,
        Source::Data(data),
        Source::File(&file, 0),
        data.description(),
        offset,
        peak,
        progress,
    )?;
    Ok((metrics, file.header().operations))
}
