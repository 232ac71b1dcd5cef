// Position and wrap (chapter 6). Twin: decoder-core/src/kernel/position.rs.
//
// A position is a fraction of the image in u0.32 per axis, so that it wraps by itself. A filtered
// sample stands between two texels of each axis, which lie in one block or in two neighbours.

// Texels of one block along one axis, and their weights.
struct Span {
    block: u32,
    row_a: u32,
    row_b: u32,
    weight_a_q15: i32,
    weight_b_q15: i32,
}

// One or two blocks along one axis; over both the weights sum to ONE_Q15.
struct Axis {
    first: Span,
    second: Span,
    count: u32,
}

// Where a texture is asked for: a level of detail, and texels along both axes.
struct Place {
    level: u32,
    x: Axis,
    y: Axis,
}

// The u0.32 fraction of a binary32 position, by its bits (6.1-2).
fn fraction_from_binary32(bits: u32) -> u32 {
    let exponent = (bits >> 23u) & 0xffu;
    let mantissa = (bits & 0x7fffffu) | 0x800000u;
    var magnitude = 0u;
    // 6.1-2: the value is mantissa * 2^(exponent - 150), the fraction counts 2^-32.
    if (exponent >= 118u && exponent < 150u) {
        magnitude = mantissa << (exponent - 118u);
    }
    if (exponent > 94u && exponent < 118u) {
        magnitude = mantissa >> (118u - exponent);
    }
    if ((bits >> 31u) != 0u) {
        // Two's complement: WGSL has no unary minus for u32.
        return ~magnitude + 1u;
    }
    return magnitude;
}

// The block of a texel along an axis (6.2-1).
fn block_of(edge_reciprocal_q18: u32, texel: u32) -> u32 {
    // 6.2-1: equals texel / edge for every texel below 16,384.
    return (texel * edge_reciprocal_q18) >> 18u;
}

// One texel alone (6.2-2).
fn axis_at_texel(edge: u32, edge_reciprocal_q18: u32, texel: u32) -> Axis {
    let block = block_of(edge_reciprocal_q18, texel);
    let row = texel - block * edge;
    // 6.2-2: the second weight is zero.
    let first = Span(block, row, row, ONE_Q15, 0);
    return Axis(first, first, 1u);
}

// The two texels whose centres enclose a position (6.3).
fn axis_at_position(edge: u32, edge_reciprocal_q18: u32, size: u32, position_q32: u32) -> Axis {
    // 6.3-1: position * size - 1/2 in 32.32, wrapped below zero to the last texel.
    let low = position_q32 * size;
    let high = product_high(position_q32, size);
    let fraction_q32 = low - 0x80000000u;
    var texel_a = high;
    if (low < 0x80000000u) {
        // select(if false, if true, condition)
        texel_a = select(size - 1u, high - 1u, high > 0u);
    }
    let after = texel_a + 1u;
    // select(if false, if true, condition)
    let texel_b = select(0u, after, after < size);
    // 6.3-2: the weight of the second texel is the fraction, cut to Q15.
    let weight_b = i32(fraction_q32 >> 17u);
    let weight_a = ONE_Q15 - weight_b;
    let block_a = block_of(edge_reciprocal_q18, texel_a);
    let block_b = block_of(edge_reciprocal_q18, texel_b);
    let row_a = texel_a - block_a * edge;
    let row_b = texel_b - block_b * edge;
    // 6.3-3: within one block the two share a span; otherwise each has its own.
    if (block_a == block_b) {
        let both = Span(block_a, row_a, row_b, weight_a, weight_b);
        return Axis(both, both, 1u);
    }
    let first = Span(block_a, row_a, row_a, weight_a, 0);
    let second = Span(block_b, row_b, row_b, weight_b, 0);
    return Axis(first, second, 2u);
}

// The texel nearest below a position (6.1-3).
fn texel_at_position(size: u32, position_q32: u32) -> u32 {
    // 6.1-3: the high word of the product.
    return product_high(position_q32, size);
}

// Blocks along an axis of `size` texels (6.2-3).
fn block_count(material: u32, size: u32) -> u32 {
    // 6.2-3: the last block may be partly outside the image.
    return block_of(materials[material].edge_reciprocal_q18, size - 1u) + 1u;
}
