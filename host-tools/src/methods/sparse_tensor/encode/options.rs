//! How to encode, and what comes out.

use super::fit::{Shape, Trained, Training};
use crate::encode::goal::Target;
use crate::format::model::MaterialModel;

/// The encoder with its own options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseTensor {
    /// Sizes of the dictionaries and lists; chosen if `None`. With [`Goal::AsGiven`](crate::encode::goal::Goal) they are the goal.
    pub shape: Option<Shape>,
    /// Components that training works in, at most.
    pub rank: usize,
    /// Memory budget of their decomposition, bytes.
    pub memory: usize,
    /// How long to train.
    pub training: Training,
}

/// Components, where none are asked for.
pub(super) const RANK: u16 = 200;
/// Memory budget of the decomposition, where none is asked for, MB.
pub(super) const MEMORY: u32 = 4000;
/// Bytes of one MB.
pub(super) const MB: usize = 1_000_000;

impl Default for SparseTensor {
    fn default() -> SparseTensor {
        SparseTensor::DEFAULT
    }
}

impl SparseTensor {
    /// A chosen shape.
    pub const DEFAULT: SparseTensor = SparseTensor {
        shape: None,
        rank: RANK as usize,
        memory: MEMORY as usize * MB,
        training: Training::DEFAULT,
    };
}

/// How to encode.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Sizes of the dictionaries and lists.
    pub shape: Shape,
    /// What to aim at; [`Target::AsGiven`] takes as many coefficients as the shape allows, for every texel.
    pub target: Target,
    /// Bits of a coefficient; chosen by their cost if `None`.
    pub value_bits: Option<u32>,
    /// How long to train.
    pub training: Training,
}

/// A finished file and what is known of it without decoding it.
pub struct Encoded {
    /// The material.
    pub model: MaterialModel,
    /// Its file.
    pub bytes: Vec<u8>,
    /// Coefficients of level 0.
    pub coefficients: usize,
    /// Predicted root mean squared error over level 0, in the domain that is coded, all rounding of stored
    /// numbers included.
    pub predicted_rms: f64,
    /// Coefficients that were clipped to the range of their ABRDF atom.
    pub clipped: usize,
    /// What training found.
    pub trained: Trained,
}

impl AsRef<[u8]> for Encoded {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// Energies of ABRDF atoms that lie further apart are not taken for granted; those of common materials are
/// within ten.
pub(super) const STIFF: f64 = 1e3;
/// Of so many coefficients one may be clipped before the quantisation ranges are too small.
const CLIPPED_ONE_IN: usize = 100;

/// Whether clipping is so frequent that the quantisation ranges are too small.
pub(super) fn is_clipping_frequent(clipped: usize, coefficients: usize) -> bool {
    clipped * CLIPPED_ONE_IN > coefficients
}

/// Cost to minimise among files that meet a target, from their error and bytes.
pub(super) fn cost(target: Target, rms: f64, bytes: f64) -> f64 {
    match target {
        Target::Rms(_) => bytes,
        Target::Bytes(_) => rms,
        // Bytes to the power at which error falls with them, about: no target weighs one against the other.
        Target::AsGiven => rms * bytes.sqrt(),
    }
}

impl Encoded {
    /// What training and coding found, in words.
    pub fn found(&self) -> String {
        let Trained { revived, breakdowns, condition, .. } = &self.trained;
        format!(
            "{revived} atoms revived, {breakdowns} breakdowns, energies of atoms within {condition:.0}:1, {} \
             coefficients clipped",
            self.clipped
        )
    }

    /// Whether any of it is unusual: data whose energy is in a few of their values.
    pub fn is_stiff(&self) -> bool {
        self.trained.revived > 0
            || self.trained.breakdowns > 0
            || self.trained.condition > STIFF
            || is_clipping_frequent(self.clipped, self.coefficients)
    }
}
