//! Files at the ends of what is legal: no sum of the decoder overflows, and no colour is not a number.

use super::case::{Case, Outcome, case};
use super::files::{direction, opened, upward};
use crate::check::extreme::extreme;
use crate::error::Result;
use crate::format::write::write_material;
use crate::math::random::Random;
use crate::methods::{METHODS, Method, sparse_tensor};
use selvedge::kernel::fixed::{multiply_q15, round_shift};
use selvedge::kernel::material::part;
use selvedge::kernel::position::axis_at_position;
use selvedge::kernel::words::word;
use selvedge::method::sparse_tensor::{
    FIBRES_PART, LIGHT_ATOMS_PART, LIST_END, angular_q15, blend_light, corner_weight, lists_start,
    next_coefficient, open_list,
};
use selvedge::{Selvedge, Taps};

/// Random materials of a case.
const SEEDS: u64 = 40;

pub(super) fn cases() -> Vec<Case> {
    let mut cases = vec![
        case(
            "largest legal",
            "sparse tensor: sums over fibres of extreme files",
            "files",
            "12.5-2: magnitudes of all products of an atom sum to 2^30 + 2^20 at most",
            |_| {
                let mut measured = 0.0f64;
                for seed in 0..SEEDS {
                    let bytes = write_material(&extreme(&sparse_tensor::METHOD, seed));
                    measured = measured.max(largest_fibre_sum(&opened(&bytes)?));
                }
                Ok(Outcome { condition: SEEDS as f64, bound: 2f64.powi(30) + 2f64.powi(20), measured })
            },
        ),
        case(
            "largest legal",
            "sparse tensor: sums of a texel of extreme files, in wide integers",
            "samples",
            "12.5-8: weights and products of all ABRDF atoms of a sample sum below 2^31 before they are \
            clamped",
            |_| layer_sums(),
        ),
    ];
    for &method in METHODS {
        cases.push(case(
            "largest legal",
            format!("{}: values of extreme files", method.title),
            "samples",
            "11.1: no colour that is not a finite number, or negative",
            move |_| extreme_values(method),
        ));
    }
    cases
}

/// The largest sums of layers over random samples of extreme sparse tensors.
fn layer_sums() -> Result<Outcome> {
    let mut random = Random::new(8);
    let (mut measured, mut samples) = (0.0f64, 0.0);
    for seed in 0..SEEDS {
        let bytes = write_material(&extreme(&sparse_tensor::METHOD, seed));
        let file = opened(&bytes)?;
        for _ in 0..if file.material().full_count > 0 { 200 } else { 0 } {
            let light = file.locate_light(direction(upward(&mut random))).taps;
            let view = file.locate_view(direction(upward(&mut random))).taps;
            let position = [random.word(), random.word()];
            measured = measured.max(largest_layer_sum(&file, position, light, view));
            samples += 1.0;
        }
    }
    Ok(Outcome { condition: samples, bound: 2f64.powi(31) - 1.0, measured })
}

/// How many colour values of extreme files are no radiances.
fn extreme_values(method: &Method) -> Result<Outcome> {
    let mut random = Random::new(9);
    let (mut measured, mut samples) = (0.0f64, 0.0);
    for seed in 0..SEEDS {
        let bytes = write_material(&extreme(method, seed));
        let file = opened(&bytes)?;
        for _ in 0..300 {
            let (light, view) = (direction(upward(&mut random)), direction(upward(&mut random)));
            let (u, v) = (random.word(), random.word());
            let rgb = file.filtered(u, v, light, view).to_f32();
            measured += rgb.iter().filter(|c| !c.is_finite() || c.is_sign_negative()).count() as f64;
            samples += 1.0;
        }
    }
    Ok(Outcome { condition: samples, bound: 0.0, measured })
}

