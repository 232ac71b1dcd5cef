//! The coverage list of the generator of legal but extreme files: the smallest and the largest of every
//! field, and every branch of the reconstruction, are reached by some seed or by a file that is made for it.

use selvedge::direction::hull_start;
use selvedge::ensemble::{coefficients_start, read_record};
use selvedge::words::word;
use selvedge::{Direction, Limits, Selvedge};
use selvedge_tools::check::extreme::{extreme_model, extreme_tensor};
use selvedge_tools::format::model::{
    AtomModel, CoefficientsModel, FactorModel, MaterialModel, RecordModel, TransferModel,
};
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use std::collections::BTreeSet;

/// What must be reached. Words behind a colon are values.
const LIST: &[&str] = &[
    "width: 1",
    "height: 1",
    "levels: 1",
    "levels: 15",
    "layers: 1",
    "layers: 8",
    "edge: 1",
    "edge: 16",
    "lights: 1",
    "lights: 2",
    "lights: 1024",
    "state: 0",
    "state: 1",
    "state: 2",
    "transfer: log",
    "transfer: linear",
    "offset: 0",
    "offset: least",
    "offset: 1",
    "exponent: -60",
    "exponent: 60",
    "cosine: no",
    "cosine: yes",
    "matrix: -32767",
    "matrix: 32767",
    "views: shared",
    "views: own",
    "triangles: none",
    "triangles: some",
    "horizon direction",
    "mean base: -2^26",
    "mean base: 2^26",
    "mean shift: 0",
    "mean shift: 11",
    "mean entry: -32767",
    "mean entry: 32767",
    "scale: none",
    "scale: some",
    "scale shift: 0",
    "scale shift: 8",
    "dictionaries: 1",
    "dictionaries: several",
    "columns: 1",
    "columns: 1024",
    "factor entry: -32767",
    "factor entry: 32767",
    "atom shift: 0",
    "atom shift: 15",
    "atom base: -32767",
    "atom base: 32767",
    "atom step: 0",
    "atom step: 65534",
    "atoms: none",
    "atoms: 65536",
    "value bits: 1",
    "value bits: 16",
    "record: empty",
    "record shift: 0",
    "record shift: 31",
    "low bits: 0",
    "low bits: 12",
    "high parts over a window",
    "record sum: 65535",
    "optional section",
    "external dictionary",
    "taps: triangle",
    "taps: hull edge",
    "taps: hull corner",
    "taps: one direction",
    "cosine: below the horizon",
    "cosine: less than one",
    "axis: one block",
    "axis: two blocks",
    "axis: wraps around",
    "values: limited above",
    "values: limited below",
    "record: limited",
    "between levels",
    "result: zero",
    "result: largest",
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
    "ABRDF atom: limited",
    "layer: limited",
    "tensor: external dictionary",
];

