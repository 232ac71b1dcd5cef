//! The principal components of [`crate::math::pca`] as a baseline.
//!
//! Both factors and the mean are quantised to 8 or 16 bits, a scale for each component and factor, and
//! everything is counted.

use super::decoder::{At, Blend, Decoder, Frame, Pairs, add_row, dot, inverse_operations};
use super::{Row, Sums};
use crate::data::dataset::Dataset;
use crate::data::pass::pass;
use crate::data::transfer::Domain;
use crate::error::Result;
use crate::math::linear::product_bt;
use crate::math::pca::{Pca, pca};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Deref;

/// Widths that a factor can have, in bits.
pub const WIDTHS: [u32; 2] = [8, 16];

/// The components of a dataset, and what was measured of them so far.
pub struct Components<'a> {
    pca: Pca<'a>,
    /// By rank and width.
    measured: BTreeMap<(usize, u32), Row>,
}

/// The leading `max_rank` components of a dataset, to be measured.
///
/// # Errors
/// If the data cannot be read.
pub fn components(dataset: &Dataset, domain: Domain, max_rank: usize) -> Result<Components<'_>> {
    Ok(Components { pca: pca(dataset, domain, max_rank)?, measured: BTreeMap::new() })
}

impl<'a> Deref for Components<'a> {
    type Target = Pca<'a>;

    fn deref(&self) -> &Pca<'a> {
        &self.pca
    }
}

/// A rank and a width that were chosen, and what they reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Components.
    pub rank: usize,
    /// Bits of a number.
    pub bits: u32,
    /// Cost and errors.
    pub row: Row,
}

/// Components decoded from what they store.
pub struct Decoded {
    frame: Frame,
    of_texels: Vec<f32>,
    of_pairs: Vec<f32>,
    rank: usize,
    bytes: u64,
}

impl Decoder for Decoded {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]) {
        let rank = self.rank;
        let mut rows = vec![0.0f32; lights.len() * 3 * rank];
        for (i, &light) in lights.iter().enumerate() {
            for &(pair, weight) in Pairs::of(light, view, self.frame.lights).iter() {
                add_row(
                    &mut rows[i * 3 * rank..][..3 * rank],
                    weight,
                    &self.of_pairs[pair * 3 * rank..][..3 * rank],
                );
            }
        }
        self.frame.images(lights, view, &rows, &self.of_texels, out);
    }

    fn filtered(&self, at: &At) -> [f32; 3] {
        // The four texels' weights first, so that every pair and colour meets one row of them.
        const MOST: usize = 512;
        let mut blended = [0.0f32; MOST];
        let mut sum = self.frame.mean_at(at);
        let (texels, pairs) = (at.texels(self.frame.width), at.pairs(self.frame.lights));
        let mut first = 0;
        while first < self.rank {
            let part = (self.rank - first).min(MOST);
            let blended = &mut blended[..part];
            blended.fill(0.0);
            texels.iter().for_each(|&(texel, weight)| {
                add_row(blended, weight, &self.of_texels[texel * self.rank + first..][..part])
            });
            for &(pair, weight) in pairs.iter() {
                for (c, sum) in sum.iter_mut().enumerate() {
                    *sum +=
                        weight * dot(blended, &self.of_pairs[(pair * 3 + c) * self.rank + first..][..part]);
                }
            }
            first += part;
        }
        self.frame.back(sum)
    }

    fn operations(&self, at: &At) -> u64 {
        let (pairs, rank) = (at.pairs(self.frame.lights).len() as u64, self.rank as u64);
        4 * rank + pairs * (3 * rank + 7) + inverse_operations(self.frame.domain)
    }
}

