//! From the textures that a method gives to values and radiance: chapter 8 for many samples.

use crate::fast::table::blend_pairs;
use crate::kernel::colour::{Rgb, Values, colour};
use crate::kernel::direction::Taps;
use crate::kernel::fixed::{clamp_magnitude, round_shift};
use crate::kernel::interpolation::{VALUE_BOUND, mean_q20, scale_q15, scale_texture};
use crate::kernel::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, Material};
use crate::kernel::words::{Words, word};

/// Means, scales and colour of a sample whose textures are known, the same bits as
/// [`crate::kernel::interpolation::place_values`].
pub(crate) fn finish(
    words: Words<'_>,
    material: &Material,
    textures: [i32; 3],
    light: Taps,
    view: Taps,
) -> Rgb {
    let blend = |start: u32| blend_pairs(words, start, material.light_count, light, view);
    let value = |channel: Channel, texture: i32| {
        if channel.state == CHANNEL_MISSING {
            return 0;
        }
        // A channel without texture has none, whatever its method gave.
        let mut texture = if channel.state == CHANNEL_FULL { texture } else { 0 };
        if channel.scale_start != 0 {
            let scale = round_shift(blend(channel.scale_start), 15);
            texture = scale_texture(texture, scale, word(words, channel.scale_start.wrapping_add(1)));
        }
        let mut mean = 0;
        if channel.mean_start != 0 {
            let base_q20 = word(words, channel.mean_start) as i32;
            let shift = 15u32.wrapping_sub(word(words, channel.mean_start.wrapping_add(1)));
            mean = round_shift(blend(channel.mean_start), shift).wrapping_add(base_q20);
        }
        clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
    };
    let ([c0, c1, c2], [t0, t1, t2]) = (material.channels, textures);
    let values = Values { c0: value(c0, t0), c1: value(c1, t1), c2: value(c2, t2) };
    colour(material, values, light.cosine_q15)
}

/// How a texture becomes the value of its channel, for one light and view (8.3).
#[derive(Clone, Copy)]
pub(crate) struct Finish {
    state: u32,
    mean: i32,
    /// The scale and its shift, if the channel has one.
    scale: Option<(i32, u32)>,
}

impl Finish {
    /// Of a channel.
    pub fn of(words: Words<'_>, material: &Material, channel: Channel, light: Taps, view: Taps) -> Finish {
        let mut mean = 0;
        if channel.state != CHANNEL_MISSING {
            mean = mean_q20(words, material, channel, light, view);
        }
        let scaled = channel.scale_start != 0;
        let scale = scaled.then(|| {
            let shift = word(words, channel.scale_start.wrapping_add(1));
            (scale_q15(words, material, channel, light, view), shift)
        });
        Finish { state: channel.state, mean, scale }
    }

    /// The value of a texture.
    #[inline(always)]
    pub fn value(&self, texture: i32) -> i32 {
        // A channel without texture has none, whatever its method gave; a missing one has a mean of zero.
        let texture = match (self.state == CHANNEL_FULL, self.scale) {
            (false, _) => 0,
            (true, None) => texture,
            (true, Some((scale, shift))) => scale_texture(texture, scale, shift),
        };
        clamp_magnitude(texture.wrapping_add(self.mean), VALUE_BOUND)
    }
}
