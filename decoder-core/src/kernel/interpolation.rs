//! Interpolation in the model (chapter 8). Twin: `shaders/wgsl/interpolation.wgsl`.
//!
//! What every method shares: means and scales for pairs of directions, the value of a channel, and the
//! samples that a caller can ask for. The method adds the textures of all channels: `textures_q20`.

use crate::kernel::colour::{Rgb, Values, colour};
use crate::kernel::direction::{Direction, Located, Taps, locate, locate_sample};
use crate::kernel::fixed::{clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, Material, channel_of, level_size};
use crate::kernel::method::textures_q20;
use crate::kernel::position::{Place, axis_at_position, axis_at_texel};
use crate::kernel::words::{Words, packed_i16, word};

/// Channel values are clamped to this magnitude, Q20: 128 (8.1-4).
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

/// The mean of a channel for a pair of directions, Q20; zero for a channel without means (8.1-3).
pub fn mean_q20(words: Words<'_>, material: &Material, channel: Channel, light: Taps, view: Taps) -> i32 {
    let start = channel.mean_start;
    // 8.1-8: a channel without means has the mean zero.
    if start == 0 {
        return 0;
    }
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
    // 8.2-2: clamped before the shift, so that nothing is lost above.
    clamp_magnitude(multiply_q15(texture, scale), VALUE_BOUND >> shift) << shift
}

/// The value of a channel, Q20, from its texture and located directions (8.3).
pub fn channel_q20(
    words: Words<'_>,
    material: &Material,
    number: u32,
    given: i32,
    light: Taps,
    view: Taps,
) -> i32 {
    let channel = channel_of(material, number);
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
    // 8.2-3: a channel without scales keeps its texture.
    if channel.scale_start != 0 {
        let scale = scale_q15(words, material, channel, light, view);
        texture = scale_texture(texture, scale, word(words, channel.scale_start.wrapping_add(1)));
    }
    // 8.3-3: each part is within 2^30, so their sum is exact.
    clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
}

/// The values of all channels at one place (8.3).
pub fn place_values(
    words: Words<'_>,
    material: &Material,
    place: &Place,
    light: &Located,
    view: &Located,
) -> Values {
    let mut values = Values { c0: 0, c1: 0, c2: 0 };
    // 8.3-3: the method gives the textures of all channels.
    if material.full_count != 0 {
        values = textures_q20(words, material, place, light, view);
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
        let value = channel_q20(words, material, number, given, light.taps, view.taps);
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

/// The place of a position at a level (6.3).
pub fn place_at_position(material: &Material, level: u32, u_q32: u32, v_q32: u32) -> Place {
    let width = level_size(material.width, level);
    let height = level_size(material.height, level);
    Place {
        level,
        x: axis_at_position(material.edge, material.edge_reciprocal_q18, width, u_q32),
        y: axis_at_position(material.edge, material.edge_reciprocal_q18, height, v_q32),
    }
}

/// The place of a texel that is there, at a level (6.2-2).
pub fn place_at_texel(material: &Material, level: u32, texel_x: u32, texel_y: u32) -> Place {
    Place {
        level,
        x: axis_at_texel(material.edge, material.edge_reciprocal_q18, texel_x),
        y: axis_at_texel(material.edge, material.edge_reciprocal_q18, texel_y),
    }
}

/// Values between two texels of each axis of one level (8.4).
pub fn filtered_values(
    words: Words<'_>,
    material: &Material,
    level: u32,
    u_q32: u32,
    v_q32: u32,
    light: &Located,
    view: &Located,
) -> Values {
    // 8.4-4: a level beyond the last is the last.
    let inside = level.min(material.level_count.wrapping_sub(1));
    place_values(words, material, &place_at_position(material, inside, u_q32, v_q32), light, view)
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
    // 8.5-1: an index beyond the end is clamped to the last.
    let light = light_sample(words, material, light_index);
    let view = view_sample(words, material, view_index);
    texel_values(words, material, texel_x, texel_y, &light, &view)
}

/// Values of one texel of level 0 for located directions (8.5).
pub fn texel_values(
    words: Words<'_>,
    material: &Material,
    texel_x: u32,
    texel_y: u32,
    light: &Located,
    view: &Located,
) -> Values {
    let inside_x = texel_x.min(material.width.wrapping_sub(1));
    let inside_y = texel_y.min(material.height.wrapping_sub(1));
    place_values(words, material, &place_at_texel(material, 0, inside_x, inside_y), light, view)
}

/// A light direction, located (5.6).
pub fn locate_light(words: Words<'_>, material: &Material, direction: Direction) -> Located {
    locate(words, material.light_start, direction)
}

/// A view direction, located (5.6).
pub fn locate_view(words: Words<'_>, material: &Material, direction: Direction) -> Located {
    locate(words, material.view_start, direction)
}

/// Sample direction `index` of the light, located; beyond the end the last (8.5).
pub fn light_sample(words: Words<'_>, material: &Material, index: u32) -> Located {
    locate_sample(words, material.light_start, index.min(material.light_count.wrapping_sub(1)))
}

/// Sample direction `index` of the view, located; beyond the end the last (8.5).
pub fn view_sample(words: Words<'_>, material: &Material, index: u32) -> Located {
    locate_sample(words, material.view_start, index.min(material.view_count.wrapping_sub(1)))
}

/// Linear radiance of values seen under a located light (7.1).
pub fn radiance(material: &Material, values: Values, light: &Located) -> Rgb {
    colour(material, values, light.taps.cosine_q15)
}
