//! The choice between methods: every encoder, in every domain that is asked for.

use super::encoder::{Attempts, Common, Encoded, Encoder, Levels};
use super::goal::{Goal, rms_of};
use crate::error::{Result, ToolError};
use crate::measure::baseline::pca::Domain;
use crate::progress::Observer;

/// What the best of several files is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preference {
    /// Fewest bytes.
    Bytes,
    /// Least error, of this domain.
    Error(Domain),
    /// Fewest stated operations of a sample.
    Operations,
}

impl Preference {
    fn cost(self, encoded: &Encoded) -> f64 {
        match self {
            Preference::Bytes => encoded.bytes.len() as f64,
            Preference::Operations => encoded.operations as f64,
            Preference::Error(domain) => rms_of(&encoded.metrics, domain),
        }
    }
}

/// Refuses options of encoders that do not go with a choice between them, before any data are read.
///
/// # Errors
/// [`ToolError::Usage`].
pub fn check(encoders: &[&dyn Encoder], goal: Goal, common: &Common) -> Result<()> {
    if goal == Goal::AsGiven {
        return Err(ToolError::Usage("a goal is missing: --rmse, --psnr or --size".into()));
    }
    for encoder in encoders {
        encoder.check_choice()?;
        match encoder.check(goal, &limited(*encoder, common)) {
            // Another encoder may reach it.
            Ok(()) | Err(ToolError::Unreachable { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Options without a cap that the encoder does not keep; files beyond it are dropped instead.
fn limited(encoder: &dyn Encoder, common: &Common) -> Common {
    Common { operations: common.operations.filter(|_| encoder.caps_operations()), ..*common }
}

/// All files that reach the goal, the best for a preference first.
///
/// # Errors
/// As [`Encoder::encode`]; [`ToolError::Unreachable`] if no method reaches the goal.
pub fn encode(
    encoders: &[&dyn Encoder],
    levels: &Levels<'_>,
    goal: Goal,
    commons: &[Common],
    preference: Preference,
    observer: &dyn Observer,
) -> Result<Vec<Encoded>> {
    let mut all = Attempts::default();
    for common in commons {
        for encoder in encoders {
            let own = limited(*encoder, common);
            let attempts =
                encoder.check(goal, &own).and_then(|()| encoder.encode(levels, goal, &own, observer));
            match attempts {
                Ok(attempts) => {
                    all.reached.extend(attempts.reached);
                    all.missed.extend(attempts.missed);
                }
                // A goal that one method cannot reach is another's to reach.
                Err(error @ ToolError::Unreachable { .. }) => all.missed.push(error),
                Err(error) => return Err(error),
            }
        }
    }
    let Attempts { mut reached, missed } = all;
    let mut why: Vec<String> = missed.iter().map(ToolError::to_string).collect();
    if let Some(most) = commons.iter().find_map(|common| common.operations) {
        let least = reached.iter().map(|encoded| encoded.operations).min();
        reached.retain(|encoded| encoded.operations <= most);
        if let (true, Some(least)) = (reached.is_empty(), least) {
            why.push(format!("the fewest operations of files that reach it are {least}"));
        }
    }
    if reached.is_empty() {
        return Err(ToolError::Unreachable { goal: goal.to_string(), least: why.join("; ") });
    }
    reached.sort_by(|a, b| preference.cost(a).total_cmp(&preference.cost(b)));
    Ok(reached)
}
