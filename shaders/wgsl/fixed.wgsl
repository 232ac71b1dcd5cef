// Fixed-point arithmetic (chapter 2). Twin: decoder-core/src/kernel/fixed.rs.
//
// Everything that decides a bit of a result is here or built from what is here: 32-bit integers that
// wrap, shifts, comparisons. There is no division and no float, so every machine agrees.

// One in Q15.
const ONE_Q15: i32 = 32768;
// One half in Q15, added before a shift by 15 to round halves up.
const HALF_Q15: i32 = 16384;
// One half in Q13.
const HALF_Q13: i32 = 4096;
// Coefficients of 2^x - 1 over the unit interval in Q32, fitted for the least relative error (2.3-2).
const EXP2_C1: u32 = 0xb17215afu;
const EXP2_C2: u32 = 0x3d7faaf3u;
const EXP2_C3: u32 = 0x0e344889u;
const EXP2_C4: u32 = 0x027a1725u;
const EXP2_C5: u32 = 0x0051b593u;
const EXP2_C6: u32 = 0x000e2a0cu;
// The largest finite binary32.
const BINARY32_MAX: u32 = 0x7f7fffffu;

// floor((p * u + 2^14) / 2^15), for |u| <= 2^15; if p is -2^31, u is above -2^15 (2.2-1).
fn multiply_q15(p: i32, u: i32) -> i32 {
    // 2.2-1: the high limb is exact, only the low one is rounded.
    return (p >> 15u) * u + (((p & 0x7fff) * u + HALF_Q15) >> 15u);
}

// floor((p * u + 2^12) / 2^13), for |u| < 2^15 and |p| <= 2^27 (2.2-2).
fn multiply_q13(p: i32, u: i32) -> i32 {
    // 2.2-2: as 2.2-1 with 13 fraction bits.
    return (p >> 13u) * u + (((p & 0x1fff) * u + HALF_Q13) >> 13u);
}

// floor((p + 2^(shift-1)) / 2^shift), and p for a shift of zero (2.2-3). shift <= 31.
fn round_shift(p: i32, shift: u32) -> i32 {
    if (shift == 0u) {
        return p;
    }
    // 2.2-3: the highest bit that falls off says whether to round up; nothing overflows.
    return (p >> shift) + ((p >> (shift - 1u)) & 1);
}

// floor(a * b / 2^32) (2.2-4).
fn product_high(a: u32, b: u32) -> u32 {
    // 2.2-4: one wide product there, four of 16-bit limbs here; no partial sum exceeds 32 bits.
    let low = (a & 0xffffu) * (b & 0xffffu);
    let middle_a = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let middle_b = (a & 0xffffu) * (b >> 16u) + (middle_a & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (middle_a >> 16u) + (middle_b >> 16u);
}

// floor(n * 2^bits / d) for n <= d, 1 <= d <= 2^31, bits <= 19 (2.2-5).
fn divide(n: u32, d: u32, bits: u32) -> u32 {
    var remainder = n;
    var quotient = 0u;
    // 2.2-5: restoring division; the remainder stays below d, so doubling it fits 32 bits.
    for (var step = 0u; step < bits + 1u; step++) {
        quotient <<= 1u;
        if (remainder >= d) {
            remainder -= d;
            quotient |= 1u;
        }
        remainder <<= 1u;
    }
    return quotient;
}

// x clamped to -bound ..= bound (2.2-6).
fn clamp_magnitude(x: i32, bound: i32) -> i32 {
    // 2.2-6: bounds are positive, so their negation exists.
    return max(min(x, bound), -bound);
}

// 2^31 * 2^fraction for a Q20 fraction below one: the mantissa, in [2^31, 2^32) (2.3-1).
fn exp2_q31(fraction_q20: u32) -> u32 {
    let x_q32 = fraction_q20 << 12u;
    // 2.3-1: Horner's rule; every sum stays below 2^32, since all coefficients together are 2 - 1.
    let y5 = EXP2_C5 + product_high(EXP2_C6, x_q32);
    let y4 = EXP2_C4 + product_high(y5, x_q32);
    let y3 = EXP2_C3 + product_high(y4, x_q32);
    let y2 = EXP2_C2 + product_high(y3, x_q32);
    let y1 = EXP2_C1 + product_high(y2, x_q32);
    return 0x80000000u + (product_high(y1, x_q32) >> 1u);
}

// The binary32 nearest to mantissa * 2^(exponent - 31), halves away from zero (2.4-1).
fn assemble_binary32(mantissa: u32, exponent: i32) -> u32 {
    if (mantissa == 0u) {
        return 0u;
    }
    // 2.4-1: bring the leading one to bit 31.
    let shift = countLeadingZeros(mantissa);
    let normal = mantissa << shift;
    // 2.4-2: 24 bits, halves up; a carry out of them moves the exponent by itself.
    let rounded = (normal >> 8u) + ((normal >> 7u) & 1u);
    let biased = exponent - i32(shift) + 126;
    let bits = (biased << 23u) + i32(rounded);
    // 2.4-3: biased is one less than the stored exponent, because rounded carries the leading one.
    if (biased < 0) {
        return 0u;
    }
    if (biased > 253 || bits > i32(BINARY32_MAX)) {
        return BINARY32_MAX;
    }
    return u32(bits);
}
