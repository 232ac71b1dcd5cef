//! Trimming of sparse tensors: what stays keeps its order and its values, so that every sum is formed as
//! before.

use crate::format::renumber::{Renumbering, kept_columns, kept_rows};
use crate::format::texture::Kept;
use crate::methods::sparse_tensor::layout::index_mask;
use crate::methods::sparse_tensor::model::TensorModel;

/// Leaves channels, levels, layers and rows of directions; without a channel the tensor is empty.
pub fn keep(tensor: &mut TensorModel, kept: &Kept<'_>) {
    let keeps: [bool; 3] = std::array::from_fn(|c| tensor.channels[c] && kept.channels[c]);
    if !keeps.contains(&true) {
        *tensor = TensorModel::default();
        return;
    }
    tensor.channels = keeps;
    for entry in &mut tensor.lights {
        entry.iter_mut().zip(keeps).filter(|(_, keeps)| !keeps).for_each(|(channel, _)| *channel = 0);
    }
    tensor.lists.truncate(kept.levels);
    tensor.lists.iter_mut().for_each(|level| level.truncate(kept.layers));
    tensor.lights = kept_rows(&tensor.lights, tensor.light_atoms as usize, kept.lights);
    let view_row = tensor.atoms.len() * tensor.entries as usize;
    tensor.fibres = kept_rows(&tensor.fibres, view_row, kept.views);
}

/// Leaves out ABRDF atoms that no list has, and light atoms that no entry with a value numbers.
pub fn drop_unused(tensor: &mut TensorModel) {
    if tensor.lists.is_empty() {
        return;
    }
    let mut used = vec![false; tensor.atoms.len()];
    let lists = tensor.lists.iter().flatten().flat_map(|layer| &layer.lists);
    lists.flatten().for_each(|&(atom, _)| used[atom as usize] = true);
    let atoms = Renumbering::new(&used, true);
    for (atom, _) in tensor.lists.iter_mut().flatten().flat_map(|layer| &mut layer.lists).flatten() {
        *atom = atoms.new[*atom as usize];
    }
    let (row, entries) = (tensor.atoms.len() * tensor.entries as usize, tensor.entries as usize);
    let rows = tensor.fibres.chunks(row);
    tensor.fibres = rows.flat_map(|row| kept_rows(row, entries, &atoms.kept)).collect();
    tensor.atoms = atoms.kept.iter().map(|&atom| tensor.atoms[atom as usize]).collect();

    let mask = index_mask(tensor.light_atoms);
    let mut used = vec![false; tensor.light_atoms as usize];
    let with_value = tensor.fibres.iter().filter(|&&entry| entry & !mask != 0);
    with_value.for_each(|&entry| used[(entry & mask) as usize] = true);
    let light = Renumbering::new(&used, true);
    // With fewer bits for the number the bits that a value gains are zero, as they were in effect.
    for entry in &mut tensor.fibres {
        let value = *entry & !mask;
        *entry = if value == 0 { 0 } else { value | light.new[(*entry & mask) as usize] as u16 };
    }
    tensor.lights = kept_columns(&tensor.lights, tensor.light_atoms as usize, &light.kept);
    tensor.light_atoms = light.kept.len() as u32;
}
