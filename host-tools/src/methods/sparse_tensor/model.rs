//! Textures of the sparse tensor, quantised: what chapter 12 stores.

use crate::format::model::MaterialModel;
use serde::{Deserialize, Serialize};

/// Name of the method, as everywhere.
pub const NAME: &str = "sparse-tensor";

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

/// The tensor of a model; none if it is of another method.
pub fn tensor_of(model: &MaterialModel) -> Option<&TensorModel> {
    model.texture.downcast_ref()
}
