//! The decode digest of a file (chapter 11): equal for every right decoder.

use crate::kernel::direction::{Direction, ONE_Q18};
use crate::kernel::fixed::product_high;
use crate::selvedge::Selvedge;
use crate::walk::sha256::{Digest, Sha256};

/// Start of the query sequence (11.2-2).
const SEED: u32 = 0x5345_4c56;

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
    let (x_q18, y_q18) = (x_q18.wrapping_sub(ONE_Q18), y_q18.wrapping_sub(ONE_Q18));
    let z_q15 = (second & 0xffff) as i32;
    Direction { x_q18, y_q18, z_q15 }
}

impl Selvedge<'_> {
    /// SHA-256 of what a fixed sequence of queries decodes to (11.2): equal for every right decoder.
    pub fn decode_digest(&self) -> Digest {
        let mut hash = Sha256::default();
        let mut state = SEED;
        let material = self.material();
        for kind in 0..3u32 {
            for _query in 0..DIGEST_QUERIES {
                let mut next = || next_query_word(&mut state);
                let (u, v) = (next(), next());
                let rgb = match kind {
                    // 11.2-4: point samples, indices by the high word of a product.
                    0 => {
                        let pick = |word: u32, count: u32| product_high(word, count);
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
                        let level_q16 = product_high(next(), material.level_count << 16);
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
