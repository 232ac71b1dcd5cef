//! How to encode, and what comes out.

use crate::format::model::MaterialModel;
use std::sync::Arc;

/// What decides which coefficients are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// Coefficients of a block in each channel: the largest.
    Coefficients([usize; 3]),
    /// Predicted root mean squared error in the domain of the channels: of `ln(x + offset)`, or of linear
    /// radiance.
    Rms(f64),
    /// Bytes of the whole file, at most.
    Bytes(u64),
    /// Magnitude below which a coefficient is not kept, in units of the channel.
    Threshold(f64),
}

/// How to encode.
#[derive(Clone, Debug)]
pub struct Options {
    /// Texels along the side of a block.
    pub edge: usize,
    /// What decides which coefficients are kept.
    pub criterion: Criterion,
    /// Operations of a filtered sample that the file may state, at most.
    pub operations: Option<u32>,
    /// Quality layers.
    pub layers: usize,
    /// Bits of a value in each channel; chosen by their cost if `None`.
    pub value_bits: Option<[u32; 3]>,
    /// A dictionary file that the material references instead of embedding its columns. The ensembles are
    /// those that were read from it, with their own spatial bases where the edge is another.
    pub external: Option<Arc<[u8]>>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            edge: 4,
            criterion: Criterion::Rms(0.2),
            operations: None,
            layers: 1,
            value_bits: None,
            external: None,
        }
    }
}

/// A finished file and what is known of it without decoding it.
pub struct Encoded {
    /// The material.
    pub model: MaterialModel,
    /// Its file.
    pub bytes: Vec<u8>,
    /// Coefficients of level 0 in each channel.
    pub coefficients: [usize; 3],
    /// The threshold.
    pub threshold: f64,
    /// Energy of the coefficients of level 0 that were left out.
    pub lost: f64,
    /// Predicted root mean squared error over level 0, in the domain of the channels (`ln`, or linear).
    pub predicted_rms: f64,
}

impl AsRef<[u8]> for Encoded {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// What a coefficient costs on average, in bits: its value and its position.
pub(super) const COEFFICIENT_BITS: f64 = 10.0;