fn of_model(model: &MaterialModel, seen: &mut BTreeSet<String>) {
    let mut add = |name: &str, value: i64| {
        seen.insert(format!("{name}: {value}"));
    };
    add("width", model.size[0] as i64);
    add("height", model.size[1] as i64);
    add("levels", model.level_count as i64);
    add("layers", model.layer_count as i64);
    add("edge", model.edge as i64);
    add("lights", model.lights.len() as i64);
    model.matrix_q13.iter().for_each(|&entry| add("matrix", entry as i64));
    for (c, channel) in model.channels.iter().enumerate() {
        add("state", model.state(c) as i64);
        if let Some(mean) = &channel.mean {
            add("mean shift", mean.shift as i64);
            mean.entries.iter().filter(|e| e.abs() == 32_767).for_each(|&e| add("mean entry", e as i64));
        }
        if let Some(scale) = &channel.scale {
            add("scale shift", scale.shift as i64);
        }
        if let Some(ensemble) = &channel.ensemble {
            add("dictionaries", ensemble.dictionaries.len() as i64);
            for dictionary in &ensemble.dictionaries {
                for factor in [&dictionary.light, &dictionary.view, &dictionary.x, &dictionary.y] {
                    add("columns", factor.columns as i64);
                    factor
                        .entries
                        .iter()
                        .filter(|e| e.abs() == 32_767)
                        .for_each(|&e| add("factor entry", e as i64));
                }
            }
            for list in &ensemble.atoms {
                add("atoms", list.len() as i64);
                for atom in list {
                    add("atom shift", atom.shift as i64);
                    if atom.base.abs() == 32_767 {
                        add("atom base", atom.base as i64);
                    }
                    if [0, 65_534].contains(&atom.step) {
                        add("atom step", atom.step as i64);
                    }
                }
            }
            for coefficients in ensemble.coefficients.iter().flatten() {
                add("value bits", coefficients.value_bits as i64);
                coefficients.records.iter().for_each(|record| add("record shift", record.shift as i64));
            }
        }
    }
    let mut say = |holds: bool, what: &str| {
        if holds {
            seen.insert(what.to_owned());
        }
    };
    match model.transfer {
        TransferModel::Log2 { offset } => {
            say(true, "transfer: log");
            say(offset == 0.0, "offset: 0");
            say(offset == f32::MIN_POSITIVE, "offset: least");
            say(offset == 1.0, "offset: 1");
        }
        TransferModel::Linear { exponent } => {
            say(true, "transfer: linear");
            say(exponent == -60, "exponent: -60");
            say(exponent == 60, "exponent: 60");
        }
    }
    say(model.cosine_included, "cosine: yes");
    say(!model.cosine_included, "cosine: no");
    say(model.views.is_none(), "views: shared");
    say(model.views.is_some(), "views: own");
    say(model.lights.iter().any(|[x, y]| x * x + y * y == 1 << 28), "horizon direction");
    say(!model.extras.is_empty(), "optional section");
    for channel in &model.channels {
        say(channel.mean.as_ref().is_some_and(|m| m.base_q20 == -(1 << 26)), "mean base: -2^26");
        say(channel.mean.as_ref().is_some_and(|m| m.base_q20 == 1 << 26), "mean base: 2^26");
        say(channel.ensemble.is_some() && channel.scale.is_none(), "scale: none");
        say(channel.scale.is_some(), "scale: some");
        if let Some(ensemble) = &channel.ensemble {
            say(ensemble.dictionaries.len() > 1, "dictionaries: several");
            say(ensemble.atoms.iter().any(Vec::is_empty), "atoms: none");
            for record in ensemble.coefficients.iter().flatten().flat_map(|c| &c.records) {
                say(record.coefficients.is_empty(), "record: empty");
            }
        }
    }
}

