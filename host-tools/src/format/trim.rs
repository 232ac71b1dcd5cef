//! Trimming: a file without the layers, levels, channels and directions that its user does not need.
//!
//! Nothing is quantised again. What is left decodes to the bits of the original, decoded with as many
//! layers:
//!
//! - *levels*: filtered samples on kept levels, and samples between levels with `level_q16` up to the last
//!   kept one;
//! - *channels*: the value of every channel that keeps its texture. A channel that keeps its mean has the
//!   value that a channel of state 1 has, and one that keeps nothing has 0. Radiance is the original's if
//!   every channel keeps what it has, or what goes has only zeros in its column of the colour matrix;
//! - *directions*: filtered and texel samples whose light and view lie in their sectors
//!   ([`Sector::contains`]), and point samples of kept directions, under the new number: the place in
//!   [`kept_directions`]. Other queries are answered too, from what is left;
//! - *unused*: every query.
//!
//! The promise is for models as the writer triangulates them. The result has its factors in itself, whether
//! or not the original took them from another file, and optional sections as they were. Stated cost, lengths
//! and checksums are the writer's.

use crate::error::{Result, ToolError};
use crate::format::model::{
    AtomModel, ChannelModel, EnsembleModel, FactorModel, MaterialModel, PairTableModel, TensorModel,
};
use crate::format::sector::{Sector, kept_directions};
use selvedge::tensor::bit_length;

/// What stays of a channel, if it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All that it has.
    #[default]
    Texture,
    /// Its mean for each pair of directions.
    Mean,
    /// Nothing: its values are zero.
    Nothing,
}

/// What is to be left; the default is everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trim {
    /// The first layers, at least 1.
    pub layers: Option<u32>,
    /// The first levels, at least 1.
    pub levels: Option<u32>,
    /// What stays of each channel.
    pub channels: [Keep; 3],
    /// Leave out what no record uses: atoms, columns, dictionaries.
    pub unused: bool,
    /// Light directions that queries will have.
    pub lights: Option<Sector>,
    /// View directions that queries will have.
    pub views: Option<Sector>,
}

/// The model that is left.
///
/// # Errors
/// [`ToolError::Usage`] for layers or levels that the model does not have, and for angles that are none.
pub fn trim(model: &MaterialModel, options: &Trim) -> Result<MaterialModel> {
    let count = |name: &str, asked: Option<u32>, there: u32| match asked {
        Some(asked) if !(1..=there).contains(&asked) => {
            Err(ToolError::Usage(format!("the file has {there} {name}: keep 1 to {there}, not {asked}")))
        }
        asked => Ok(asked.unwrap_or(there)),
    };
    let layers = count("layers", options.layers, model.layer_count)?;
    let levels = count("levels", options.levels, model.level_count)?;
    options.lights.iter().chain(&options.views).try_for_each(Sector::check)?;

    let mut left = model.clone();
    left.layer_count = layers;
    left.level_count = levels;
    for (channel, keep) in left.channels.iter_mut().zip(options.channels) {
        match keep {
            Keep::Texture => {}
            Keep::Mean => *channel = ChannelModel { mean: channel.mean.take(), ..ChannelModel::default() },
            Keep::Nothing => *channel = ChannelModel::default(),
        }
        if let Some(ensemble) = &mut channel.ensemble {
            ensemble.coefficients.truncate(levels as usize);
            ensemble.coefficients.iter_mut().for_each(|level| level.truncate(layers as usize));
        }
    }
    if let Some(tensor) = &mut left.tensor {
        let keeps: [bool; 3] =
            std::array::from_fn(|c| tensor.channels[c] && options.channels[c] == Keep::Texture);
        keep_channels(tensor, keeps);
        tensor.lists.truncate(levels as usize);
        tensor.lists.iter_mut().for_each(|level| level.truncate(layers as usize));
    }
    keep_directions(&mut left, options);
    if options.unused {
        left.tensor.iter_mut().filter(|tensor| !tensor.lists.is_empty()).for_each(drop_unused_of_tensor);
        left.channels.iter_mut().filter_map(|channel| channel.ensemble.as_mut()).for_each(drop_unused);
    }
    Ok(left)
}

