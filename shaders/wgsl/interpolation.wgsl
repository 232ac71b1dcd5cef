// Interpolation in the model (chapter 8). Twin: decoder-core/src/kernel/interpolation.rs.
//
// What every method shares: means and scales for pairs of directions, the value of a channel, and the
// samples that a caller can ask for. The method adds the textures of all channels: textures_q20.

// Channel values are clamped to this magnitude, Q20: 128 (8.1-4).
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

// The mean of a channel for a pair of directions, Q20; zero for a channel without means (8.1-3).
fn mean_q20(material: u32, channel: Channel, light: Taps, view: Taps) -> i32 {
    let start = channel.mean_start;
    // 8.1-8: a channel without means has the mean zero.
    if (start == 0u) {
        return 0;
    }
    let blended_q15 = blend_table_q15(start, materials[material].light_count, light, view);
    let base_q20 = i32(word(start));
    // 8.1-3: shift is at most 11, so the table reaches 2^26 and with the base 2^27.
    return round_shift(blended_q15, 15u - word(start + 1u)) + base_q20;
}

// The scale of a channel for a pair of directions, Q15 (8.2-1).
fn scale_q15(material: u32, channel: Channel, light: Taps, view: Taps) -> i32 {
    // 8.2-1: blended like the means, to 16 bits.
    return round_shift(blend_table_q15(channel.scale_start, materials[material].light_count, light, view), 15u);
}

// A texture times a scale of 2^shift units, Q20 (8.2-2).
fn scale_texture(texture: i32, scale: i32, shift: u32) -> i32 {
    // 8.2-2: clamped before the shift, so that nothing is lost above.
    return clamp_magnitude(multiply_q15(texture, scale), VALUE_BOUND >> shift) << shift;
}

// The value of a channel, Q20, from its texture and located directions (8.3).
fn channel_q20(material: u32, number: u32, given: i32, light: Taps, view: Taps) -> i32 {
    let channel = channel_of(material, number);
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
    // 8.2-3: a channel without scales keeps its texture.
    if (channel.scale_start != 0u) {
        let scale = scale_q15(material, channel, light, view);
        texture = scale_texture(texture, scale, word(channel.scale_start + 1u));
    }
    // 8.3-3: each part is within 2^30, so their sum is exact.
    return clamp_magnitude(texture + mean, VALUE_BOUND);
}

// The values of all channels at one place (8.3).
fn place_values(material: u32, place: Place, light: Located, view: Located) -> Values {
    var values = Values(0, 0, 0);
    // 8.3-3: the method gives the textures of all channels.
    if (materials[material].full_count != 0u) {
        values = textures_q20(material, place, light, view);
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
        let value = channel_q20(material, number, given, light.taps, view.taps);
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

// The place of a position at a level (6.3).
fn place_at_position(material: u32, level: u32, u_q32: u32, v_q32: u32) -> Place {
    let edge = materials[material].edge;
    let edge_reciprocal_q18 = materials[material].edge_reciprocal_q18;
    let width = level_size(materials[material].width, level);
    let height = level_size(materials[material].height, level);
    return Place(
        level,
        axis_at_position(edge, edge_reciprocal_q18, width, u_q32),
        axis_at_position(edge, edge_reciprocal_q18, height, v_q32),
    );
}

// The place of a texel that is there, at a level (6.2-2).
fn place_at_texel(material: u32, level: u32, texel_x: u32, texel_y: u32) -> Place {
    let edge = materials[material].edge;
    let edge_reciprocal_q18 = materials[material].edge_reciprocal_q18;
    return Place(
        level,
        axis_at_texel(edge, edge_reciprocal_q18, texel_x),
        axis_at_texel(edge, edge_reciprocal_q18, texel_y),
    );
}

// Values between two texels of each axis of one level (8.4).
fn filtered_values(material: u32, level: u32, u_q32: u32, v_q32: u32, light: Located, view: Located) -> Values {
    // 8.4-4: a level beyond the last is the last.
    let inside = min(level, materials[material].level_count - 1u);
    return place_values(material, place_at_position(material, inside, u_q32, v_q32), light, view);
}

// Values of one texel of level 0 for one pair of sample directions (8.5).
fn point_values(material: u32, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Values {
    // 8.5-1: an index beyond the end is clamped to the last.
    let light = light_sample(material, light_index);
    let view = view_sample(material, view_index);
    return texel_values(material, texel_x, texel_y, light, view);
}

// Values of one texel of level 0 for located directions (8.5).
fn texel_values(material: u32, texel_x: u32, texel_y: u32, light: Located, view: Located) -> Values {
    let inside_x = min(texel_x, materials[material].width - 1u);
    let inside_y = min(texel_y, materials[material].height - 1u);
    return place_values(material, place_at_texel(material, 0u, inside_x, inside_y), light, view);
}

// A light direction, located (5.6).
fn locate_light(material: u32, direction: Direction) -> Located {
    return locate(materials[material].light_start, direction);
}

// A view direction, located (5.6).
fn locate_view(material: u32, direction: Direction) -> Located {
    return locate(materials[material].view_start, direction);
}

// Sample direction `index` of the light, located; beyond the end the last (8.5).
fn light_sample(material: u32, index: u32) -> Located {
    return locate_sample(materials[material].light_start, min(index, materials[material].light_count - 1u));
}

// Sample direction `index` of the view, located; beyond the end the last (8.5).
fn view_sample(material: u32, index: u32) -> Located {
    return locate_sample(materials[material].view_start, min(index, materials[material].view_count - 1u));
}

// Linear radiance of values seen under a located light (7.1).
fn radiance(material: u32, values: Values, light: Located) -> Rgb {
    return colour(material, values, light.taps.cosine_q15);
}
