//! Small files that try to cost time or memory: each is refused for what it is, or its price is stated and a
//! sample keeps to it.
//!
//! Memory is no matter of the core, which has none (`firmware/` links it without an allocator). Work is
//! counted, not timed.

use selvedge::{Direction, Limits, Rule, Selvedge};
use selvedge_tools::check::count;
use selvedge_tools::format::container::{repair_checksums, take_apart};
use selvedge_tools::format::model::{ChannelModel, MaterialModel, PairTableModel};
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::example::example_model;
use selvedge_tools::methods::sparse_ensemble::model::EnsembleTexture;

fn set_word(file: &mut [u8], at: usize, value: u32) {
    file[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

fn refused(file: &[u8], limits: &Limits) -> Rule {
    selvedge::open(file, limits).expect_err("refused").rule
}

/// The dearest of some samples, which is within what the file states.
fn dearest(material: &Selvedge<'_>) -> u64 {
    let mut random = Random::new(5);
    let mut most = 0;
    for _ in 0..200 {
        let mut direction = || Direction {
            x_q18: random.range(-262_144, 262_144) as i32,
            y_q18: random.range(-262_144, 262_144) as i32,
            z_q15: random.range(0, 32_768) as i32,
        };
        let (light, view) = (direction(), direction());
        let level = random.word() % material.header().level_count;
        most = most.max(
            count::filtered(material, level, random.word(), random.word(), light, view)
                .expect("known")
                .operations,
        );
    }
    assert!(most <= material.header().operations as u64);
    most
}

/// The example without texture, its tables for as many directions as it then has.
fn plain(lights: Vec<[i32; 2]>) -> MaterialModel {
    let mut model = example_model();
    let table = PairTableModel { base_q20: 0, shift: 0, entries: vec![1; lights.len() * lights.len()] };
    model.lights = lights;
    model.texture = Box::new(EnsembleTexture::default());
    model.channels = [
        ChannelModel { mean: Some(table), ..ChannelModel::default() },
        ChannelModel::default(),
        ChannelModel::default(),
    ];
    model
}

#[test]
fn absurd_headers_end_at_the_header() {
    let good = write_material(&example_model());
    let claims = [
        (24, 4096, Rule::SectionCount),
        (24, u32::MAX, Rule::SectionCount),
        (12, 0xffff_fff0, Rule::FileLength),
        (32, u32::MAX, Rule::ImageSize),
    ];
    for (at, value, rule) in claims {
        let mut file = good.clone();
        set_word(&mut file, at, value);
        repair_checksums(&mut file);
        assert_eq!(refused(&file, &Limits::NONE), rule, "{at}");
    }
}

/// 268 million texels of one mean: a small legal file, whose images a caller's limit refuses and whose
/// samples cost little.
#[test]
fn a_huge_plain_image() {
    let mut model = plain(vec![[0, 0]]);
    model.size = [16_384, 16_384];
    model.level_count = 15;
    let file = write_material(&model);
    assert!(file.len() < 1024);
    assert_eq!(refused(&file, &Limits { texels: 1 << 20, ..Limits::NONE }), Rule::LimitTexels);
    let material = selvedge::open(&file, &Limits::NONE).expect("legal");
    assert!(dearest(&material) < 200);
}

/// All directions on one line: no triangle, and every query walks the whole hull. The price says so, and a
/// limit refuses it.
#[test]
fn a_line_of_a_thousand_directions() {
    let file = write_material(&plain((0..1024).map(|i| [i * 16 - 8192, 0]).collect()));
    let material = selvedge::open(&file, &Limits::NONE).expect("legal");
    let stated = material.header().operations;
    assert!(stated > 2 * 6 * 2046 && dearest(&material) > 2 * 6 * 2046, "{stated}");
    assert_eq!(refused(&file, &Limits { operations: stated - 1, ..Limits::NONE }), Rule::LimitOperations);
}

/// Triangles like spokes: one cell would hold them all, and a finer grid keeps to the limit of a cell or is
/// refused.
#[test]
fn a_thousand_spokes() {
    let mut lights: Vec<[i32; 2]> = vec![[0, 0]];
    lights.extend(
        (0..900)
            .map(|i| (i as f64 / 900.0 * std::f64::consts::TAU).sin_cos())
            .map(|(s, c)| [(c * 16_000.0) as i32, (s * 16_000.0) as i32]),
    );
    let file = write_material(&plain(lights));
    match selvedge::open(&file, &Limits::NONE) {
        Ok(material) => drop(dearest(&material)),
        Err(finding) => assert_eq!(finding.rule, Rule::GridCell),
    }
}

/// A material that names a dictionary of four gigabytes, and one that is given a dictionary which is not its
/// own.
#[test]
fn an_enormous_dictionary() {
    let (mut file, dictionary) = write_split(&example_model());
    let (_, parts) = take_apart(&file);
    assert_eq!(parts[1].kind, 2);
    let entry = 128 + 16;
    let offset =
        u32::from_le_bytes([file[entry + 4], file[entry + 5], file[entry + 6], file[entry + 7]]) as usize;
    set_word(&mut file, offset + 32, 0xffff_fff0);
    repair_checksums(&mut file);
    let limits = Limits { bytes: 1 << 20, ..Limits::NONE };
    let rule =
        |limits: &Limits| selvedge::open_with(&file, Some(&dictionary), limits).expect_err("refused").rule;
    assert_eq!((rule(&limits), rule(&Limits::NONE)), (Rule::LimitBytes, Rule::ExternalDigest));
}

/// Eight layers of three channels with as many coefficients as fit: the price is the sum, and no sample is
/// dearer.
#[test]
fn many_layers_of_full_records() {
    for seed in 0..400 {
        let file = write_material(&selvedge_tools::check::extreme::extreme_of_any_method(seed));
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        if material.header().layer_count == 8 {
            dearest(&material);
        }
    }
}
