//! Counts what the textures of a sample cost, by walking its lists: the multiplications of values that 4.2
//! prices.
//!
//! The arithmetic of 12.5 a second time, by maps instead of a merge of lists (the core has it in its plain
//! path and its fast ones): a walk that strays from the decoder is found out by its values.

use crate::methods::sample::SampleAt;
use crate::methods::sparse_tensor::layout::{
    CHANNEL_BITS, FIBRE_SHIFT, LIGHT_SHIFT, atom_count, atom_shifts, entries_start, fibre_shape, light_row,
    value_bits_and_shift,
};
use selvedge::kernel::fixed::{ONE_Q15, clamp_magnitude, multiply_q15, round_shift};
use selvedge::kernel::material::level_size;
use selvedge::kernel::position::Axis;
use selvedge::kernel::words::{packed_i16, word};
use selvedge::method::sparse_tensor::{
    ANGULAR_BOUND, LAYER_BOUND, LIST_END, lists_start, next_coefficient, open_list,
};
use selvedge::{Selvedge, Taps, Values};
use std::collections::BTreeMap;

/// A coefficient: a product, and one in halves.
const OF_COEFFICIENT: u64 = 3;
/// An entry of a fibre: its weight, three channels of three lights, and three products.
const OF_ENTRY: u64 = 13;
/// An ABRDF atom: its weight into three channels, in halves.
const OF_ATOM: u64 = 6;

/// The textures of a sample, and the operations that they take.
pub fn count(opened: &Selvedge<'_>, at: &SampleAt, operations: &mut u64) -> Values {
    let mut sums = [0i32; 3];
    for layer in 0..opened.material().layer_limit {
        let part = walk_layer(opened, layer, at, operations);
        sums.iter_mut().zip(part).for_each(|(sum, part)| *sum = sum.wrapping_add(part));
    }
    let [c0, c1, c2] = sums;
    Values { c0, c1, c2 }
}

/// Texels of an axis and their weights, Q15.
fn ends(axis: Axis) -> Vec<(u32, i32)> {
    let Axis { first, second, .. } = axis;
    match axis.count {
        2 => vec![(first.block, first.weight_a_q15), (second.block, second.weight_a_q15)],
        _ => vec![(first.block, ONE_Q15)],
    }
}

fn taps(taps: Taps) -> [(u32, i32); 3] {
    [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)]
}

/// One layer.
fn walk_layer(opened: &Selvedge<'_>, layer: u32, at: &SampleAt, operations: &mut u64) -> [i32; 3] {
    let (words, m) = (opened.words(), opened.material());
    let start = lists_start(words, m, at.place.level, layer);
    let mut weights = BTreeMap::<u32, i32>::new();
    for (row, weight_y) in ends(at.place.y) {
        for (column, weight_x) in ends(at.place.x) {
            let texel = row * level_size(m.width, at.place.level) + column;
            let mut list = open_list(words, start, atom_count(words, m), texel);
            while list.index != LIST_END {
                *operations += OF_COEFFICIENT;
                let weight = weights.entry(list.index).or_default();
                *weight = weight.wrapping_add(multiply_q15(list.coefficient * weight_x, weight_y));
                list = next_coefficient(words, list);
            }
        }
    }
    let mut total = [0i32; 3];
    for (atom, weight) in weights {
        let [angular_shift, gain_shift] = atom_shifts(words, m, atom);
        *operations += OF_ATOM;
        for (total, sum) in total.iter_mut().zip(walk_atom(opened, atom, at, operations)) {
            let angular = clamp_magnitude(round_shift(sum, angular_shift), ANGULAR_BOUND);
            *total = total.wrapping_add(round_shift(multiply_q15(weight, angular), gain_shift));
        }
    }
    let [_, shift] = value_bits_and_shift(word(words, start));
    total.map(|total| clamp_magnitude(round_shift(total, shift), LAYER_BOUND))
}

/// The sums of an ABRDF atom over its three fibres, in each channel.
fn walk_atom(opened: &Selvedge<'_>, atom: u32, at: &SampleAt, operations: &mut u64) -> [i32; 3] {
    let (words, m) = (opened.words(), opened.material());
    let ([entries, index_bits], first) = (fibre_shape(words, m), entries_start(words, m));
    let mask = (1u32 << index_bits) - 1;
    let rounded = |value: i32, shift: u32| (value + (1 << (shift - 1))) >> shift;
    let light_entry = |light: u32, index: u32, c: usize| {
        let unused = u32::BITS - CHANNEL_BITS;
        let entry = word(words, light_row(words, m, light) + index);
        (entry << (unused - c as u32 * CHANNEL_BITS)) as i32 >> unused
    };
    let mut sums = [0i32; 3];
    for (view, weight) in taps(at.view.taps) {
        let fibre = (view * atom_count(words, m) + atom) * entries;
        for n in 0..entries {
            let entry = packed_i16(words, first, fibre + n) as u32 & 0xffff;
            let (index, value) = (entry & mask, (entry & !mask) as u16 as i16 as i32);
            *operations += OF_ENTRY;
            let h = rounded(value * weight, FIBRE_SHIFT);
            for (c, sum) in sums.iter_mut().enumerate() {
                let lights = taps(at.light.taps).map(|(light, weight)| light_entry(light, index, c) * weight);
                *sum += h * rounded(lights.iter().sum(), LIGHT_SHIFT);
            }
        }
    }
    sums
}
