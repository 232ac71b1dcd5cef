"""Chapter 2: fixed-point arithmetic."""

from chapters.conventions import BINARY32_MAX, HALF_Q13, HALF_Q15, i32, u32


def multiply_q15(p, u):
    """2.2-1."""
    return i32(i32((p >> 15) * u) + (i32(i32((p & 0x7FFF) * u) + HALF_Q15) >> 15))


def multiply_q13(p, u):
    """2.2-2."""
    return i32(i32((p >> 13) * u) + (i32(i32((p & 0x1FFF) * u) + HALF_Q13) >> 13))


def round_shift(p, shift):
    """2.2-3."""
    if shift == 0:
        return p
    return i32((p >> shift) + ((p >> (shift - 1)) & 1))


def product_high(a, b):
    """2.2-4."""
    return (a * b) >> 32


def divide(n, d, bits):
    """2.2-5."""
    return (n << bits) // d


def clamp_magnitude(x, bound):
    """2.2-6."""
    return max(min(x, bound), -bound)


# 2.3-2
EXP2_C1 = 0xB17215AF
EXP2_C2 = 0x3D7FAAF3
EXP2_C3 = 0x0E344889
EXP2_C4 = 0x027A1725
EXP2_C5 = 0x0051B593
EXP2_C6 = 0x000E2A0C


def exp2_q31(fraction_q20):
    """2.3-1."""
    x_q32 = u32(fraction_q20 << 12)
    y5 = u32(EXP2_C5 + product_high(EXP2_C6, x_q32))
    y4 = u32(EXP2_C4 + product_high(y5, x_q32))
    y3 = u32(EXP2_C3 + product_high(y4, x_q32))
    y2 = u32(EXP2_C2 + product_high(y3, x_q32))
    y1 = u32(EXP2_C1 + product_high(y2, x_q32))
    return u32(0x80000000 + (product_high(y1, x_q32) >> 1))


def leading_zeros(word):
    return 32 - word.bit_length()


def assemble_binary32(mantissa, exponent):
    """2.4-1, 2.4-2, 2.4-3."""
    if mantissa == 0:
        return 0
    shift = leading_zeros(mantissa)
    normal = u32(mantissa << shift)
    rounded = u32((normal >> 8) + ((normal >> 7) & 1))
    biased = i32(i32(exponent - shift) + 126)
    if biased < 0:
        return 0
    if biased > 253:
        return BINARY32_MAX
    bits = u32(u32(biased << 23) + rounded)
    return BINARY32_MAX if bits > BINARY32_MAX else bits
