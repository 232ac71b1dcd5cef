//! Legal files at the ends of what is legal, by seed: for the tests that hold decoders equal.
//!
//! Every field takes its smallest and largest value for some seed; sums come as close to their bounds
//! as random numbers get. What a seed gives is only promised to be legal, not to look like a material.

use crate::format::model::{
    AtomModel, AtomShifts, ChannelModel, CoefficientsModel, DictionaryModel, EnsembleModel, FactorModel,
    ListsModel, MaterialModel, MetadataModel, PairTableModel, RecordModel, TensorModel, TransferModel,
};
use crate::math::random::Random;
use selvedge::ensemble::dequantise;
use selvedge::ensemble_set::SUM_LIMIT;
use selvedge::material::level_size;
use selvedge::tensor::list_coefficient;
use selvedge::tensor_set::LIST_SUM_LIMIT;
use std::collections::BTreeSet;

/// A legal material by its seed.
pub fn extreme_model(seed: u64) -> MaterialModel {
    let mut model = extreme_model_from(&mut Random::new(seed), Reach::FULL);
    model.metadata.texts[0] = format!("seed {seed}");
    model
}

/// How large the models grow. It cuts counts, so every branch and every end of a *value* is within any reach.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// Most texels along an axis.
    texels: u32,
    /// Most directions of a set.
    directions: usize,
    /// Most columns of a factor.
    columns: i64,
    /// Most atoms that a dictionary is tried with.
    atoms: i64,
}

impl Reach {
    /// As large as tests of all sizes want them.
    pub const FULL: Reach = Reach { texels: 40, directions: 200, columns: 60, atoms: 400 };
    /// A few hundred of anything: what a fuzzer runs thousands of in a second.
    pub const SMALL: Reach = Reach { texels: 5, directions: 7, columns: 4, atoms: 9 };
}

/// A legal material by random numbers.
pub fn extreme_model_from(r: &mut Random, reach: Reach) -> MaterialModel {
    let any_size = r.range(2, reach.texels as i64) as u32;
    let size = [r.pick(&[any_size, any_size, 1, 2, 17]), r.pick(&[any_size / 2 + 1, any_size, 1, 3, 33])]
        .map(|s| s.min(reach.texels));
    let edge = r.range(1, 16) as u32;
    let most_levels = 1 + size[0].max(size[1]).next_power_of_two().trailing_zeros();
    let level_count = r.pick(&[1, 1, most_levels, r.clone().range(1, most_levels as i64) as u32]);
    let layer_count = r.pick(&[1, 1, 1, 2, 3, 8]);
    let offset = r.pick(&[0.0, 1.0, f32::MIN_POSITIVE, 1e-5, 0.7]);
    let transfer = if r.once_in(3) {
        TransferModel::Linear { exponent: r.pick(&[-60, -7, 0, 13, 60]) }
    } else {
        TransferModel::Log2 { offset }
    };
    let plain_matrix = r.once_in(2);
    let matrix_q13 =
        std::array::from_fn(|_| if plain_matrix { r.pick(&[0, 8192, 8192, -4096]) } else { r.entry() });
    let lights = extreme_directions(r, reach);
    let views = if r.once_in(3) { None } else { Some(extreme_directions(r, reach)) };
    let view_count = views.as_ref().map_or(lights.len(), Vec::len);
    let blocks: Vec<u32> = (0..level_count)
        .map(|level| size.map(|s| level_size(s, level).div_ceil(edge)).iter().product())
        .collect();
    let channels = std::array::from_fn(|_| {
        let state = r.pick(&[0, 1, 2, 2, 2, 2]);
        ChannelModel {
            mean: (state > 0).then(|| extreme_table(r, lights.len(), view_count, false)),
            scale: (state == 2 && r.once_in(2)).then(|| extreme_table(r, lights.len(), view_count, true)),
            ensemble: (state == 2)
                .then(|| extreme_ensemble(r, edge, lights.len(), view_count, &blocks, layer_count, reach)),
        }
    });
    let extras = if r.once_in(4) {
        vec![(0x8001, 7, vec![1; 4 * r.range(0, 9) as usize]), (0xffff, 0xffff, Vec::new())]
    } else {
        Vec::new()
    };
    MaterialModel {
        size,
        level_count,
        edge,
        layer_count,
        transfer,
        cosine_included: r.once_in(2),
        matrix_q13,
        metadata: MetadataModel {
            texel_nm: [r.word(), r.pick(&[0, u32::MAX])],
            frame: r.range(0, 2) as u32,
            image_origin: r.range(0, 2) as u32,
            primaries: r.range(0, 4) as u32,
            texts: [String::new(), "\u{10ffff}\u{e9}".repeat(r.range(0, 5) as usize), String::new()],
        },
        lights,
        views,
        channels,
        tensor: None,
        extras,
    }
}

