//! The data themselves in binary16, interpolated between nine pairs of directions and four texels: nothing is
//! lost, and nothing is saved.

use super::decoder::{At, Blend, Decoder, Pairs};
use crate::data::dataset::Dataset;
use crate::error::Result;
use half::f16;

/// All values, in memory.
pub struct Uncompressed {
    /// `[texel][view][light][colour]`, binary16.
    values: Vec<u16>,
    /// Every binary16 as binary32: a table is faster than a conversion where the compiler may not use the
    /// processor's own.
    decoded: Vec<f32>,
    width: usize,
    lights: usize,
    pairs: usize,
}

impl Uncompressed {
    /// Reads all.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn new(dataset: &Dataset) -> Result<Uncompressed> {
        let description = dataset.description();
        let (texels, columns) = (description.texels(), description.texel_len());
        let mut values = Vec::with_capacity(texels * columns);
        let (mut bytes, mut texel) = (Vec::new(), vec![0.0; columns]);
        for i in 0..texels {
            dataset.read(i, 1, &mut bytes, &mut texel)?;
            // What is beyond the largest binary16 becomes it.
            values.extend(texel.iter().map(|&x| f16::from_f32(x.min(65_504.0)).to_bits()));
        }
        let decoded = (0..=u16::MAX).map(|bits| f16::from_bits(bits).to_f32()).collect();
        Ok(Uncompressed {
            values,
            decoded,
            width: description.size[0],
            lights: description.lights.len(),
            pairs: description.pairs(),
        })
    }

    #[inline(always)]
    fn rgb(&self, texel: usize, pair: usize) -> [f32; 3] {
        let start = (texel * self.pairs + pair) * 3;
        std::array::from_fn(|c| self.decoded[self.values[start + c] as usize])
    }
}

impl Decoder for Uncompressed {
    fn bytes(&self) -> u64 {
        2 * self.values.len() as u64
    }

    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]) {
        let texels = out.len() / lights.len();
        for (i, rgb) in out.iter_mut().enumerate() {
            *rgb = [0.0; 3];
            for &(pair, weight) in Pairs::of(lights[i / texels], view, self.lights).iter() {
                let found = self.rgb(i % texels, pair);
                (0..3).for_each(|c| rgb[c] += weight * found[c]);
            }
        }
    }

    fn filtered(&self, at: &At) -> [f32; 3] {
        let mut sum = [0.0f32; 3];
        let pairs = at.pairs(self.lights);
        for (texel, of_texel) in at.texels(self.width) {
            for &(pair, of_pair) in pairs.iter() {
                let (weight, found) = (of_texel * of_pair, self.rgb(texel, pair));
                (0..3).for_each(|c| sum[c] += weight * found[c]);
            }
        }
        sum
    }

    fn operations(&self, at: &At) -> u64 {
        // Nine weights of pairs; for each of four texels the weight and three colours.
        let pairs = at.pairs(self.lights).len() as u64;
        pairs + 4 * 4 * pairs
    }
}
