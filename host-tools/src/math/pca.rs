//! Principal components: one matrix, a row for each texel and a column for each pair and colour.
//!
//! The matrix holds `ln(x + e)`, or `x` itself, less its mean row (the mean ABRDF). Its leading singular
//! vectors are found by block power iteration with a random start (Halko, Martinsson, Tropp 2011, algorithm
//! 4.4); each iteration is one pass over the data, so that the matrix is never held. Singular values are in
//! the factor over texels.

use crate::data::dataset::Dataset;
use crate::data::pass::{BATCH, pass, pass_in};
use crate::data::transfer::Domain;
use crate::error::Result;
use crate::math::linear::{self, eigenbasis, product, product_at};
use crate::math::random::Random;
use crate::work::WAVE;

/// Iterations, each of which squares the separation of the singular values.
const PASSES: usize = 5;
/// Directions beyond the wished rank, as a part of it, and at least.
const OVERSAMPLING: (usize, usize) = (4, 8);
/// Memory of a decomposition, bytes, if nothing else is said.
pub const MEMORY: usize = 4 << 30;

/// The leading components of a dataset.
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

    /// Error in its domain at a rank, without quantisation.
    pub fn predicted_rms(&self, rank: usize) -> f64 {
        let left = self.energy - self.energies[..rank].iter().sum::<f64>();
        (left.max(0.0) / (self.dataset.description().texels() * self.mean.len()) as f64).sqrt()
    }
}

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
    let most = texels.min(columns);
    let (rank, wave) = fit_in(memory, [texels, columns], max_rank.clamp(1, most));
    let wide = (rank + (rank / OVERSAMPLING.0).max(OVERSAMPLING.1)).min(most);
    let matrix = Matrix::new(dataset, domain, wave)?;
    let mut random = Random::new(1);
    let start: Vec<f64> = (0..columns * wide).map(|_| random.range(-1_000_000, 1_000_000) as f64).collect();
    let mut q = orthonormal(&start, wide);
    for _ in 0..PASSES {
        q = orthonormal(&matrix.squared_times(&q, wide)?, wide);
    }
    // In the subspace the singular vectors are those of a small matrix.
    let Projected { rows, gram, energy } = matrix.projected(&q, wide)?;
    let (turn, energies) = eigenbasis(&gram, wide);
    let turn = turn.first(rank);
    let mut of_texels = vec![0.0; texels * rank];
    product(&mut of_texels, &rows, &turn.entries, [texels, wide, rank], false);
    let mut of_pairs = vec![0.0; columns * rank];
    product(&mut of_pairs, &q, &turn.entries, [columns, wide, rank], false);
    Ok(Pca { dataset, domain, mean: matrix.mean, of_texels, of_pairs, rank, energies, energy })
}

/// The matrix, which is read in batches of rows.
struct Matrix<'a> {
    dataset: &'a Dataset,
    domain: Domain,
    offset: f32,
    /// Its mean row.
    mean: Vec<f32>,
    /// Batches at once.
    wave: usize,
}

/// The matrix in a subspace.
#[derive(Default)]
struct Projected {
    /// `[texel][direction]`.
    rows: Vec<f32>,
    /// `[direction][direction]`: sum of the products of all rows with themselves.
    gram: Vec<f64>,
    /// Sum of all squares of the whole matrix.
    energy: f64,
}

impl<'a> Matrix<'a> {
    /// Finds the mean row.
    fn new(dataset: &'a Dataset, domain: Domain, wave: usize) -> Result<Matrix<'a>> {
        let (texels, columns) = (dataset.description().texels(), dataset.description().texel_len());
        let offset = dataset.statistics().log_offset();
        let sums = |_: usize, values: &[f32]| {
            let mut sum = vec![0.0f64; columns];
            for texel in values.chunks(columns) {
                sum.iter_mut().zip(texel).for_each(|(sum, &x)| *sum += domain.forward(x, offset) as f64);
            }
            sum
        };
        let sum = pass(dataset, sums, vec![0.0; columns], |total: &mut Vec<f64>, sum: Vec<f64>| {
            total.iter_mut().zip(sum).for_each(|(total, sum)| *total += sum)
        })?;
        let mean = sum.iter().map(|sum| (sum / texels as f64) as f32).collect();
        Ok(Matrix { dataset, domain, offset, mean, wave })
    }

    /// Rows of the matrix, of the radiance of some texels, and their product with `q`.
    fn rows(&self, values: &[f32], q: &[f32], wide: usize) -> (Vec<f32>, Vec<f32>) {
        let columns = self.mean.len();
        let matrix: Vec<f32> = values
            .chunks(columns)
            .flat_map(|texel| {
                texel.iter().zip(&self.mean).map(|(&x, mean)| self.domain.forward(x, self.offset) - mean)
            })
            .collect();
        let count = matrix.len() / columns;
        let mut projected = vec![0.0; count * wide];
        product(&mut projected, &matrix, q, [count, columns, wide], false);
        (matrix, projected)
    }

    /// The transposed matrix times the matrix times `q`, which has `wide` columns.
    fn squared_times(&self, q: &[f32], wide: usize) -> Result<Vec<f64>> {
        let columns = self.mean.len();
        let work = |_: usize, values: &[f32]| {
            let (matrix, projected) = self.rows(values, q, wide);
            let mut back = vec![0.0; columns * wide];
            product_at(&mut back, &matrix, &projected, [columns, matrix.len() / columns, wide], false);
            back
        };
        let add = |total: &mut Vec<f64>, part: Vec<f32>| {
            total.iter_mut().zip(part).for_each(|(total, part)| *total += part as f64)
        };
        pass_in(self.wave, self.dataset, work, vec![0.0; columns * wide], add)
    }

    /// The matrix times `q`.
    fn projected(&self, q: &[f32], wide: usize) -> Result<Projected> {
        let work = |_: usize, values: &[f32]| {
            let (matrix, projected) = self.rows(values, q, wide);
            let mut gram = vec![0.0; wide * wide];
            product_at(&mut gram, &projected, &projected, [wide, projected.len() / wide, wide], false);
            (projected, gram, matrix.iter().map(|&v| (v as f64).powi(2)).sum::<f64>())
        };
        let start = Projected { gram: vec![0.0; wide * wide], ..Projected::default() };
        pass_in(
            self.wave,
            self.dataset,
            work,
            start,
            |all, (rows, gram, energy): (Vec<f32>, Vec<f32>, f64)| {
                all.rows.extend(rows);
                all.gram.iter_mut().zip(gram).for_each(|(total, part)| *total += part as f64);
                all.energy += energy;
            },
        )
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
}