/// A legal sparse tensor by its seed.
pub fn extreme_tensor(seed: u64) -> MaterialModel {
    let mut model = extreme_tensor_from(&mut Random::new(seed), Reach::FULL);
    model.metadata.texts[0] = format!("tensor {seed}");
    model
}

/// A legal material of any method by its seed.
pub fn extreme_of_any_method(seed: u64) -> MaterialModel {
    if seed % 3 == 2 { extreme_tensor(seed) } else { extreme_model(seed) }
}

/// A legal sparse tensor by random numbers: shared parts as [`extreme_model_from`] makes them, other
/// textures.
pub fn extreme_tensor_from(r: &mut Random, reach: Reach) -> MaterialModel {
    let mut model = extreme_model_from(r, reach);
    let channels = std::array::from_fn(|c| model.state(c) == 2);
    model.channels.iter_mut().for_each(|channel| channel.ensemble = None);
    model.edge = 1;
    let texels: Vec<u32> = (0..model.level_count)
        .map(|level| model.size.map(|s| level_size(s, level)).iter().product())
        .collect();
    let textured = channels.contains(&true);
    let (lights, views) = (model.lights.len(), model.views().len());
    model.tensor = Some(TensorModel {
        channels,
        ..if textured {
            extreme_atoms_of_tensor(r, channels, lights, views, reach)
        } else {
            TensorModel::default()
        }
    });
    if let Some(tensor) = model.tensor.as_mut().filter(|_| textured) {
        tensor.lists = texels
            .iter()
            .map(|&count| (0..model.layer_count).map(|_| extreme_lists(r, tensor, count)).collect())
            .collect();
    }
    model
}

