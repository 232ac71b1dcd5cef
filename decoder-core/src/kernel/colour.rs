//! Colour and transfer (chapter 7). Twin: `shaders/wgsl/colour.wgsl`.
//!
//! Three channel values in Q20 become three linear radiances as binary32 bits: a matrix, then either
//! a power of two less the file's offset, or a plain scale, then the cosine beyond the hull.

use crate::kernel::fixed::{ONE_Q15, assemble_binary32, exp2_q31, multiply_q13, product_high};
use crate::kernel::material::{Material, TRANSFER_LOG2};

/// The values of the three channels, Q20.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Values {
    /// Channel 0, luminance in most files.
    pub c0: i32,
    /// Channel 1.
    pub c1: i32,
    /// Channel 2.
    pub c2: i32,
}

/// Linear radiance as three binary32 bit patterns: never negative, never infinite, never NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Rgb {
    /// Red.
    pub r: u32,
    /// Green.
    pub g: u32,
    /// Blue.
    pub b: u32,
}

/// One row of the colour matrix times the channel values (7.1-2).
///
/// Values are within 2^27 and entries below 4, so the sum of three stays below 2^31.
pub fn matrix_row(m0: i32, m1: i32, m2: i32, values: Values) -> i32 {
    // 7.1-2: each product is rounded, the sum is exact.
    multiply_q13(values.c0, m0)
        .wrapping_add(multiply_q13(values.c1, m1))
        .wrapping_add(multiply_q13(values.c2, m2))
}

/// `mantissa * 2^(exponent - 31)` times a Q15 factor, as binary32 bits (7.4-1).
pub fn present(mantissa: u32, exponent: i32, cosine_q15: i32) -> u32 {
    if cosine_q15 >= ONE_Q15 || mantissa == 0 {
        return assemble_binary32(mantissa, exponent);
    }
    // 7.4-1: the leading one goes to bit 31 first, so that a small mantissa loses nothing.
    let shift = mantissa.leading_zeros();
    let scaled = product_high(mantissa << shift, (cosine_q15 as u32) << 17);
    assemble_binary32(scaled, exponent.wrapping_sub(shift as i32))
}

/// `2^x` less the offset, as binary32 bits (7.2).
pub fn transfer_log2(x_q20: i32, offset_mantissa: u32, offset_exponent: i32, cosine_q15: i32) -> u32 {
    let exponent = x_q20 >> 20;
    let mantissa = exp2_q31((x_q20 & 0xf_ffff) as u32);
    let distance = exponent.wrapping_sub(offset_exponent);
    let mut offset = 0u32;
    // 7.2-2: align the offset to the value; the bits that fall off are cut.
    if distance >= 0 && distance < 32 {
        offset = offset_mantissa >> (distance as u32);
    }
    // 7.2-3: a result that is not positive is +0.
    if offset_mantissa != 0 && (distance < 0 || mantissa <= offset) {
        return 0;
    }
    present(mantissa.wrapping_sub(offset), exponent, cosine_q15)
}

/// `x * 2^exponent`, as binary32 bits (7.3).
pub fn transfer_linear(x_q20: i32, exponent: i32, cosine_q15: i32) -> u32 {
    // 7.3-2: a result that is not positive is +0.
    if x_q20 <= 0 {
        return 0;
    }
    present(x_q20 as u32, exponent.wrapping_add(11), cosine_q15)
}

/// One colour's transfer (7.2, 7.3).
pub fn transfer(material: &Material, x_q20: i32, cosine_q15: i32) -> u32 {
    if material.transfer == TRANSFER_LOG2 {
        return transfer_log2(x_q20, material.offset_mantissa_q31, material.exponent, cosine_q15);
    }
    transfer_linear(x_q20, material.exponent, cosine_q15)
}

/// Channel values to linear radiance (7.1).
pub fn colour(material: &Material, values: Values, light_cosine_q15: i32) -> Rgb {
    let m = material.matrix_q13;
    let mut cosine_q15 = ONE_Q15;
    // 7.4-2: only values that carry the light's cosine lose it beyond the hull.
    if material.cosine_included != 0 {
        cosine_q15 = light_cosine_q15;
    }
    Rgb {
        r: transfer(material, matrix_row(m[0], m[1], m[2], values), cosine_q15),
        g: transfer(material, matrix_row(m[3], m[4], m[5], values), cosine_q15),
        b: transfer(material, matrix_row(m[6], m[7], m[8], values), cosine_q15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_values_lose_their_offset() {
        let offset = 1e-5f32;
        let mantissa = (offset.to_bits() & 0x7f_ffff | 0x80_0000) << 8;
        let exponent = (offset.to_bits() >> 23) as i32 - 127;
        for i in -20_000_000..9_000_000i32 {
            if i % 997 != 0 {
                continue;
            }
            let exact = (i as f64 / 1_048_576.0).exp2() - offset as f64;
            let got = f32::from_bits(transfer_log2(i, mantissa, exponent, ONE_Q15)) as f64;
            if exact <= 0.0 {
                assert!(got < 2e-12, "{i}");
            } else {
                assert!(
                    (got - exact).abs() <= (exact + offset as f64) * 6e-8 + exact * 6e-8,
                    "{i} {got} {exact}"
                );
            }
            let half = f32::from_bits(transfer_log2(i, mantissa, exponent, ONE_Q15 / 2)) as f64;
            assert!((half - got / 2.0).abs() <= got * 6.1e-8);
        }
        assert_eq!(transfer_log2(-(1 << 27), mantissa, exponent, ONE_Q15), 0);
        assert_eq!(transfer_log2(i32::MIN, 0, 0, ONE_Q15), 0);
        assert_eq!(transfer_log2(i32::MAX, mantissa, exponent, ONE_Q15), 0x7f7f_ffff);
    }

    #[test]
    fn linear_values_are_scaled() {
        for i in [-5, 0, 1, 3, 1 << 20, i32::MAX] {
            for exponent in [-60, 0, 60] {
                let got = f32::from_bits(transfer_linear(i, exponent, ONE_Q15));
                assert_eq!(got, ((i.max(0) as f64) * ((exponent - 20) as f64).exp2()) as f32);
            }
        }
    }
}