/// Leaves out directions, and their rows of every table.
fn keep_directions(model: &mut MaterialModel, options: &Trim) {
    let kept = |points: &[[i32; 2]], sector: &Option<Sector>| match sector {
        Some(sector) => kept_directions(points, sector),
        None => (0..points.len() as u32).collect(),
    };
    let (lights, views) = (kept(&model.lights, &options.lights), kept(model.views(), &options.views));
    let light_count = model.lights.len();
    let chosen =
        |points: &[[i32; 2]], kept: &[u32]| kept.iter().map(|&i| points[i as usize]).collect::<Vec<_>>();
    // One set for both stays one set as long as both keep the same of it.
    let new_views = (model.views.is_some() || lights != views).then(|| chosen(model.views(), &views));
    model.lights = chosen(&model.lights, &lights);
    model.views = new_views;
    let table = |table: &mut PairTableModel| {
        let entry = |view: u32, light: u32| table.entries[view as usize * light_count + light as usize];
        table.entries =
            views.iter().flat_map(|&view| lights.iter().map(move |&light| entry(view, light))).collect();
    };
    let rows = |factor: &mut FactorModel, kept: &[u32]| {
        let columns = factor.columns as usize;
        factor.entries = kept
            .iter()
            .flat_map(|&row| &factor.entries[row as usize * columns..][..columns])
            .copied()
            .collect();
    };
    if let Some(tensor) = &mut model.tensor {
        let (light_row, view_row) =
            (tensor.light_atoms as usize, tensor.atoms.len() * tensor.entries as usize);
        tensor.lights = lights
            .iter()
            .flat_map(|&light| &tensor.lights[light as usize * light_row..][..light_row])
            .copied()
            .collect();
        tensor.fibres = views
            .iter()
            .flat_map(|&view| &tensor.fibres[view as usize * view_row..][..view_row])
            .copied()
            .collect();
    }
    for channel in &mut model.channels {
        channel.mean.iter_mut().chain(&mut channel.scale).for_each(table);
        for dictionary in channel.ensemble.iter_mut().flat_map(|ensemble| &mut ensemble.dictionaries) {
            rows(&mut dictionary.light, &lights);
            rows(&mut dictionary.view, &views);
        }
    }
}

/// Numbers of what is used, in order, and the new number of each. At least the first is kept, for the format
/// has no empty factor and no empty ensemble.
struct Renumbering {
    kept: Vec<u32>,
    new: Vec<u32>,
}

impl Renumbering {
    fn new(is_used: &[bool], at_least_one: bool) -> Renumbering {
        let mut kept: Vec<u32> = (0u32..).zip(is_used).filter(|(_, used)| **used).map(|(i, _)| i).collect();
        if kept.is_empty() && at_least_one {
            kept.push(0);
        }
        let mut new = vec![0; is_used.len()];
        kept.iter().enumerate().for_each(|(number, &old)| new[old as usize] = number as u32);
        Renumbering { kept, new }
    }

    fn columns(&self, factor: &mut FactorModel) {
        let rows = factor.entries.chunks(factor.columns.max(1) as usize);
        factor.entries = rows.flat_map(|row| self.kept.iter().map(|&column| row[column as usize])).collect();
        factor.columns = self.kept.len() as u32;
    }
}

