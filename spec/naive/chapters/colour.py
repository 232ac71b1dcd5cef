"""Chapter 7: colour and transfer."""

from chapters.conventions import ONE_Q15, as_i32, i32, u32
from chapters.fixed_point import assemble_binary32, exp2_q31, leading_zeros, multiply_q13, product_high


def colour(file, values, cosine_q15):
    """7.1-1, 7.4-2: the three words of a result."""
    if file.cosine_included == 0:
        cosine_q15 = ONE_Q15
    result = []
    for row in range(3):
        x_q20 = matrix_row(values, file.matrix_q13[3 * row : 3 * row + 3])
        if file.transfer == 0:
            result.append(log2_transfer(x_q20, file.parameter, cosine_q15))
        else:
            result.append(linear_transfer(x_q20, as_i32(file.parameter), cosine_q15))
    return result


def matrix_row(values, entries):
    """7.1-2."""
    total = 0
    for value, entry in zip(values, entries):
        total = i32(total + multiply_q13(value, entry))
    return total


def log2_transfer(x_q20, bits, cosine_q15):
    """7.2-1, 7.2-2, 7.2-3."""
    exponent = x_q20 >> 20
    mantissa = exp2_q31(x_q20 & 0xFFFFF)
    if bits == 0:
        return present(mantissa, exponent, cosine_q15)
    offset_exponent = (bits >> 23) - 127
    offset_mantissa = u32(((bits & 0x7FFFFF) | 0x800000) << 8)
    distance = i32(exponent - offset_exponent)
    if distance < 0:
        return 0
    offset = offset_mantissa >> distance if distance < 32 else 0
    if mantissa <= offset:
        return 0
    return present(mantissa - offset, exponent, cosine_q15)


def linear_transfer(x_q20, exponent, cosine_q15):
    """7.3-1, 7.3-2."""
    if x_q20 <= 0:
        return 0
    return present(x_q20, i32(exponent + 11), cosine_q15)


def present(mantissa, exponent, cosine_q15):
    """7.4-1."""
    if cosine_q15 >= ONE_Q15 or mantissa == 0:
        return assemble_binary32(mantissa, exponent)
    shift = leading_zeros(mantissa)
    scaled = product_high(u32(mantissa << shift), u32(cosine_q15 << 17))
    return assemble_binary32(scaled, i32(exponent - shift))
