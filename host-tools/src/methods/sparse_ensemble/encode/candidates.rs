//! The pass over all blocks: project on every dictionary, keep the best, and of it the coefficients that may
//! matter.
//!
//! What is kept of a block is a short list, so that memory grows with what the file may hold and not with the
//! data.

use crate::error::Result;
use crate::methods::sparse_ensemble::blocks::{self, Blocks};
use crate::methods::sparse_ensemble::dictionary::{self, Ensemble};
use crate::work::ordered;

/// How many coefficients to keep of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// All of at least this magnitude; the dictionary is the one that gains most at the second magnitude.
    Above(f32, f32),
    /// This many of each channel, the largest.
    Largest([usize; 3]),
}

/// Coefficients of all blocks of one level in one channel.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    /// Dictionary of each block.
    pub dictionaries: Vec<u16>,
    /// First coefficient of each block, and the count at the end.
    pub starts: Vec<usize>,
    /// Place in the tensor of coefficients, `[y][x][view column][light column]`, ascending within a block.
    pub places: Vec<u32>,
    /// Values, in units of the channel for orthonormal dictionaries.
    pub values: Vec<f32>,
    /// Sum of the squares of all values of the blocks, kept or not.
    pub energy: f64,
}

impl Candidates {
    /// The least square of each block.
    pub fn least_squares(&self) -> impl Iterator<Item = f64> + '_ {
        let least = |range: &[usize]| {
            self.values[range[0]..range[1]].iter().map(|&v| (v as f64).powi(2)).fold(f64::MAX, f64::min)
        };
        self.starts.windows(2).filter(|range| range[0] < range[1]).map(least)
    }
}

/// One block's share of [`Candidates`].
struct Share {
    dictionary: u16,
    places: Vec<u32>,
    values: Vec<f32>,
    energy: f64,
}

/// Buckets of magnitudes: exponent and seven bits of the mantissa.
const BUCKETS: usize = 1 << 15;

/// A magnitude that at least `count` of the numbers reach, less than 1 % below the largest such, and the
/// energy of those above it.
pub fn magnitude_of_rank(numbers: &[f32], count: usize, buckets: &mut Vec<u32>) -> (f32, f64) {
    buckets.clear();
    buckets.resize(BUCKETS, 0);
    for number in numbers {
        buckets[((number.to_bits() & 0x7fff_ffff) >> 16) as usize] += 1;
    }
    let (mut seen, mut energy, mut bucket) = (0, 0.0, BUCKETS);
    while bucket > 0 && seen < count {
        bucket -= 1;
        // Empty ones too are skipped because the highest stand for what is no number.
        if buckets[bucket] == 0 {
            continue;
        }
        seen += buckets[bucket] as usize;
        let middle = f32::from_bits((bucket as u32) << 16 | 0x8000) as f64;
        energy += buckets[bucket] as f64 * middle * middle;
    }
    (f32::from_bits((bucket as u32) << 16), energy)
}

/// What a threshold gains: the energy above it, less what keeping costs at that threshold.
fn gain_above(numbers: &[f32], threshold: f32) -> f64 {
    let square = threshold * threshold;
    // Eight sums side by side, in an order that does not depend on vector width.
    let mut sums = [0.0f32; 8];
    let mut total = 0.0f64;
    for chunk in numbers.chunks(4096) {
        for eight in chunk.chunks(8) {
            for (sum, number) in sums.iter_mut().zip(eight) {
                *sum += (number * number - square).max(0.0);
            }
        }
        total += sums.iter().map(|&sum| sum as f64).sum::<f64>();
        sums = [0.0; 8];
    }
    total
}

