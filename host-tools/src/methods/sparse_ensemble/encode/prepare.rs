//! The first pass over a dataset: what does not depend on the goal.

use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::error::Result;
use crate::format::model::{PairTableModel, TransferModel};
use crate::math::linear::{Basis, eigenbasis};
use crate::methods::means::mean_tables;
use crate::methods::sparse_ensemble::blocks::{Blocks, Moments, moments};
use crate::methods::sparse_ensemble::dictionary::{Ensemble, Turn};
use std::f64::consts::LN_2;

/// Everything about a dataset that does not depend on the goal.
pub struct Prepared<'a> {
    /// The levels of detail, finest first.
    pub levels: Vec<&'a Dataset>,
    /// Radiance to channels.
    pub forward: Forward,
    /// Means as the file holds them.
    pub means: [PairTableModel; 3],
    /// Means that the decoder will add, in floats.
    pub decoded_means: [Vec<f32>; 3],
    /// Second moments.
    pub moments: Moments,
}

/// The first pass over the data: means and second moments.
///
/// # Errors
/// If the data cannot be read, or their means are beyond the format.
pub fn prepare<'a>(
    levels: Vec<&'a Dataset>,
    transfer: TransferModel,
    progress: &dyn Fn(usize, usize),
) -> Result<Prepared<'a>> {
    let forward = Forward::new(transfer);
    let moments = moments(levels[0], forward, progress)?;
    let (means, decoded_means) = mean_tables(&moments.means)?;
    Ok(Prepared { levels, forward, means, decoded_means, moments })
}

impl Prepared<'_> {
    /// The material's own bases: eigenvectors between lights and between views (HOSVD), cosines over texels;
    /// one dictionary a channel.
    pub fn own_ensembles(&self, edge: usize) -> [Ensemble; 3] {
        std::array::from_fn(|c| {
            let description = self.levels[0].description();
            let (light, _) = eigenbasis(&self.moments.lights[c], description.lights.len());
            let (view, _) = eigenbasis(&self.moments.views[c], description.views.len());
            Ensemble {
                light,
                view,
                turns: vec![Turn { light: None, view: None, x: Basis::cosine(edge), y: Basis::cosine(edge) }],
                tables: None,
            }
        })
    }

    /// Number of values of level 0: texels of all blocks, times pairs, times channels.
    pub(super) fn values(&self, edge: usize) -> f64 {
        let description = self.levels[0].description();
        let texels: usize = description.size.iter().map(|n| n.div_ceil(edge) * edge).product();
        (texels * description.pairs() * 3) as f64
    }

    /// Blocks of a level.
    pub fn blocks(&self, level: usize, edge: usize) -> Blocks<'_> {
        Blocks { dataset: self.levels[level], forward: self.forward, edge, means: &self.decoded_means }
    }

    /// Units of a channel in those of errors, which are of natural logarithms where channels are of base two.
    pub(super) fn unit(&self) -> f64 {
        match self.forward.transfer {
            TransferModel::Log2 { .. } => LN_2,
            TransferModel::Linear { exponent } => 2f64.powi(exponent),
        }
    }
}