/// Leaves out dictionaries that no record uses, atoms that no record uses, and columns that no atom uses.
///
/// What stays keeps its order, so that lists stay sorted and every sum is formed as before.
pub fn drop_unused(ensemble: &mut EnsembleModel) {
    let mut used: Vec<Vec<bool>> = ensemble.atoms.iter().map(|atoms| vec![false; atoms.len()]).collect();
    let mut dictionary_used = vec![false; ensemble.dictionaries.len()];
    let records = || ensemble.coefficients.iter().flatten().flat_map(|coefficients| &coefficients.records);
    for record in records().filter(|record| !record.coefficients.is_empty()) {
        dictionary_used[record.dictionary as usize] = true;
        record
            .coefficients
            .iter()
            .for_each(|&(position, _)| used[record.dictionary as usize][position as usize] = true);
    }
    let positions: Vec<Renumbering> = used.iter().map(|used| Renumbering::new(used, false)).collect();
    let numbers = Renumbering::new(&dictionary_used, true);
    for record in
        ensemble.coefficients.iter_mut().flatten().flat_map(|coefficients| &mut coefficients.records)
    {
        let of_k = &positions[record.dictionary as usize];
        record.coefficients.iter_mut().for_each(|(position, _)| *position = of_k.new[*position as usize]);
        record.dictionary =
            if record.coefficients.is_empty() { 0 } else { numbers.new[record.dictionary as usize] };
    }
    let kept = |k: &u32| *k as usize;
    ensemble.atoms = numbers
        .kept
        .iter()
        .map(kept)
        .map(|k| positions[k].kept.iter().map(|&i| ensemble.atoms[k][i as usize]).collect())
        .collect();
    ensemble.dictionaries = numbers.kept.iter().map(kept).map(|k| ensemble.dictionaries[k].clone()).collect();
    for (dictionary, atoms) in ensemble.dictionaries.iter_mut().zip(&mut ensemble.atoms) {
        drop_columns(&mut dictionary.light, atoms, |atom| &mut atom.light);
        drop_columns(&mut dictionary.view, atoms, |atom| &mut atom.view);
        drop_columns(&mut dictionary.x, atoms, |atom| &mut atom.x);
        drop_columns(&mut dictionary.y, atoms, |atom| &mut atom.y);
    }
}

/// Leaves a sparse tensor the textures of some channels; without any it is empty.
fn keep_channels(tensor: &mut TensorModel, keeps: [bool; 3]) {
    if !keeps.contains(&true) {
        *tensor = TensorModel::default();
    }
    tensor.channels = keeps;
    for entry in &mut tensor.lights {
        entry.iter_mut().zip(keeps).filter(|(_, keeps)| !keeps).for_each(|(channel, _)| *channel = 0);
    }
}

/// Leaves out ABRDF atoms that no list has, and light atoms that no entry with a value names.
///
/// What stays keeps its order and its values, so that every sum is formed as before.
fn drop_unused_of_tensor(tensor: &mut TensorModel) {
    let mut used = vec![false; tensor.atoms.len()];
    tensor
        .lists
        .iter()
        .flatten()
        .flat_map(|layer| &layer.lists)
        .flatten()
        .for_each(|&(atom, _)| used[atom as usize] = true);
    let atoms = Renumbering::new(&used, true);
    for (atom, _) in tensor.lists.iter_mut().flatten().flat_map(|layer| &mut layer.lists).flatten() {
        *atom = atoms.new[*atom as usize];
    }
    let (row, entries) = (tensor.atoms.len() * tensor.entries as usize, tensor.entries as usize);
    let fibres = tensor.fibres.chunks(row);
    tensor.fibres = fibres
        .flat_map(|row| atoms.kept.iter().flat_map(|&atom| &row[atom as usize * entries..][..entries]))
        .copied()
        .collect();
    tensor.atoms = atoms.kept.iter().map(|&atom| tensor.atoms[atom as usize]).collect();

    let mask = (1u16 << bit_length(tensor.light_atoms - 1)).wrapping_sub(1);
    let mut used = vec![false; tensor.light_atoms as usize];
    tensor
        .fibres
        .iter()
        .filter(|&&entry| entry & !mask != 0)
        .for_each(|&entry| used[(entry & mask) as usize] = true);
    let light = Renumbering::new(&used, true);
    // With fewer bits for the number the bits that a value gains are zero, as they were in effect.
    for entry in &mut tensor.fibres {
        let value = *entry & !mask;
        *entry = if value == 0 { 0 } else { value | light.new[(*entry & mask) as usize] as u16 };
    }
    let rows = tensor.lights.chunks(tensor.light_atoms as usize);
    tensor.lights = rows.flat_map(|row| light.kept.iter().map(|&index| row[index as usize])).collect();
    tensor.light_atoms = light.kept.len() as u32;
}

fn drop_columns(factor: &mut FactorModel, atoms: &mut [AtomModel], column: fn(&mut AtomModel) -> &mut u32) {
    let mut used = vec![false; factor.columns as usize];
    atoms.iter_mut().for_each(|atom| used[*column(atom) as usize] = true);
    let columns = Renumbering::new(&used, true);
    atoms.iter_mut().for_each(|atom| *column(atom) = columns.new[*column(atom) as usize]);
    columns.columns(factor);
}
