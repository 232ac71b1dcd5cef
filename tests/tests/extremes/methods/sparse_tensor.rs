//! What the sparse tensor must reach.

use crate::{Own, Seen, any_direction};
use selvedge::Selvedge;
use selvedge::kernel::position::{Place, axis_at_position};
use selvedge::method::sparse_tensor::check::{FIBRE_SUM_LIMIT, LIST_SUM_LIMIT};
use selvedge::method::sparse_tensor::{
    ANGULAR_BOUND, GROUP_TEXELS, LAYER_BOUND, angular_q15, bit_length, layer_q20, list_coefficient,
    list_low_bits,
};
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_tensor::layout::index_mask;
use selvedge_tools::methods::sparse_tensor::model::{TensorModel, tensor_of};

/// What the method must reach.
pub const OWN: Own = Own { name: "sparse-tensor", seeds: 150, list: LIST, reached, made };

/// What must be reached. Words behind a colon are values.
const LIST: &[&str] = &[
    "tensor: no texture",
    "tensor: one channel",
    "tensor: three channels",
    "light atoms: 1",
    "light atoms: 256",
    "light entry: -512",
    "light entry: 511",
    "entries: 1",
    "entries: 32",
    "ABRDF atoms: 1",
    "ABRDF atoms: 1024",
    "angular shift: 0",
    "angular shift: 31",
    "gain shift: 0",
    "gain shift: 31",
    "fibre value: -32768",
    "fibre sum: 2^18",
    "fibres: odd number of entries",
    "list value bits: 1",
    "list value bits: 15",
    "list shift: 0",
    "list shift: 31",
    "list: empty",
    "list: more than 31",
    "list low bits: 0",
    "list low bits: 9",
    "list sum: 65534",
    "lists: nothing in a layer",
    "group: part of it outside the image",
    "ABRDF atom: clamped",
    "layer: clamped",
    "external dictionary",
];

/// What a model has and samples of its file reach.
fn reached(model: &MaterialModel, material: &Selvedge<'_>, seen: &mut Seen) {
    let tensor = tensor_of(model).expect("a model of this method");
    let channels = tensor.channels.iter().filter(|&&full| full).count();
    seen.say(channels == 0, "tensor: no texture");
    seen.say(channels == 1, "tensor: one channel");
    seen.say(channels == 3, "tensor: three channels");
    if channels == 0 {
        return;
    }
    of_lists(tensor, seen);
    of_samples(tensor, material, seen);
    seen.say(tensor.light_atoms == 1, "light atoms: 1");
    seen.say(tensor.light_atoms == 256, "light atoms: 256");
    seen.say(tensor.lights.iter().flatten().any(|&entry| entry == -512), "light entry: -512");
    seen.say(tensor.lights.iter().flatten().any(|&entry| entry == 511), "light entry: 511");
    seen.say(tensor.entries == 1, "entries: 1");
    seen.say(tensor.entries == 32, "entries: 32");
    seen.say(tensor.atoms.len() == 1, "ABRDF atoms: 1");
    seen.say(tensor.atoms.len() == 1024, "ABRDF atoms: 1024");
    seen.say(tensor.atoms.iter().any(|atom| atom.angular == 0), "angular shift: 0");
    seen.say(tensor.atoms.iter().any(|atom| atom.angular == 31), "angular shift: 31");
    seen.say(tensor.atoms.iter().any(|atom| atom.gain == 0), "gain shift: 0");
    seen.say(tensor.atoms.iter().any(|atom| atom.gain == 31), "gain shift: 31");
    let mask = index_mask(tensor.light_atoms);
    let value = |entry: &u16| (entry & !mask) as i16;
    seen.say(tensor.fibres.iter().any(|entry| value(entry) == -32_768), "fibre value: -32768");
    let sum = |fibre: &[u16]| fibre.iter().map(|entry| value(entry).unsigned_abs() as u32).sum::<u32>();
    seen.say(
        tensor.fibres.chunks(tensor.entries as usize).any(|fibre| sum(fibre) == FIBRE_SUM_LIMIT),
        "fibre sum: 2^18",
    );
    seen.say(tensor.fibres.len() % 2 == 1, "fibres: odd number of entries");
}

fn of_lists(tensor: &TensorModel, seen: &mut Seen) {
    let atom_bits = bit_length(tensor.atoms.len() as u32 - 1);
    for layer in tensor.lists.iter().flatten() {
        seen.say(layer.value_bits == 1, "list value bits: 1");
        seen.say(layer.value_bits == 15, "list value bits: 15");
        seen.say(layer.shift == 0, "list shift: 0");
        seen.say(layer.shift == 31, "list shift: 31");
        seen.say(layer.lists.iter().all(Vec::is_empty), "lists: nothing in a layer");
        seen.say(layer.lists.len() as u32 % GROUP_TEXELS != 0, "group: part of it outside the image");
        for list in &layer.lists {
            seen.say(list.is_empty(), "list: empty");
            seen.say(list.len() > 31, "list: more than 31");
            let low_bits = list_low_bits(atom_bits, list.len() as u32);
            seen.say(!list.is_empty() && low_bits == 0, "list low bits: 0");
            seen.say(!list.is_empty() && low_bits == 9, "list low bits: 9");
            let part = |&(atom, value): &(u32, u16)| {
                list_coefficient(value as u32, layer.value_bits)
                    .unsigned_abs()
                    .div_ceil(1 << tensor.atoms[atom as usize].gain)
            };
            seen.say(list.iter().map(part).sum::<u32>() == LIST_SUM_LIMIT, "list sum: 65534");
        }
    }
}

fn of_samples(tensor: &TensorModel, material: &Selvedge<'_>, seen: &mut Seen) {
    let (words, m) = (material.words(), material.material());
    let mut random = Random::new(tensor.fibres.len() as u64);
    for _ in 0..10 {
        let light = material.locate_light(any_direction(&mut random)).taps;
        let view = material.locate_view(any_direction(&mut random)).taps;
        let angular = angular_q15(words, m, 0, tensor.atoms[0].angular, light, view);
        let bound = |values: [i32; 3], bound: i32| values.iter().any(|value| value.abs() == bound);
        seen.say(bound([angular.c0, angular.c1, angular.c2], ANGULAR_BOUND), "ABRDF atom: clamped");
        let mut axis = |size: u32| axis_at_position(m.edge, m.edge_reciprocal_q18, size, random.word());
        let (x, y) = (axis(m.width), axis(m.height));
        let texture = layer_q20(words, m, 0, &Place { level: 0, x, y }, light, view);
        seen.say(bound([texture.c0, texture.c1, texture.c2], LAYER_BOUND), "layer: clamped");
    }
}

/// Files that no random number would make: none are needed.
fn made() -> Vec<MaterialModel> {
    Vec::new()
}
