//! Principal components: one matrix, a row for each texel and a column for each pair and colour.
//!
//! The matrix holds `ln(x + e)`, or `x` itself, less its mean row (the mean ABRDF). Its leading singular
//! vectors are found by block power iteration with a random start (Halko, Martinsson, Tropp 2011, algorithm
//! 4.4); each iteration is one pass over the data, so that the matrix is never held. Both factors and the
//! mean are quantised to 8 or 16 bits, a scale for each component and factor, and everything is counted.
//! Singular values are in the factor over texels.

use super::decoder::{At, Blend, Decoder, EXPONENTIAL, Frame, Pairs, add_row, dot};
use super::{Row, Sums};
use crate::data::dataset::Dataset;
use crate::data::transfer::log2;
use crate::error::Result;
use crate::math::linear::{self, WAVE, eigenbasis, ordered_in, product, product_at, product_bt};
use crate::math::random::Random;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f32::consts::LN_2;

/// Iterations, each of which squares the separation of the singular values.
const PASSES: usize = 5;
/// Directions beyond the wished rank, as a part of it, and at least.
const OVERSAMPLING: (usize, usize) = (4, 8);
/// Texels of a part of a pass.
const BATCH: usize = 64;
/// Widths that a factor can have, in bits.
pub const WIDTHS: [u32; 2] = [8, 16];

/// What the matrix holds of a radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// `ln(x + e)`, with the dataset's offset.
    Log,
    /// `x`.
    Linear,
}

impl Domain {
    /// Into the matrix.
    #[inline(always)]
    pub fn forward(self, x: f32, offset: f32) -> f32 {
        if self == Domain::Log { LN_2 * log2(x + offset) } else { x }
    }

    /// Multiplications of [`Domain::back`] for three channels.
    pub fn operations(self) -> u64 {
        if self == Domain::Log { 3 * EXPONENTIAL } else { 0 }
    }

    /// Radiance again.
    #[inline(always)]
    pub fn back(self, y: f32, offset: f32) -> f32 {
        (if self == Domain::Log { y.exp() - offset } else { y }).max(0.0)
    }
}

/// The components of a dataset, and what was measured of them so far.
pub struct Pca<'a> {
    /// The data.
    pub dataset: &'a Dataset,
    /// What the matrix holds.
    pub domain: Domain,
    /// Its mean row: `[view][light][colour]`.
    pub mean: Vec<f32>,
    /// `[texel][component]`: left singular vectors times singular values.
    pub of_texels: Vec<f32>,
    /// `[pair and colour][component]`: right singular vectors.
    pub of_pairs: Vec<f32>,
    rank: usize,
    /// Square of each singular value.
    pub energies: Vec<f64>,
    /// Sum of all squares of the matrix.
    pub energy: f64,
    measured: BTreeMap<(usize, u32), Row>,
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
        self.frame.images(lights, view, &rows, &self.of_texels, rank, out);
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
        4 * rank + pairs * (3 * rank + 7) + self.frame.domain.operations()
    }
}

thread_local! {
    /// Bytes and values of a batch, and decoded logarithms: mapping fresh memory for each would take longer than the work.
    static BUFFERS: RefCell<(Vec<u8>, Vec<f32>)> = const { RefCell::new((Vec::new(), Vec::new())) };
    static LOGS: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Work on the linear values of batches of texels, results in the order of the texels.
pub(super) fn pass<T: Send, A>(
    dataset: &Dataset,
    work: impl Fn(usize, &[f32]) -> T + Sync,
    total: A,
    fold: impl FnMut(&mut A, T),
) -> Result<A> {
    pass_in(WAVE, dataset, work, total, fold)
}

/// As [`pass`], with so many batches at once.
fn pass_in<T: Send, A>(
    wave: usize,
    dataset: &Dataset,
    work: impl Fn(usize, &[f32]) -> T + Sync,
    total: A,
    mut fold: impl FnMut(&mut A, T),
) -> Result<A> {
    let (texels, columns) = (dataset.description().texels(), dataset.description().texel_len());
    let part = |i: usize| -> Result<T> {
        let count = BATCH.min(texels - i * BATCH);
        BUFFERS.with_borrow_mut(|(bytes, values)| {
            values.resize(count * columns, 0.0);
            dataset.read(i * BATCH, count, bytes, values)?;
            Ok(work(i * BATCH, values))
        })
    };
    ordered_in(wave, texels.div_ceil(BATCH), part, total, |total, _, result| fold(total, result))
}

/// Memory of a decomposition, bytes, if nothing else is said.
pub const MEMORY: usize = 4 << 30;

/// What `memory` bytes allow: how many of `max_rank` components, and how many batches at once.
fn fit_in(memory: usize, [texels, columns]: [usize; 2], max_rank: usize) -> (usize, usize) {
    let wide = |rank: usize| rank + (rank / OVERSAMPLING.0).max(OVERSAMPLING.1);
    // Of a direction of the iteration: its sums, two matrices of the decomposition and the result over the
    // pairs; its part and two results over texels.
    let held = |rank: usize| wide(rank).saturating_mul(columns * (8 + 8 + 8 + 4) + texels * 12);
    // Of a batch: its values twice, and what it adds.
    let batch = |rank: usize| columns * (2 * BATCH + wide(rank)) * 4;
    let fits = |rank: usize| held(rank).saturating_add(batch(rank)) <= memory;
    let rank = (1..=max_rank).rev().find(|&rank| fits(rank)).unwrap_or(1);
    (rank, (memory.saturating_sub(held(rank)) / batch(rank)).clamp(1, WAVE))
}

/// Orthonormal columns with the span of a tall matrix, both row-major.
fn orthonormal(matrix: &[f64], columns: usize) -> Vec<f32> {
    let q = linear::orthonormal(matrix, columns);
    (0..matrix.len()).map(|i| q[(i / columns, i % columns)] as f32).collect()
}

/// The leading `max_rank` components of a dataset.
///
/// # Errors
/// If the data cannot be read.
pub fn pca(dataset: &Dataset, domain: Domain, max_rank: usize) -> Result<Pca<'_>> {
    pca_within(dataset, domain, max_rank, MEMORY)
}

