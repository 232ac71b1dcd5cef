//! Texels against atoms: products with all of them, and the lists of coefficients pursued from these.

use super::integers::Quantiser;
use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::error::Result;
use crate::math::ksvd::{Pursuit, Rows, dot, pursue};
use crate::math::linear::product_bt;
use crate::work::ordered;
use rayon::prelude::*;

/// Products of every texel with all atoms, and its energy, both about the mean.
pub(super) struct Correlations {
    /// `[texel][atom]`.
    alpha: Vec<f32>,
    pub(super) energy: Vec<f64>,
}

/// Texels of a part of a pass.
const BATCH: usize = 32;

pub(super) fn correlate(
    data: &Dataset,
    forward: &Forward,
    means: &[Vec<f32>; 3],
    atoms: &Rows,
) -> Result<Correlations> {
    let (texels, columns, n) = (data.description().texels(), data.description().texel_len(), atoms.count());
    let work = |batch: usize| -> Result<(Vec<f32>, Vec<f64>)> {
        let count = BATCH.min(texels - batch * BATCH);
        let (mut bytes, mut values) = (Vec::new(), vec![0.0f32; count * columns]);
        data.read(batch * BATCH, count, &mut bytes, &mut values)?;
        for texel in values.chunks_mut(columns) {
            for (pair, rgb) in texel.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let channels = forward.channels(*rgb);
                *rgb = std::array::from_fn(|c| channels[c] - means[c][pair]);
            }
        }
        let mut alpha = vec![0.0; count * n];
        product_bt(&mut alpha, &values, &atoms.values, [count, columns, n], false);
        let energy = values.chunks(columns).map(|texel| dot(texel, texel)).collect();
        Ok((alpha, energy))
    };
    let start = Correlations { alpha: Vec::with_capacity(texels * n), energy: Vec::with_capacity(texels) };
    ordered(texels.div_ceil(BATCH), work, start, |all, _, (alpha, energy): (Vec<f32>, Vec<f64>)| {
        all.alpha.extend(alpha);
        all.energy.extend(energy);
    })
}

/// The lists of a level and what they come to.
pub(super) struct Lists {
    /// Atoms and stored values of each texel.
    pub(super) model: Vec<Vec<(u32, u16)>>,
    /// Squared error in units of the channels.
    pub(super) error: f64,
    /// Coefficients.
    pub(super) count: usize,
    /// Coefficients that were clipped to the range of their atom.
    pub(super) clipped: usize,
}

impl Correlations {
    /// Codes every texel by what each coefficient gains, and rounds.
    pub(super) fn lists(&self, gram: &[f64], quantiser: &Quantiser, pursuit: Pursuit) -> Lists {
        let of = |texel: usize| self.list(texel, gram, quantiser, pursuit);
        let all: Vec<Coded> = (0..self.energy.len()).into_par_iter().map(of).collect();
        let mut lists = Lists { model: Vec::with_capacity(all.len()), error: 0.0, count: 0, clipped: 0 };
        for Coded { list, error, clipped } in all {
            lists.error += error;
            lists.count += list.len();
            lists.clipped += clipped;
            lists.model.push(list);
        }
        lists
    }

    /// The best list of a texel.
    fn list(&self, texel: usize, gram: &[f64], quantiser: &Quantiser, pursuit: Pursuit) -> Coded {
        let mut best = self.coded(texel, gram, quantiser, pursuit);
        // Near-parallel atoms get large cancelling coefficients; once clipped they no longer cancel, so a
        // shorter list may fit better.
        if best.clipped > 0 {
            for most in (0..best.list.len()).rev() {
                let shorter = self.coded(texel, gram, quantiser, Pursuit { most, ..pursuit });
                let is_whole = shorter.clipped == 0;
                if shorter.error < best.error {
                    best = shorter;
                }
                if is_whole {
                    break;
                }
            }
        }
        if best.error > self.energy[texel] {
            return Coded { list: Vec::new(), error: self.energy[texel], clipped: 0 };
        }
        best
    }

    /// One pursuit of a texel, and its error after rounding.
    fn coded(&self, texel: usize, gram: &[f64], quantiser: &Quantiser, pursuit: Pursuit) -> Coded {
        let n = quantiser.atoms();
        let alpha = &self.alpha[texel * n..][..n];
        let code = pursue(alpha, self.energy[texel], gram, pursuit);
        let mut clipped = 0;
        let mut list: Vec<(u32, u16)> = Vec::with_capacity(code.terms.len());
        for &(atom, value) in &code.terms {
            let (stored, is_clipped) = quantiser.value(atom, value);
            list.push((atom, stored));
            clipped += is_clipped as usize;
        }
        list.sort_unstable();
        let rounded: Vec<(usize, f64)> =
            list.iter().map(|&(atom, stored)| (atom as usize, quantiser.coefficient(atom, stored))).collect();
        let mut error = self.energy[texel];
        for &(a, x) in &rounded {
            error -= 2.0 * x * alpha[a] as f64;
            error += rounded.iter().map(|&(b, y)| x * y * gram[a * n + b]).sum::<f64>();
        }
        Coded { list, error: error.max(0.0), clipped }
    }
}

/// The list of a texel.
struct Coded {
    list: Vec<(u32, u16)>,
    error: f64,
    clipped: usize,
}
