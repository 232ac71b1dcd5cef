// Interpolation in the model (chapter 8) and levels (chapter 9). Twin: decoder-core/src/interpolation.rs.
//
// What every method shares: means and scales for pairs of directions, the value of a channel, and the
// samples that a caller can ask for. The method adds the texture: texture_q20 of a channel, or
// textures_q20 of all at once.

// Channel values are limited to this magnitude, Q20: 128 (8.1-4).
const VALUE_BOUND: i32 = 0x08000000;

// A table of 16-bit numbers for pairs of directions, blended over nine of them, in Q15 (8.1).
fn blend_table_q15(start: u32, light_count: u32, light: Taps, view: Taps) -> i32 {
    let row_words = (light_count + 1u) >> 1u;
    let row_a = start + 4u + view.a * row_words;
    let row_b = start + 4u + view.b * row_words;
    let row_c = start + 4u + view.c * row_words;
    // 8.1-2: lights inside, exact; views outside, each product rounded.
    let sum_a = multiply_q15(blend_row(row_a, light), view.weight_a_q15);
    let sum_b = multiply_q15(blend_row(row_b, light), view.weight_b_q15);
    let sum_c = multiply_q15(blend_row(row_c, light), view.weight_c_q15);
    return sum_a + sum_b + sum_c;
}

// Three entries of one packed row by their weights, in Q15, exact (8.1-1).
fn blend_row(row: u32, taps: Taps) -> i32 {
    let a = packed_i16(row, taps.a) * taps.weight_a_q15;
    let b = packed_i16(row, taps.b) * taps.weight_b_q15;
    let c = packed_i16(row, taps.c) * taps.weight_c_q15;
    // 8.1-1: at most 32,767 * 32,768.
    return a + b + c;
}

// The mean of a channel for a pair of directions, Q20 (8.1-3).
fn mean_q20(material: Material, channel: Channel, light: Taps, view: Taps) -> i32 {
    let start = channel.mean_start;
    let blended_q15 = blend_table_q15(start, material.light_count, light, view);
    let base_q20 = i32(word(start));
    // 8.1-3: shift is at most 11, so the table reaches 2^26 and with the base 2^27.
    return round_shift(blended_q15, 15u - word(start + 1u)) + base_q20;
}

// The scale of a channel for a pair of directions, Q15 (8.2-1).
fn scale_q15(material: Material, channel: Channel, light: Taps, view: Taps) -> i32 {
    // 8.2-1: blended like the means, to 16 bits.
    return round_shift(blend_table_q15(channel.scale_start, material.light_count, light, view), 15u);
}

// A texture times a scale of 2^shift units, Q20 (8.2-2).
fn scale_texture(texture: i32, scale: i32, shift: u32) -> i32 {
    // 8.2-2: limited before the shift, so that nothing is lost above.
    return clamp_magnitude(multiply_q15(texture, scale), VALUE_BOUND >> shift) << shift;
}

// The value of a channel at one level, Q20 (8.3); `given` is its texture where the method gives those of all channels at once.
fn channel_q20(material: Material, channel: Channel, given: i32, level: u32, x: Axis, y: Axis, light: Taps, view: Taps) -> i32 {
    // 8.3-1: a missing channel is zero.
    if (channel.state == CHANNEL_MISSING) {
        return 0;
    }
    let mean = mean_q20(material, channel, light, view);
    // 8.3-2: a mean alone has no texture.
    if (channel.state != CHANNEL_FULL) {
        return clamp_magnitude(mean, VALUE_BOUND);
    }
    var texture = given;
    // 8.3-3: a sparse ensemble gives each channel's texture by itself.
    if (material.method != METHOD_SPARSE_TENSOR) {
        texture = texture_q20(material, channel, level, x, y, light, view);
    }
    // 8.2-3: a channel without scales keeps its texture.
    if (channel.scale_start != 0u) {
        let scale = scale_q15(material, channel, light, view);
        texture = scale_texture(texture, scale, word(channel.scale_start + 1u));
    }
    // 8.3-3: each part is within 2^30, so their sum is exact.
    return clamp_magnitude(texture + mean, VALUE_BOUND);
}

// Channel `number` of a material (8.3).
fn channel_of(material: Material, number: u32) -> Channel {
    // 8.3-4: by comparison, so that no index can be out of range.
    if (number == 0u) {
        return material.channels[0];
    }
    if (number == 1u) {
        return material.channels[1];
    }
    return material.channels[2];
}

