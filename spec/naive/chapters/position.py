"""Chapter 6: position."""

from chapters.conventions import ONE_Q15, ceil_div, modulo32, u32
from chapters.fixed_point import product_high


def fraction_of_binary32(bits):
    """6.1-2."""
    exponent = (bits >> 23) & 0xFF
    mantissa = (bits & 0x7FFFFF) | 0x800000
    if 118 <= exponent <= 149:
        magnitude = modulo32(mantissa << (exponent - 118))
    elif 95 <= exponent <= 117:
        magnitude = mantissa >> (118 - exponent)
    else:
        magnitude = 0
    return modulo32(-magnitude) if bits >> 31 else magnitude


def texel_under(position_q32, size):
    """6.1-3."""
    return product_high(position_q32, size)


def block_of(texel, edge):
    """6.2-1."""
    edge_reciprocal_q18 = ceil_div(1 << 18, edge)
    return u32(texel * edge_reciprocal_q18) >> 18


def blocks_along(size, edge):
    """6.2-3."""
    return block_of(size - 1, edge) + 1


class Span:
    """6.3: one block along an axis, two of its rows and their weights."""

    def __init__(self, block, row_a, row_b, weight_a, weight_b):
        self.block = block
        self.rows = (row_a, row_b)
        self.weights = (weight_a, weight_b)


class Place:
    """Where a texture is asked for: a level, and one or two spans along each axis."""

    def __init__(self, level, axis_x, axis_y):
        self.level, self.axis_x, self.axis_y = level, axis_x, axis_y


def axis_of_texel(texel, edge):
    """6.2-2."""
    block = block_of(texel, edge)
    row = texel - block * edge
    return [Span(block, row, row, ONE_Q15, 0)]


def axis_of_position(position_q32, size, edge):
    """6.3-1, 6.3-2, 6.3-3."""
    low = modulo32(position_q32 * size)
    high = product_high(position_q32, size)
    if low >= 0x80000000:
        texel_a = high
    elif high != 0:
        texel_a = high - 1
    else:
        texel_a = size - 1
    texel_b = texel_a + 1
    if texel_b == size:
        texel_b = 0
    weight_b = modulo32(low - 0x80000000) >> 17
    weight_a = ONE_Q15 - weight_b
    block_a, block_b = block_of(texel_a, edge), block_of(texel_b, edge)
    row_a, row_b = texel_a - block_a * edge, texel_b - block_b * edge
    if block_a == block_b:
        return [Span(block_a, row_a, row_b, weight_a, weight_b)]
    return [Span(block_a, row_a, row_a, weight_a, 0), Span(block_b, row_b, row_b, weight_b, 0)]
