//! Interpolation in the model (chapter 8) and levels (chapter 9). Twin: `shaders/wgsl/interpolation.wgsl`.
//!
//! What every method shares: means and scales for pairs of directions, the value of a channel, and the
//! samples that a caller can ask for. The method adds the texture: `texture_q20` of a channel, or
//! `textures_q20` of all at once.

use crate::colour::{Rgb, Values, colour};
use crate::direction::{Direction, Taps, locate, single_tap};
#[cfg(feature = "sparse-ensemble")]
use crate::ensemble::texture_q20;
use crate::fixed::{clamp_magnitude, multiply_q15, round_shift};
use crate::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR, Material, level_size};
#[cfg(not(feature = "sparse-ensemble"))]
use crate::no_ensemble::texture_q20;
#[cfg(not(feature = "sparse-tensor"))]
use crate::no_tensor::textures_q20;
use crate::position::{Axis, axis_at_position, axis_at_texel};
#[cfg(feature = "sparse-tensor")]
use crate::tensor::textures_q20;
use crate::words::{Words, packed_i16, word};

/// Channel values are limited to this magnitude, Q20: 128 (8.1-4).
pub const VALUE_BOUND: i32 = 0x0800_0000;

/// A table of 16-bit numbers for pairs of directions, blended over nine of them, in Q15 (8.1).
///
/// The weights sum to one, so the inner sum is within 2^30 and the outer within 2^30 + 2.
pub fn blend_table_q15(words: Words<'_>, start: u32, light_count: u32, light: Taps, view: Taps) -> i32 {
    let row_words = light_count.wrapping_add(1) >> 1;
    let row_a = start.wrapping_add(4).wrapping_add(view.a.wrapping_mul(row_words));
    let row_b = start.wrapping_add(4).wrapping_add(view.b.wrapping_mul(row_words));
    let row_c = start.wrapping_add(4).wrapping_add(view.c.wrapping_mul(row_words));
    // 8.1-2: lights inside, exact; views outside, each product rounded.
    let sum_a = multiply_q15(blend_row(words, row_a, light), view.weight_a_q15);
    let sum_b = multiply_q15(blend_row(words, row_b, light), view.weight_b_q15);
    let sum_c = multiply_q15(blend_row(words, row_c, light), view.weight_c_q15);
    sum_a.wrapping_add(sum_b).wrapping_add(sum_c)
}

/// Three entries of one packed row by their weights, in Q15, exact (8.1-1).
pub fn blend_row(words: Words<'_>, row: u32, taps: Taps) -> i32 {
    let a = packed_i16(words, row, taps.a).wrapping_mul(taps.weight_a_q15);
    let b = packed_i16(words, row, taps.b).wrapping_mul(taps.weight_b_q15);
    let c = packed_i16(words, row, taps.c).wrapping_mul(taps.weight_c_q15);
    // 8.1-1: at most 32,767 * 32,768.
    a.wrapping_add(b).wrapping_add(c)
}

/// The mean of a channel for a pair of directions, Q20 (8.1-3).
pub fn mean_q20(words: Words<'_>, material: &Material, channel: Channel, light: Taps, view: Taps) -> i32 {
    let start = channel.mean_start;
    let blended_q15 = blend_table_q15(words, start, material.light_count, light, view);
    let base_q20 = word(words, start) as i32;
    // 8.1-3: shift is at most 11, so the table reaches 2^26 and with the base 2^27.
    round_shift(blended_q15, 15u32.wrapping_sub(word(words, start.wrapping_add(1)))).wrapping_add(base_q20)
}

/// The scale of a channel for a pair of directions, Q15 (8.2-1).
pub fn scale_q15(words: Words<'_>, material: &Material, channel: Channel, light: Taps, view: Taps) -> i32 {
    // 8.2-1: blended like the means, to 16 bits.
    round_shift(blend_table_q15(words, channel.scale_start, material.light_count, light, view), 15)
}

/// A texture times a scale of `2^shift` units, Q20 (8.2-2).
pub fn scale_texture(texture: i32, scale: i32, shift: u32) -> i32 {
    // 8.2-2: limited before the shift, so that nothing is lost above.
    clamp_magnitude(multiply_q15(texture, scale), VALUE_BOUND >> shift) << shift
}

/// The value of a channel at one level, Q20 (8.3); `given` is its texture where the method gives those of all
/// channels at once.
pub fn channel_q20(
    words: Words<'_>,
    material: &Material,
    channel: Channel,
    given: i32,
    level: u32,
    x: Axis,
    y: Axis,
    light: Taps,
    view: Taps,
) -> i32 {
    // 8.3-1: a missing channel is zero.
    if channel.state == CHANNEL_MISSING {
        return 0;
    }
    let mean = mean_q20(words, material, channel, light, view);
    // 8.3-2: a mean alone has no texture.
    if channel.state != CHANNEL_FULL {
        return clamp_magnitude(mean, VALUE_BOUND);
    }
    let mut texture = given;
    // 8.3-3: a sparse ensemble gives each channel's texture by itself.
    if material.method != METHOD_SPARSE_TENSOR {
        texture = texture_q20(words, material, channel, level, x, y, light, view);
    }
    // 8.2-3: a channel without scales keeps its texture.
    if channel.scale_start != 0 {
        let scale = scale_q15(words, material, channel, light, view);
        texture = scale_texture(texture, scale, word(words, channel.scale_start.wrapping_add(1)));
    }
    // 8.3-3: each part is within 2^30, so their sum is exact.
    clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
}

