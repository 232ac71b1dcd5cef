//! The header's layout (chapter 3.1).

use crate::kernel::material::CHANNEL_FULL;

/// `SELV`, then the bytes that tell a text-mode transfer.
pub const MAGIC: [u8; 8] = [0x53, 0x45, 0x4c, 0x56, 0x0d, 0x0a, 0x1a, 0x0a];
/// The only major version.
pub const MAJOR_VERSION: u32 = 1;
/// Bytes of the header.
pub const HEADER_LENGTH: u32 = 128;
/// Bytes of a directory entry.
pub const ENTRY_LENGTH: u32 = 16;
/// Most texels along the side of a block of any method (3.1-12).
pub const EDGE_LIMIT: u32 = 16;
/// A material.
pub const CONTENT_MATERIAL: u32 = 0;
/// A dictionary that materials name by digest.
pub const CONTENT_DICTIONARY: u32 = 1;

/// The fields of a header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Minor version; readers of this version take all.
    pub minor_version: u32,
    /// Bytes of the whole file.
    pub file_length: u32,
    /// [`CONTENT_MATERIAL`] or [`CONTENT_DICTIONARY`].
    pub content: u32,
    /// Number of the method.
    pub method: u32,
    /// Entries of the directory.
    pub section_count: u32,
    /// Stated operations of a filtered sample at worst.
    pub operations: u32,
    /// Texels along x.
    pub width: u32,
    /// Texels along y.
    pub height: u32,
    /// Light directions.
    pub light_count: u32,
    /// View directions.
    pub view_count: u32,
    /// Levels of detail.
    pub level_count: u32,
    /// Texels along the side of a block.
    pub edge: u32,
    /// Quality layers.
    pub layer_count: u32,
    /// State of each channel.
    pub states: [u32; 3],
    /// Transfer.
    pub transfer: u32,
    /// 1 if the light's cosine is in the values.
    pub cosine_included: u32,
    /// Bits of the log offset, or the linear exponent.
    pub transfer_parameter: u32,
    /// Colour matrix.
    pub matrix_q13: [i32; 9],
}

impl Header {
    /// Whether channel `c` has texture.
    pub fn is_full(&self, c: u32) -> bool {
        self.states.get(c as usize).is_some_and(|&state| state == CHANNEL_FULL)
    }

    /// Whether any channel has texture.
    pub fn has_texture(&self) -> bool {
        self.states.contains(&CHANNEL_FULL)
    }

    /// Reads the fields of a header that is long enough; nothing is checked.
    pub fn read(word_at: impl Fn(u32) -> u32) -> Header {
        let word = |index: u32| word_at(index.wrapping_mul(4));
        let byte = |index: u32, n: u32| (word(index) >> (n & 3).wrapping_mul(8)) & 0xff;
        let entry =
            |n: u32| ((word(17u32.wrapping_add(n >> 1)) << (16u32.wrapping_sub((n & 1) << 4))) as i32) >> 16;
        Header {
            minor_version: word(2) >> 16,
            file_length: word(3),
            content: word(4),
            method: word(5),
            section_count: word(6),
            operations: word(7),
            width: word(8),
            height: word(9),
            light_count: word(10),
            view_count: word(11),
            level_count: word(12),
            edge: byte(13, 0),
            layer_count: byte(13, 1),
            states: [byte(14, 0), byte(14, 1), byte(14, 2)],
            transfer: byte(15, 0),
            cosine_included: byte(15, 1),
            transfer_parameter: word(16),
            matrix_q13: [
                entry(0),
                entry(1),
                entry(2),
                entry(3),
                entry(4),
                entry(5),
                entry(6),
                entry(7),
                entry(8),
            ],
        }
    }
}