/// The same within some bytes of memory, whatever the size of the data. First fewer batches are worked on at
/// once, which changes no bit; where not even one fits, there are fewer components.
///
/// # Errors
/// As [`pca`].
pub fn pca_within(dataset: &Dataset, domain: Domain, max_rank: usize, memory: usize) -> Result<Pca<'_>> {
    let (texels, columns) = (dataset.description().texels(), dataset.description().texel_len());
    let offset = dataset.statistics().log_offset();
    let forward = |x: f32| domain.forward(x, offset);
    let sums = |_: usize, values: &[f32]| {
        let mut sum = vec![0.0f64; columns];
        values
            .chunks(columns)
            .for_each(|texel| sum.iter_mut().zip(texel).for_each(|(sum, &x)| *sum += forward(x) as f64));
        sum
    };
    let add = |total: &mut Vec<f64>, sum: Vec<f64>| {
        total.iter_mut().zip(sum).for_each(|(total, sum)| *total += sum)
    };
    let sum = pass(dataset, sums, vec![0.0; columns], add)?;
    let mean: Vec<f32> = sum.iter().map(|sum| (sum / texels as f64) as f32).collect();

    let most = texels.min(columns);
    let (rank, wave) = fit_in(memory, [texels, columns], max_rank.clamp(1, most));
    let wide = (rank + (rank / OVERSAMPLING.0).max(OVERSAMPLING.1)).min(most);
    let mut random = Random::new(1);
    let start: Vec<f64> = (0..columns * wide).map(|_| random.range(-1_000_000, 1_000_000) as f64).collect();
    let mut q = orthonormal(&start, wide);
    let centred = |values: &[f32]| -> Vec<f32> {
        values
            .chunks(columns)
            .flat_map(|texel| texel.iter().zip(&mean).map(|(&x, mean)| forward(x) - mean))
            .collect()
    };
    for _ in 0..PASSES {
        let work = |_: usize, values: &[f32]| {
            let matrix = centred(values);
            let count = matrix.len() / columns;
            let mut projected = vec![0.0; count * wide];
            product(&mut projected, &matrix, &q, [count, columns, wide], false);
            let mut back = vec![0.0; columns * wide];
            product_at(&mut back, &matrix, &projected, [columns, count, wide], false);
            back
        };
        let add = |total: &mut Vec<f64>, part: Vec<f32>| {
            total.iter_mut().zip(part).for_each(|(total, part)| *total += part as f64)
        };
        q = orthonormal(&pass_in(wave, dataset, work, vec![0.0; columns * wide], add)?, wide);
    }
    // In the subspace the singular vectors are those of a small matrix.
    let work = |_: usize, values: &[f32]| {
        let matrix = centred(values);
        let count = matrix.len() / columns;
        let mut projected = vec![0.0; count * wide];
        product(&mut projected, &matrix, &q, [count, columns, wide], false);
        let mut gram = vec![0.0; wide * wide];
        product_at(&mut gram, &projected, &projected, [wide, count, wide], false);
        (projected, gram, matrix.iter().map(|&v| (v as f64).powi(2)).sum::<f64>())
    };
    let start = (Vec::new(), vec![0.0; wide * wide], 0.0);
    let (projected, gram, energy) = pass_in(
        wave,
        dataset,
        work,
        start,
        |(all, gram, energy), (projected, part, of_part): (Vec<f32>, Vec<f32>, f64)| {
            all.extend(projected);
            gram.iter_mut().zip(part).for_each(|(total, part): (&mut f64, f32)| *total += part as f64);
            *energy += of_part;
        },
    )?;
    let (turn, energies) = eigenbasis(&gram, wide);
    let turn = turn.first(rank);
    let mut of_texels = vec![0.0; texels * rank];
    product(&mut of_texels, &projected, &turn.entries, [texels, wide, rank], false);
    let mut of_pairs = vec![0.0; columns * rank];
    product(&mut of_pairs, &q, &turn.entries, [columns, wide, rank], false);
    Ok(Pca { dataset, domain, mean, of_texels, of_pairs, rank, energies, energy, measured: BTreeMap::new() })
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

