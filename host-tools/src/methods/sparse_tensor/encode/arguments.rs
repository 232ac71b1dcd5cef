//! Options of the sparse tensor on the command line.

use super::fit::Shape;
use super::options::{MB, MEMORY, RANK, SparseTensor};
use clap::Args;

#[derive(Args)]
// No group: its name would be that of every struct called so.
#[group(skip)]
#[command(next_help_heading = "Sparse tensor options")]
pub(super) struct Arguments {
    /// Light atoms, ABRDF atoms, entries of a fibre and coefficients of a texel, as 64,128,8,10; chosen if
    /// not given. Alone it is the goal
    #[arg(long, value_parser = shape)]
    shape: Option<Shape>,
    /// Principal components that training works in; memory grows with their number times the texels
    #[arg(long, default_value_t = RANK, value_parser = clap::value_parser!(u16).range(1..=2048))]
    rank: u16,
    /// PCA memory budget, MB; below it PCA uses more passes, then fewer components
    #[arg(long, default_value_t = MEMORY, value_parser = clap::value_parser!(u32).range(16..=1_000_000))]
    memory: u32,
}

impl Arguments {
    pub(super) fn encoder(&self) -> SparseTensor {
        SparseTensor {
            shape: self.shape,
            rank: self.rank.into(),
            memory: self.memory as usize * MB,
            ..SparseTensor::DEFAULT
        }
    }
}

/// Most light atoms, ABRDF atoms, entries and coefficients (chapter 12).
const MOST: [usize; 4] = [256, 1024, 32, 63];

/// Four numbers in the ranges of chapter 12.
fn shape(text: &str) -> std::result::Result<Shape, String> {
    let numbers: Vec<usize> = text
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| format!("`{n}` is no number")))
        .collect::<std::result::Result<_, _>>()?;
    let sizes: [usize; 4] = numbers
        .try_into()
        .map_err(|_| "four numbers: light atoms, ABRDF atoms, entries, coefficients".to_owned())?;
    if sizes.iter().zip(MOST).any(|(n, most)| !(1..=most).contains(n)) {
        return Err(format!("1 to {MOST:?}"));
    }
    let [light_atoms, abrdf_atoms, entries, coefficients] = sizes;
    Ok(Shape { light_atoms, abrdf_atoms, entries, coefficients })
}
