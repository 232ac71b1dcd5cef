//! Position and wrap (chapter 6). Twin: `shaders/wgsl/position.wgsl`.
//!
//! A position is a fraction of the image in u0.32 per axis, so that it wraps by itself. A filtered
//! sample stands between two texels of each axis, which lie in one block or in two neighbours.

use crate::kernel::fixed::{ONE_Q15, product_high};
use crate::kernel::material::Material;

/// Texels of one block along one axis, and their weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// Block along the axis.
    pub block: u32,
    /// First texel within the block.
    pub row_a: u32,
    /// Second texel within the block.
    pub row_b: u32,
    /// Weight of the first.
    pub weight_a_q15: i32,
    /// Weight of the second.
    pub weight_b_q15: i32,
}

/// One or two blocks along one axis; over both the weights sum to `ONE_Q15`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// The block of the first texel.
    pub first: Span,
    /// The block of the second texel, if it is another.
    pub second: Span,
    /// 1 or 2.
    pub count: u32,
}

/// Where a texture is asked for: a level of detail, and texels along both axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Place {
    /// Level of detail, one that is there.
    pub level: u32,
    /// Texels along x.
    pub x: Axis,
    /// Texels along y.
    pub y: Axis,
}

/// The u0.32 fraction of a binary32 position, by its bits (6.1-2).
///
/// Exact but for what lies below 2^-32, which is cut off the magnitude; infinities and NaN give zero.
pub fn fraction_from_binary32(bits: u32) -> u32 {
    let exponent = (bits >> 23) & 0xff;
    let mantissa = (bits & 0x7f_ffff) | 0x80_0000;
    let mut magnitude = 0u32;
    // 6.1-2: the value is mantissa * 2^(exponent - 150), the fraction counts 2^-32.
    if exponent >= 118 && exponent < 150 {
        magnitude = mantissa << (exponent.wrapping_sub(118));
    }
    if exponent > 94 && exponent < 118 {
        magnitude = mantissa >> (118u32.wrapping_sub(exponent));
    }
    if (bits >> 31) != 0 {
        return magnitude.wrapping_neg();
    }
    magnitude
}

/// The block of a texel along an axis (6.2-1).
pub fn block_of(edge_reciprocal_q18: u32, texel: u32) -> u32 {
    // 6.2-1: equals texel / edge for every texel below 16,384.
    texel.wrapping_mul(edge_reciprocal_q18) >> 18
}

/// One texel alone (6.2-2).
pub fn axis_at_texel(edge: u32, edge_reciprocal_q18: u32, texel: u32) -> Axis {
    let block = block_of(edge_reciprocal_q18, texel);
    let row = texel.wrapping_sub(block.wrapping_mul(edge));
    // 6.2-2: the second weight is zero.
    let first = Span { block, row_a: row, row_b: row, weight_a_q15: ONE_Q15, weight_b_q15: 0 };
    Axis { first, second: first, count: 1 }
}

/// The two texels whose centres enclose a position (6.3).
pub fn axis_at_position(edge: u32, edge_reciprocal_q18: u32, size: u32, position_q32: u32) -> Axis {
    // 6.3-1: position * size - 1/2 in 32.32, wrapped below zero to the last texel.
    let low = position_q32.wrapping_mul(size);
    let high = product_high(position_q32, size);
    let fraction_q32 = low.wrapping_sub(0x8000_0000);
    let mut texel_a = high;
    if low < 0x8000_0000 {
        texel_a = if high > 0 { high.wrapping_sub(1) } else { size.wrapping_sub(1) };
    }
    let after = texel_a.wrapping_add(1);
    let texel_b = if after < size { after } else { 0 };
    // 6.3-2: the weight of the second texel is the fraction, cut to Q15.
    let weight_b = (fraction_q32 >> 17) as i32;
    let weight_a = ONE_Q15.wrapping_sub(weight_b);
    let block_a = block_of(edge_reciprocal_q18, texel_a);
    let block_b = block_of(edge_reciprocal_q18, texel_b);
    let row_a = texel_a.wrapping_sub(block_a.wrapping_mul(edge));
    let row_b = texel_b.wrapping_sub(block_b.wrapping_mul(edge));
    // 6.3-3: within one block the two share a span; otherwise each has its own.
    if block_a == block_b {
        let both = Span { block: block_a, row_a, row_b, weight_a_q15: weight_a, weight_b_q15: weight_b };
        return Axis { first: both, second: both, count: 1 };
    }
    let first = Span { block: block_a, row_a, row_b: row_a, weight_a_q15: weight_a, weight_b_q15: 0 };
    let second = Span { block: block_b, row_a: row_b, row_b, weight_a_q15: weight_b, weight_b_q15: 0 };
    Axis { first, second, count: 2 }
}

