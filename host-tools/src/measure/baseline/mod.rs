//! What the encoder is measured against: older ways to store the same data, in honest floats.
//!
//! [`pca`] is a truncated singular value decomposition, quantised to 8 or 16 bits; [`clusters`] has one for
//! each cluster of texels; [`tucker`] is the decomposition along all modes; [`data`] are the data themselves.
//! [`published`] is the layout of SparseBTF (Kavoosighafi et al. 2023, sections 3.1 to 3.4). All are decoded
//! from what they would store, and compared by the metrics of [`crate::measure::compare`]: root mean squared errors of
//! linear radiance and of `ln(x + e)` over all values, where `e` is the dataset's
//! [`log_offset`](crate::data::dataset::Statistics::log_offset). Neither writes a file.

pub mod clusters;
pub mod data;
pub mod decoder;
pub mod pca;
pub mod published;
pub mod tucker;

use crate::data::transfer::log2;
use serde::Serialize;
use std::f64::consts::LN_2;

/// What a baseline costs and how far it is from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Bytes that it would store.
    pub bytes: u64,
    /// Root mean squared error of `ln(x + e)`.
    pub log_rms: f64,
    /// Root mean squared error of linear radiance.
    pub linear_rms: f64,
}

/// Sums of squared errors of one part.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: u64,
    log: f64,
    linear: f64,
}

impl Sums {
    /// One value of the data and the one decoded for it.
    #[inline(always)]
    fn compare(&mut self, wanted: f32, decoded: f32, log_offset: f32) {
        self.count += 1;
        self.log += (log2(decoded + log_offset) as f64 - log2(wanted + log_offset) as f64).powi(2);
        self.linear += (decoded as f64 - wanted as f64).powi(2);
    }

    fn add(&mut self, other: Sums) {
        self.count += other.count;
        self.log += other.log;
        self.linear += other.linear;
    }

    fn row(&self, bytes: u64) -> Row {
        let count = self.count as f64;
        Row { bytes, log_rms: LN_2 * (self.log / count).sqrt(), linear_rms: (self.linear / count).sqrt() }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::data::dataset::{Dataset, Description, Sample};
    use crate::data::directions;
    use crate::math::random::Random;
    use std::path::Path;

    /// A dataset of three products of a texel's and a pair's factor, and a little noise.
    pub fn small(folder: &Path, size: [usize; 2]) -> Dataset {
        let lights = directions::grid(81).expect("known")[..9].to_vec();
        let path = folder.join("a.selvset");
        let description = Description {
            size,
            views: lights[..6].to_vec(),
            lights,
            sample: Sample::Float,
            ..Description::default()
        };
        let mut random = Random::new(7);
        let wave = |i: usize, k: usize| ((i * (k + 2)) as f32 * 0.37).sin();
        let value = |texel: usize, i: usize| {
            let log = (0..3).map(|k| wave(texel, k) * wave(i / 3, k + 3)).sum::<f32>() + wave(i, 1) * 0.2;
            log.exp() + random.range(0, 1000) as f32 / 1e5
        };
        Dataset::from_fn(&path, description, value).expect("written")
    }
}
