//! The whole way from a prepared dataset to a verified file: the edge chosen, the goal met by what the core
//! decodes.

use super::options::{Criterion, Encoded, Options};
use super::prepare::Prepared;
use super::threshold::encode;
use crate::data::transfer::Domain;
use crate::encode::goal::{Goal, Steering, Target, Task, Verified, meet};
use crate::error::{Result, ToolError};
use crate::format::model::TransferModel;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::progress::Observer;

/// Edges of blocks that are tried if none is given.
pub const EDGES: [usize; 3] = [2, 4, 8];
/// The edge for numbers of coefficients, which are of a block.
const EDGE_OF_COUNTS: usize = 8;
/// How much worse a file may be that needs fewer operations.
const ALLOWANCE: f64 = 1.1;

/// How targets move towards an error. The prediction is near in the domain that is coded, and a file that is
/// more than 3 % better than it has to be is followed by another attempt.
const STEERING: Steering = Steering {
    attempts: 8,
    first: 0.997,
    near: 0.97,
    after_hit: 0.998,
    after_miss: 0.995,
    step: 0.05..=20.0,
    smallest: 1e-9,
};

/// The edges that are tried for a goal: `edge` alone, or all of them if it is 0.
pub fn edges(edge: usize, goal: Goal) -> Vec<usize> {
    match (edge, goal) {
        (0, Goal::AsGiven) => vec![EDGE_OF_COUNTS],
        (0, _) => EDGES.to_vec(),
        (edge, _) => vec![edge],
    }
}

/// Of files that reached a goal, each with its log RMS, bytes and operations: among those at most 10 % worse
/// than the best (in error for a size, in bytes for an error), the first with the fewest operations.
pub fn choose<T>(goal: Goal, files: Vec<T>, of: impl Fn(&T) -> (f64, usize, u32)) -> Option<T> {
    let cost = |file: &T| match (goal, of(file)) {
        (Goal::Bytes(_) | Goal::AsGiven, (log_rms, ..)) => log_rms,
        (Goal::Error(..) | Goal::Psnr(_), (_, bytes, _)) => bytes as f64,
    };
    let best = files.iter().map(cost).fold(f64::MAX, f64::min);
    let good = files.into_iter().filter(|file| cost(file) <= best * ALLOWANCE);
    good.min_by_key(|file| of(file).2)
}

/// Encodes until the goal holds, [`Goal::AsGiven`] by the criterion of the options. An edge of 0 chooses
/// among [`EDGES`].
///
/// # Errors
/// As [`encode`]; [`ToolError::Unreachable`] if the goal cannot be met.
pub fn encode_verified(
    prepared: &Prepared<'_>,
    ensembles: &dyn Fn(usize) -> [Ensemble; 3],
    goal: Goal,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Verified<Encoded>> {
    let mut reached = Vec::new();
    let mut missed = None;
    for edge in edges(options.edge, goal) {
        let options = Options { edge, ..options.clone() };
        match encode_edge(prepared, &ensembles(edge), goal, &options, observer) {
            Ok(verified) => reached.push(verified),
            Err(error @ ToolError::Unreachable { .. }) => missed = Some(error),
            Err(error) => return Err(error),
        }
    }
    let of = |v: &Verified<Encoded>| (v.metrics.log_rms, v.encoded.bytes.len(), v.operations);
    choose(goal, reached, of).ok_or_else(|| {
        missed.unwrap_or_else(|| ToolError::Unreachable {
            goal: goal.to_string(),
            least: "no edge of blocks was tried".into(),
        })
    })
}

/// Encodes in blocks of one edge until the goal holds.
///
/// # Errors
/// As [`encode_verified`].
pub fn encode_edge(
    prepared: &Prepared<'_>,
    ensembles: &[Ensemble; 3],
    goal: Goal,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Verified<Encoded>> {
    let is_log = matches!(prepared.forward.transfer, TransferModel::Log2 { .. });
    let task = Task {
        data: prepared.levels[0],
        coded: if is_log { Domain::Log } else { Domain::Linear },
        dictionary: options.external.as_deref(),
        observer,
    };
    meet(&task, goal, &STEERING, |target| {
        let criterion = match target {
            Target::Bytes(bytes) => Criterion::Bytes(bytes),
            Target::Rms(rms) => Criterion::Rms(rms),
            Target::AsGiven => options.criterion,
        };
        let options = Options { criterion, ..options.clone() };
        let progress = |done, all| observer.pass("projecting", done, all);
        let encoded = encode(prepared, ensembles, &options, &progress)?;
        let every = sampling(prepared, &encoded);
        Ok((encoded, every))
    })
}

/// Coefficients times images that a verification may cost while a goal is still looked for.
const TRIAL: u64 = 4_000_000_000;
/// Lights of which one is decoded then, at most.
const MOST_SAMPLING: u64 = 16;

/// Of how many lights one is decoded while a goal is still looked for.
fn sampling(prepared: &Prepared<'_>, encoded: &Encoded) -> usize {
    let coefficients: usize = encoded.coefficients.iter().sum();
    let images = prepared.levels[0].description().pairs() as u64;
    (coefficients as u64 * images / TRIAL).clamp(1, MOST_SAMPLING) as usize
}
