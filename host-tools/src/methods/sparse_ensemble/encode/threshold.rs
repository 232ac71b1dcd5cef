//! One threshold for all coefficients: candidates down to a threshold that meets the criterion for certain,
//! then the search among them.

use super::candidates::{Candidates, Keep, collect};
use super::options::{COEFFICIENT_BITS, Criterion, Encoded, Options};
use super::prepare::Prepared;
use super::search::Search;
use crate::error::{Result, ToolError};
use crate::methods::sparse_ensemble::dictionary::Ensemble;

/// Candidates are collected down to this part of the threshold that is guessed from a few blocks.
const FIRST_REACH: f64 = 0.6;
/// Factor of the next reach where all candidates together leave the goal unmet.
const NEXT_REACH: f64 = 0.5;
/// Below this magnitude, in units of a channel, there is no information: everything is kept.
const NO_INFORMATION: f64 = 1e-7;
/// Below this part of the guess a dictionary whose atoms are all taken ends the search.
const LAST_REACH: f64 = 0.05;
/// Values of the blocks from which the threshold is guessed, and how many blocks that are at least and most.
const GUESS_VALUES: usize = 12_000_000;
const GUESS_BLOCKS: (usize, usize) = (4, 4096);
/// Smallest threshold that is guessed.
const LEAST_GUESS: f64 = 1e-6;

/// Encodes by a criterion.
///
/// # Errors
/// If the data cannot be read; [`ToolError::Unreachable`] if the criterion is beyond what the format or the
/// cap of operations allows.
pub fn encode(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    options: &Options,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Encoded> {
    let guess = match options.criterion {
        Criterion::Coefficients(counts) => {
            let candidates = collect_levels(prepared, ensembles, options, Keep::Largest(counts), progress)?;
            return Search::new(prepared, ensembles, options, &candidates).all();
        }
        Criterion::Threshold(threshold) => {
            let candidates = collect_levels(
                prepared,
                ensembles,
                options,
                Keep::Above(threshold as f32, threshold as f32),
                progress,
            )?;
            return Search::new(prepared, ensembles, options, &candidates).at(threshold);
        }
        Criterion::Rms(_) | Criterion::Bytes(_) => guess_threshold(prepared, ensembles, options)?,
    };
    let mut least = guess * FIRST_REACH;
    loop {
        let candidates =
            collect_levels(prepared, ensembles, options, Keep::Above(least as f32, guess as f32), progress)?;
        let search = Search::new(prepared, ensembles, options, &candidates);
        let found = match options.criterion {
            Criterion::Bytes(bytes) => search.for_size(least, bytes)?,
            Criterion::Rms(rms) => search.for_rms(least, rms)?,
            Criterion::Coefficients(_) | Criterion::Threshold(_) => None,
        };
        // Nothing is found where even all candidates miss the goal: collect more, down to what is no
        // information.
        match found {
            Some(encoded) => return Ok(encoded),
            None if least < NO_INFORMATION => return search.at(0.0),
            // Where no atom can be added, a lower threshold adds little, and the search would not end.
            None if least < guess * LAST_REACH && search.is_full(least) => {
                return Err(ToolError::Unreachable {
                    goal: format!("this goal in blocks of {}", options.edge),
                    least: "it needs more atoms than a dictionary can hold: choose a smaller edge or more \
                            dictionaries"
                        .into(),
                });
            }
            None => least *= NEXT_REACH,
        }
    }
}

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
    let sample = (GUESS_VALUES / (blocks.block_len() * 3)).clamp(GUESS_BLOCKS.0, GUESS_BLOCKS.1);
    let stride = blocks.total().div_ceil(sample).max(1);
    let candidates = collect(&blocks, ensembles, Keep::Above(0.0, 0.0), stride, &|_, _| ())?;
    let mut squares: Vec<f32> = candidates.iter().flat_map(|c| c.values.iter().map(|v| v * v)).collect();
    squares.sort_unstable_by(f32::total_cmp);
    let sampled = candidates[0].dictionaries.len() as f64;
    let all = blocks.total() as f64;
    let rank_from_top = match options.criterion {
        Criterion::Bytes(bytes) => {
            let coefficients = bytes as f64 * 8.0 / COEFFICIENT_BITS / all * sampled;
            coefficients as usize
        }
        Criterion::Rms(rms) => {
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
        Criterion::Coefficients(_) | Criterion::Threshold(_) => 0,
    };
    let square =
        if squares.is_empty() { 0.0 } else { squares[squares.len() - rank_from_top.clamp(1, squares.len())] };
    Ok((square as f64).sqrt().max(LEAST_GUESS))
}