/// What a sparse tensor has and its samples reach.
fn of_tensor(
    tensor: &selvedge_tools::format::model::TensorModel,
    material: &Selvedge<'_>,
    seen: &mut BTreeSet<String>,
) {
    use selvedge::tensor::{angular_q15, layer_q20, list_coefficient, list_low_bits};
    let mut say = |holds: bool, what: &str| {
        if holds {
            seen.insert(what.to_owned());
        }
    };
    let channels = tensor.channels.iter().filter(|&&full| full).count();
    say(channels == 0, "tensor: no texture");
    say(channels == 1, "tensor: one channel");
    say(channels == 3, "tensor: three channels");
    if channels == 0 {
        return;
    }
    say(tensor.light_atoms == 1, "light atoms: 1");
    say(tensor.light_atoms == 256, "light atoms: 256");
    say(tensor.lights.iter().flatten().any(|&entry| entry == -512), "light entry: -512");
    say(tensor.lights.iter().flatten().any(|&entry| entry == 511), "light entry: 511");
    say(tensor.entries == 1, "entries: 1");
    say(tensor.entries == 32, "entries: 32");
    say(tensor.atoms.len() == 1, "ABRDF atoms: 1");
    say(tensor.atoms.len() == 1024, "ABRDF atoms: 1024");
    say(tensor.atoms.iter().any(|atom| atom.angular == 0), "angular shift: 0");
    say(tensor.atoms.iter().any(|atom| atom.angular == 31), "angular shift: 31");
    say(tensor.atoms.iter().any(|atom| atom.gain == 0), "gain shift: 0");
    say(tensor.atoms.iter().any(|atom| atom.gain == 31), "gain shift: 31");
    let index_bits = 32 - (tensor.light_atoms - 1).leading_zeros();
    let value = |entry: &u16| (entry & !((1u32 << index_bits) - 1) as u16) as i16;
    say(tensor.fibres.iter().any(|entry| value(entry) == -32_768), "fibre value: -32768");
    let sum = |fibre: &[u16]| fibre.iter().map(|entry| value(entry).unsigned_abs() as u32).sum::<u32>();
    say(tensor.fibres.chunks(tensor.entries as usize).any(|fibre| sum(fibre) == 1 << 18), "fibre sum: 2^18");
    say(tensor.fibres.len() % 2 == 1, "fibres: odd number of entries");
    let atom_bits = 32 - (tensor.atoms.len() as u32 - 1).leading_zeros();
    for layer in tensor.lists.iter().flatten() {
        say(layer.value_bits == 1, "list value bits: 1");
        say(layer.value_bits == 15, "list value bits: 15");
        say(layer.shift == 0, "list shift: 0");
        say(layer.shift == 31, "list shift: 31");
        say(layer.lists.iter().all(Vec::is_empty), "lists: nothing in a layer");
        say(layer.lists.len() % 8 != 0, "group: part of it outside the image");
        for list in &layer.lists {
            say(list.is_empty(), "list: empty");
            say(list.len() > 31, "list: more than 31");
            let low_bits = list_low_bits(atom_bits, list.len() as u32);
            say(!list.is_empty() && low_bits == 0, "list low bits: 0");
            say(!list.is_empty() && low_bits == 9, "list low bits: 9");
            let part = |&(atom, value): &(u32, u16)| {
                list_coefficient(value as u32, layer.value_bits)
                    .unsigned_abs()
                    .div_ceil(1 << tensor.atoms[atom as usize].gain)
            };
            say(list.iter().map(part).sum::<u32>() == 65_534, "list sum: 65534");
        }
    }
    let (words, m) = (material.words(), material.material());
    let mut random = Random::new(tensor.fibres.len() as u64);
    for _ in 0..10 {
        let mut direction = || Direction {
            x_q18: random.range(-262_144, 262_144) as i32,
            y_q18: random.range(-262_144, 262_144) as i32,
            z_q15: 9,
        };
        let (light, view) = (material.locate_light(direction()), material.locate_view(direction()));
        let angular = angular_q15(words, m, 0, tensor.atoms[0].angular, light, view);
        say([angular.c0, angular.c1, angular.c2].iter().any(|c| c.abs() == 32_767), "ABRDF atom: limited");
        let axis = |size: u32, at: u32| {
            selvedge::position::axis_at_position(m.edge, m.edge_reciprocal_q18, size, at)
        };
        let texture = layer_q20(
            words,
            m,
            0,
            0,
            axis(m.width, random.word()),
            axis(m.height, random.word()),
            light,
            view,
        );
        say([texture.c0, texture.c1, texture.c2].iter().any(|c| c.abs() == 1 << 27), "layer: limited");
    }
}

