//! A material in memory, quantised: exactly what a file holds, before layout, checksums and cost.
//!
//! Whoever makes a file (an importer, an encoder, a generator of test files) fills a [`MaterialModel`];
//! [`write`](super::write) turns it into bytes. All numbers have the meaning of the specification.

use crate::format::texture::Texture;
use selvedge::kernel::material::{CHANNEL_FULL, CHANNEL_MEAN, CHANNEL_MISSING};
use serde::{Deserialize, Serialize};

/// A whole material.
///
/// `T` is what the method stores: a [`Texture`], or, of a recipe that its method has yet to read, JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaterialModel<T = Box<dyn Texture>> {
    /// Texels along x and y.
    pub size: [u32; 2],
    /// Levels of detail.
    pub level_count: u32,
    /// Texels along the side of a block.
    pub edge: u32,
    /// Quality layers.
    pub layer_count: u32,
    /// How channel values become radiance.
    pub transfer: TransferModel,
    /// The light's cosine is in the values.
    pub cosine_included: bool,
    /// Rows give red, green, blue; Q13.
    pub matrix_q13: [i16; 9],
    /// Texts and units.
    pub metadata: MetadataModel,
    /// Light directions: points of the disc, Q14.
    pub lights: Vec<[i32; 2]>,
    /// View directions; `None` if they are those of the light.
    pub views: Option<Vec<[i32; 2]>>,
    /// The channels.
    pub channels: [ChannelModel; 3],
    /// The textures of the channels.
    pub texture: T,
    /// Optional sections of unknown kinds: kind, instance, bytes (a multiple of four).
    pub extras: Vec<(u16, u16, Vec<u8>)>,
}

impl MaterialModel {
    /// The method in the header.
    pub fn method(&self) -> u32 {
        self.texture.method()
    }

    /// The state of a channel in the header: full with texture, else a mean if it has one, else missing.
    pub fn state(&self, channel: usize) -> u32 {
        match (self.texture.channels()[channel], &self.channels[channel].mean) {
            (true, _) => CHANNEL_FULL,
            (false, Some(_)) => CHANNEL_MEAN,
            (false, None) => CHANNEL_MISSING,
        }
    }

    /// Whether any channel has texture.
    pub fn has_texture(&self) -> bool {
        self.texture.channels().contains(&true)
    }
}

impl<T> MaterialModel<T> {
    /// View directions, whether or not they are stored apart.
    pub fn views(&self) -> &[[i32; 2]] {
        self.views.as_deref().unwrap_or(&self.lights)
    }

    /// The same material with another texture.
    pub fn with_texture<U>(self, texture: U) -> MaterialModel<U> {
        MaterialModel {
            size: self.size,
            level_count: self.level_count,
            edge: self.edge,
            layer_count: self.layer_count,
            transfer: self.transfer,
            cosine_included: self.cosine_included,
            matrix_q13: self.matrix_q13,
            metadata: self.metadata,
            lights: self.lights,
            views: self.views,
            channels: self.channels,
            texture,
            extras: self.extras,
        }
    }
}

/// Chapter 7.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TransferModel {
    /// Base-two logarithm of radiance plus an offset.
    Log2 {
        /// The offset.
        offset: f32,
    },
    /// Linear values times a power of two.
    Linear {
        /// The power.
        exponent: i32,
    },
}

/// Chapter 3.4.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MetadataModel {
    /// Width and height of a texel in nanometres, 0 if unknown.
    pub texel_nm: [u32; 2],
    /// Axes of the directions.
    pub frame: u32,
    /// Where texel (0, 0) is.
    pub image_origin: u32,
    /// Primaries.
    pub primaries: u32,
    /// Name, origin of the data, licence.
    pub texts: [String; 3],
}

/// The tables of one channel. Without means and texture the channel is missing; a channel with texture and
/// without means has the mean zero (8.1).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelModel {
    /// Means for pairs of directions.
    pub mean: Option<PairTableModel>,
    /// Scales for pairs of directions.
    pub scale: Option<PairTableModel>,
}

/// Chapters 8.1 and 8.2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairTableModel {
    /// Added to every entry, Q20.
    pub base_q20: i32,
    /// Left shift of the entries.
    pub shift: u32,
    /// `entries[view * light_count + light]`.
    pub entries: Vec<i16>,
}
