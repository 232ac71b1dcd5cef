//! Textures of the sparse ensemble, quantised: what chapter 10 stores.

use crate::format::model::MaterialModel;
use crate::methods::sparse_ensemble::layout::{
    LIGHT_BIT, STEP_BIT, VIEW_BIT, X_BIT, Y_BIT, atom_columns, atom_shift,
};
use serde::{Deserialize, Serialize};

/// Name of the method, as everywhere.
pub const NAME: &str = "sparse-ensemble";

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
    /// The atom's word in the file (10.5-2).
    pub fn word(&self) -> u32 {
        self.y << Y_BIT | self.x << X_BIT | self.light << LIGHT_BIT | self.view << VIEW_BIT | self.shift
    }

    /// Base and step in one word.
    pub fn quantiser(&self) -> u32 {
        self.base as u16 as u32 | (self.step as u32) << STEP_BIT
    }

    /// The atom of its two words.
    pub fn of_words(word: u32, quantiser: u32) -> AtomModel {
        let [light, view, x, y] = atom_columns(word);
        let (base, step) = (quantiser as u16 as i16, (quantiser >> STEP_BIT) as u16);
        AtomModel { light, view, x, y, shift: atom_shift(word), base, step }
    }
}

/// The textures of a material by the sparse ensemble.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnsembleTexture {
    /// Ensembles of the channels that have texture.
    pub channels: [Option<EnsembleModel>; 3],
}

impl EnsembleTexture {
    /// The ensembles that are there, with their channels.
    pub fn full(&self) -> impl Iterator<Item = (usize, &EnsembleModel)> {
        self.channels.iter().enumerate().filter_map(|(c, ensemble)| Some((c, ensemble.as_ref()?)))
    }
}

/// The ensembles of a model's channels; none if it is of another method.
pub fn ensembles(model: &MaterialModel) -> impl Iterator<Item = &EnsembleModel> {
    model.texture.downcast_ref::<EnsembleTexture>().into_iter().flat_map(|t| t.channels.iter().flatten())
}

/// The same, to be changed.
pub fn ensembles_mut(model: &mut MaterialModel) -> impl Iterator<Item = &mut EnsembleModel> {
    let texture = model.texture.downcast_mut::<EnsembleTexture>();
    texture.into_iter().flat_map(|texture| texture.channels.iter_mut().flatten())
}

/// The ensemble of one channel; none if the channel has no texture or the model is of another method.
pub fn ensemble_of(model: &MaterialModel, channel: usize) -> Option<&EnsembleModel> {
    model.texture.downcast_ref::<EnsembleTexture>()?.channels[channel].as_ref()
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
