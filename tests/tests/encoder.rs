//! From data to files: threads and interruptions change no byte, goals are met as decoded, bad data are
//! refused or become a correct file.

use glam::DVec3;
use selvedge::{Limits, Selvedge};
use selvedge_tools::data::dataset::{Dataset, Description, Sample, Writer};
use selvedge_tools::data::directions;
use selvedge_tools::data::pyramid;
use selvedge_tools::data::transfer::Domain;
use selvedge_tools::encode::goal::{Goal, Verified};
use selvedge_tools::error::ToolError;
use selvedge_tools::format::model::{MetadataModel, TransferModel};
use selvedge_tools::format::write;
use selvedge_tools::math::random::Random;
use selvedge_tools::measure::compare::{Metrics, compare};
use selvedge_tools::measure::radiance::AtLevel;
use selvedge_tools::methods::sparse_ensemble::dictionary_file::{self, Training};
use selvedge_tools::methods::sparse_ensemble::encode::verified::encode_verified;
use selvedge_tools::methods::sparse_ensemble::encode::{Criterion, Encoded, Options, encode, prepare};
use selvedge_tools::methods::sparse_ensemble::train::{self, train};
use selvedge_tools::progress::Quiet;
use std::path::Path;

/// A small material with texture, relief and a highlight, of any size and number of directions.
fn material(path: &Path, size: [usize; 2], directions: usize, scale: f32, seed: u64) -> Dataset {
    let set: Vec<DVec3> = directions::grid(81).expect("known")[..directions].to_vec();
    let description = Description {
        size,
        lights: set.clone(),
        views: set.clone(),
        sample: Sample::Float,
        cosine_included: true,
        ..Description::default()
    };
    let writer = Writer::create(path, description).expect("created");
    let mut random = Random::new(seed);
    for texel in 0..size[0] * size[1] {
        let noise = |random: &mut Random| random.range(0, 1000) as f64 / 1000.0;
        let normal = DVec3::new(noise(&mut random) - 0.5, noise(&mut random) - 0.5, 2.0).normalize();
        let albedo = [noise(&mut random), 0.3, 0.5 * noise(&mut random)];
        let mut values = Vec::new();
        for view in &set {
            for light in &set {
                let shading = light.dot(normal).max(0.0);
                let highlight = (*light + *view).normalize_or_zero().dot(normal).max(0.0).powi(60);
                values.extend(albedo.map(|a| ((a * shading + highlight) as f32) * scale));
            }
        }
        writer.put(texel, 0, &values).expect("put");
    }
    writer.finish().expect("finished");
    Dataset::open(path).expect("opened")
}

fn transfer(data: &Dataset) -> TransferModel {
    TransferModel::Log2 { offset: data.statistics().coded_offset() }
}

fn open(bytes: &[u8]) -> Selvedge<'_> {
    selvedge::open(bytes, &Limits::NONE).expect("legal")
}

fn measured(data: &Dataset, bytes: &[u8]) -> Metrics {
    let file = open(bytes);
    compare(
        data,
        &AtLevel::finest(&file),
        data.description(),
        data.statistics().log_offset(),
        None,
        &|_, _| (),
    )
    .expect("alike")
}

fn verified(data: &Dataset, goal: Goal, options: &Options) -> Verified<Encoded> {
    let prepared = prepare(vec![data], transfer(data), &|_, _| ()).expect("readable");
    encode_verified(&prepared, &|edge| prepared.own_ensembles(edge), goal, options, &Quiet)
        .expect("reachable")
}

fn with_threads<T: Send>(count: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads").install(work)
}

fn small_training() -> train::Options {
    train::Options {
        dictionaries: 3,
        sparsity: [12, 6, 6],
        edge: 4,
        subspace: 10,
        blocks: 20,
        iterations: 4,
        ..train::Options::default()
    }
}

fn dictionary_bytes(data: &Dataset, trained: &train::Trained, options: train::Options) -> Vec<u8> {
    let description = data.description();
    let training = Training {
        lights: description.lights.clone(),
        views: description.views.clone(),
        options,
        ..Training::default()
    };
    dictionary_file::to_bytes(trained, &training, MetadataModel::default())
}