thread_local! {
    /// Decoded values: mapping fresh memory for each batch would take longer than the work.
    static DECODED: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Errors of texels that `decode` gives in the domain of the components.
pub(super) fn decode_and_compare(
    pca: &Pca<'_>,
    bytes: u64,
    decode: &(dyn Fn(usize, &mut [f32]) + Sync),
) -> Result<Row> {
    let (columns, offset) = (pca.mean.len(), pca.dataset.statistics().log_offset());
    let work = |first: usize, values: &[f32]| {
        let mut decoded = vec![0.0; columns];
        let mut sums = Sums::default();
        for (i, texel) in values.chunks(columns).enumerate() {
            decode(first + i, &mut decoded);
            texel
                .iter()
                .zip(&decoded)
                .for_each(|(&wanted, &found)| sums.compare(wanted, pca.domain.back(found, offset), offset));
        }
        sums
    };
    Ok(pass(pca.dataset, work, Sums::default(), |total, sums| total.add(sums))?.row(bytes))
}

/// The first `rank` of `all` columns, each quantised to its largest magnitude and decoded again.
pub(super) fn quantised(factor: &[f32], all: usize, rank: usize, bits: u32) -> Vec<f32> {
    let most = ((1u32 << (bits - 1)) - 1) as f32;
    let mut largest = vec![0.0f32; rank];
    for row in factor.chunks(all) {
        largest.iter_mut().zip(row).for_each(|(largest, v)| *largest = largest.max(v.abs()));
    }
    let scales: Vec<f32> = largest.iter().map(|largest| largest.max(1e-30) / most).collect();
    factor
        .chunks(all)
        .flat_map(|row| row.iter().zip(&scales).map(|(v, scale)| (v / scale).round() * scale))
        .collect()
}

impl Components<'_> {
    /// Bytes at a rank and width: the mean with its base and scale, both factors, and two scales a component.
    pub fn bytes(&self, rank: usize, bits: u32) -> u64 {
        let (texels, columns) = (self.dataset.description().texels() as u64, self.mean.len() as u64);
        let width = bits as u64 / 8;
        columns * width + 8 + rank as u64 * ((texels + columns) * width + 8)
    }

    /// The error that belongs to the domain.
    pub fn error(&self, row: &Row) -> f64 {
        if self.domain == Domain::Log { row.log_rms } else { row.linear_rms }
    }

    /// Errors over all values, decoded from quantised factors and mean.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn measure(&mut self, rank: usize, bits: u32) -> Result<Row> {
        let rank = rank.min(self.rank());
        if let Some(row) = self.measured.get(&(rank, bits)) {
            return Ok(*row);
        }
        let columns = self.mean.len();
        let Decoded { frame: Frame { mean, offset, .. }, of_texels, of_pairs, .. } = self.decoder(rank, bits);
        let work = |first: usize, values: &[f32]| {
            DECODED.with_borrow_mut(|decoded| {
                decoded.resize(values.len(), 0.0);
                decoded.chunks_mut(columns).for_each(|texel| texel.copy_from_slice(&mean));
                let count = values.len() / columns;
                if rank > 0 {
                    product_bt(
                        decoded,
                        &of_texels[first * rank..][..count * rank],
                        &of_pairs,
                        [count, rank, columns],
                        true,
                    );
                }
                let mut sums = Sums::default();
                values.iter().zip(decoded).for_each(|(&wanted, value)| {
                    sums.compare(wanted, self.domain.back(*value, offset), offset)
                });
                sums
            })
        };
        let sums = pass(self.dataset, work, Sums::default(), |total, sums| total.add(sums))?;
        let row = sums.row(self.bytes(rank, bits));
        self.measured.insert((rank, bits), row);
        Ok(row)
    }

    /// Decodes what a rank and width would store.
    pub fn decoder(&self, rank: usize, bits: u32) -> Decoded {
        let rank = rank.min(self.rank());
        let least = self.mean.iter().copied().fold(f32::MAX, f32::min);
        let largest = self.mean.iter().copied().fold(f32::MIN, f32::max);
        let scale = (largest - least).max(1e-30) / ((1u32 << bits) - 1) as f32;
        Decoded {
            frame: Frame::new(
                self,
                self.mean.iter().map(|m| least + ((m - least) / scale).round() * scale).collect(),
            ),
            of_texels: quantised(&self.of_texels, self.rank(), rank, bits),
            of_pairs: quantised(&self.of_pairs, self.rank(), rank, bits),
            rank,
            bytes: self.bytes(rank, bits),
        }
    }

    fn error_at(&mut self, rank: usize, bits: u32) -> Result<f64> {
        let row = self.measure(rank, bits)?;
        Ok(self.error(&row))
    }

    /// The better of both widths within a budget, or `None` if not even the mean fits.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn best_at(&mut self, bytes: u64) -> Result<Option<Choice>> {
        let mut best: Option<Choice> = None;
        for bits in WIDTHS {
            let base = self.bytes(0, bits);
            if base <= bytes {
                let rank = (((bytes - base) / (self.bytes(1, bits) - base)) as usize).min(self.rank());
                let row = self.measure(rank, bits)?;
                if best.is_none_or(|best| self.error(&row) < self.error(&best.row)) {
                    best = Some(Choice { rank, bits, row });
                }
            }
        }
        Ok(best)
    }

    /// The fewest bytes that reach an error in its domain, or `None` if all components found do not.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn reach(&mut self, rms: f64) -> Result<Option<Choice>> {
        let mut best: Option<Choice> = None;
        for bits in WIDTHS {
            // A wider one is of use only if it needs fewer bytes.
            let most = (0..=self.rank())
                .rev()
                .find(|&rank| best.is_none_or(|best| self.bytes(rank, bits) < best.row.bytes));
            let Some(most) = most else { continue };
            if let Some(rank) = self.least_rank(bits, rms, most)? {
                best = Some(Choice { rank, bits, row: self.measure(rank, bits)? });
            }
        }
        Ok(best)
    }

    /// The least rank up to `most` that reaches an error; errors fall with rank.
    fn least_rank(&mut self, bits: u32, rms: f64, most: usize) -> Result<Option<usize>> {
        let mut high = (0..most).find(|&rank| self.predicted_rms(rank) <= rms).unwrap_or(most);
        let mut step = 1;
        let mut low = high;
        while self.error_at(high, bits)? > rms {
            if high == most {
                return Ok(None);
            }
            (low, high, step) = (high, (high + step).min(most), step * 2);
        }
        step = 1;
        while low > 0 && self.error_at(low, bits)? <= rms {
            (high, low, step) = (low, low.saturating_sub(step), step * 2);
        }
        // The least that reaches is above `low`, or is 0.
        if self.error_at(low, bits)? <= rms {
            return Ok(Some(low));
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if self.error_at(middle, bits)? <= rms { high = middle } else { low = middle }
        }
        Ok(Some(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::baseline::tests::small;

    #[test]
    fn components_explain_what_they_should_at_the_stated_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [21, 12]);
        let mut pca = components(&dataset, Domain::Log, 12).expect("made");
        let errors: Vec<f64> =
            [0, 1, 2, 3].map(|rank| pca.measure(rank, 16).expect("measured").log_rms).to_vec();
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0] * 0.95), "{errors:?}");
        assert!(errors[3] < 0.05 * errors[0], "{errors:?}");
        (0..4).for_each(|rank| assert!((errors[rank] - pca.predicted_rms(rank)).abs() < 1e-3, "{errors:?}"));
        assert_eq!(pca.bytes(2, 8), 162 + 8 + 2 * (162 + 252 + 8));
        assert_eq!(pca.bytes(1, 16), 2 * 162 + 8 + 2 * (162 + 252) + 8);
        let best = pca.best_at(2000).expect("measured").expect("fits");
        assert!(best.row.bytes <= 2000 && best.rank > 0);
        assert!(pca.best_at(100).expect("measured").is_none());
        let reached = pca.reach(errors[2]).expect("measured").expect("reached");
        assert!(reached.row.log_rms <= errors[2] && reached.row.bytes <= pca.bytes(2, 16));
        assert!(pca.reach(1e-9).expect("measured").is_none());
    }
}
