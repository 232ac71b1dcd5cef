//! A material in memory, quantised: exactly what a file holds, before layout, checksums and cost.
//!
//! Whoever makes a file (an importer, an encoder, a generator of test files) fills a [`MaterialModel`];
//! [`crate::format::write`] turns it into bytes. All numbers have the meaning of the specification.

use selvedge::header::{METHOD_SPARSE_ENSEMBLE, METHOD_SPARSE_TENSOR};
use selvedge::material::CHANNEL_FULL;
use serde::{Deserialize, Serialize};

/// A whole material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaterialModel {
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
    /// The textures of all channels, where the method is the sparse tensor; no channel has an ensemble then.
    pub tensor: Option<TensorModel>,
    /// Optional sections of unknown kinds: kind, instance, bytes (a multiple of four).
    pub extras: Vec<(u16, u16, Vec<u8>)>,
}

impl MaterialModel {
    /// The method in the header.
    pub fn method(&self) -> u32 {
        if self.tensor.is_some() { METHOD_SPARSE_TENSOR } else { METHOD_SPARSE_ENSEMBLE }
    }

    /// The state of a channel in the header.
    pub fn state(&self, channel: usize) -> u32 {
        let ChannelModel { mean, ensemble, .. } = &self.channels[channel];
        let full = ensemble.is_some() || self.tensor.as_ref().is_some_and(|tensor| tensor.channels[channel]);
        if full { CHANNEL_FULL } else { mean.is_some() as u32 }
    }

    /// Whether any channel has texture.
    pub fn has_texture(&self) -> bool {
        (0..3).any(|channel| self.state(channel) == CHANNEL_FULL)
    }

    /// View directions, whether or not they are stored apart.
    pub fn views(&self) -> &[[i32; 2]] {
        self.views.as_deref().unwrap_or(&self.lights)
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

/// One channel; which parts are there says whether it is missing, a mean, or full.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelModel {
    /// Means for pairs of directions.
    pub mean: Option<PairTableModel>,
    /// Scales for pairs of directions.
    pub scale: Option<PairTableModel>,
    /// Texture.
    pub ensemble: Option<EnsembleModel>,
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

/// `rows` x `columns` numbers in Q15, row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FactorModel {
    /// Columns.
    pub columns: u32,
    /// Entries.
    pub entries: Vec<i16>,
}

/// One dictionary: four factors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DictionaryModel {
    /// Rows are light directions.
    pub light: FactorModel,
    /// Rows are view directions.
    pub view: FactorModel,
    /// Rows are texels of a block along x.
    pub x: FactorModel,
    /// Rows are texels of a block along y.
    pub y: FactorModel,
}

/// An atom: a column of each factor, and how its values are quantised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AtomModel {
    /// Column of the light factor.
    pub light: u32,
    /// Column of the view factor.
    pub view: u32,
    /// Column of the x factor.
    pub x: u32,
    /// Column of the y factor.
    pub y: u32,
    /// Right shift of its products.
    pub shift: u32,
    /// Coefficient of value 0.
    pub base: i16,
    /// Coefficients over the whole range of values.
    pub step: u16,
}

impl AtomModel {
    /// The atom's word in the file.
    pub fn word(&self) -> u32 {
        self.y << 28 | self.x << 24 | self.light << 14 | self.view << 4 | self.shift
    }

    /// Base and step in one word.
    pub fn quantiser(&self) -> u32 {
        self.base as u16 as u32 | (self.step as u32) << 16
    }
}

/// The texture of a channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnsembleModel {
    /// The ensemble.
    pub dictionaries: Vec<DictionaryModel>,
    /// Atoms of each dictionary, ascending by [`AtomModel::word`].
    pub atoms: Vec<Vec<AtomModel>>,
    /// `coefficients[level][layer]`.
    pub coefficients: Vec<Vec<CoefficientsModel>>,
}

/// The records of one level and layer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CoefficientsModel {
    /// Bits of a value.
    pub value_bits: u32,
    /// Block by block, row by row.
    pub records: Vec<RecordModel>,
}

/// The record of one block.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordModel {
    /// Which dictionary.
    pub dictionary: u32,
    /// Right shift of the result, 0 to 31; 0 without coefficients.
    pub shift: u32,
    /// Positions in the list of atoms, ascending, with their values.
    pub coefficients: Vec<(u32, u16)>,
}

/// The sparse tensor of chapter 12.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TensorModel {
    /// Channels that have texture.
    pub channels: [bool; 3],
    /// Light atoms.
    pub light_atoms: u32,
    /// `lights[light * light_atoms + index]`: three channels of ten bits with their sign.
    pub lights: Vec<[i16; 3]>,
    /// Entries of a fibre.
    pub entries: u32,
    /// Two shifts of each ABRDF atom.
    pub atoms: Vec<AtomShifts>,
    /// `fibres[(view * atoms + atom) * entries + n]`: value and index of a light atom, as the file has them.
    pub fibres: Vec<u16>,
    /// `lists[level][layer]`.
    pub lists: Vec<Vec<ListsModel>>,
}

/// What an ABRDF atom is scaled by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AtomShifts {
    /// Right shift of its sums over fibres.
    pub angular: u32,
    /// Right shift of its products with weights.
    pub gain: u32,
}

/// The lists of one level and layer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListsModel {
    /// Bits of a value.
    pub value_bits: u32,
    /// Right shift of the totals.
    pub shift: u32,
    /// Texel by texel, row by row: ABRDF atoms, ascending, with their values.
    pub lists: Vec<Vec<(u32, u16)>>,
}
