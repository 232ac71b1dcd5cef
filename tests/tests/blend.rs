//! Blends meet both materials at their ends, and the mean of what both decode to in the middle.

use proptest::prelude::*;
use selvedge::kernel::interpolation::{VALUE_BOUND, filtered_values};
use selvedge::{Direction, Limits, Selvedge, Values};
use selvedge_tests::setting;
use selvedge_tools::check::extreme::extreme;
use selvedge_tools::format::blend::blend;
use selvedge_tools::format::model::{MaterialModel, TransferModel};
use selvedge_tools::format::texture::{Blend, BlendReport};
use selvedge_tools::format::trim::{Keep, Trim, trim};
use selvedge_tools::format::write::write_material;
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::read::read_model;
use selvedge_tools::methods::sparse_ensemble;
use selvedge_tools::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, FactorModel, RecordModel, ensemble_of,
    ensembles, ensembles_mut,
};
use selvedge_tools::methods::sparse_ensemble::quantise::{FloatRecord, quantise};

fn excerpt() -> MaterialModel {
    let file = std::fs::read(selvedge_tests::excerpt_file()).expect("excerpt");
    read_model(&file, None, &Limits::NONE).expect("legal")
}

fn extreme_ensemble(seed: u64) -> MaterialModel {
    extreme(&sparse_ensemble::METHOD, seed)
}

fn open(file: &[u8]) -> Selvedge<'_> {
    selvedge::open(file, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"))
}