// The values of all channels at one level (8.3).
fn level_values(material: Material, level: u32, x: Axis, y: Axis, light: Taps, view: Taps) -> Values {
    var values = Values(0, 0, 0);
    // 8.3-3: a sparse tensor gives the textures of all channels at once.
    if (material.method == METHOD_SPARSE_TENSOR && material.full_count != 0u) {
        values = textures_q20(material, level, x, y, light, view);
    }
    // 8.3-4: a loop, so that a compiler for GPUs makes one copy of a channel.
    for (var number = 0u; number < 3u; number++) {
        var given = values.c0;
        if (number == 1u) {
            given = values.c1;
        }
        if (number == 2u) {
            given = values.c2;
        }
        let value = channel_q20(material, channel_of(material, number), given, level, x, y, light, view);
        if (number == 0u) {
            values.c0 = value;
        }
        if (number == 1u) {
            values.c1 = value;
        }
        if (number == 2u) {
            values.c2 = value;
        }
    }
    return values;
}

// Values between two texels of each axis of one level (8.4).
fn filtered_values(material: Material, level: u32, u_q32: u32, v_q32: u32, light: Taps, view: Taps) -> Values {
    // 8.4-4: a level beyond the last is the last.
    let inside = min(level, material.level_count - 1u);
    let x = axis_at_position(material.edge, material.edge_reciprocal_q18, level_size(material.width, inside), u_q32);
    let y = axis_at_position(material.edge, material.edge_reciprocal_q18, level_size(material.height, inside), v_q32);
    return level_values(material, inside, x, y, light, view);
}

// Part of the way from one value to another (9.2-3).
fn between(from_value: i32, to_value: i32, fraction_q15: i32) -> i32 {
    // 9.2-3: values are within 2^27, so the difference is exact.
    return from_value + multiply_q15(to_value - from_value, fraction_q15);
}

// Values between two levels, the level in Q16 (9.2).
fn trilinear_values(material: Material, level_q16: u32, u_q32: u32, v_q32: u32, light: Taps, view: Taps) -> Values {
    // 9.2-1: beyond the last level lies the last level.
    let limited = min(level_q16, (material.level_count - 1u) << 16u);
    let level = limited >> 16u;
    let fraction_q15 = i32((limited & 0xffffu) >> 1u);
    var values = filtered_values(material, level, u_q32, v_q32, light, view);
    // 9.2-2: on a level nothing else is read.
    if (fraction_q15 != 0) {
        let coarse = filtered_values(material, level + 1u, u_q32, v_q32, light, view);
        values.c0 = between(values.c0, coarse.c0, fraction_q15);
        values.c1 = between(values.c1, coarse.c1, fraction_q15);
        values.c2 = between(values.c2, coarse.c2, fraction_q15);
    }
    return values;
}

// Values of one texel of level 0 for one pair of sample directions (8.5).
fn point_values(material: Material, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Values {
    // 8.5-1: an index beyond the end is moved to the last.
    let light = single_tap(min(light_index, material.light_count - 1u));
    let view = single_tap(min(view_index, material.view_count - 1u));
    return texel_values(material, texel_x, texel_y, light, view);
}

// Values of one texel of level 0 for located directions (8.5).
fn texel_values(material: Material, texel_x: u32, texel_y: u32, light: Taps, view: Taps) -> Values {
    let inside_x = min(texel_x, material.width - 1u);
    let inside_y = min(texel_y, material.height - 1u);
    let x = axis_at_texel(material.edge, material.edge_reciprocal_q18, inside_x);
    let y = axis_at_texel(material.edge, material.edge_reciprocal_q18, inside_y);
    return level_values(material, 0u, x, y, light, view);
}

// The taps of a light direction (5.6).
fn locate_light(material: Material, direction: Direction) -> Taps {
    return locate(material.light_start, direction);
}

// The taps of a view direction (5.6).
fn locate_view(material: Material, direction: Direction) -> Taps {
    return locate(material.view_start, direction);
}

// Linear radiance of values seen under a located light (7.1).
fn radiance(material: Material, values: Values, light: Taps) -> Rgb {
    return colour(material, values, light.cosine_q15);
}
