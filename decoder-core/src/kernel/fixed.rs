//! Fixed-point arithmetic (chapter 2). Twin: `shaders/wgsl/fixed.wgsl`.
//!
//! Everything that decides a bit of a result is here or built from what is here: 32-bit integers that
//! wrap, shifts, comparisons. There is no division instruction and no float, so every machine agrees.

/// One in Q15.
pub const ONE_Q15: i32 = 32768;
/// One half in Q15, added before a shift by 15 to round halves up.
pub const HALF_Q15: i32 = 16384;
/// One half in Q13.
pub const HALF_Q13: i32 = 4096;
// Coefficients of 2^x - 1 over the unit interval in Q32, fitted for the least relative error (2.3-2).
/// Coefficient of `x` in `2^x`, Q32 (2.3-2).
pub const EXP2_C1: u32 = 0xb172_15af;
/// Coefficient of `x^2` in `2^x`, Q32 (2.3-2).
pub const EXP2_C2: u32 = 0x3d7f_aaf3;
/// Coefficient of `x^3` in `2^x`, Q32 (2.3-2).
pub const EXP2_C3: u32 = 0x0e34_4889;
/// Coefficient of `x^4` in `2^x`, Q32 (2.3-2).
pub const EXP2_C4: u32 = 0x027a_1725;
/// Coefficient of `x^5` in `2^x`, Q32 (2.3-2).
pub const EXP2_C5: u32 = 0x0051_b593;
/// Coefficient of `x^6` in `2^x`, Q32 (2.3-2).
pub const EXP2_C6: u32 = 0x000e_2a0c;
/// The largest finite binary32.
pub const BINARY32_MAX: u32 = 0x7f7f_ffff;

/// `floor((p * u + 2^14) / 2^15)`, for `|u| <= 2^15`; if `p` is -2^31, `u` is above -2^15 (2.2-1).
///
/// Never larger in magnitude than `p`. The product has up to 47 bits; the two limbs of `p` keep each
/// partial product within 32.
pub fn multiply_q15(p: i32, u: i32) -> i32 {
    // 2.2-1: the high limb is exact, only the low one is rounded.
    (p >> 15).wrapping_mul(u).wrapping_add((p & 0x7fff).wrapping_mul(u).wrapping_add(HALF_Q15) >> 15)
}

/// `floor((p * u + 2^12) / 2^13)`, for `|u| < 2^15` and `|p| <= 2^27` (2.2-2).
pub fn multiply_q13(p: i32, u: i32) -> i32 {
    // 2.2-2: as 2.2-1 with 13 fraction bits.
    (p >> 13).wrapping_mul(u).wrapping_add((p & 0x1fff).wrapping_mul(u).wrapping_add(HALF_Q13) >> 13)
}

/// `floor((p + 2^(shift-1)) / 2^shift)`, and `p` for a shift of zero (2.2-3). `shift <= 31`.
pub fn round_shift(p: i32, shift: u32) -> i32 {
    if shift == 0 {
        return p;
    }
    // 2.2-3: the highest bit that falls off says whether to round up; nothing overflows.
    (p >> shift).wrapping_add((p >> (shift.wrapping_sub(1))) & 1)
}

/// `floor(a * b / 2^32)` (2.2-4).
pub fn product_high(a: u32, b: u32) -> u32 {
    // 2.2-4: one wide product here, four of 16-bit limbs in the kernel, which has no 64 bits.
    ((a as u64).wrapping_mul(b as u64) >> 32) as u32
}

/// `floor(n * 2^bits / d)` for `n <= d`, `1 <= d <= 2^31`, `bits <= 19` (2.2-5).
pub fn divide(n: u32, d: u32, bits: u32) -> u32 {
    let mut remainder = n;
    let mut quotient = 0u32;
    // 2.2-5: restoring division; the remainder stays below d, so doubling it fits 32 bits.
    for _step in 0..bits.wrapping_add(1) {
        quotient <<= 1;
        if remainder >= d {
            remainder = remainder.wrapping_sub(d);
            quotient |= 1;
        }
        remainder <<= 1;
    }
    quotient
}

/// `x` limited to `-bound ..= bound` (2.2-6).
pub fn clamp_magnitude(x: i32, bound: i32) -> i32 {
    // 2.2-6: bounds are positive, so their negation exists.
    x.min(bound).max(bound.wrapping_neg())
}

/// `2^31 * 2^fraction` for a Q20 fraction below one: the mantissa, in `[2^31, 2^32)` (2.3-1).
///
/// Within 2^-28 of the real function. A polynomial, not a table: kernels copy tables into private memory.
pub fn exp2_q31(fraction_q20: u32) -> u32 {
    let x_q32 = fraction_q20 << 12;
    // 2.3-1: Horner's rule; every sum stays below 2^32, since all coefficients together are 2 - 1.
    let y5 = EXP2_C5.wrapping_add(product_high(EXP2_C6, x_q32));
    let y4 = EXP2_C4.wrapping_add(product_high(y5, x_q32));
    let y3 = EXP2_C3.wrapping_add(product_high(y4, x_q32));
    let y2 = EXP2_C2.wrapping_add(product_high(y3, x_q32));
    let y1 = EXP2_C1.wrapping_add(product_high(y2, x_q32));
    0x8000_0000u32.wrapping_add(product_high(y1, x_q32) >> 1)
}

