//! What every encoder is: a method's own options, and how a dataset becomes a file by them.

use super::goal::{Goal, domain_name};
use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::error::{Result, ToolError};
use crate::measure::compare::Metrics;
use crate::progress::Observer;
use serde::ser::{Serialize, SerializeMap as _, Serializer};

/// A dataset and its coarser levels of detail, as [`crate::data::pyramid::levels`] makes them.
#[derive(Clone, Copy)]
pub struct Levels<'a> {
    /// Level 0, which errors are measured of.
    pub finest: &'a Dataset,
    /// The levels from the second on.
    pub coarser: &'a [Dataset],
}

impl<'a> Levels<'a> {
    /// A dataset alone.
    pub fn of(finest: &'a Dataset) -> Levels<'a> {
        Levels { finest, coarser: &[] }
    }

    /// All levels, finest first.
    pub fn all(&self) -> Vec<&'a Dataset> {
        std::iter::once(self.finest).chain(self.coarser).collect()
    }
}

/// Options that mean the same for every method, though not every encoder takes each of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Common {
    /// The domain that is coded.
    pub transfer: Domain,
    /// Offset of the logarithm; a thousandth of the mean if `None`.
    pub offset: Option<f64>,
    /// Operations of a filtered sample that the file may state, at most.
    pub operations: Option<u32>,
    /// Quality layers, from 1.
    pub layers: usize,
    /// Bits of a value in each channel; chosen if `None`.
    pub value_bits: Option<[u32; 3]>,
}

impl Default for Common {
    fn default() -> Common {
        Common { transfer: Domain::Log, offset: None, operations: None, layers: 1, value_bits: None }
    }
}

/// How a method made a file, for reports: names and values in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings(pub Vec<(&'static str, serde_json::Value)>);

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        self.0.iter().try_for_each(|(name, value)| map.serialize_entry(name, value))?;
        map.end()
    }
}

/// A file that reached its goal.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// Name of the method.
    pub method: &'static str,
    /// The domain that is coded.
    pub transfer: Domain,
    /// The file.
    pub bytes: Vec<u8>,
    /// Operations of a filtered sample that it states.
    pub operations: u32,
    /// Root mean squared error over level 0 that the encoder predicted, in the domain that is coded.
    pub predicted_rms: f64,
    /// Decoded against the data, over all texels and pairs of level 0.
    pub metrics: Metrics,
    /// What the method chose, in a few words: `edge 4`.
    pub setting: String,
    /// The same and more, for machines.
    pub settings: Settings,
}

impl Encoded {
    /// One line on it: method, settings, bytes, errors, operations.
    pub fn line(&self) -> String {
        format!(
            "{}, {}, {}: {} bytes, RMS log {:.4}, linear {:.5}, {} operations",
            self.method,
            domain_name(self.transfer),
            self.setting,
            self.bytes.len(),
            self.metrics.log_rms,
            self.metrics.linear_rms,
            self.operations
        )
    }
}

/// What came of the settings that a method tried.
#[derive(Default)]
pub struct Attempts {
    /// A file for each setting that reached the goal.
    pub reached: Vec<Encoded>,
    /// Why the others did not.
    pub missed: Vec<ToolError>,
}

impl Attempts {
    /// Adds what came of a setting.
    ///
    /// # Errors
    /// Whatever is not [`ToolError::Unreachable`].
    pub fn add(&mut self, result: Result<Encoded>) -> Result<()> {
        match result {
            Ok(encoded) => self.reached.push(encoded),
            Err(error @ ToolError::Unreachable { .. }) => self.missed.push(error),
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// The encoder of a method with its options: those of a new one are defaults.
pub trait Encoder: Sync {
    /// Name of the method.
    fn method(&self) -> &'static str;

    /// The method in a line of help.
    fn about(&self) -> &'static str;

    /// Whether [`Common::operations`] is a cap that the encoder keeps.
    fn caps_operations(&self) -> bool;

    /// Refuses options that do not go together, before any data are read.
    ///
    /// # Errors
    /// [`ToolError::Usage`]; [`ToolError::Unreachable`] if this encoder cannot aim at such a goal, though
    /// another one may.
    fn check(&self, goal: Goal, common: &Common) -> Result<()>;

    /// Refuses options of the method that leave nothing to choose between it and others.
    ///
    /// # Errors
    /// [`ToolError::Usage`].
    fn check_choice(&self) -> Result<()>;

    /// Encodes and verifies: a file for each setting that the method tries, in the order of trying.
    ///
    /// # Errors
    /// If data cannot be read or hold what the method cannot, or options do not fit them. A goal that a
    /// setting does not reach is no error here.
    fn encode(
        &self,
        levels: &Levels<'_>,
        goal: Goal,
        common: &Common,
        observer: &dyn Observer,
    ) -> Result<Attempts>;

    /// The best for a goal of the files that reached it.
    fn choose(&self, goal: Goal, reached: Vec<Encoded>) -> Option<Encoded>;

    /// Adds the method's options to a command, under a heading of their own.
    #[cfg(feature = "cli")]
    fn arguments(&self, command: clap::Command) -> clap::Command;

    /// The encoder with the options of a command line.
    ///
    /// # Errors
    /// If a file that an option names cannot be read.
    #[cfg(feature = "cli")]
    fn configured(&self, matches: &clap::ArgMatches) -> Result<Box<dyn Encoder>>;
}

/// Encodes with one method.
///
/// # Errors
/// As [`Encoder::check`] and [`Encoder::encode`]; [`ToolError::Unreachable`] if no setting reaches the goal.
pub fn encode(
    encoder: &dyn Encoder,
    levels: &Levels<'_>,
    goal: Goal,
    common: &Common,
    observer: &dyn Observer,
) -> Result<Encoded> {
    encoder.check(goal, common)?;
    let Attempts { reached, mut missed } = encoder.encode(levels, goal, common, observer)?;
    encoder.choose(goal, reached).ok_or_else(|| {
        missed.pop().unwrap_or_else(|| ToolError::Unreachable {
            goal: goal.to_string(),
            least: "no setting of the method was tried".into(),
        })
    })
}
