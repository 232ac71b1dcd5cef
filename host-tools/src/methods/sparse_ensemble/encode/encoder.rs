//! The encoder of the sparse ensemble behind the trait of encoders.

#[cfg(feature = "cli")]
use super::arguments::Arguments;
use super::options::{Criterion, Encoded, Options};
use super::prepare::prepare;
use super::settings::SparseEnsemble;
use super::verified::{self, encode_edge};
use crate::data::dataset::{Dataset, Description};
use crate::data::transfer::{Domain, transfer_of};
use crate::encode::encoder::{self, Attempts, Common, Encoder, Levels, Settings};
use crate::encode::goal::{Goal, Verified};
use crate::error::{Result, ToolError};
use crate::format::model::TransferModel;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::methods::sparse_ensemble::dictionary_file::DictionaryFile;
use crate::methods::sparse_ensemble::train;
use crate::progress::Observer;
#[cfg(feature = "cli")]
use clap::{ArgMatches, Args as _, Command, FromArgMatches as _};

/// Name of the method.
pub const NAME: &str = "sparse-ensemble";

/// Edge of blocks that dictionaries of a material itself are trained with if none is given.
const TRAINED_EDGE: usize = 4;
/// Texels in blocks that they are trained on, and blocks at least.
const TRAINED_TEXELS: usize = 200_000;
const TRAINED_BLOCKS: usize = 64;
/// Iterations of that training at most: it is of one material, and repeated with every encoding.
const TRAINED_ITERATIONS: usize = 12;
/// Distance of unit vectors below which directions are the same: those of a dictionary file were rounded.
const SAME_DIRECTION: f64 = 2e-4;
/// Offsets of a logarithm: normal numbers, up to one.
const OFFSETS: std::ops::RangeInclusive<f64> = 1.2e-38..=1.0;

impl SparseEnsemble {
    /// The edge that is encoded with, 0 if it is chosen.
    fn edge(&self) -> usize {
        // The trained spatial bases gain more than another edge.
        let of_dictionary = self.dictionary.as_ref().map(|dictionary| dictionary.training.options.edge);
        let of_training = self.own_dictionaries.map(|_| TRAINED_EDGE);
        self.edge.or(of_training).or(of_dictionary).unwrap_or(0)
    }

    fn options(&self, common: &Common) -> Options {
        let external = self.dictionary.as_ref().filter(|_| self.external);
        Options {
            criterion: self.coefficients.map_or(Options::default().criterion, Criterion::Coefficients),
            operations: common.operations,
            layers: common.layers,
            value_bits: common.value_bits,
            external: external.map(|dictionary| dictionary.bytes.as_slice().into()),
            ..Options::default()
        }
    }
}

/// The encoder with default options.
pub static ENCODER: SparseEnsemble = SparseEnsemble::DEFAULT;