#[test]
fn threads_change_no_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [22, 19], 19, 1.0, 1);
    let run = || {
        let trained =
            train(&[&data], &small_training(), None, &mut |_| true).expect("trained").expect("not stopped");
        let prepared = prepare(vec![&data], transfer(&data), &|_, _| ()).expect("readable");
        let options = Options { edge: 4, criterion: Criterion::Rms(0.1), layers: 2, ..Options::default() };
        let encoded = encode(&prepared, &trained.ensembles, &options, &|_, _| ()).expect("encoded");
        (dictionary_bytes(&data, &trained, small_training()), encoded.bytes)
    };
    let (one, two, three) = (with_threads(1, run), with_threads(2, run), with_threads(3, run));
    assert!(one == two && two == three);
}

#[test]
fn a_stopped_training_goes_on_to_the_same_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [20, 20], 19, 1.0, 2);
    let whole =
        train(&[&data], &small_training(), None, &mut |_| true).expect("trained").expect("not stopped");
    let state = folder.path().join("state");
    let mut runs = 0;
    let pieces = loop {
        runs += 1;
        let mut steps = 0;
        let tell = &mut |_: train::Step| {
            steps += 1;
            steps < 2
        };
        if let Some(trained) = train(&[&data], &small_training(), Some(&state), tell).expect("trained") {
            break trained;
        }
        assert!(state.exists());
    };
    assert!(runs > 3 && !state.exists(), "{runs}");
    assert!(pieces == whole);
    // A state is not continued by another training.
    let _ = train(&[&data], &small_training(), Some(&state), &mut |_| false).expect("trained");
    let other = train::Options { seed: 9, ..small_training() };
    assert!(
        train(&[&data], &other, Some(&state), &mut |_| true)
            .expect_err("refused")
            .to_string()
            .contains("another training")
    );
}

#[test]
fn the_objective_never_rises_and_a_subspace_costs_little() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [32, 32], 19, 1.0, 3);
    let options = train::Options {
        dictionaries: 4,
        sparsity: [16, 8, 8],
        blocks: 60,
        iterations: 10,
        tolerance: 0.0,
        ..small_training()
    };
    let run = |subspace| {
        train(&[&data], &train::Options { subspace, ..options.clone() }, None, &mut |_| true)
            .expect("trained")
            .expect("not stopped")
    };
    let (fast, whole) = (run(14), run(19));
    for c in 0..3 {
        for trained in [&fast, &whole] {
            let o = &trained.objectives[c];
            assert!(o.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-6)), "channel {c}: {o:?}");
            assert!(o.last() < o.first());
            assert_eq!(trained.members[c].iter().sum::<usize>(), 60);
        }
        let [fast, whole] = [&fast, &whole].map(|t| *t.objectives[c].last().expect("iterations"));
        println!("channel {c}: subspace {fast:.6}, whole {whole:.6}");
        assert!(fast < whole * 1.01, "channel {c}: {fast} {whole}");
    }
}

#[test]
fn goals_hold_as_decoded() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [24, 20], 19, 1.0, 4);
    for edge in [0, 1, 3, 10] {
        let options = Options { edge, ..Options::default() };
        let v = verified(&data, Goal::Error(Domain::Log, 0.15), &options);
        let found = measured(&data, &v.encoded.bytes);
        assert!(found.log_rms <= 0.15 && found.log_rms > 0.13, "edge {edge}: {}", found.log_rms);
        assert!(
            (v.encoded.predicted_rms - found.log_rms).abs() < 0.03 * found.log_rms || 24 % edge.max(1) != 0,
            "edge {edge}"
        );
        let v = verified(&data, Goal::Bytes(16_000), &options);
        assert!(
            v.encoded.bytes.len() <= 16_000 && v.encoded.bytes.len() > 15_500,
            "edge {edge}: {}",
            v.encoded.bytes.len()
        );
    }
    let options = Options { edge: 4, ..Options::default() };
    let v = verified(&data, Goal::Error(Domain::Linear, 0.02), &options);
    assert!(measured(&data, &v.encoded.bytes).linear_rms <= 0.02);
    let v = verified(&data, Goal::Psnr(35.0), &options);
    assert!(measured(&data, &v.encoded.bytes).psnr_db >= 35.0);
    let free = verified(&data, Goal::Bytes(16_000), &options);
    let cap = free.operations / 2;
    let capped = verified(&data, Goal::Bytes(16_000), &Options { operations: Some(cap), ..options.clone() });
    assert!(capped.operations <= cap && capped.encoded.bytes.len() <= 16_000, "{} {cap}", capped.operations);
    let counts = Options { criterion: Criterion::Coefficients([9, 4, 2]), ..options };
    let v = verified(&data, Goal::AsGiven, &counts);
    assert_eq!(v.encoded.coefficients, [9 * 30, 4 * 30, 2 * 30]);
}

