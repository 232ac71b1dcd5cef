//! What the sparse ensemble must reach.

use crate::{Own, Seen, any_direction};
use selvedge::Selvedge;
use selvedge::kernel::material::{CHANNEL_FULL, channel_of};
use selvedge::kernel::position::{axis_at_position, block_count};
use selvedge::kernel::words::word;
use selvedge::method::sparse_ensemble::check::{LOW_BITS_LIMIT, SUM_LIMIT};
use selvedge::method::sparse_ensemble::{
    RECORD_BOUND, coefficients_start, dequantise, read_record, record_q20, tables_of,
};
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::example::example_model;
use selvedge_tools::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, EnsembleModel, FactorModel, RecordModel, ensembles, ensembles_mut,
};

/// What the method must reach.
pub const OWN: Own = Own { name: "sparse-ensemble", seeds: 400, list: LIST, reached, made };

/// What must be reached. Words behind a colon are values.
const LIST: &[&str] = &[
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
    "record: clamped",
    "external dictionary",
];

/// What a model has and samples of its file reach.
fn reached(model: &MaterialModel, material: &Selvedge<'_>, seen: &mut Seen) {
    ensembles(model).for_each(|ensemble| of_ensemble(ensemble, seen));
    of_samples(material, seen);
}

fn of_ensemble(ensemble: &EnsembleModel, seen: &mut Seen) {
    seen.add("dictionaries", ensemble.dictionaries.len() as i64);
    seen.say(ensemble.dictionaries.len() > 1, "dictionaries: several");
    seen.say(ensemble.atoms.iter().any(Vec::is_empty), "atoms: none");
    for dictionary in &ensemble.dictionaries {
        for factor in [&dictionary.light, &dictionary.view, &dictionary.x, &dictionary.y] {
            seen.add("columns", factor.columns as i64);
            seen.ends("factor entry", &factor.entries);
        }
    }
    for list in &ensemble.atoms {
        seen.add("atoms", list.len() as i64);
        for atom in list {
            seen.add("atom shift", atom.shift as i64);
            seen.ends("atom base", &[atom.base]);
            seen.say(atom.step == 0, "atom step: 0");
            seen.say(atom.step == 65_534, "atom step: 65534");
        }
    }
    for layer in ensemble.coefficients.iter().flatten() {
        seen.add("value bits", layer.value_bits as i64);
        layer.records.iter().for_each(|record| of_record(ensemble, record, layer.value_bits, seen));
    }
}

fn of_record(ensemble: &EnsembleModel, record: &RecordModel, value_bits: u32, seen: &mut Seen) {
    seen.add("record shift", record.shift as i64);
    seen.say(record.coefficients.is_empty(), "record: empty");
    let part = |&(position, value): &(u32, u16)| {
        let atom = &ensemble.atoms[record.dictionary as usize][position as usize];
        dequantise(atom.quantiser(), value as u32, value_bits).unsigned_abs().div_ceil(1 << atom.shift)
    };
    seen.say(record.coefficients.iter().map(part).sum::<u32>() == SUM_LIMIT, "record sum: 65535");
    // A window of the high parts is 32 bits; a gap of more than that many zeros needs a second.
    let first = record.coefficients.first().is_some_and(|c| c.0 >> LOW_BITS_LIMIT >= 8);
    let far = |pair: &[(u32, u16)]| pair[1].0 - pair[0].0 > 32 << LOW_BITS_LIMIT;
    seen.say(first || record.coefficients.windows(2).any(far), "high parts over a window");
}

fn of_samples(material: &Selvedge<'_>, seen: &mut Seen) {
    let (m, words) = (*material.material(), material.words());
    let mut random = Random::new(m.width as u64);
    for number in (0..3).filter(|&number| channel_of(&m, number).state == CHANNEL_FULL) {
        let tables = tables_of(&m, number);
        for layer in 0..m.layer_count {
            let start = coefficients_start(words, &m, tables.full_rank, 0, layer);
            for block in 0..word(words, start + 1).min(200) {
                let record = read_record(words, start, block);
                seen.say(record.count > 0 && record.low_bits == 0, "low bits: 0");
                seen.say(record.low_bits == LOW_BITS_LIMIT, "low bits: 12");
            }
        }
        for _ in 0..60 {
            let mut axis = |size: u32| axis_at_position(m.edge, m.edge_reciprocal_q18, size, random.word());
            let (x, y) = (axis(m.width), axis(m.height));
            let light = material.locate_light(any_direction(&mut random)).taps;
            let view = material.locate_view(any_direction(&mut random)).taps;
            let block = y.first.block * block_count(&m, m.width) + x.first.block;
            let record = read_record(words, coefficients_start(words, &m, tables.full_rank, 0, 0), block);
            if record.count > 0 {
                let texture = record_q20(words, tables, record, x.first, y.first, light, view);
                seen.say(texture.abs() == RECORD_BOUND, "record: clamped");
            }
        }
    }
}

/// Files that no random number would make.
fn made() -> Vec<MaterialModel> {
    let ensemble_of = |edit: &dyn Fn(&mut EnsembleModel)| {
        let mut model = example_model();
        edit(ensembles_mut(&mut model).next().expect("full"));
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
    vec![empty, crowd(vec![(65_535, 8)]), crowd((0..16).map(|i| (i * 4096 + 4095, 8)).collect()), full]
}