/// What the file and samples of it reach.
fn of_samples(material: &Selvedge<'_>, seen: &mut BTreeSet<String>, seed: u64) {
    let mut say = |holds: bool, what: &str| {
        if holds {
            seen.insert(what.to_owned());
        }
    };
    let (m, words) = (*material.material(), material.words());
    say(word(words, m.light_start + 1) == 0, "triangles: none");
    say(word(words, m.light_start + 1) > 0, "triangles: some");
    for channel in m.channels.iter().filter(|channel| channel.state == 2 && channel.atoms_start != 0) {
        for layer in 0..m.layer_count {
            let start = coefficients_start(words, &m, *channel, 0, layer);
            for block in 0..word(words, start + 1).min(200) {
                let record = read_record(words, start, block);
                say(record.count > 0 && record.low_bits == 0, "low bits: 0");
                say(record.low_bits == 12, "low bits: 12");
            }
        }
    }
    let mut random = Random::new(seed);
    for _ in 0..60 {
        let mut direction = || Direction {
            x_q18: random.range(-262_144, 262_144) as i32,
            y_q18: random.range(-262_144, 262_144) as i32,
            z_q15: random.range(-2000, 32_768) as i32,
        };
        let (asked, view) = (direction(), direction());
        let taps = material.locate_light(asked);
        let hull = word(words, m.light_start + 2);
        say(taps.weight_c_q15 > 0, "taps: triangle");
        say(
            hull > 0 && taps.a != taps.b && taps.a == taps.c
                || hull > 0 && taps.weight_c_q15 == 0 && taps.weight_b_q15 > 0,
            "taps: hull edge",
        );
        say(hull > 0 && taps.a == taps.b && hull_start(words, m.light_start) > 0, "taps: hull corner");
        say(hull == 0, "taps: one direction");
        say(taps.cosine_q15 == 0, "cosine: below the horizon");
        say((1..32_768).contains(&taps.cosine_q15), "cosine: less than one");
        let u = random.word();
        let axis = selvedge::position::axis_at_position(m.edge, m.edge_reciprocal_q18, m.width, u);
        say(axis.count == 1, "axis: one block");
        say(axis.count == 2, "axis: two blocks");
        say(axis.count == 2 && axis.second.block < axis.first.block, "axis: wraps around");
        let view_taps = material.locate_view(view);
        let values = material.filtered_values(u, random.word(), taps, view_taps);
        for value in [values.c0, values.c1, values.c2] {
            say(value == 1 << 27, "values: limited above");
            say(value == -(1 << 27), "values: limited below");
        }
        let rgb = selvedge::interpolation::radiance(&m, values, taps).to_words();
        say(rgb.contains(&0), "result: zero");
        say(rgb.contains(&0x7f7f_ffff), "result: largest");
        if m.level_count > 1 {
            let (fine, half) =
                (material.trilinear(0, u, 7, asked, view), material.trilinear(0x8000, u, 7, asked, view));
            say(fine != half, "between levels");
        }
        for (c, channel) in m
            .channels
            .iter()
            .enumerate()
            .filter(|(_, channel)| channel.state == 2 && channel.atoms_start != 0)
        {
            let (x, y) =
                (axis, selvedge::position::axis_at_position(m.edge, m.edge_reciprocal_q18, m.height, 7));
            let block = y.first.block * selvedge::position::block_count(&m, m.width) + x.first.block;
            let record = read_record(words, coefficients_start(words, &m, *channel, 0, 0), block);
            if record.count > 0 && c < 3 {
                let texture = selvedge::ensemble::record_q20(
                    words, *channel, record, x.first, y.first, taps, view_taps,
                );
                say(texture.abs() == 1 << 25, "record: limited");
            }
        }
    }
}

