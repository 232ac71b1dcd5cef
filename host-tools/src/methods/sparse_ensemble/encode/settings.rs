//! The encoder with its options, which the command line fills.

use crate::methods::sparse_ensemble::dictionary_file::DictionaryFile;
use std::sync::Arc;

/// The encoder with its own options.
#[derive(Clone, Debug, Default)]
pub struct SparseEnsemble {
    /// Texels along the side of a block, 1 to 16; chosen if `None`.
    pub edge: Option<usize>,
    /// Coefficients of a block in each channel: the goal, with [`Goal::AsGiven`](crate::encode::goal::Goal).
    pub coefficients: Option<[usize; 3]>,
    /// A trained dictionary; the material's own columns if `None`.
    pub dictionary: Option<Arc<DictionaryFile>>,
    /// Whether files reference the dictionary instead of embedding its columns.
    pub external: bool,
    /// How many dictionaries are trained on the material itself; none if `None`.
    pub own_dictionaries: Option<usize>,
}

impl SparseEnsemble {
    /// The material's own columns and a chosen edge.
    pub const DEFAULT: SparseEnsemble = SparseEnsemble {
        edge: None,
        coefficients: None,
        dictionary: None,
        external: false,
        own_dictionaries: None,
    };
}