fn extreme_atoms_of_tensor(
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
    let index_bits = 32 - (light_atoms - 1).leading_zeros();
    let mask = (1u32 << index_bits) - 1;
    let full = r.once_in(3);
    let mut fibres = Vec::new();
    for _ in 0..views as i64 * atoms {
        let mut left = 1 << 18;
        for _ in 0..entries {
            let any = r.range(-32_768, 32_767);
            let wanted = if full { r.pick(&[-32_768, 32_767]) } else { r.pick(&[any, any >> 4, 0, -32_768]) };
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

/// One, two, many, collinear, co-circular, nearly coincident, on the horizon.
fn extreme_directions(r: &mut Random, reach: Reach) -> Vec<[i32; 2]> {
    let in_disc = |[x, y]: [i32; 2]| x * x + y * y <= 1 << 28;
    let mut points: Vec<[i32; 2]> = Vec::new();
    match r.range(0, 9) {
        0 => points.push([r.range(-9000, 9000) as i32, r.range(-9000, 9000) as i32]),
        1 => points.extend([[r.pick(&[-16_384, 0]), 0], [r.pick(&[1, 16_384]), 0]]),
        2 => {
            let (dx, dy) = r.pick(&[(1, 0), (0, 1), (37, -12), (101, 100)]);
            let n = r.range(3, 40) as i32;
            points.extend((0..n).map(|i| [(i - n / 2) * dx, (i - n / 2) * dy]));
            points.sort_by_key(|p| (p[0] * 7919 + p[1] * 104_729) % 1009);
        }
        3 => points.extend([[16_384, 0], [0, 16_384], [-16_384, 0], [0, -16_384], [0, 0]]),
        4 => points.extend([[3, 5], [4, 5], [3, 6], [4, 6], [5, 5]]),
        5 => {
            // Pythagorean points: exactly co-circular.
            let base = [
                [3, 4],
                [4, 3],
                [5, 0],
                [4, -3],
                [3, -4],
                [0, -5],
                [-3, -4],
                [-4, -3],
                [-5, 0],
                [-4, 3],
                [-3, 4],
                [0, 5],
            ];
            let scale = r.range(1, 3276) as i32;
            points.extend(base.map(|p| p.map(|c| c * scale)));
        }
        6 => {
            // Rings as measured grids have them.
            points.push([0, 0]);
            for ring in 1..=r.range(1, 6) {
                let n = ring * 6;
                let radius = ring as f64 * 2100.0;
                points.extend(
                    (0..n)
                        .map(|i| (i as f64 / n as f64 * std::f64::consts::TAU).sin_cos())
                        .map(|(s, c)| [(c * radius) as i32, (s * radius) as i32]),
                );
            }
        }
        7 => points.extend(
            (0..r.range(3, 60)).map(|_| [r.range(-60, 60) as i32 * 190, r.range(-60, 60) as i32 * 190]),
        ),
        _ => {
            let reach = r.pick(&[40, 2000, 16_384]);
            points.extend(
                (0..r.range(4, 90)).map(|_| [r.range(-reach, reach) as i32, r.range(-reach, reach) as i32]),
            );
        }
    }
    let mut seen = BTreeSet::new();
    points.retain(|&p| in_disc(p) && seen.insert(p));
    points.truncate(reach.directions);
    if points.is_empty() {
        points.push([0, 0]);
    }
    points
}

fn extreme_table(r: &mut Random, lights: usize, views: usize, is_scale: bool) -> PairTableModel {
    let any = r.range(-(1 << 26), 1 << 26) as i32;
    let base_q20 = if is_scale { 0 } else { r.pick(&[0, any >> 6, any, 1 << 26, -(1 << 26)]) };
    let most = if is_scale { 8 } else { 11 };
    let shift = r.pick(&[0, most, r.clone().range(0, most) as u32 as i64]) as u32;
    PairTableModel { base_q20, shift, entries: (0..lights * views).map(|_| r.entry()).collect() }
}

fn extreme_factor(r: &mut Random, rows: usize, most_columns: i64) -> FactorModel {
    let columns = r.range(1, most_columns) as u32;
    let constant = r.once_in(4).then(|| r.pick(&[32_767i16, -32_767]));
    FactorModel {
        columns,
        entries: (0..rows * columns as usize).map(|_| constant.unwrap_or_else(|| r.entry())).collect(),
    }
}

fn extreme_ensemble(
    r: &mut Random,
    edge: u32,
    lights: usize,
    views: usize,
    blocks: &[u32],
    layers: u32,
    reach: Reach,
) -> EnsembleModel {
    let dictionaries: Vec<DictionaryModel> = (0..r.range(1, 4))
        .map(|_| {
            let most = r.pick(&[3, 20, 60]).min(reach.columns);
            DictionaryModel {
                light: extreme_factor(r, lights, most),
                view: extreme_factor(r, views, most),
                x: extreme_factor(r, edge as usize, (edge as i64).min(reach.columns)),
                y: extreme_factor(r, edge as usize, (edge as i64).min(reach.columns)),
            }
        })
        .collect();
    let atoms: Vec<Vec<AtomModel>> = dictionaries.iter().map(|d| extreme_atoms(r, d, reach)).collect();
    let value_bits = r.pick(&[1, 8, 16, r.clone().range(1, 16) as u32]);
    let coefficients = blocks
        .iter()
        .map(|&count| {
            (0..layers)
                .map(|_| CoefficientsModel {
                    value_bits,
                    records: (0..count).map(|_| extreme_record(r, &atoms, value_bits)).collect(),
                })
                .collect()
        })
        .collect();
    EnsembleModel { dictionaries, atoms, coefficients }
}

fn extreme_atoms(r: &mut Random, d: &DictionaryModel, reach: Reach) -> Vec<AtomModel> {
    let mut of_key = std::collections::BTreeMap::new();
    for _ in 0..r.pick(&[1, 5, 60, 400]).min(reach.atoms) {
        let mut column = |factor: &FactorModel| r.range(0, factor.columns as i64 - 1) as u32;
        let (light, view, x, y) = (column(&d.light), column(&d.view), column(&d.x), column(&d.y));
        let base = r.entry();
        let room = 32_767 - base as i64;
        let step = r.pick(&[0, room, r.clone().range(0, room)]) as u16;
        let atom = AtomModel {
            light,
            view,
            x,
            y,
            shift: r.pick(&[0, 15, r.clone().range(0, 15) as u32]),
            base,
            step,
        };
        of_key.insert(atom.word() >> 4, atom);
    }
    of_key.into_values().collect()
}

fn extreme_record(r: &mut Random, atoms: &[Vec<AtomModel>], value_bits: u32) -> RecordModel {
    let dictionary = r.range(0, atoms.len() as i64 - 1) as u32;
    let list = &atoms[dictionary as usize];
    if r.once_in(6) || list.is_empty() {
        return RecordModel::default();
    }
    let keep = r.pick(&[1, 1, 2, 9]);
    let most = (1u32 << value_bits) - 1;
    let mut sum = 0;
    let mut coefficients = Vec::new();
    for (position, atom) in (0u32..).zip(list) {
        let value = r.pick(&[0, most, r.clone().range(0, most as i64) as u32]) as u16;
        let part =
            dequantise(atom.quantiser(), value as u32, value_bits).unsigned_abs().div_ceil(1 << atom.shift);
        if r.once_in(keep) && sum + part <= SUM_LIMIT {
            sum += part;
            coefficients.push((position, value));
        }
    }
    if coefficients.is_empty() {
        return RecordModel::default();
    }
    RecordModel { dictionary, shift: r.pick(&[0, 31, r.clone().range(0, 31) as u32]), coefficients }
}