#[test]
fn layers_and_levels_are_coarser_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [21, 18], 19, 1.0, 5);
    let coarser = pyramid::levels(&data, 3, folder.path()).expect("levels");
    let levels: Vec<&Dataset> = std::iter::once(&data).chain(&coarser).collect();
    let prepared = prepare(levels, transfer(&data), &|_, _| ()).expect("readable");
    let options = Options { edge: 4, criterion: Criterion::Rms(0.08), layers: 3, ..Options::default() };
    let encoded = encode(&prepared, &prepared.own_ensembles(4), &options, &|_, _| ()).expect("encoded");
    let file = open(&encoded.bytes);
    assert_eq!((file.header().layer_count, file.header().level_count), (3, 3));
    let log_rms = |data: &Dataset, file: &Selvedge<'_>, level| {
        compare(data, &AtLevel { file, level }, data.description(), 1e-3, None, &|_, _| ())
            .expect("alike")
            .log_rms
    };
    let by_layers: Vec<f64> =
        (1..=3).map(|layers| log_rms(&data, &open(&encoded.bytes).with_layers(layers), 0)).collect();
    assert!(by_layers[0] > by_layers[1] && by_layers[1] > by_layers[2], "{by_layers:?}");
    for (level, data) in (1..).zip(&coarser) {
        assert!(log_rms(data, &file, level) < 0.15, "level {level}");
    }
}

#[test]
fn trained_dictionaries_serve_unseen_materials_inside_and_beside_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let [seen, unseen] =
        [6, 7].map(|seed| material(&folder.path().join(seed.to_string()), [24, 24], 19, 1.0, seed));
    let trained =
        train(&[&seen], &small_training(), None, &mut |_| true).expect("trained").expect("not stopped");
    let bytes = dictionary_bytes(&seen, &trained, small_training());
    let dictionary = dictionary_file::from_bytes(Path::new("d"), bytes.clone()).expect("legal");
    for (c, ensemble) in dictionary.ensembles.iter().enumerate() {
        // The file's bases are those of training, but for 16 bits.
        for k in 0..ensemble.turns.len() {
            for (a, b) in ensemble.angular(k).iter().zip(trained.ensembles[c].angular(k)) {
                let far = a.entries.iter().zip(&b.entries).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(far < 2e-4, "channel {c}, dictionary {k}: {far}");
            }
        }
    }
    let prepared = prepare(vec![&unseen], transfer(&unseen), &|_, _| ()).expect("readable");
    for edge in [4, 5] {
        let ensembles = dictionary.ensembles.each_ref().map(|e| e.with_edge(edge));
        let options = Options { edge, criterion: Criterion::Rms(0.12), ..Options::default() };
        let inside = encode(&prepared, &ensembles, &options, &|_, _| ()).expect("encoded");
        let options = Options { external: Some(bytes.as_slice().into()), ..options };
        let beside = encode(&prepared, &ensembles, &options, &|_, _| ()).expect("encoded");
        let file = selvedge::open_with(&beside.bytes, Some(&bytes), &Limits::NONE).expect("legal");
        let found = compare(
            &unseen,
            &AtLevel::finest(&file),
            unseen.description(),
            unseen.statistics().log_offset(),
            None,
            &|_, _| (),
        );
        let (inside, beside) = (measured(&unseen, &inside.bytes).log_rms, found.expect("alike").log_rms);
        assert!(inside < 0.14 && (inside - beside).abs() < 0.005, "edge {edge}: {inside} {beside}");
    }
}

