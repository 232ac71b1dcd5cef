//! Sparse tensors at the ends of what is legal.

use crate::format::model::MaterialModel;
use crate::math::random::Random;
use crate::methods::reach::Reach;
use crate::methods::sparse_ensemble;
use crate::methods::sparse_tensor::layout::index_mask;
use crate::methods::sparse_tensor::model::{AtomShifts, ListsModel, TensorModel};
use selvedge::kernel::material::level_size;
use selvedge::method::sparse_tensor::check::{FIBRE_SUM_LIMIT, LIST_SUM_LIMIT};
use selvedge::method::sparse_tensor::list_coefficient;
use std::collections::BTreeSet;

/// Ends of a fibre's entry.
const LEAST: i64 = i16::MIN as i64;
const LARGEST: i64 = i16::MAX as i64;

/// A legal material by random numbers.
///
/// The shared parts are those of a sparse ensemble of the same numbers, whose textures go: the numbers in
/// between are drawn as when the suite's vectors were made.
pub fn extreme_model(r: &mut Random, reach: Reach) -> MaterialModel {
    let mut model = sparse_ensemble::extreme::extreme_model(r, reach);
    let channels = model.texture.channels();
    model.edge = 1;
    model.metadata.texts[0] = "tensor".into();
    let (lights, views) = (model.lights.len(), model.views().len());
    let mut tensor = TensorModel { channels, ..TensorModel::default() };
    if channels.contains(&true) {
        tensor = extreme_atoms(r, channels, lights, views, reach);
        let texels = |level| model.size.map(|s| level_size(s, level)).iter().product();
        tensor.lists = (0..model.level_count)
            .map(|level| (0..model.layer_count).map(|_| extreme_lists(r, &tensor, texels(level))).collect())
            .collect();
    }
    model.texture = Box::new(tensor);
    model
}

/// Light atoms, fibres and shifts, without lists.
fn extreme_atoms(
    r: &mut Random,
    channels: [bool; 3],
    lights: usize,
    views: usize,
    reach: Reach,
) -> TensorModel {
    let light_atoms = r.pick(&[1, 2, 3, 16, 40, 255, 256]).min(reach.columns * 5) as u32;
    let ten_bits =
        |r: &mut Random| r.pick(&[-512, 511, 0, r.clone().range(-512, 511), r.clone().range(-9, 9)]) as i16;
    let entry = |r: &mut Random| std::array::from_fn(|c| if channels[c] { ten_bits(r) } else { 0 });
    let entries = r.pick(&[1, 2, 3, 9, 32]);
    let atoms = r
        .pick(&[1, 2, 7, 64, 65, 300, 1024])
        .min(reach.atoms * 3)
        .min(300_000 / (views as i64 * entries))
        .max(1);
    let mask = index_mask(light_atoms) as u32;
    let full = r.once_in(3);
    let mut fibres = Vec::new();
    for _ in 0..views as i64 * atoms {
        let mut left = FIBRE_SUM_LIMIT;
        for _ in 0..entries {
            let any = r.range(LEAST, LARGEST);
            let wanted = if full { r.pick(&[LEAST, LARGEST]) } else { r.pick(&[any, any >> 4, 0, LEAST]) };
            let mut value = wanted as i16 as u16 as u32 & !mask;
            if (value as u16 as i16).unsigned_abs() as u32 > left {
                value = 0;
            }
            left -= (value as u16 as i16).unsigned_abs() as u32;
            fibres.push((value | r.range(0, light_atoms as i64 - 1) as u32) as u16);
        }
    }
    let shift = |r: &mut Random| {
        r.pick(&[0, 15, 31, r.clone().range(8, 18), r.clone().range(8, 18), r.clone().range(0, 31)]) as u32
    };
    TensorModel {
        channels,
        light_atoms,
        lights: (0..lights * light_atoms as usize).map(|_| entry(r)).collect(),
        entries: entries as u32,
        atoms: (0..atoms)
            .map(|_| AtomShifts {
                angular: shift(r),
                gain: r.pick(&[0, 31, r.clone().range(0, 31), r.clone().range(0, 3)]) as u32,
            })
            .collect(),
        fibres,
        lists: Vec::new(),
    }
}

fn extreme_lists(r: &mut Random, tensor: &TensorModel, texels: u32) -> ListsModel {
    let value_bits = r.pick(&[1, 8, 15, r.clone().range(1, 15)]) as u32;
    let most = r.pick(&[0, 1, 3, 11, 63]);
    let last = tensor.atoms.len() as i64 - 1;
    let list = |r: &mut Random| {
        let mut indices = BTreeSet::new();
        if most == 63 && last >= 62 && r.once_in(3) {
            indices.extend(0..63);
        }
        for _ in 0..r.range(0, most - indices.len() as i64) {
            indices
                .insert(r.pick(&[0, last, r.clone().range(0, last), r.clone().range(0, last.min(6))]) as u32);
        }
        let mut sum = 0;
        let mut coefficients = Vec::new();
        for index in indices {
            let value = r.pick(&[
                0,
                (1 << value_bits) - 1,
                1 << (value_bits - 1),
                r.clone().range(0, (1 << value_bits) - 1),
            ]) as u32;
            let part = list_coefficient(value, value_bits)
                .unsigned_abs()
                .div_ceil(1 << tensor.atoms[index as usize].gain);
            if sum + part <= LIST_SUM_LIMIT {
                sum += part;
                coefficients.push((index, value as u16));
            }
        }
        coefficients
    };
    let lists = (0..texels).map(|_| list(r)).collect();
    ListsModel { value_bits, shift: r.pick(&[0, 31, r.clone().range(0, 12)]) as u32, lists }
}