impl Pca<'_> {
    /// Components that were found.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// The mean over the texels, rows of texels and rows of pairs, `[view][light][colour]`, which are
    /// orthonormal columns; each row has [`Pca::rank`] numbers.
    pub fn factors(&self) -> (&[f32], &[f32], &[f32]) {
        (&self.mean, &self.of_texels, &self.of_pairs)
    }

    /// Bytes at a rank and width: the mean with its base and scale, both factors, and two scales a component.
    pub fn bytes(&self, rank: usize, bits: u32) -> u64 {
        let (texels, columns) = (self.dataset.description().texels() as u64, self.mean.len() as u64);
        let width = bits as u64 / 8;
        columns * width + 8 + rank as u64 * ((texels + columns) * width + 8)
    }

    /// Error in its domain at a rank, without quantisation.
    pub fn predicted_rms(&self, rank: usize) -> f64 {
        let left = self.energy - self.energies[..rank].iter().sum::<f64>();
        (left.max(0.0) / (self.dataset.description().texels() * self.mean.len()) as f64).sqrt()
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
        let rank = rank.min(self.rank);
        if let Some(row) = self.measured.get(&(rank, bits)) {
            return Ok(*row);
        }
        let columns = self.mean.len();
        let Decoded { frame: Frame { mean, offset, .. }, of_texels, of_pairs, .. } = self.decoder(rank, bits);
        let work = |first: usize, values: &[f32]| {
            LOGS.with_borrow_mut(|logs| {
                logs.resize(values.len(), 0.0);
                logs.chunks_mut(columns).for_each(|texel| texel.copy_from_slice(&mean));
                let count = values.len() / columns;
                if rank > 0 {
                    product_bt(
                        logs,
                        &of_texels[first * rank..][..count * rank],
                        &of_pairs,
                        [count, rank, columns],
                        true,
                    );
                }
                let mut sums = Sums::default();
                values
                    .iter()
                    .zip(logs)
                    .for_each(|(&wanted, log)| sums.compare(wanted, self.domain.back(*log, offset), offset));
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
        let rank = rank.min(self.rank);
        let least = self.mean.iter().copied().fold(f32::MAX, f32::min);
        let largest = self.mean.iter().copied().fold(f32::MIN, f32::max);
        let scale = (largest - least).max(1e-30) / ((1u32 << bits) - 1) as f32;
        Decoded {
            frame: Frame::new(
                self,
                self.mean.iter().map(|m| least + ((m - least) / scale).round() * scale).collect(),
            ),
            of_texels: quantised(&self.of_texels, self.rank, rank, bits),
            of_pairs: quantised(&self.of_pairs, self.rank, rank, bits),
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
                let rank = (((bytes - base) / (self.bytes(1, bits) - base)) as usize).min(self.rank);
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
            let most = (0..=self.rank)
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
    fn memory_limits_batches_and_then_components() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [21, 12]);
        let within = |memory| pca_within(&dataset, Domain::Log, 12, memory).expect("made");
        let (all, tight, few) = (within(MEMORY), within(260_000), within(150_000));
        assert_eq!([fit_in(MEMORY, [252, 162], 12), fit_in(260_000, [252, 162], 12)], [(12, WAVE), (12, 1)]);
        let bits = |pca: &Pca<'_>| -> Vec<u32> {
            pca.of_texels.iter().chain(&pca.of_pairs).map(|v| v.to_bits()).collect()
        };
        assert!(bits(&all) == bits(&tight));
        assert!((1..12).contains(&few.rank()), "{}", few.rank());
    }

    #[test]
    fn components_explain_what_they_should_at_the_stated_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [21, 12]);
        let mut pca = pca(&dataset, Domain::Log, 12).expect("made");
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
