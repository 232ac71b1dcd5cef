//! Options of the sparse ensemble on the command line.

use super::settings::SparseEnsemble;
use crate::encode::parse::counts;
use crate::error::Result;
use crate::files;
use crate::methods::sparse_ensemble::dictionary_file;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Args)]
// No group: its name would be that of every struct called so.
#[group(skip)]
#[command(next_help_heading = "Sparse ensemble options")]
pub(super) struct Arguments {
    /// Goal: coefficients of a block in each channel, as 256,64,64
    #[arg(long, value_parser = counts, group = "goal")]
    coefficients: Option<[usize; 3]>,
    /// Texels along the side of a block, 1 to 16; chosen among 2, 4 and 8 if not given
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=16))]
    edge: Option<u16>,
    /// A trained dictionary; without it the material's own columns
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Reference the dictionary file instead of embedding it
    #[arg(long, requires = "dictionary")]
    external: bool,
    /// Train this many dictionaries on the material itself
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256), conflicts_with = "dictionary")]
    own_dictionaries: Option<u16>,
}

impl Arguments {
    pub(super) fn encoder(self) -> Result<SparseEnsemble> {
        let read = |path: PathBuf| dictionary_file::from_bytes(&path, files::read(&path)?).map(Arc::new);
        Ok(SparseEnsemble {
            edge: self.edge.map(usize::from),
            coefficients: self.coefficients,
            dictionary: self.dictionary.map(read).transpose()?,
            external: self.external,
            own_dictionaries: self.own_dictionaries.map(usize::from),
        })
    }
}
