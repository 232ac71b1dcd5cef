//! What a file has to reach, and the one loop that reaches it: encode, decode with the core, encode again.
//!
//! An encoder aims at a [`Target`] in the domain that it codes and predicts what it reaches. [`meet`] decodes
//! what it wrote, at every texel and pair of directions, and moves the target until the [`Goal`] holds in the
//! domain that was asked for.

use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::error::{Result, ToolError};
use crate::measure::compare::Metrics;
use crate::measure::verify::verify;
use crate::progress::Observer;
use std::ops::RangeInclusive;

/// What a file has to reach, as decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Bytes of the file, at most.
    Bytes(u64),
    /// Root mean squared error, at most: of `ln(x + offset)`, or of linear radiance.
    Error(Domain, f64),
    /// Peak signal to noise ratio of linear radiance, decibels, at least, against the largest value of the
    /// data.
    Psnr(f64),
    /// Nothing beyond what the method's own options say.
    AsGiven,
}

impl Goal {
    /// The domain of an error goal, and the largest root mean square that meets it.
    pub fn limit(self, data: &Dataset) -> Option<(Domain, f64)> {
        match self {
            Goal::Error(domain, rms) => Some((domain, rms)),
            Goal::Psnr(db) => {
                Some((Domain::Linear, data.statistics().largest as f64 / 10f64.powf(db / 20.0)))
            }
            Goal::Bytes(_) | Goal::AsGiven => None,
        }
    }
}

impl std::fmt::Display for Goal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Goal::Bytes(bytes) => write!(f, "a size of {bytes} bytes"),
            Goal::Error(domain, rms) => write!(f, "an RMS error of {rms} ({})", domain_name(*domain)),
            Goal::Psnr(db) => write!(f, "a PSNR of {db} dB"),
            Goal::AsGiven => write!(f, "a file of these settings"),
        }
    }
}

/// What one attempt of an encoder aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Bytes of the whole file, at most.
    Bytes(u64),
    /// Predicted root mean squared error in the domain that is coded: of `ln(x + offset)`, or of linear
    /// radiance.
    Rms(f64),
    /// Whatever the method's own options give.
    AsGiven,
}

/// `log` or `linear`, as options and reports have it.
pub fn domain_name(domain: Domain) -> &'static str {
    if domain == Domain::Log { "log" } else { "linear" }
}

/// The root mean squared error of a domain.
pub fn rms_of(metrics: &Metrics, domain: Domain) -> f64 {
    if domain == Domain::Log { metrics.log_rms } else { metrics.linear_rms }
}

/// How a method's targets are moved towards an error. Part of what determines the bytes of its files.
#[derive(Clone, Debug, PartialEq)]
pub struct Steering {
    /// Attempts, at most.
    pub attempts: usize,
    /// First target over the limit, where the limit is of the domain that is coded.
    pub first: f64,
    /// A file that meets the limit is good enough above this part of it; below, a smaller file is looked for.
    pub near: f64,
    /// Factor of the next target beyond the measured ratio, after a file that meets the limit.
    pub after_hit: f64,
    /// The same after a file that misses it.
    pub after_miss: f64,
    /// Change of the target from one attempt to the next.
    pub step: RangeInclusive<f64>,
    /// A target below this is the last.
    pub smallest: f64,
}

/// First target of an error of logarithms whose limit is of linear radiance: a common error of files.
const FIRST_LOG: f64 = 0.2;
/// The same of linear radiance whose limit is of logarithms, as a part of the mean of green.
const FIRST_LINEAR: f64 = 0.1;
/// Smallest mean that this is a part of, so that black data have a target.
const LEAST_MEAN: f64 = 1e-6;

/// What attempts are verified against.
pub struct Task<'a> {
    /// The data of level 0.
    pub data: &'a Dataset,
    /// The domain that is coded.
    pub coded: Domain,
    /// The external dictionary of the files.
    pub dictionary: Option<&'a [u8]>,
    /// Told of progress.
    pub observer: &'a dyn Observer,
}

/// A file and what was measured of it.
pub struct Verified<E> {
    /// What the encoder made.
    pub encoded: E,
    /// Decoded against the data, over all texels and pairs of level 0.
    pub metrics: Metrics,
    /// Operations of a filtered sample that it states.
    pub operations: u32,
}

impl Task<'_> {
    fn verified<E: AsRef<[u8]>>(&self, encoded: E, every: usize) -> Result<Verified<E>> {
        let progress = |done, all| self.observer.pass("verifying", done, all);
        let (metrics, operations) = verify(self.data, encoded.as_ref(), self.dictionary, every, &progress)?;
        Ok(Verified { encoded, metrics, operations })
    }

    /// The first target for an error.
    fn first(&self, goal: Goal, (domain, limit): (Domain, f64), steering: &Steering) -> f64 {
        match (goal, self.coded) {
            (Goal::Psnr(_), coded) if coded == domain => limit,
            (_, coded) if coded == domain => limit * steering.first,
            (_, Domain::Log) => FIRST_LOG,
            (_, Domain::Linear) => self.data.statistics().mean[1].max(LEAST_MEAN) * FIRST_LINEAR,
        }
    }
}

/// Encodes until the goal holds. `attempt` gives a file for a target, and at every which light it is decoded
/// while the goal is still looked for: 1 for all.
///
/// # Errors
/// Of `attempt`; if a file breaks a rule or data cannot be read; [`ToolError::Unreachable`] if no attempt
/// meets the goal.
pub fn meet<E: AsRef<[u8]>>(
    task: &Task<'_>,
    goal: Goal,
    steering: &Steering,
    mut attempt: impl FnMut(Target) -> Result<(E, usize)>,
) -> Result<Verified<E>> {
    let Some((domain, limit)) = goal.limit(task.data) else {
        let target = if let Goal::Bytes(bytes) = goal { Target::Bytes(bytes) } else { Target::AsGiven };
        return task.verified(attempt(target)?.0, 1);
    };
    // In the domain that is coded the prediction is near; in the other the way goes by ratios.
    let mut target = task.first(goal, (domain, limit), steering);
    let (mut best, mut least) = (None::<Verified<E>>, f64::INFINITY);
    for _ in 0..steering.attempts {
        let (encoded, every) = attempt(Target::Rms(target))?;
        let mut verified = task.verified(encoded, every)?;
        let mut found = rms_of(&verified.metrics, domain);
        let length = |verified: &Verified<E>| verified.encoded.as_ref().len();
        let is_smaller = best.as_ref().is_none_or(|best| length(&verified) < length(best));
        // A sample can only refuse: what is kept was decoded as a whole.
        if every > 1 && found <= limit && is_smaller {
            verified = task.verified(verified.encoded, 1)?;
            found = rms_of(&verified.metrics, domain);
        }
        least = least.min(found);
        let (reached, near) = (found <= limit, found > limit * steering.near);
        if reached && is_smaller {
            best = Some(verified);
        }
        if reached && near || found <= 0.0 || target < steering.smallest {
            break;
        }
        // A little below, so that rounding does not leave it above again.
        let spare = if reached { steering.after_hit } else { steering.after_miss };
        target *= (limit / found * spare).clamp(*steering.step.start(), *steering.step.end());
    }
    best.ok_or_else(|| ToolError::Unreachable {
        goal: goal.to_string(),
        least: format!("the least error that was reached is {least:.6}, and {limit:.6} is asked for"),
    })
}