/// Projects blocks on the ensembles of the three channels, every `stride`-th of them.
///
/// # Errors
/// If the data cannot be read.
pub fn collect(
    blocks: &Blocks<'_>,
    ensembles: &[Ensemble; 3],
    keep: Keep,
    stride: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<[Candidates; 3]> {
    let total = blocks.total().div_ceil(stride);
    // Small blocks go together, so that the products with the shared bases are large.
    let group = (64 / (blocks.edge * blocks.edge)).max(1);
    let parts = total.div_ceil(group);
    let work = |part: usize| -> Result<Vec<[Share; 3]>> {
        let (mut scratch, mut products) = (blocks::Scratch::default(), dictionary::Scratch::default());
        let mut planes: [Vec<f32>; 3] = Default::default();
        let (mut core, mut tensor, mut best, mut buckets) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let range = part * group..((part + 1) * group).min(total);
        range
            .map(|i| {
                blocks.read(i * stride, &mut scratch, &mut planes)?;
                Ok(std::array::from_fn(|c| {
                    let ensemble = &ensembles[c];
                    let energy = planes[c].iter().map(|&v| (v as f64).powi(2)).sum();
                    ensemble.to_core(&planes[c], &mut products, &mut core);
                    let (mut dictionary, mut most, mut threshold) = (0, f64::MIN, 0.0f32);
                    for k in 0..ensemble.turns.len() {
                        ensemble.to_coefficients(k, &core, &mut products, &mut tensor);
                        let (limit, gain) = match keep {
                            Keep::Above(least, judge) => (least, gain_above(&tensor, judge)),
                            Keep::Largest(counts) => magnitude_of_rank(&tensor, counts[c], &mut buckets),
                        };
                        if gain > most {
                            (dictionary, most, threshold) = (k, gain, limit);
                            std::mem::swap(&mut best, &mut tensor);
                        }
                    }
                    share(dictionary, &best, threshold, keep, c, energy)
                }))
            })
            .collect()
    };
    let start = || Candidates { starts: vec![0], ..Candidates::default() };
    ordered(parts, work, [start(), start(), start()], |all, part, shares| {
        for (c, share) in shares.into_iter().flat_map(|shares| (0..3).zip(shares)) {
            let channel = &mut all[c];
            channel.dictionaries.push(share.dictionary);
            channel.places.extend(share.places);
            channel.values.extend(share.values);
            channel.starts.push(channel.values.len());
            channel.energy += share.energy;
        }
        progress(part + 1, parts);
    })
}

fn share(
    dictionary: usize,
    tensor: &[f32],
    threshold: f32,
    keep: Keep,
    channel: usize,
    energy: f64,
) -> Share {
    let above = (0u32..)
        .zip(tensor)
        .filter(|(_, value)| value.abs() >= threshold && **value != 0.0)
        .map(|(place, &value)| (place, value));
    let mut list: Vec<(u32, f32)> = above.collect();
    if let Keep::Largest(counts) = keep
        && list.len() > counts[channel]
    {
        // Equal magnitudes by place, so that the choice is one.
        list.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
        list.truncate(counts[channel]);
        list.sort_unstable_by_key(|c| c.0);
    }
    let (places, values) = list.into_iter().unzip();
    Share { dictionary: dictionary as u16, places, values, energy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn ranks_and_gains_agree_with_sorting() {
        let mut random = Random::new(4);
        let numbers: Vec<f32> =
            (0..5000).map(|_| (random.range(-1000, 1000) as f32 / 100.0).powi(3)).collect();
        let mut sorted: Vec<f32> = numbers.iter().map(|v| v.abs()).collect();
        sorted.sort_by(|a, b| b.total_cmp(a));
        for count in [1, 7, 100, 5000, 9000] {
            let (magnitude, energy) = magnitude_of_rank(&numbers, count, &mut Vec::new());
            let exact = sorted[count.min(sorted.len()) - 1];
            assert!(magnitude <= exact && magnitude >= exact * 0.99 - 1e-30, "{count}: {magnitude} {exact}");
            let above: f64 = sorted.iter().filter(|&&v| v >= magnitude).map(|&v| (v as f64).powi(2)).sum();
            assert!((energy - above).abs() < 0.01 * above, "{count}: {energy} {above}");
        }
        let exact: f64 = numbers.iter().map(|&v| (v as f64 * v as f64 - 9.0).max(0.0)).sum();
        assert!((gain_above(&numbers, 3.0) - exact).abs() < 1e-4 * exact);
    }
}
