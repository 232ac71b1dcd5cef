//! The encoder of the sparse tensor behind the trait of encoders.

#[cfg(feature = "cli")]
use super::arguments::Arguments;
use super::coder::encode_fit;
use super::fit::{Fit, Shape, fit};
use super::options::{Encoded, Options, SparseTensor};
use super::shapes::ShapeSearch;
use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::encode::encoder::{self, Attempts, Common, Encoder, Levels, Settings};
use crate::encode::goal::{Goal, Steering, Task, Verified, domain_name, meet};
use crate::error::{Result, ToolError};
use crate::math::pca::{Pca, pca_within};
use crate::progress::Observer;
#[cfg(feature = "cli")]
use clap::{ArgMatches, Args as _, Command, FromArgMatches as _};

/// Name of the method.
pub const NAME: &str = "sparse-tensor";

/// How targets move towards an error. The prediction is within a few parts in a hundred, and an attempt is
/// expensive, so the first file that meets the limit is taken.
const STEERING: Steering = Steering {
    attempts: 4,
    first: 1.0,
    near: 0.0,
    after_hit: 0.998,
    after_miss: 0.998,
    step: 0.0..=f64::INFINITY,
    smallest: 0.0,
};

impl SparseTensor {
    /// A file that meets the goal, from the components of level 0.
    fn verified(
        &self,
        components: &Pca<'_>,
        coarser: &[&Dataset],
        goal: Goal,
        value_bits: Option<u32>,
        observer: &dyn Observer,
    ) -> Result<Verified<Shaped>> {
        let report = |step: &str, done, all| observer.pass(step, done, all);
        let training = self.training;
        // Later attempts keep the shape and the decomposition of the first.
        let mut fitted: Option<(Shape, Fit)> =
            self.shape.map(|shape| (shape, fit(components, shape, training, report)));
        let task = Task { data: components.dataset, coded: components.domain, dictionary: None, observer };
        meet(&task, goal, &STEERING, |target| {
            if let Some((shape, fitted)) = &fitted {
                let options = Options { shape: *shape, target, value_bits, training };
                let encoded = encode_fit(components, fitted, coarser, &options)?;
                return Ok((Shaped { shape: *shape, encoded }, 1));
            }
            let search = ShapeSearch::new(components, training, report);
            let (shape, found, encoded) = search.encode(coarser, target, value_bits, training, report)?;
            fitted = Some((shape, found));
            Ok((Shaped { shape, encoded }, 1))
        })
    }
}

/// A file, and the shape that it has.
struct Shaped {
    shape: Shape,
    encoded: Encoded,
}

impl AsRef<[u8]> for Shaped {
    fn as_ref(&self) -> &[u8] {
        &self.encoded.bytes
    }
}

/// The encoder with default options.
pub static ENCODER: SparseTensor = SparseTensor::DEFAULT;

impl Encoder for SparseTensor {
    fn method(&self) -> &'static str {
        NAME
    }

    fn about(&self) -> &'static str {
        "Texels of a few ABRDF atoms, these of a few light atoms (Ruiters and Klein 2009)"
    }

    fn caps_operations(&self) -> bool {
        false
    }

    fn check(&self, goal: Goal, common: &Common) -> Result<()> {
        let usage = |text: String| Err(ToolError::Usage(text));
        if common.layers > 1 || common.offset.is_some() {
            return usage(format!("--layers and --offset are not of --method {NAME}"));
        }
        if common.operations.is_some() {
            return usage(format!("--operations is not of --method {NAME}"));
        }
        if common.value_bits.is_some_and(|all| all.iter().any(|bits| !(1..=15).contains(bits))) {
            return usage("--value-bits: 1 to 15".into());
        }
        // The prediction is of the domain that is coded.
        let coded = common.transfer;
        let unreachable = |least: &str| {
            Err(ToolError::Unreachable { goal: format!("{goal} with --method {NAME}"), least: least.into() })
        };
        match goal {
            Goal::AsGiven if self.shape.is_none() => {
                usage("a goal is missing: --rmse, --psnr, --size, or --shape of a sparse tensor alone".into())
            }
            Goal::Error(domain, _) if domain != coded => {
                unreachable("--domain and --transfer have to be the same")
            }
            Goal::Psnr(_) if coded != Domain::Linear => unreachable("it needs --transfer linear"),
            _ => Ok(()),
        }
    }

    fn check_choice(&self) -> Result<()> {
        if self.shape.is_some() {
            return Err(ToolError::Usage(format!("--shape is of --method {NAME}")));
        }
        Ok(())
    }

    fn encode(
        &self,
        levels: &Levels<'_>,
        goal: Goal,
        common: &Common,
        observer: &dyn Observer,
    ) -> Result<Attempts> {
        observer.pass("components", 0, 1);
        let components = pca_within(levels.finest, common.transfer, self.rank, self.memory)?;
        let coarser: Vec<&Dataset> = levels.coarser.iter().collect();
        let value_bits = common.value_bits.map(|bits| bits[0]);
        let verified = self.verified(&components, &coarser, goal, value_bits, observer);
        let described = verified.map(|verified| {
            let encoded = &verified.encoded.encoded;
            if encoded.is_stiff() {
                observer.note(&format!("{NAME}, {}: {}", domain_name(common.transfer), encoded.found()));
            }
            described(verified, components.rank(), common.transfer)
        });
        let mut attempts = Attempts::default();
        attempts.add(described)?;
        Ok(attempts)
    }

    fn choose(&self, _: Goal, reached: Vec<encoder::Encoded>) -> Option<encoder::Encoded> {
        reached.into_iter().next()
    }

    #[cfg(feature = "cli")]
    fn arguments(&self, command: Command) -> Command {
        Arguments::augment_args(command)
    }

    #[cfg(feature = "cli")]
    fn configured(&self, matches: &ArgMatches) -> Result<Box<dyn Encoder>> {
        let arguments =
            Arguments::from_arg_matches(matches).map_err(|error| ToolError::Usage(error.to_string()))?;
        Ok(Box::new(arguments.encoder()))
    }
}

/// The file for reports.
fn described(verified: Verified<Shaped>, components: usize, transfer: Domain) -> encoder::Encoded {
    let Verified { encoded: Shaped { shape, encoded }, metrics, operations } = verified;
    let sizes = [shape.light_atoms, shape.abrdf_atoms, shape.entries, shape.coefficients];
    encoder::Encoded {
        method: NAME,
        transfer,
        operations,
        predicted_rms: encoded.predicted_rms,
        metrics,
        setting: format!("shape {}", sizes.map(|n| n.to_string()).join(",")),
        settings: Settings(vec![
            ("shape", sizes.to_vec().into()),
            ("components", components.into()),
            ("list_coefficients", encoded.coefficients.into()),
            ("limited", encoded.clipped.into()),
            ("trained", serde_json::to_value(encoded.trained).unwrap_or_default()),
        ]),
        bytes: encoded.bytes,
    }
}
