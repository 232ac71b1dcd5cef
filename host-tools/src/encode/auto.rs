//! The choice between methods: every encoder, in every domain that is asked for.

use super::encoder::{Attempts, Common, Encoded, Encoder, Levels};
use super::goal::{Goal, rms_of};
use crate::data::transfer::Domain;
use crate::error::{Result, ToolError};
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::encoder::Settings;
    use crate::measure::baseline::tests::small;
    use crate::measure::compare::Metrics;
    use crate::progress::Quiet;

    /// An encoder that gives what it is told to.
    struct Fake {
        method: &'static str,
        gives: fn() -> Result<Vec<[u32; 2]>>,
        caps: bool,
    }

    impl Encoder for Fake {
        fn method(&self) -> &'static str {
            self.method
        }

        fn about(&self) -> &'static str {
            "a fake"
        }

        fn caps_operations(&self) -> bool {
            self.caps
        }

        fn check(&self, _: Goal, common: &Common) -> Result<()> {
            assert!(self.caps || common.operations.is_none(), "a cap reaches who keeps it alone");
            Ok(())
        }

        fn check_choice(&self) -> Result<()> {
            Ok(())
        }

        fn encode(&self, _: &Levels<'_>, _: Goal, common: &Common, _: &dyn Observer) -> Result<Attempts> {
            let file = |[bytes, operations]: [u32; 2]| Encoded {
                method: self.method,
                transfer: common.transfer,
                bytes: vec![0; bytes as usize],
                operations,
                predicted_rms: 0.0,
                metrics: Metrics { log_rms: 1.0 / bytes as f64, ..Metrics::default() },
                setting: String::new(),
                settings: Settings::default(),
            };
            let mut attempts = Attempts::default();
            match (self.gives)() {
                Ok(files) => files.into_iter().try_for_each(|of| attempts.add(Ok(file(of))))?,
                Err(error) => attempts.add(Err(error))?,
            }
            Ok(attempts)
        }

        fn choose(&self, _: Goal, reached: Vec<Encoded>) -> Option<Encoded> {
            reached.into_iter().next()
        }

        #[cfg(feature = "cli")]
        fn arguments(&self, command: clap::Command) -> clap::Command {
            command
        }

        #[cfg(feature = "cli")]
        fn configured(&self, _: &clap::ArgMatches) -> Result<Box<dyn Encoder>> {
            Err(ToolError::Usage("no options".into()))
        }
    }

    fn unreachable() -> ToolError {
        ToolError::Unreachable { goal: "a goal".into(), least: "too little".into() }
    }

    #[test]
    fn goals_out_of_reach_are_passed_over_and_mistakes_are_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [3, 2]);
        let run = |encoders: &[&dyn Encoder], operations, preference| {
            let common = Common { operations, ..Common::default() };
            encode(encoders, &Levels::of(&data), Goal::Bytes(9), &[common], preference, &Quiet)
        };
        let far = Fake { method: "far", gives: || Err(unreachable()), caps: false };
        let two = Fake { method: "two", gives: || Ok(vec![[7, 30], [5, 50]]), caps: true };
        let one = Fake { method: "one", gives: || Ok(vec![[6, 10]]), caps: false };
        let wrong = Fake { method: "wrong", gives: || Err(ToolError::Usage("nonsense".into())), caps: false };
        let sizes = |found: Result<Vec<Encoded>>| -> Vec<usize> {
            found.expect("reached").iter().map(|encoded| encoded.bytes.len()).collect()
        };
        let all: [&dyn Encoder; 3] = [&far, &two, &one];
        assert_eq!(sizes(run(&all, None, Preference::Bytes)), [5, 6, 7]);
        assert_eq!(sizes(run(&all, None, Preference::Error(Domain::Log))), [7, 6, 5]);
        assert_eq!(sizes(run(&all, None, Preference::Operations)), [6, 7, 5]);
        assert_eq!(sizes(run(&all, Some(30), Preference::Bytes)), [6, 7]);
        let capped = run(&all, Some(9), Preference::Bytes).expect_err("too many operations");
        assert!(
            matches!(capped, ToolError::Unreachable { .. }) && capped.to_string().contains("10"),
            "{capped}"
        );
        assert!(matches!(run(&[&far], None, Preference::Bytes), Err(ToolError::Unreachable { .. })));
        let mistaken = run(&[&two, &wrong], None, Preference::Bytes);
        assert!(matches!(mistaken, Err(ToolError::Usage(_))), "a mistake is no goal out of reach");
    }
}