/// The texel nearest below a position (6.1-3).
pub fn texel_at_position(size: u32, position_q32: u32) -> u32 {
    // 6.1-3: the high word of the product.
    product_high(position_q32, size)
}

/// Blocks along an axis of `size` texels (6.2-3).
pub fn block_count(material: &Material, size: u32) -> u32 {
    // 6.2-3: the last block may be partly outside the image.
    block_of(material.edge_reciprocal_q18, size.wrapping_sub(1)).wrapping_add(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_equal_division() {
        for edge in 1..=16u32 {
            let reciprocal = (1u32 << 18).div_ceil(edge);
            for texel in 0..16_384 {
                assert_eq!(block_of(reciprocal, texel), texel / edge);
            }
        }
    }

    #[test]
    fn fractions_of_binary32_wrap() {
        for (value, want) in [
            (0.25f32, 1u32 << 30),
            (1.25, 1 << 30),
            (-0.25, 3 << 30),
            (-7.75, 1 << 30),
            (0.0, 0),
            (1e30, 0),
            (f32::NAN, 0),
            (1e-30, 0),
        ] {
            assert_eq!(fraction_from_binary32(value.to_bits()), want, "{value}");
        }
        let mut state = 1u32;
        for _ in 0..100_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f32::from_bits(state);
            if value.is_finite() && value.abs() < 1e9 {
                let magnitude = (value.abs() as f64 * 4_294_967_296.0).floor() % 4_294_967_296.0;
                let want = if value < 0.0 { (magnitude as u32).wrapping_neg() } else { magnitude as u32 };
                assert_eq!(fraction_from_binary32(state), want, "{value}");
            }
        }
    }

    #[test]
    fn texels_equal_wide_products() {
        let mut state = 3u32;
        for size in 1..4_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            for position in [0, state, u32::MAX] {
                assert_eq!(texel_at_position(size, position), ((position as u64 * size as u64) >> 32) as u32);
            }
        }
    }

    #[test]
    fn a_centre_is_its_texel_alone() {
        for exponent in 0..=14u32 {
            let size = 1 << exponent;
            for texel in (0..size).step_by(1.max(size as usize / 64)) {
                let axis = axis_at_position(1, 1 << 18, size, (2 * texel + 1) << (31 - exponent));
                assert_eq!(
                    (axis.first.block, axis.first.weight_a_q15),
                    (texel, ONE_Q15),
                    "{texel} of {size}"
                );
            }
        }
    }

    #[test]
    fn weights_sum_to_one_and_texels_are_in_range() {
        let mut state = 7u32;
        for i in 0..200_000u32 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let edge = i % 16 + 1;
            let size = (state >> 7) % if i % 3 == 0 { 16_384 } else { 20 } + 1;
            let position = state.wrapping_mul(0x9e37_79b9);
            let axis = axis_at_position(edge, (1u32 << 18).div_ceil(edge), size, position);
            let mut sum = 0;
            let mut mean = 0f64;
            for (n, span) in [axis.first, axis.second].iter().enumerate() {
                if (n as u32) < axis.count {
                    sum += span.weight_a_q15 + span.weight_b_q15;
                    for (row, weight) in [(span.row_a, span.weight_a_q15), (span.row_b, span.weight_b_q15)] {
                        assert!(row < edge && span.block * edge + row < size);
                        mean += (span.block * edge + row) as f64 * weight as f64 / 32768.0;
                    }
                }
            }
            assert_eq!(sum, ONE_Q15);
            let exact = position as f64 / 4_294_967_296.0 * size as f64 - 0.5;
            if exact > 0.0 && exact < size as f64 - 1.0 {
                assert!((mean - exact).abs() < 1.0 / 16384.0, "{mean} {exact}");
            }
        }
    }
}