/// Files that no random number would make.
fn made() -> Vec<MaterialModel> {
    let example = selvedge_tools::check::example::example_model;
    let ensemble_of = |edit: &dyn Fn(&mut selvedge_tools::format::model::EnsembleModel)| {
        let mut model = example();
        edit(model.channels[0].ensemble.as_mut().expect("full"));
        model
    };
    let only = |record: RecordModel| {
        vec![
            vec![CoefficientsModel { value_bits: 4, records: vec![record.clone(), RecordModel::default()] }],
            vec![CoefficientsModel { value_bits: 4, records: vec![RecordModel::default()] }],
        ]
    };
    // 1,024 columns of light and 64 of view: 65,536 atoms, of which the last alone is used, then sixteen far
    // apart.
    let atoms: Vec<AtomModel> = (0..65_536)
        .map(|i| AtomModel {
            light: i / 64,
            view: i % 64,
            step: 65_534,
            base: -32_767,
            ..AtomModel::default()
        })
        .collect();
    let crowd = |coefficients: Vec<(u32, u16)>| {
        ensemble_of(&|e| {
            e.dictionaries[0].light = FactorModel { columns: 1024, entries: vec![1; 5 * 1024] };
            e.dictionaries[0].view = FactorModel { columns: 64, entries: vec![1; 5 * 64] };
            e.atoms[0].clone_from(&atoms);
            e.coefficients =
                only(RecordModel { dictionary: 0, shift: 3, coefficients: coefficients.clone() });
        })
    };
    let mut deep = example();
    deep.size = [16_384, 1];
    deep.level_count = 15;
    deep.channels[0].ensemble = None;
    deep.channels[0].scale = None;
    let mut many = deep.clone();
    many.lights = (0..1024).map(|i| [i % 32 * 500 - 7750, i / 32 * 500 - 7750]).collect();
    for channel in many.channels.iter_mut().filter_map(|channel| channel.mean.as_mut()) {
        channel.entries = vec![7; 1024 * 1024];
    }
    many.level_count = 1;
    // 32,767 + 32,767 + 1: the largest sum that a record may have.
    let full = ensemble_of(&|e| {
        e.atoms[0]
            .iter_mut()
            .zip([-32_767i16, -32_767, 1])
            .for_each(|(atom, base)| (atom.base, atom.step, atom.shift) = (base, 0, 0));
        e.coefficients =
            only(RecordModel { dictionary: 0, shift: 0, coefficients: vec![(0, 0), (1, 0), (2, 0)] });
    });
    // A second dictionary, which has no atoms.
    let empty = ensemble_of(&|e| {
        e.dictionaries.push(e.dictionaries[0].clone());
        e.atoms.push(Vec::new());
    });
    vec![
        empty,
        crowd(vec![(65_535, 8)]),
        crowd((0..16).map(|i| (i * 4096 + 4095, 8)).collect()),
        deep,
        many,
        full,
    ]
}

#[test]
fn the_list_is_covered() {
    let mut seen = BTreeSet::new();
    let models = (0..400).map(extreme_model).chain(made()).chain((0..150).map(extreme_tensor));
    for (seed, model) in (0u64..).zip(models) {
        of_model(&model, &mut seen);
        let file = write_material(&model);
        let material =
            selvedge::open(&file, &Limits::NONE).unwrap_or_else(|finding| panic!("{seed}: {finding}"));
        of_samples(&material, &mut seen, seed);
        let ensembles = model.channels.iter().filter_map(|channel| channel.ensemble.as_ref());
        for ensemble in ensembles {
            let sum = |record: &RecordModel, bits: u32| -> u32 {
                let of = |&(position, value): &(u32, u16)| {
                    let atom = &ensemble.atoms[record.dictionary as usize][position as usize];
                    selvedge::ensemble::dequantise(atom.quantiser(), value as u32, bits)
                        .unsigned_abs()
                        .div_ceil(1 << atom.shift)
                };
                record.coefficients.iter().map(of).sum()
            };
            for (record, bits) in ensemble
                .coefficients
                .iter()
                .flatten()
                .flat_map(|c| c.records.iter().map(|record| (record, c.value_bits)))
            {
                if sum(record, bits) == 65_535 {
                    seen.insert("record sum: 65535".into());
                }
                // A window of the high parts is 32 bits; a gap of more than that many zeros needs a second.
                if record.coefficients.windows(2).any(|pair| pair[1].0 - pair[0].0 > 4096 * 32)
                    || record.coefficients.first().is_some_and(|c| c.0 >> 12 >= 8)
                {
                    seen.insert("high parts over a window".into());
                }
            }
        }
        if let Some(tensor) = &model.tensor {
            of_tensor(tensor, &material, &mut seen);
        }
        if (seed < 40 || model.tensor.is_some() && seed % 4 == 0) && model.has_texture() {
            let (split, dictionary) = write_split(&model);
            selvedge::open_with(&split, Some(&dictionary), &Limits::NONE).expect("legal");
            seen.insert(
                if model.tensor.is_some() { "tensor: external dictionary" } else { "external dictionary" }
                    .into(),
            );
        }
    }
    let missing: Vec<_> = LIST.iter().filter(|item| !seen.contains(**item)).collect();
    assert!(missing.is_empty(), "not reached: {missing:?}");
    println!("{} items reached", LIST.len());
}