/// Channel `number` of a material (8.3).
pub fn channel_of(material: &Material, number: u32) -> Channel {
    // 8.3-4: by comparison, so that no index can be out of range.
    if number == 0 {
        return material.channels[0];
    }
    if number == 1 {
        return material.channels[1];
    }
    material.channels[2]
}

/// The values of all channels at one level (8.3).
pub fn level_values(
    words: Words<'_>,
    material: &Material,
    level: u32,
    x: Axis,
    y: Axis,
    light: Taps,
    view: Taps,
) -> Values {
    let mut values = Values { c0: 0, c1: 0, c2: 0 };
    // 8.3-3: a sparse tensor gives the textures of all channels at once.
    if material.method == METHOD_SPARSE_TENSOR && material.full_count != 0 {
        values = textures_q20(words, material, level, x, y, light, view);
    }
    // 8.3-4: a loop, so that a compiler for GPUs makes one copy of a channel.
    for number in 0..3u32 {
        let mut given = values.c0;
        if number == 1 {
            given = values.c1;
        }
        if number == 2 {
            given = values.c2;
        }
        let value =
            channel_q20(words, material, channel_of(material, number), given, level, x, y, light, view);
        if number == 0 {
            values.c0 = value;
        }
        if number == 1 {
            values.c1 = value;
        }
        if number == 2 {
            values.c2 = value;
        }
    }
    values
}

/// Values between two texels of each axis of one level (8.4).
pub fn filtered_values(
    words: Words<'_>,
    material: &Material,
    level: u32,
    u_q32: u32,
    v_q32: u32,
    light: Taps,
    view: Taps,
) -> Values {
    // 8.4-4: a level beyond the last is the last.
    let inside = level.min(material.level_count.wrapping_sub(1));
    let x = axis_at_position(
        material.edge,
        material.edge_reciprocal_q18,
        level_size(material.width, inside),
        u_q32,
    );
    let y = axis_at_position(
        material.edge,
        material.edge_reciprocal_q18,
        level_size(material.height, inside),
        v_q32,
    );
    level_values(words, material, inside, x, y, light, view)
}

/// Part of the way from one value to another (9.2-3).
pub fn between(from_value: i32, to_value: i32, fraction_q15: i32) -> i32 {
    // 9.2-3: values are within 2^27, so the difference is exact.
    from_value.wrapping_add(multiply_q15(to_value.wrapping_sub(from_value), fraction_q15))
}

/// Values between two levels, the level in Q16 (9.2).
pub fn trilinear_values(
    words: Words<'_>,
    material: &Material,
    level_q16: u32,
    u_q32: u32,
    v_q32: u32,
    light: Taps,
    view: Taps,
) -> Values {
    // 9.2-1: beyond the last level lies the last level.
    let limited = level_q16.min(material.level_count.wrapping_sub(1) << 16);
    let level = limited >> 16;
    let fraction_q15 = ((limited & 0xffff) >> 1) as i32;
    let mut values = filtered_values(words, material, level, u_q32, v_q32, light, view);
    // 9.2-2: on a level nothing else is read.
    if fraction_q15 != 0 {
        let coarse = filtered_values(words, material, level.wrapping_add(1), u_q32, v_q32, light, view);
        values.c0 = between(values.c0, coarse.c0, fraction_q15);
        values.c1 = between(values.c1, coarse.c1, fraction_q15);
        values.c2 = between(values.c2, coarse.c2, fraction_q15);
    }
    values
}

/// Values of one texel of level 0 for one pair of sample directions (8.5).
pub fn point_values(
    words: Words<'_>,
    material: &Material,
    texel_x: u32,
    texel_y: u32,
    light_index: u32,
    view_index: u32,
) -> Values {
    // 8.5-1: an index beyond the end is moved to the last.
    let light = single_tap(light_index.min(material.light_count.wrapping_sub(1)));
    let view = single_tap(view_index.min(material.view_count.wrapping_sub(1)));
    texel_values(words, material, texel_x, texel_y, light, view)
}

/// Values of one texel of level 0 for located directions (8.5).
pub fn texel_values(
    words: Words<'_>,
    material: &Material,
    texel_x: u32,
    texel_y: u32,
    light: Taps,
    view: Taps,
) -> Values {
    let inside_x = texel_x.min(material.width.wrapping_sub(1));
    let inside_y = texel_y.min(material.height.wrapping_sub(1));
    let x = axis_at_texel(material.edge, material.edge_reciprocal_q18, inside_x);
    let y = axis_at_texel(material.edge, material.edge_reciprocal_q18, inside_y);
    level_values(words, material, 0, x, y, light, view)
}

/// The taps of a light direction (5.6).
pub fn locate_light(words: Words<'_>, material: &Material, direction: Direction) -> Taps {
    locate(words, material.light_start, direction)
}

/// The taps of a view direction (5.6).
pub fn locate_view(words: Words<'_>, material: &Material, direction: Direction) -> Taps {
    locate(words, material.view_start, direction)
}

/// Linear radiance of values seen under a located light (7.1).
pub fn radiance(material: &Material, values: Values, light: Taps) -> Rgb {
    colour(material, values, light.cosine_q15)
}
