//! Results as callers see them, and the decode digest of a file (chapter 11).

use crate::colour::Rgb;
use crate::direction::{Direction, direction_from_binary32};
use crate::open::Selvedge;
use crate::position::fraction_from_binary32;
use crate::sha256::{Digest, Sha256};
use core::fmt;

/// A lent buffer is too short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferTooSmall {
    /// Elements needed.
    pub needed: usize,
    /// Elements lent.
    pub lent: usize,
}

impl fmt::Display for BufferTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the buffer has {} elements, {} are needed", self.lent, self.needed)
    }
}

impl core::error::Error for BufferTooSmall {}

impl Rgb {
    /// Linear radiance as floats: a bit cast.
    pub fn to_f32(self) -> [f32; 3] {
        [f32::from_bits(self.r), f32::from_bits(self.g), f32::from_bits(self.b)]
    }

    /// The three words.
    pub fn to_words(self) -> [u32; 3] {
        [self.r, self.g, self.b]
    }
}

impl Direction {
    /// From a unit vector in the material's tangent frame, by integer arithmetic on its bits (5.2-3).
    pub fn from_unit_vector([x, y, z]: [f32; 3]) -> Direction {
        direction_from_binary32(x.to_bits(), y.to_bits(), z.to_bits())
    }
}

/// A position of any magnitude as its u0.32 fraction, by integer arithmetic on its bits (6.1-2).
pub fn position_from_f32(position: f32) -> u32 {
    fraction_from_binary32(position.to_bits())
}

/// Queries of each of the three kinds in a decode digest (11.2-1).
pub const DIGEST_QUERIES: u32 = 256;

/// The next number of the digest's query sequence (11.2-2): xorshift32 of Marsaglia.
pub fn next_query_word(state: &mut u32) -> u32 {
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    *state
}

/// A direction of the query sequence (11.2-3): any point of the square, any cosine, half of them above one.
fn next_query_direction(state: &mut u32) -> Direction {
    let first = next_query_word(state);
    let second = next_query_word(state);
    let x_q18 = ((first & 0xffff) << 3 | (second >> 16) & 7) as i32;
    let y_q18 = ((first >> 16) << 3 | (second >> 19) & 7) as i32;
    let (x_q18, y_q18) = (x_q18.wrapping_sub(262_144), y_q18.wrapping_sub(262_144));
    let z_q15 = (second & 0xffff) as i32;
    Direction { x_q18, y_q18, z_q15 }
}

impl Selvedge<'_> {
    /// SHA-256 of what a fixed sequence of queries decodes to (11.2): equal for every right decoder.
    pub fn decode_digest(&self) -> Digest {
        let mut hash = Sha256::default();
        let mut state = 0x5345_4c56u32;
        let material = self.material();
        for kind in 0..3u32 {
            for _query in 0..DIGEST_QUERIES {
                let mut next = || next_query_word(&mut state);
                let (u, v) = (next(), next());
                let rgb = match kind {
                    // 11.2-4: point samples, indices by the high word of a product.
                    0 => {
                        let pick = |word: u32, count: u32| crate::fixed::product_high(word, count);
                        let (l, w) = (next(), next());
                        self.point(
                            pick(u, material.width),
                            pick(v, material.height),
                            pick(l, material.light_count),
                            pick(w, material.view_count),
                        )
                    }
                    // 11.2-5: filtered samples.
                    1 => {
                        let light = next_query_direction(&mut state);
                        let view = next_query_direction(&mut state);
                        self.filtered(u, v, light, view)
                    }
                    // 11.2-6: samples between levels.
                    _ => {
                        let level_q16 = crate::fixed::product_high(next(), material.level_count << 16);
                        let light = next_query_direction(&mut state);
                        let view = next_query_direction(&mut state);
                        self.trilinear(level_q16, u, v, light, view)
                    }
                };
                for word in rgb.to_words() {
                    hash.update(&word.to_le_bytes());
                }
            }
        }
        hash.finish()
    }
}