/// The largest sum of a layer before it is clamped: magnitudes of the weights of an atom, and of the products
/// of all atoms, added in wide integers.
fn largest_layer_sum(file: &Selvedge<'_>, position: [u32; 2], light: Taps, view: Taps) -> f64 {
    let (words, m) = (file.words(), file.material());
    let atoms = word(words, part(m, FIBRES_PART));
    let ends = |size: u32, at: u32| {
        let axis = axis_at_position(m.edge, m.edge_reciprocal_q18, size, at);
        let whole = [(axis.first.block, 32_768)].to_vec();
        if axis.count == 2 {
            vec![(axis.first.block, axis.first.weight_a_q15), (axis.second.block, axis.second.weight_a_q15)]
        } else {
            whole
        }
    };
    let (x, y) = (ends(m.width, position[0]), ends(m.height, position[1]));
    let mut largest = 0i64;
    for layer in 0..m.layer_limit {
        let start = lists_start(words, m, 0, layer);
        let mut weights = std::collections::BTreeMap::<u32, (i64, i64)>::new();
        for &(row, weight_y) in &y {
            for &(column, weight_x) in &x {
                let mut list = open_list(words, start, atoms, row * m.width + column);
                while list.index != LIST_END {
                    let weight = corner_weight(list.coefficient, weight_x, weight_y) as i64;
                    let sum = weights.entry(list.index).or_default();
                    *sum = (sum.0 + weight, sum.1 + weight.abs());
                    list = next_coefficient(words, list);
                }
            }
        }
        let mut sums = [0i64; 3];
        for (atom, (weight, magnitude)) in weights {
            largest = largest.max(magnitude);
            let shifts = word(words, part(m, FIBRES_PART) + 2 + atom);
            let found = angular_q15(words, m, atom, shifts & 31, light, view);
            for (sum, angular) in sums.iter_mut().zip([found.c0, found.c1, found.c2]) {
                *sum +=
                    round_shift(multiply_q15(weight as i32, angular), shifts >> 5 & 31).unsigned_abs() as i64;
            }
        }
        largest = sums.into_iter().fold(largest, i64::max);
    }
    largest as f64
}

/// The largest sum of magnitudes of all products of an ABRDF atom, in wide integers, over all pairs of
/// directions.
fn largest_fibre_sum(file: &Selvedge<'_>) -> f64 {
    let (words, m) = (file.words(), file.material());
    if m.full_count == 0 {
        return 0.0;
    }
    let (atoms, shape) = (word(words, part(m, FIBRES_PART)), word(words, part(m, FIBRES_PART) + 1));
    let (entries, index_bits) = (shape & 0xff, shape >> 8 & 15);
    let (table, light_atoms) = (part(m, FIBRES_PART) + 2 + atoms, word(words, part(m, LIGHT_ATOMS_PART)));
    // One light at full weight: the largest that a blend can be.
    let tap = |a| Taps {
        a,
        b: a,
        c: a,
        weight_a_q15: 32_768,
        weight_b_q15: 0,
        weight_c_q15: 0,
        cosine_q15: 32_768,
    };
    let mut largest = 0i64;
    for view in 0..m.view_count {
        for atom in 0..atoms {
            for light in 0..m.light_count {
                let mut sums = [0i64; 3];
                for n in 0..entries {
                    let at = (view * atoms + atom) * entries + n;
                    let entry = word(words, table + (at >> 1)) >> ((at & 1) << 4) & 0xffff;
                    let index = entry & ((1 << index_bits) - 1);
                    let value = (((entry - index) << 16) as i32 >> 16) as i64;
                    let h = (value * 32_768 + 0x10000) >> 17;
                    let l = word(words, part(m, LIGHT_ATOMS_PART) + 2 + light * light_atoms + index);
                    (0..3).for_each(|c| {
                        sums[c as usize] += (h * blend_light(l, l, l, tap(light), c) as i64).abs()
                    });
                }
                // Three views share the weight, but each may be rounded up.
                largest = largest.max(sums.into_iter().max().unwrap_or(0));
            }
        }
    }
    largest as f64
}
