//! Sections of chapter 12: written, and read from an open material.

use crate::format::bits::{BitWriter, bits_for, pack_rows};
use crate::format::container::{RawSection, level_instance};
use crate::methods::sparse_tensor::layout::{
    GAIN_BIT, INDEX_BITS_BIT, LIST_SHIFT_BIT, SECOND_BYTE, atom_count, atom_shifts, channel_field,
    entries_start, fibre_shape, light_atom_count, light_row, value_bits_and_shift,
};
use crate::methods::sparse_tensor::model::{AtomShifts, ListsModel, TensorModel};
use selvedge::Selvedge;
use selvedge::kernel::material::{CHANNEL_FULL, level_size};
use selvedge::kernel::words::{Words, packed_i16, word};
use selvedge::method::sparse_tensor::check::{FIBRES, LIGHT_ATOMS, LISTS};
use selvedge::method::sparse_tensor::{
    GROUP_TEXELS, LIST_END, bit_length, light_entry, list_low_bits, lists_start, next_coefficient, open_list,
};

/// Light atoms and fibres (12.1, 12.2), if any channel has texture.
pub fn dictionary_sections(tensor: &TensorModel) -> Vec<RawSection> {
    if !tensor.channels.contains(&true) {
        return Vec::new();
    }
    let entry = |entry: &[i16; 3]| (0..3).map(|c| channel_field(entry[c], c)).sum::<u32>();
    let mut light = vec![tensor.light_atoms, 0];
    light.extend(tensor.lights.iter().map(entry));
    let index_bits = bit_length(tensor.light_atoms - 1);
    let mut fibres = vec![tensor.atoms.len() as u32, tensor.entries | index_bits << SECOND_BYTE];
    fibres.extend(tensor.atoms.iter().map(|atom| atom.angular | atom.gain << GAIN_BIT));
    let entries: Vec<i16> = tensor.fibres.iter().map(|&entry| entry as i16).collect();
    pack_rows(&mut fibres, &entries, entries.len() as u32);
    vec![RawSection::of_words(LIGHT_ATOMS, 0, &light), RawSection::of_words(FIBRES, 0, &fibres)]
}

/// Lists of every level and layer (12.3, 12.4), if any channel has texture.
pub fn own_sections(tensor: &TensorModel) -> Vec<RawSection> {
    if !tensor.channels.contains(&true) {
        return Vec::new();
    }
    let mut sections = Vec::new();
    for (level, layers) in tensor.lists.iter().enumerate() {
        for (layer, lists) in layers.iter().enumerate() {
            let words = list_words(lists, tensor.atoms.len() as u32);
            sections.push(RawSection::of_words(LISTS, level_instance(level, layer, 0), &words));
        }
    }
    sections
}

/// The length of the longest list.
pub fn largest_count(lists: &ListsModel) -> u32 {
    lists.lists.iter().map(Vec::len).max().unwrap_or(0) as u32
}

/// A section of lists (12.3, 12.4).
fn list_words(model: &ListsModel, atoms: u32) -> Vec<u32> {
    let largest = largest_count(model);
    let (count_bits, index_bits) = (bits_for(largest).max(1), bit_length(atoms - 1));
    let mut stream = BitWriter::default();
    let mut starts = Vec::new();
    for group in model.lists.chunks(GROUP_TEXELS as usize) {
        starts.push(stream.length());
        for n in 0..GROUP_TEXELS as usize {
            stream.push(group.get(n).map_or(0, Vec::len) as u32, count_bits);
        }
        for list in group.iter().filter(|list| !list.is_empty()) {
            let low_bits = list_low_bits(index_bits, list.len() as u32);
            let high = stream.push_list(list, low_bits, model.value_bits);
            stream.push(0, ((atoms - 1) >> low_bits) - high);
        }
    }
    let widths = model.value_bits | count_bits << SECOND_BYTE | index_bits << INDEX_BITS_BIT;
    let head = widths | model.shift << LIST_SHIFT_BIT;
    let mut words = vec![head, model.lists.len() as u32, stream.length(), largest];
    words.extend(starts);
    words.extend(stream.into_words());
    words
}

/// The texture of an open material.
pub fn read(opened: &Selvedge<'_>) -> TensorModel {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let channels = material.channels.map(|channel| channel.state == CHANNEL_FULL);
    if !header.has_texture() {
        return TensorModel { channels, ..TensorModel::default() };
    }
    let light_atoms = light_atom_count(words, material);
    let first = light_row(words, material, 0);
    let light = |n: u32| [0, 1, 2].map(|c| light_entry(word(words, first + n), c) as i16);
    let (count, [entries, _]) = (atom_count(words, material), fibre_shape(words, material));
    let shifts = |n: u32| {
        let [angular, gain] = atom_shifts(words, material, n);
        AtomShifts { angular, gain }
    };
    let of_level = |level: u32| {
        let texels = texels_of_level(opened, level);
        let of_layer = |layer: u32| {
            let start = lists_start(words, material, level, layer);
            let [value_bits, shift] = value_bits_and_shift(word(words, start));
            let lists = (0..texels).map(|texel| list(words, start, count, texel)).collect();
            ListsModel { value_bits, shift, lists }
        };
        (0..header.layer_count).map(of_layer).collect()
    };
    let first = entries_start(words, material);
    TensorModel {
        channels,
        light_atoms,
        lights: (0..header.light_count * light_atoms).map(light).collect(),
        entries,
        atoms: (0..count).map(shifts).collect(),
        fibres: (0..header.view_count * count * entries)
            .map(|n| packed_i16(words, first, n) as u16)
            .collect(),
        lists: (0..header.level_count).map(of_level).collect(),
    }
}

/// Texels of a level.
pub fn texels_of_level(opened: &Selvedge<'_>, level: u32) -> u32 {
    let header = opened.header();
    [header.width, header.height].iter().map(|&size| level_size(size, level)).product()
}

/// The ABRDF atoms and values of a texel's list (12.4).
pub fn list(words: Words<'_>, start: u32, atom_count: u32, texel: u32) -> Vec<(u32, u16)> {
    let mut list = open_list(words, start, atom_count, texel);
    let mut coefficients = Vec::new();
    while list.index != LIST_END {
        // 12.4-5 backwards.
        let value = (list.coefficient + 0x8000) as u32 >> (16 - list.value_bits);
        coefficients.push((list.index, value as u16));
        list = next_coefficient(words, list);
    }
    coefficients
}
