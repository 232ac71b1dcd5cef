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
/// The sparse ensemble, chapter 10.
pub const METHOD_SPARSE_ENSEMBLE: u32 = 1;
/// The sparse tensor, chapter 12.
pub const METHOD_SPARSE_TENSOR: u32 = 2;
/// Channels are base-two logarithms of radiance plus an offset.
pub const TRANSFER_LOG2: u32 = 0;
/// Channels are linear.
pub const TRANSFER_LINEAR: u32 = 1;

/// Where the parts of one channel are. Offsets are word numbers; 0 for what a channel does not have.
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
    /// First word of the angular factors.
    pub angular_start: u32,
    /// First word of the spatial factors.
    pub spatial_start: u32,
    /// First word of the table of atoms.
    pub atoms_start: u32,
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
    /// Word number of the first directory entry of the coefficients, or of the lists.
    pub coefficient_entry: u32,
    /// [`METHOD_SPARSE_ENSEMBLE`] or [`METHOD_SPARSE_TENSOR`].
    pub method: u32,
    /// First word of the light atoms of a sparse tensor.
    pub light_atoms_start: u32,
    /// First word of the fibres of a sparse tensor.
    pub fibres_start: u32,
    /// The three channels.
    pub channels: [Channel; 3],
}

/// Words in a [`Material`].
pub const MATERIAL_WORDS: usize = 51;

impl Material {
    /// The record's words in the order of its fields, for a kernel's table of materials.
    pub fn to_words(&self) -> [u32; MATERIAL_WORDS] {
        let Material { matrix_q13: m, channels, .. } = *self;
        let [c0, c1, c2] = channels.map(|c| {
            [
                c.state,
                c.mean_start,
                c.scale_start,
                c.full_rank,
                c.angular_start,
                c.spatial_start,
                c.atoms_start,
            ]
        });
        let head = [
            self.file_start,
            self.width,
            self.height,
            self.level_count,
            self.light_count,
            self.view_count,
            self.light_start,
            self.view_start,
            self.transfer,
            self.cosine_included,
            self.offset_mantissa_q31,
            self.exponent as u32,
        ];
        let tail = [
            self.edge,
            self.edge_reciprocal_q18,
            self.layer_count,
            self.layer_limit,
            self.full_count,
            self.coefficient_entry,
        ];
        let tensor = [self.method, self.light_atoms_start, self.fibres_start];
        let mut words = [0; MATERIAL_WORDS];
        let fields = head
            .into_iter()
            .chain(m.map(|entry| entry as u32))
            .chain(tail)
            .chain(tensor)
            .chain(c0)
            .chain(c1)
            .chain(c2);
        words.iter_mut().zip(fields).for_each(|(word, field)| *word = field);
        words
    }
}

const _: () = assert!(size_of::<Material>() == MATERIAL_WORDS * 4, "every field is one word");

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
            angular_start: first + 4,
            spatial_start: first + 5,
            atoms_start: first + 6,
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
            coefficient_entry: 26,
            method: 27,
            light_atoms_start: 28,
            fibres_start: 29,
            channels: [channel(30), channel(37), channel(44)],
        };
        assert_eq!(material.to_words(), core::array::from_fn(|n| n as u32));
    }
}
