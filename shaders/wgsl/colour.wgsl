// Colour and transfer (chapter 7). Twin: decoder-core/src/kernel/colour.rs.
//
// Three channel values in Q20 become three linear radiances as binary32 bits: a matrix, then either
// a power of two less the file's offset, or a plain scale, then the cosine beyond the hull.

// The values of the three channels, Q20.
struct Values {
    c0: i32,
    c1: i32,
    c2: i32,
}

// Linear radiance as three binary32 bit patterns: never negative, never infinite, never NaN.
struct Rgb {
    r: u32,
    g: u32,
    b: u32,
}

// One row of the colour matrix times the channel values (7.1-2).
fn matrix_row(m0: i32, m1: i32, m2: i32, values: Values) -> i32 {
    // 7.1-2: each product is rounded, the sum is exact.
    return multiply_q13(values.c0, m0) + multiply_q13(values.c1, m1) + multiply_q13(values.c2, m2);
}

// mantissa * 2^(exponent - 31) times a Q15 factor, as binary32 bits (7.4-1).
fn present(mantissa: u32, exponent: i32, cosine_q15: i32) -> u32 {
    if (cosine_q15 >= ONE_Q15 || mantissa == 0u) {
        return assemble_binary32(mantissa, exponent);
    }
    // 7.4-1: the leading one goes to bit 31 first, so that a small mantissa loses nothing.
    let shift = countLeadingZeros(mantissa);
    let scaled = product_high(mantissa << shift, u32(cosine_q15) << 17u);
    return assemble_binary32(scaled, exponent - i32(shift));
}

// 2^x less the offset, as binary32 bits (7.2).
fn transfer_log2(x_q20: i32, offset_mantissa: u32, offset_exponent: i32, cosine_q15: i32) -> u32 {
    let exponent = x_q20 >> 20u;
    let mantissa = exp2_q31(u32(x_q20 & 0xfffff));
    let distance = exponent - offset_exponent;
    var offset = 0u;
    // 7.2-2: align the offset to the value; the bits that fall off are cut.
    if (distance >= 0 && distance < 32) {
        offset = offset_mantissa >> u32(distance);
    }
    // 7.2-3: a result that is not positive is +0.
    if (offset_mantissa != 0u && (distance < 0 || mantissa <= offset)) {
        return 0u;
    }
    return present(mantissa - offset, exponent, cosine_q15);
}

// x * 2^exponent, as binary32 bits (7.3).
fn transfer_linear(x_q20: i32, exponent: i32, cosine_q15: i32) -> u32 {
    // 7.3-2: a result that is not positive is +0.
    if (x_q20 <= 0) {
        return 0u;
    }
    return present(u32(x_q20), exponent + 11, cosine_q15);
}

// One colour's transfer (7.2, 7.3).
fn transfer(material: u32, x_q20: i32, cosine_q15: i32) -> u32 {
    if (materials[material].transfer == TRANSFER_LOG2) {
        return transfer_log2(x_q20, materials[material].offset_mantissa_q31, materials[material].exponent, cosine_q15);
    }
    return transfer_linear(x_q20, materials[material].exponent, cosine_q15);
}

// Channel values to linear radiance (7.1).
fn colour(material: u32, values: Values, light_cosine_q15: i32) -> Rgb {
    let m = materials[material].matrix_q13;
    var cosine_q15 = ONE_Q15;
    // 7.4-2: only values that carry the light's cosine lose it beyond the hull.
    if (materials[material].cosine_included != 0u) {
        cosine_q15 = light_cosine_q15;
    }
    return Rgb(
        transfer(material, matrix_row(m[0], m[1], m[2], values), cosine_q15),
        transfer(material, matrix_row(m[3], m[4], m[5], values), cosine_q15),
        transfer(material, matrix_row(m[6], m[7], m[8], values), cosine_q15),
    );
}