fn cases(count: u32) -> ProptestConfig {
    ProptestConfig {
        cases: setting("SELVEDGE_CASES", count as usize) as u32,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn as_array(values: Values) -> [i32; 3] {
    [values.c0, values.c1, values.c2]
}

/// Values of one place and pair on one level.
fn values(material: &Selvedge<'_>, random: &mut Random) -> [i32; 3] {
    let r = random;
    let mut direction = || Direction {
        x_q18: r.range(-200_000, 200_000) as i32,
        y_q18: r.range(-200_000, 200_000) as i32,
        z_q15: r.range(0, 32_768) as i32,
    };
    let (light, view) = (material.locate_light(direction()), material.locate_view(direction()));
    let level = r.range(0, material.header().level_count as i64 - 1) as u32;
    as_array(filtered_values(material.words(), material.material(), level, r.word(), r.word(), &light, &view))
}

/// The largest difference, Q20, of a blend to the blend of what both decode to; values at the bound, where
/// they are cut, do not count.
fn largest_difference(
    a: &MaterialModel,
    b: &MaterialModel,
    alpha: f64,
    blended: &MaterialModel,
    count: u64,
) -> [f64; 3] {
    let files = [a, b, blended].map(write_material);
    let [a, b, c] = files.each_ref().map(|file| open(file));
    let mut largest = [0.0f64; 3];
    for seed in 0..count {
        let [a, b, c] = [&a, &b, &c].map(|material| values(material, &mut Random::new(seed)));
        for channel in 0..3 {
            let (a, b, c) = (a[channel], b[channel], c[channel]);
            if [a, b, c].iter().all(|value| value.abs() < VALUE_BOUND) {
                largest[channel] =
                    largest[channel].max((a as f64 * (1.0 - alpha) + b as f64 * alpha - c as f64).abs());
            }
        }
    }
    largest
}

/// A model of the same shape: other values, signs of columns, order of dictionaries.
fn varied(model: &MaterialModel, random: &mut Random) -> MaterialModel {
    let mut other = model.clone();
    for channel in &mut other.channels {
        channel.mean.iter_mut().for_each(|mean| mean.entries.iter_mut().for_each(|entry| *entry /= 2));
    }
    for ensemble in ensembles_mut(&mut other) {
        for dictionary in &mut ensemble.dictionaries {
            dictionary
                .light
                .entries
                .iter_mut()
                .chain(&mut dictionary.y.entries)
                .for_each(|entry| *entry = entry.wrapping_neg());
            dictionary.x.entries.reverse();
        }
        for record in ensemble.coefficients.iter_mut().flatten().flat_map(|layer| &mut layer.records) {
            record.coefficients.retain(|_| !random.once_in(3));
            if record.coefficients.is_empty() {
                (record.dictionary, record.shift) = (0, 5);
            }
        }
    }
    other
}

/// A bound, Q20, of what an exact blend loses in a channel: rounded quantisers and products of both, means,
/// scales.
fn exact_bound(models: [&MaterialModel; 3], channel: usize) -> f64 {
    let of_ensemble = |ensemble: &EnsembleModel| {
        let of_layer = |layer: &CoefficientsModel| {
            let of_record = |record: &RecordModel| {
                let atoms = &ensemble.atoms[record.dictionary as usize];
                let parts = record
                    .coefficients
                    .iter()
                    .map(|c| 2.0 * 32_768.0 / 2f64.powi(atoms[c.0 as usize].shift as i32) + 2.0);
                parts.sum::<f64>() / 2f64.powi(record.shift as i32) + 1.0
            };
            layer.records.iter().map(of_record).fold(0.0, f64::max)
        };
        // Four blocks at most meet in a sample.
        4.0 * ensemble
            .coefficients
            .iter()
            .map(|level| level.iter().map(of_layer).sum::<f64>())
            .fold(0.0, f64::max)
    };
    models
        .iter()
        .map(|model| {
            let (c, channel) = (channel, &model.channels[channel]);
            let scale = channel.scale.as_ref().map_or(1.0, |scale| 2f64.powi(scale.shift as i32));
            let mean = channel.mean.as_ref().map_or(0.0, |mean| 2f64.powi(mean.shift as i32) + 2.0);
            ensemble_of(model, c).map_or(0.0, of_ensemble) * scale + 2.0 * scale + mean
        })
        .sum()
}

/// The least shift of a channel's records that have coefficients.
fn least_shift(model: &MaterialModel, channel: usize) -> u32 {
    let ensemble = ensemble_of(model, channel).into_iter();
    let records =
        ensemble.flat_map(|ensemble| ensemble.coefficients.iter().flatten()).flat_map(|c| &c.records);
    records.filter(|record| !record.coefficients.is_empty()).map(|record| record.shift).min().unwrap_or(31)
}

fn is_same(a: &MaterialModel, b: &MaterialModel) -> bool {
    let (a, b) = (write_material(a), write_material(b));
    open(&a).decode_digest() == open(&b).decode_digest()
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn the_ends_are_the_materials(seed in 0u64..1_000_000, exact: bool) {
        let a = extreme_ensemble(seed);
        let b = varied(&a, &mut Random::new(seed));
        let options = Blend { exact, ..Blend::default() };
        let [first, last] = [0.0, 1.0].map(|alpha| blend(&a, &b, alpha, options).expect("alike").0);
        prop_assert!(is_same(&first, &a) && is_same(&last, &b));
    }

    #[test]
    fn exact_blends_lie_between(seed in 0u64..1_000_000, alpha in 0.01f64..0.99) {
        let a = trim(&extreme_ensemble(seed), &Trim { layers: Some(1), ..Trim::default() }).expect("a layer");
        let b = varied(&a, &mut Random::new(seed));
        let (blended, report) = match blend(&a, &b, alpha, Blend { exact: true, ..Blend::default() }) {
            Ok(blended) => blended,
            // Coefficients that fill a record to the brim at the coarsest shift.
            Err(error) => { prop_assert!(error.to_string().contains("beyond the format"), "{}", error); return Ok(()) }
        };
        prop_assert_eq!(report, BlendReport::default());
        let found = largest_difference(&a, &b, alpha, &blended, 60);
        for (channel, found) in found.into_iter().enumerate() {
            // A texture is cut at its bound before the mean is added, and a record at its own if its shift is below 6
            // (10.7-4); what follows is not linear.
            let is_cut = a.channels[channel].scale.is_some() || [&a, &b, &blended].iter().any(|model| least_shift(model, channel) < 6);
            prop_assert!(is_cut || found <= exact_bound([&a, &b, &blended], channel), "channel {}: {} {}", channel, found, exact_bound([&a, &b, &blended], channel));
        }
    }

    /// Whatever is blended gives a legal file, or a refusal, and never more coefficients than asked for.
    #[test]
    fn any_blend_is_legal(seed in 0u64..1_000_000, alpha in 0.0f64..1.0, most in 1u32..40) {
        let a = extreme_ensemble(seed);
        let b = varied(&a, &mut Random::new(seed));
        let options = Blend { most: Some(most), value_bits: Some(most % 16 + 1), ..Blend::default() };
        match blend(&a, &b, alpha, options) {
            Ok((blended, report)) => {
                open(&write_material(&blended));
                prop_assert!(report.lost.is_finite() && report.outside >= 0.0 && report.energy.is_finite());
                let records = ensembles(&blended).flat_map(|e| e.coefficients.iter().flatten()).flat_map(|c| &c.records);
                prop_assert!(alpha == 0.0 || records.into_iter().all(|record| record.coefficients.len() <= most as usize));
            }
            Err(error) => prop_assert_eq!(error.exit_code(), 1),
        }
    }

    /// One table of atoms for all levels and layers holds every value to its step.
    #[test]
    fn quantised_values_are_near(seed in 0u64..1_000_000) {
        let mut random = Random::new(seed);
        let r = &mut random;
        let (dictionaries, layers) = (r.range(1, 3) as usize, r.range(1, 4) as usize);
        let loud = 2f64.powi(r.range(-12, 4) as i32);
        let records: Vec<Vec<Vec<FloatRecord>>> = (0..r.range(1, 3))
            .map(|_| (0..layers).map(|layer| (0..r.range(1, 9)).map(|_| {
                let mut keys: Vec<u32> = (0..r.range(0, 12)).map(|_| r.range(0, 40) as u32).collect();
                keys.sort_unstable();
                keys.dedup();
                keys.reverse();
                let atom = |key: u32| AtomModel { light: key % 7, view: key / 7, x: key % 3, y: key % 2, ..AtomModel::default() };
                let list = keys.iter().map(|&key| (atom(key), r.range(-1000, 1000) as f64 / 1000.0 * loud / 8f64.powi(layer as i32))).collect();
                (r.range(0, dictionaries as i64 - 1) as usize, list)
            }).collect()).collect())
            .collect();
        let bits: Vec<Vec<u32>> = records.iter().map(|level| level.iter().map(|_| r.pick(&[1, 2, 8, 12, 16])).collect()).collect();
        let Ok((atoms, coefficients)) = quantise(&records, dictionaries, &bits) else {
            let sums = records.iter().flatten().flatten().map(|record| record.1.iter().map(|c| c.1.abs()).sum::<f64>());
            prop_assert!(sums.fold(0.0, f64::max) > 10.0);
            return Ok(());
        };
        for (level, (of_level, bits)) in coefficients.iter().zip(&bits).enumerate() {
            for (layer, (found, &bits)) in of_level.iter().zip(bits).enumerate() {
                prop_assert_eq!(found.value_bits, bits);
                for (record, (dictionary, list)) in found.records.iter().zip(&records[level][layer]) {
                    prop_assert_eq!(record.coefficients.len(), list.len());
                    prop_assert!(record.coefficients.is_sorted_by(|a, b| a.0 < b.0));
                    for (atom, value) in list {
                        let place = atoms[*dictionary].binary_search_by_key(&(atom.word() >> 4), |a| a.word() >> 4).expect("in the table");
                        let found = record.coefficients.iter().find(|c| c.0 as usize == place).expect("in the record").1;
                        let atom = atoms[*dictionary][place];
                        let unit = 2f64.powi((record.shift + 5 + atom.shift) as i32);
                        let decoded = selvedge::method::sparse_ensemble::dequantise(atom.quantiser(), found as u32, bits) as f64 / unit;
                        let step = atom.step as f64 / 2f64.powi(bits as i32);
                        prop_assert!((decoded - value).abs() <= (step / 2.0 + 1.5) / unit, "{} {} {}", decoded, value, step / unit);
                    }
                }
            }
        }
    }
}

/// The columns of a factor in another order, some with the other sign; gives the new place of each.
fn shuffle(factor: &mut FactorModel, random: &mut Random) -> Vec<u32> {
    let count = factor.columns as usize;
    let mut order: Vec<usize> = (0..count).collect();
    (1..count).for_each(|i| order.swap(i, random.range(0, i as i64) as usize));
    let signs: Vec<i16> = (0..count).map(|_| random.pick(&[1, -1])).collect();
    factor.entries = factor
        .entries
        .chunks(count)
        .flat_map(|row| order.iter().zip(&signs).map(|(&i, sign)| row[i] * sign))
        .collect();
    let mut places = vec![0; count];
    order.iter().enumerate().for_each(|(new, &old)| places[old] = new as u32);
    places
}

/// Other coefficients on dictionaries of the same spans: columns change their places and signs.
fn in_another_basis(model: &MaterialModel) -> MaterialModel {
    let mut random = Random::new(3);
    let mut other = model.clone();
    for ensemble in ensembles_mut(&mut other) {
        for k in 0..ensemble.dictionaries.len() {
            let DictionaryModel { light, view, x, y } = &mut ensemble.dictionaries[k];
            let places = [light, view, x, y].map(|factor| shuffle(factor, &mut random));
            let moved = |atom: &AtomModel| AtomModel {
                light: places[0][atom.light as usize],
                view: places[1][atom.view as usize],
                x: places[2][atom.x as usize],
                y: places[3][atom.y as usize],
                ..*atom
            };
            let mut sorted: Vec<(u32, AtomModel)> = (0..).zip(ensemble.atoms[k].iter().map(moved)).collect();
            sorted.sort_by_key(|(_, atom)| atom.word() >> 4);
            let mut new_position = vec![0; sorted.len()];
            (0u32..).zip(&sorted).for_each(|(new, (old, _))| new_position[*old as usize] = new);
            ensemble.atoms[k] = sorted.into_iter().map(|(_, atom)| atom).collect();
            for record in ensemble
                .coefficients
                .iter_mut()
                .flatten()
                .flat_map(|layer| &mut layer.records)
                .filter(|record| record.dictionary as usize == k)
            {
                record.coefficients.iter_mut().for_each(|c| c.0 = new_position[c.0 as usize]);
                record.coefficients.sort_unstable();
            }
        }
        // And another material.
        for record in ensemble.coefficients.iter_mut().flatten().flat_map(|layer| &mut layer.records) {
            record.coefficients.retain(|_| !random.once_in(3));
        }
    }
    other
}

/// Real dictionaries are nearly orthonormal, so equal spans lose next to nothing.
#[test]
fn a_change_of_basis_within_a_span_loses_nothing() {
    let a = excerpt();
    let b = in_another_basis(&a);
    open(&write_material(&b));
    for alpha in [0.25, 0.5] {
        let (blended, report) =
            blend(&a, &b, alpha, Blend { value_bits: Some(14), ..Blend::default() }).expect("alike");
        let found = largest_difference(&a, &b, alpha, &blended, 2000);
        println!("alpha {alpha}: {found:?} of 2^20, {report:?}");
        assert!(report.changed > 0 && report.lost < report.energy * 1e-4);
        let (exact, _) = blend(&a, &b, alpha, Blend { exact: true, ..Blend::default() }).expect("alike");
        let found_exact = largest_difference(&a, &b, alpha, &exact, 2000);
        println!("exact: {found_exact:?} of 2^20");
        assert!(found_exact.iter().all(|&d| d < 200.0));
        assert!(found.iter().all(|&d| d < 200.0));
    }
}

/// What is said to be lost is what decoded values miss, by the mean square of many.
#[test]
fn the_stated_loss_is_that_of_decoded_values() {
    let mut a = excerpt();
    a.channels.iter_mut().for_each(|channel| channel.scale = None);
    let mut b = a.clone();
    // Blocks the other way round stand on other dictionaries.
    for ensemble in ensembles_mut(&mut b) {
        ensemble.coefficients.iter_mut().flatten().for_each(|layer| layer.records.reverse());
    }
    for most in [None, Some(12)] {
        let (blended, report) =
            blend(&a, &b, 0.5, Blend { value_bits: Some(16), most, ..Blend::default() }).expect("alike");
        let files = [&a, &b, &blended].map(write_material);
        let [of_a, of_b, of_c] = files.each_ref().map(|file| open(file));
        let mut random = Random::new(1);
        let count = 300_000;
        let mut missed = 0.0;
        for _ in 0..count {
            let [x, y, light, view] =
                [a.size[0], a.size[1], 151, 151].map(|n| random.range(0, n as i64 - 1) as u32);
            let [p, q, r] =
                [of_a, of_b, of_c].map(|material| as_array(material.point_values(x, y, light, view)));
            missed += (0..3).map(|c| ((p[c] + q[c]) as f64 / 2.0 - r[c] as f64).powi(2)).sum::<f64>();
        }
        let samples = (a.size[0] * a.size[1]) as f64 * 151.0 * 151.0;
        let missed = missed / count as f64 * samples / 2f64.powi(40);
        println!("most {most:?}: {missed}, {report:?}");
        assert!((missed - report.lost).abs() < report.lost * 0.1, "{missed} {report:?}");
    }
}

/// On one dictionary coefficients add, whatever else differs.
#[test]
fn equal_dictionaries_add() {
    let a = excerpt();
    let mut b = a.clone();
    for ensemble in ensembles_mut(&mut b) {
        ensemble.coefficients.iter_mut().flatten().for_each(|layer| layer.records.reverse());
    }
    let (blended, report) =
        blend(&a, &b, 0.5, Blend { value_bits: Some(16), ..Blend::default() }).expect("alike");
    println!("{:?} of 2^20, {report:?}", largest_difference(&a, &b, 0.5, &blended, 1000));
    assert!(report.summed > 0);
    // With itself nothing changes but by rounding.
    let (same, report) =
        blend(&a, &a, 0.3, Blend { value_bits: Some(16), ..Blend::default() }).expect("alike");
    let found = largest_difference(&a, &a, 0.3, &same, 1000);
    println!("with itself: {found:?} of 2^20, {report:?}");
    assert!(report.changed == 0 && report.lost == 0.0 && found.iter().all(|&d| d < 200.0));
}

#[test]
fn materials_that_differ_are_refused() {
    let a = extreme_ensemble(8);
    let refuse = |b: MaterialModel, words: &str| {
        let error = blend(&a, &b, 0.5, Blend::default()).expect_err(words);
        assert!(error.exit_code() == 1 && error.to_string().contains(words), "{error}");
    };
    refuse(MaterialModel { size: [99, 99], ..a.clone() }, "image sizes");
    refuse(MaterialModel { edge: a.edge % 16 + 1, ..a.clone() }, "block edges");
    refuse(
        MaterialModel { lights: a.lights.iter().rev().chain([&[1, 1]]).copied().collect(), ..a.clone() },
        "light directions",
    );
    refuse(MaterialModel { matrix_q13: [1; 9], ..a.clone() }, "colour matrices");
    refuse(MaterialModel { cosine_included: !a.cosine_included, ..a.clone() }, "cosine flags");
    let other = match a.transfer {
        TransferModel::Log2 { offset } => {
            TransferModel::Log2 { offset: if offset == 0.5 { 0.25 } else { 0.5 } }
        }
        TransferModel::Linear { exponent } => TransferModel::Linear { exponent: exponent - 1 },
    };
    refuse(MaterialModel { transfer: other, ..a.clone() }, "log offsets or exponents");
    let fewer = trim(&a, &Trim { channels: [Keep::Nothing; 3], ..Trim::default() }).expect("nothing");
    refuse(fewer, "channel states");
    for alpha in [-0.1, 1.1, f64::NAN] {
        assert_eq!(blend(&a, &a, alpha, Blend::default()).expect_err("alpha").exit_code(), 1);
    }
    let a = excerpt();
    let mut b = a.clone();
    b.channels[1].scale.as_mut().expect("scales").entries[0] -= 1;
    let error = blend(&a, &b, 0.5, Blend::default()).expect_err("scales");
    assert!(error.to_string().contains("scales"), "{error}");
    let (apart, _) = blend(&a, &b, 0.5, Blend { scales_apart: true, ..Blend::default() }).expect("apart");
    open(&write_material(&apart));
}
