//! What the kernel knows of an open material (chapter 1). Twin: `shaders/wgsl/material.wgsl`.
//!
//! `open` fills one of these from the header and the directory; every field is one 32-bit word, so the
//! same record is a Rust struct, a WGSL struct and an entry of the host's table of materials.

/// A channel that is not in the file: its value is zero.
pub const CHANNEL_MISSING: u32 = 0;
/// A channel that is a mean for every pair of directions, without texture.
pub const CHANNEL_MEAN: u32 = 1;
/// A channel with texture.
pub const CHANNEL_FULL: u32 = 2;
/// Channels are base-two logarithms of radiance plus an offset.
pub const TRANSFER_LOG2: u32 = 0;
/// Channels are linear.
pub const TRANSFER_LINEAR: u32 = 1;

/// What every method has of a channel. Offsets are word numbers; 0 for what a channel does not have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Channel {
    /// [`CHANNEL_MISSING`], [`CHANNEL_MEAN`] or [`CHANNEL_FULL`].
    pub state: u32,
    /// First word of the means.
    pub mean_start: u32,
    /// First word of the scales.
    pub scale_start: u32,
    /// Rank among the channels with texture.
    pub full_rank: u32,
}

/// Everything that decoding needs beside the words of the file. Offsets are word numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Material {
    /// First word of the file.
    pub file_start: u32,
    /// Texels along x at level 0.
    pub width: u32,
    /// Texels along y at level 0.
    pub height: u32,
    /// Levels of detail, 1 for the full resolution alone.
    pub level_count: u32,
    /// Directions of the light.
    pub light_count: u32,
    /// Directions of the view.
    pub view_count: u32,
    /// First word of the section of light directions.
    pub light_start: u32,
    /// First word of the section of view directions.
    pub view_start: u32,
    /// [`TRANSFER_LOG2`] or [`TRANSFER_LINEAR`].
    pub transfer: u32,
    /// 1 if the light's cosine is in the values.
    pub cosine_included: u32,
    /// Q31 mantissa of the log offset, 0 for none.
    pub offset_mantissa_q31: u32,
    /// Exponent of the log offset, or of the linear values.
    pub exponent: i32,
    /// Colour matrix, row by row: red, green, blue from channels 0, 1, 2.
    pub matrix_q13: [i32; 9],
    /// Texels along the side of a block.
    pub edge: u32,
    /// `ceil(2^18 / edge)`.
    pub edge_reciprocal_q18: u32,
    /// Quality layers in the file.
    pub layer_count: u32,
    /// Quality layers to decode.
    pub layer_limit: u32,
    /// Channels with texture.
    pub full_count: u32,
    /// Number of the method (3.1).
    pub method: u32,
    /// Where the parts of the method are; which is which is the method's own. Word numbers, 0 for what a file
    /// does not have.
    pub parts: [u32; 12],
    /// The three channels.
    pub channels: [Channel; 3],
}

/// Words in a [`Material`].
pub const MATERIAL_WORDS: usize = 51;

impl Material {
    /// Notes where part `index` of the method is; an index that no method has is none.
    #[allow(dead_code, reason = "a build may have no method")]
    pub(crate) fn set_part(&mut self, index: u32, start: u32) {
        if let Some(part) = self.parts.get_mut(index as usize) {
            *part = start;
        }
    }

    /// The record's words in the order of its fields, for a kernel's table of materials.
    pub fn to_words(&self) -> [u32; MATERIAL_WORDS] {
        let Material { matrix_q13, parts, channels, .. } = *self;
        let [c0, c1, c2] = channels.map(|c| [c.state, c.mean_start, c.scale_start, c.full_rank]);
        let image = [self.file_start, self.width, self.height, self.level_count];
        let directions = [self.light_count, self.view_count, self.light_start, self.view_start];
        let transfer = [self.transfer, self.cosine_included, self.offset_mantissa_q31, self.exponent as u32];
        let blocks = [self.edge, self.edge_reciprocal_q18];
        let layers = [self.layer_count, self.layer_limit, self.full_count, self.method];
        let head = image.into_iter().chain(directions).chain(transfer);
        let head = head.chain(matrix_q13.map(|entry| entry as u32)).chain(blocks).chain(layers);
        let mut words = [0; MATERIAL_WORDS];
        let fields = head.chain(parts).chain(c0).chain(c1).chain(c2);
        words.iter_mut().zip(fields).for_each(|(word, field)| *word = field);
        words
    }
}

const _: () = assert!(size_of::<Material>() == MATERIAL_WORDS * 4, "every field is one word");

/// Word number of part `index` of the method, 0 for none (1.4).
#[inline(always)]
pub fn part(material: &Material, index: u32) -> u32 {
    // An index is a constant of the method, and a channel below three.
    match material.parts.get(index as usize) {
        Some(start) => *start,
        None => 0,
    }
}

/// What every method has of channel `number`; beyond the last, the last (8.3).
#[inline(always)]
pub fn channel_of(material: &Material, number: u32) -> Channel {
    // 8.3-4: no index is out of range.
    match material.channels.get(number as usize) {
        Some(channel) => *channel,
        None => material.channels[2],
    }
}

/// Texels along an axis of `size` texels at `level`: its share of the size, rounded up (9.1-1).
pub fn level_size(size: u32, level: u32) -> u32 {
    // 9.1-1: never zero, since sizes are at least one.
    size.wrapping_add((1u32 << level).wrapping_sub(1)) >> level
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_record_are_its_fields_in_order() {
        let channel = |first: u32| Channel {
            state: first,
            mean_start: first + 1,
            scale_start: first + 2,
            full_rank: first + 3,
        };
        let material = Material {
            file_start: 0,
            width: 1,
            height: 2,
            level_count: 3,
            light_count: 4,
            view_count: 5,
            light_start: 6,
            view_start: 7,
            transfer: 8,
            cosine_included: 9,
            offset_mantissa_q31: 10,
            exponent: 11,
            matrix_q13: [12, 13, 14, 15, 16, 17, 18, 19, 20],
            edge: 21,
            edge_reciprocal_q18: 22,
            layer_count: 23,
            layer_limit: 24,
            full_count: 25,
            method: 26,
            parts: core::array::from_fn(|n| 27 + n as u32),
            channels: [channel(39), channel(43), channel(47)],
        };
        assert_eq!(material.to_words(), core::array::from_fn(|n| n as u32));
    }
}