/// The binary32 nearest to `mantissa * 2^(exponent - 31)`, halves away from zero (2.4-1).
///
/// Zero gives +0; what is below the smallest normal before rounding gives +0; results beyond the largest
/// finite give it.
pub fn assemble_binary32(mantissa: u32, exponent: i32) -> u32 {
    if mantissa == 0 {
        return 0;
    }
    // 2.4-1: bring the leading one to bit 31.
    let shift = mantissa.leading_zeros();
    let normal = mantissa << shift;
    // 2.4-2: 24 bits, halves up; a carry out of them moves the exponent by itself.
    let rounded = (normal >> 8).wrapping_add((normal >> 7) & 1);
    let biased = exponent.wrapping_sub(shift as i32).wrapping_add(126);
    let bits = (biased << 23).wrapping_add(rounded as i32);
    // 2.4-3: biased is one less than the stored exponent, because rounded carries the leading one.
    if biased < 0 {
        return 0;
    }
    if biased > 253 || bits > BINARY32_MAX as i32 {
        return BINARY32_MAX;
    }
    bits as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws() -> impl Iterator<Item = (i32, i32)> {
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        (0..400_000u32).map(move |i| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let p = (state >> 32) as i32 >> (i % 32);
            let u = ((state & 0xffff) as i32 - 0x8000).clamp(-32767, 32767);
            match i % 7 {
                0 => (i32::MIN, u),
                1 => (i32::MAX, u),
                2 => (p, ONE_Q15),
                3 => (p, -32767),
                _ => (p, u),
            }
        })
    }

    #[test]
    fn binary32_is_assembled_as_floats_are_rounded() {
        for exponent in -140..=140 {
            // None of them is halfway between two floats.
            for mantissa in [
                1u32,
                3,
                0x7fff_ffff,
                0x8000_0000,
                0x8000_007f,
                0x8000_0081,
                0xffff_ff7f,
                0xffff_ff81,
                u32::MAX,
            ] {
                let exact = f64::from(mantissa) * 2f64.powi(exponent - 31);
                let expected =
                    if exact < f64::from(f32::MIN_POSITIVE) { 0.0 } else { (exact as f32).min(f32::MAX) };
                assert_eq!(
                    f32::from_bits(assemble_binary32(mantissa, exponent)),
                    expected,
                    "{mantissa} * 2^({exponent} - 31)"
                );
            }
        }
    }

    #[test]
    fn products_equal_wide_arithmetic() {
        for (p, u) in draws() {
            assert_eq!(multiply_q15(p, u) as i64, (p as i64 * u as i64 + (1 << 14)) >> 15);
            if p != i32::MIN {
                assert!(multiply_q15(p, u).unsigned_abs() <= p.unsigned_abs());
            }
            let small = p >> 4;
            let small = small.clamp(-(1 << 27), 1 << 27);
            let v = u.clamp(-32767, 32767);
            assert_eq!(multiply_q13(small, v) as i64, (small as i64 * v as i64 + (1 << 12)) >> 13);
            // As the kernel does it: four limb products; no partial sum exceeds 32 bits.
            let (a, b) = (p as u32, u as u32);
            let low = (a & 0xffff) * (b & 0xffff);
            let middle_a = (a >> 16) * (b & 0xffff) + (low >> 16);
            let middle_b = (a & 0xffff) * (b >> 16) + (middle_a & 0xffff);
            assert_eq!(product_high(a, b), (a >> 16) * (b >> 16) + (middle_a >> 16) + (middle_b >> 16));
            let shift = (u & 31) as u32;
            let half = if shift == 0 { 0 } else { 1i64 << (shift - 1) };
            assert_eq!(round_shift(p, shift) as i64, (p as i64 + half) >> shift);
        }
    }

    #[test]
    fn division_equals_wide_arithmetic() {
        for (p, u) in draws() {
            let d = (p as u32 & 0x7fff_ffff).max(1);
            let n = (u.unsigned_abs().wrapping_mul(0x9e37_79b9)) % (d + 1);
            for bits in [15, 19] {
                assert_eq!(divide(n, d, bits) as u64, ((n as u64) << bits) / d as u64);
            }
        }
    }

    /// Every one of the 2^20 fractions, against binary64.
    #[test]
    fn exp2_is_within_one_unit_in_the_last_place() {
        let mut worst = 0.0f64;
        let mut before = 1u32 << 31;
        for fraction in 0..1u32 << 20 {
            let exact = (fraction as f64 / (1u32 << 20) as f64).exp2();
            let mantissa = exp2_q31(fraction);
            assert!(mantissa >= before, "not monotonic at {fraction}");
            before = mantissa;
            worst = worst.max((mantissa as f64 / (1u64 << 31) as f64 / exact - 1.0).abs());
            let bits = assemble_binary32(mantissa, 0);
            let nearest = (exact as f32).to_bits();
            assert!(bits.abs_diff(nearest) <= 1, "{fraction}");
        }
        assert!(worst < 1.0 / (1u64 << 28) as f64, "{worst:e}");
    }

    #[test]
    fn binary32_is_assembled_and_saturates() {
        for (p, u) in draws() {
            let mantissa = p as u32;
            let exponent = u % 160;
            let exact = mantissa as f64 * (exponent as f64 - 31.0).exp2();
            let got = f32::from_bits(assemble_binary32(mantissa, exponent)) as f64;
            if exact < f32::MIN_POSITIVE as f64 {
                assert_eq!(got, 0.0);
            } else if exact > f32::MAX as f64 {
                assert_eq!(got, f32::MAX as f64);
            } else {
                assert!((got / exact - 1.0).abs() <= 1.0 / (1u64 << 24) as f64, "{exact} {got}");
            }
        }
        assert_eq!(assemble_binary32(1 << 31, 0), 1.0f32.to_bits());
        assert_eq!(assemble_binary32(u32::MAX, 127), BINARY32_MAX);
        assert_eq!(assemble_binary32(1, 1 << 23), BINARY32_MAX);
        assert_eq!(assemble_binary32(1, -(1 << 23)), 0);
    }
}