/// Everything that is odd and legal becomes a correct file.
#[test]
fn odd_materials_become_correct_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    for (name, size, directions, scale) in [
        ("one texel", [1, 1], 7, 1.0),
        ("one direction", [9, 5], 1, 1.0),
        ("one texel and direction", [1, 1], 1, 1.0),
        ("black", [8, 8], 7, 0.0),
        ("hardly anything", [8, 8], 7, 1e-15),
        ("very bright", [8, 8], 7, 1e15),
    ] {
        let data = material(&path, size, directions, scale, 8);
        for edge in [1, 4, 16] {
            let prepared = prepare(vec![&data], transfer(&data), &|_, _| ())
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            let ensembles = |edge| prepared.own_ensembles(edge);
            let options = Options { edge, ..Options::default() };
            let verified =
                encode_verified(&prepared, &ensembles, Goal::Error(Domain::Log, 0.05), &options, &Quiet);
            let verified = verified.unwrap_or_else(|error| panic!("{name}, edge {edge}: {error}"));
            let found = measured(&data, &verified.encoded.bytes).log_rms;
            assert!(found <= 0.05, "{name}, edge {edge}: {found}");
        }
    }
    // Beyond what a channel can hold: told, not wrapped.
    let data = material(&path, [4, 4], 7, 1e-30, 8);
    let error = prepare(vec![&data], transfer(&data), &|_, _| ()).err().expect("refused").to_string();
    assert!(error.contains("beyond the format"), "{error}");
    // Constant: every number the same.
    let description = Description {
        size: [6, 6],
        lights: vec![DVec3::Z; 1],
        views: vec![DVec3::Z; 1],
        ..Description::default()
    };
    let writer = Writer::create(&path, description).expect("created");
    (0..36).for_each(|texel| writer.put(texel, 0, &[0.25, 0.5, 0.75]).expect("put"));
    writer.finish().expect("finished");
    let data = Dataset::open(&path).expect("opened");
    let v = verified(&data, Goal::Error(Domain::Log, 0.01), &Options { edge: 4, ..Options::default() });
    assert!(measured(&data, &v.encoded.bytes).log_rms < 1e-4);
    assert_eq!(v.encoded.coefficients, [0; 3]);
}

/// 600 beside 0.001: a highlight of few pairs on dark ground.
#[test]
fn stiff_values_are_coded_in_both_domains() {
    let folder = tempfile::tempdir().expect("a folder");
    let set: Vec<DVec3> = directions::grid(81).expect("known")[..19].to_vec();
    let description = Description {
        size: [12, 12],
        lights: set.clone(),
        views: set,
        sample: Sample::Float,
        ..Description::default()
    };
    let path = folder.path().join("stiff");
    let writer = Writer::create(&path, description).expect("created");
    let mut random = Random::new(3);
    for texel in 0..144 {
        let values: Vec<f32> = (0..19 * 19)
            .flat_map(|pair| {
                if pair % 20 == 0 && random.once_in(2) {
                    [600.0, 550.0, 500.0]
                } else {
                    [0.001, 0.0012, 0.0015]
                }
            })
            .collect();
        writer.put(texel, 0, &values).expect("put");
    }
    writer.finish().expect("finished");
    let data = Dataset::open(&path).expect("opened");
    let v = verified(&data, Goal::Error(Domain::Log, 0.05), &Options { edge: 2, ..Options::default() });
    assert!(measured(&data, &v.encoded.bytes).log_rms <= 0.05);
    let exponent = data.statistics().largest.log2().ceil() as i32 - 4;
    let prepared = prepare(vec![&data], TransferModel::Linear { exponent }, &|_, _| ()).expect("readable");
    let goal = Goal::Error(Domain::Linear, 1.0);
    let linear = encode_verified(
        &prepared,
        &|edge| prepared.own_ensembles(edge),
        goal,
        &Options { edge: 2, ..Options::default() },
        &Quiet,
    )
    .expect("reachable");
    assert!(measured(&data, &linear.encoded.bytes).linear_rms <= 1.0);
}

#[test]
fn goals_that_cannot_be_reached_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = material(&folder.path().join("a"), [8, 8], 7, 1.0, 9);
    let prepared = prepare(vec![&data], transfer(&data), &|_, _| ()).expect("readable");
    let run = |options: Options| {
        encode(&prepared, &prepared.own_ensembles(options.edge), &options, &|_, _| ())
            .map(|e| write::write_material(&e.model))
    };
    let few = run(Options { edge: 4, criterion: Criterion::Bytes(100), ..Options::default() })
        .expect_err("too small");
    assert!(matches!(few, ToolError::Unreachable { .. }) && few.to_string().contains("too few"), "{few}");
    let cap = Options { edge: 4, criterion: Criterion::Rms(0.1), operations: Some(10), ..Options::default() };
    let capped = run(cap).expect_err("too few");
    let words = capped.to_string();
    assert!(matches!(capped, ToolError::Unreachable { .. }) && words.contains("a cap of 10"), "{words}");
}