impl Encoder for SparseEnsemble {
    fn method(&self) -> &'static str {
        NAME
    }

    fn about(&self) -> &'static str {
        "Blocks of a few products of four columns (SparseBTF 2023)"
    }

    fn caps_operations(&self) -> bool {
        true
    }

    fn check(&self, goal: Goal, common: &Common) -> Result<()> {
        let usage = |text: &str| Err(ToolError::Usage(text.into()));
        if common.value_bits.is_some_and(|all| all.iter().any(|bits| !(1..=16).contains(bits))) {
            return usage("--value-bits: 1 to 16");
        }
        if common.offset.is_some_and(|offset| !OFFSETS.contains(&offset)) {
            return usage("--offset: a normal number up to 1");
        }
        match (goal, self.coefficients) {
            (Goal::AsGiven, None) => {
                usage("a goal is missing: --rmse, --psnr, --size or --coefficients of a sparse ensemble")
            }
            (Goal::AsGiven, Some(_)) | (_, None) => Ok(()),
            (_, Some(_)) => usage("--coefficients are a goal, of which there can be one"),
        }
    }

    fn check_choice(&self) -> Result<()> {
        let is_given = self.dictionary.is_some()
            || self.own_dictionaries.is_some()
            || self.edge.is_some()
            || self.coefficients.is_some();
        if is_given {
            return Err(ToolError::Usage(format!(
                "--dictionary, --own-dictionaries, --edge and --coefficients are of --method {NAME}"
            )));
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
        let data = levels.finest;
        let transfer = match (common.transfer, common.offset) {
            (Domain::Log, Some(offset)) => TransferModel::Log2 { offset: offset as f32 },
            (domain, _) => transfer_of(data, domain),
        };
        let progress = |done, all| observer.pass("means and bases", done, all);
        let prepared = prepare(levels.all(), transfer, &progress)?;
        if let Some(dictionary) = &self.dictionary {
            same_directions(dictionary, data.description())?;
        }
        let edge = self.edge();
        let trained = match self.own_dictionaries {
            Some(count) => train_own(data, count, edge)?,
            None => None,
        };
        let ensembles = |edge: usize| -> [Ensemble; 3] {
            match (&self.dictionary, &trained) {
                (Some(dictionary), _) => dictionary.ensembles.each_ref().map(|e| e.with_edge(edge)),
                (_, Some(trained)) => trained.ensembles.each_ref().map(|e| e.with_edge(edge)),
                _ => prepared.own_ensembles(edge),
            }
        };
        let mut attempts = Attempts::default();
        for edge in verified::edges(edge, goal) {
            let options = Options { edge, ..self.options(common) };
            let verified = encode_edge(&prepared, &ensembles(edge), goal, &options, observer);
            attempts.add(verified.map(|verified| described(verified, common.transfer)))?;
        }
        Ok(attempts)
    }

    fn choose(&self, goal: Goal, reached: Vec<encoder::Encoded>) -> Option<encoder::Encoded> {
        verified::choose(goal, reached, |e| (e.metrics.log_rms, e.bytes.len(), e.operations))
    }

    #[cfg(feature = "cli")]
    fn arguments(&self, command: Command) -> Command {
        Arguments::augment_args(command)
    }

    #[cfg(feature = "cli")]
    fn configured(&self, matches: &ArgMatches) -> Result<Box<dyn Encoder>> {
        let arguments =
            Arguments::from_arg_matches(matches).map_err(|error| ToolError::Usage(error.to_string()))?;
        Ok(Box::new(arguments.encoder()?))
    }
}

/// The file for reports.
fn described(verified: Verified<Encoded>, transfer: Domain) -> encoder::Encoded {
    let Verified { encoded, metrics, operations } = verified;
    let edge = encoded.model.edge;
    encoder::Encoded {
        method: NAME,
        transfer,
        operations,
        predicted_rms: encoded.predicted_rms,
        metrics,
        setting: format!("edge {edge}"),
        settings: Settings(vec![
            ("edge", edge.into()),
            ("coefficients", encoded.coefficients.to_vec().into()),
        ]),
        bytes: encoded.bytes,
    }
}

/// An ensemble trained on the material that is encoded, at a sparsity near what its blocks will have.
fn train_own(data: &Dataset, count: usize, edge: usize) -> Result<Option<train::Trained>> {
    let texels = edge * edge;
    let options = train::Options {
        dictionaries: count,
        sparsity: [4 * texels, texels.div_ceil(2), texels.div_ceil(2)],
        edge,
        blocks: (TRAINED_TEXELS / texels).max(TRAINED_BLOCKS),
        iterations: TRAINED_ITERATIONS,
        ..train::Options::default()
    };
    train::train(&[data], &options, None, &mut |_| true)
}

fn same_directions(dictionary: &DictionaryFile, description: &Description) -> Result<()> {
    let near = |a: &[glam::DVec3], b: &[glam::DVec3]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (*a - *b).length() < SAME_DIRECTION)
    };
    let training = &dictionary.training;
    if near(&training.lights, &description.lights) && near(&training.views, &description.views) {
        return Ok(());
    }
    Err(ToolError::Usage("the dictionary was trained for other directions than those of the dataset".into()))
}
