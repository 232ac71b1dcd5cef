//! Speed of the decoder on one core, after its answers were checked.
//!
//!     RUSTFLAGS="-C target-cpu=x86-64-v3" cargo bench -p selvedge-tools --bench speed
//!
//! With `SELVEDGE_DATA` the full 400 x 400 material is measured, without it the excerpt in the repository.

use selvedge::kernel::interpolation::texel_values;
use selvedge::{Direction, FilteredQuery, Limits, Rgb, Selvedge};
use selvedge_tools::data::dataset::{Dataset, Sample};
use selvedge_tools::format::model::{MaterialModel, TransferModel};
use selvedge_tools::format::write;
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::encode::{Criterion, Options, encode, prepare};
use selvedge_tools::methods::sparse_ensemble::model::{ensembles, ensembles_mut};
use selvedge_tools::methods::sparse_ensemble::sparsebtf;
use selvedge_tools::synth::{Mesostructure, Request, synthesise};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs of each measurement; the median is printed with the range.
const RUNS: usize = 9;

/// Median, least and most of what a second does, given what one run does.
fn rate(per_run: f64, mut run: impl FnMut()) -> String {
    run();
    let mut rates: Vec<f64> = (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            run();
            per_run / begin.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    format!(
        "{:9.3} M/s  (range {:.3} to {:.3})",
        rates[RUNS / 2] / 1e6,
        rates[0] / 1e6,
        rates[RUNS - 1] / 1e6
    )
}

fn direction(random: &mut Random) -> Direction {
    // Uniform over the hemisphere.
    let unit = |word: u32| word as f32 / 4_294_967_296.0;
    let (z, azimuth) = (unit(random.word()), unit(random.word()) * std::f32::consts::TAU);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Direction::from_unit_vector([r * azimuth.cos(), r * azimuth.sin(), z])
}

/// Random queries over the whole image and hemisphere.
fn queries(seed: u64) -> Vec<FilteredQuery> {
    let mut random = Random::new(seed);
    (0..1 << 16)
        .map(|_| FilteredQuery {
            u_q32: random.word(),
            v_q32: random.word(),
            light: direction(&mut random),
            view: direction(&mut random),
        })
        .collect()
}

/// Mean operations of the records of a model: for one filtered sample, and for a texel of an image of one
/// channel.
///
/// Counted from the records themselves, by what 10.7 multiplies: an unpacked coefficient 1, its two columns 3
/// each where they change, their product and its own 1 each; a closed spatial atom 4. An image blends and
/// multiplies the columns once an atom, so that a coefficient costs 2 and a closed atom 2 a row or texel.
fn mean_operations(model: &MaterialModel) -> [f64; 2] {
    let edge = model.edge as f64;
    let (mut sample, mut image, mut channels, mut blocks) = (0.0, 0.0, 0.0, 1.0);
    for ensemble in ensembles(model) {
        let records = &ensemble.coefficients[0][0].records;
        channels += 1.0;
        blocks = records.len() as f64;
        for record in records {
            let (mut light, mut view, mut x, mut y) = (u32::MAX, u32::MAX, 0, 0);
            // The last atom is closed at the end.
            let (mut closed_x, mut closed_y) = (1.0, 1.0);
            for (position, _) in &record.coefficients {
                let atom = ensemble.atoms[record.dictionary as usize][*position as usize];
                sample += 3.0 + 3.0 * f64::from(atom.light != light) + 3.0 * f64::from(atom.view != view);
                closed_x += f64::from((atom.x, atom.y) != (x, y));
                closed_y += f64::from(atom.y != y);
                (light, view, x, y) = (atom.light, atom.view, atom.x, atom.y);
            }
            sample += 4.0 * (closed_x + closed_y);
            image +=
                2.0 * record.coefficients.len() as f64 + 2.0 * edge * closed_x + 2.0 * edge * edge * closed_y;
        }
    }
    // A filtered sample meets (1 + 1/edge)^2 blocks on average; a texel is scaled by one product more.
    [sample / blocks * (1.0 + 1.0 / edge).powi(2), image / blocks / channels / (edge * edge) + 2.0]
}

/// Filtered RGB samples of an encoded material whose samples meet `met` coefficients of each channel on
/// average.
fn encoded(folder: &Path, met: [usize; 3]) {
    const EDGE: usize = 16;
    let path = folder.join("cloth.selvset");
    if !path.exists() {
        let request = Request {
            kind: Mesostructure::Cloth,
            size: [64, 64],
            directions: 81,
            seed: 1,
            samples: 1,
            sample: Sample::Half,
        };
        synthesise(&request, &path, &|_, _| ()).expect("rendered");
    }
    let data = Dataset::open(&path).expect("just written");
    let prepared =
        prepare(vec![&data], TransferModel::Log2 { offset: data.statistics().log_offset() }, &|_, _| ())
            .expect("readable");
    // A sample meets (1 + 1/edge)^2 blocks in the mean.
    let blocks = (1.0 + 1.0 / EDGE as f64).powi(2);
    let counts = met.map(|n| (n as f64 / blocks).ceil() as usize);
    let options = Options { edge: EDGE, criterion: Criterion::Coefficients(counts), ..Options::default() };
    let encoded = encode(&prepared, &prepared.own_ensembles(EDGE), &options, &|_, _| ()).expect("encoded");
    let material = selvedge::open(&encoded.bytes, &Limits::NONE).expect("legal");
    let queries = queries(9);
    let mut scratch = vec![0; material.batch_scratch_len(queries.len())];
    let mut out = vec![Rgb::default(); queries.len()];
    material.sample_batch(&queries, &mut scratch, &mut out).expect("buffers fit");
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(
            material.filtered(query.u_q32, query.v_q32, query.light, query.view),
            *rgb,
            "the batch is not the plain path"
        );
    }
    for batch in [8_192, 16_384, 65_536] {
        println!(
            "filtered RGB, {met:?} coefficients met, batches of {batch:5} {}",
            rate(queries.len() as f64, || {
                for (queries, out) in queries.chunks(batch).zip(out.chunks_mut(batch)) {
                    material.sample_batch(queries, &mut scratch, out).expect("buffers fit");
                }
                black_box(&out);
            })
        );
    }
}

/// Random filtered samples, one by one and in batches, after both were compared.
fn samples(material: &Selvedge<'_>, queries: &[FilteredQuery]) {
    let mut scratch = vec![0; material.batch_scratch_len(queries.len())];
    let mut out = vec![Rgb::default(); queries.len()];
    material.sample_batch(queries, &mut scratch, &mut out).expect("buffers fit");
    let plain = |query: &FilteredQuery| material.filtered(query.u_q32, query.v_q32, query.light, query.view);
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(plain(query), *rgb, "the batch is not the plain path");
    }
    let count = queries.len() as f64;
    println!(
        "filtered, 2 x 64 coefficients, one by one     {}",
        rate(count / 8.0, || {
            for query in &queries[..queries.len() / 8] {
                black_box(plain(query));
            }
        })
    );
    for batch in [1 << 12, 1 << 14, 1 << 15, 1 << 16] {
        println!(
            "filtered, 2 x 64 coefficients, batches of {batch:5} {}",
            rate(count, || {
                for (queries, out) in queries.chunks(batch).zip(out.chunks_mut(batch)) {
                    material.sample_batch(queries, &mut scratch, out).expect("buffers fit");
                }
                black_box(&out);
            })
        );
    }
    println!(
        "two directions located                         {}",
        rate(count, || {
            for query in queries {
                black_box((material.locate_light(query.light), material.locate_view(query.view)));
            }
        })
    );
}

/// Channels that whole images are decoded of: those after the first.
const IMAGE_CHANNELS: [usize; 2] = [1, 2];

/// Asserts that a decoded channel has the values of the plain path.
fn assert_plain(material: &Selvedge<'_>, pair: [Direction; 2], channel: usize, values: &[i32]) {
    let width = material.image_size(0)[0];
    let (light, view) = (material.locate_light(pair[0]), material.locate_view(pair[1]));
    let (words, m) = (material.words(), material.material());
    for (i, value) in values.iter().enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let whole = texel_values(words, m, x, y, &light, &view);
        assert_eq!([whole.c0, whole.c1, whole.c2][channel], *value, "the image is not the plain path");
    }
}

/// Whole images of a pair of light and view, after they were compared with the plain path.
fn images(material: &Selvedge<'_>, [light, view]: [Direction; 2]) {
    let [width, height] = material.image_size(0);
    let texels = (width * height) as usize;
    let mut scratch = vec![0; material.image_scratch_len()];
    let mut values = vec![0; texels];
    for channel in IMAGE_CHANNELS {
        material.decode_channel(channel, 0, light, view, &mut scratch, &mut values).expect("buffers fit");
        assert_plain(material, [light, view], channel, &values);
    }
    println!(
        "whole image, channel texels (two channels)     {}",
        rate(2.0 * texels as f64, || {
            for channel in IMAGE_CHANNELS {
                material
                    .decode_channel(channel, 0, light, view, &mut scratch, &mut values)
                    .expect("buffers fit");
            }
            black_box(&values);
        })
    );
    let mut image = vec![Rgb::default(); texels];
    println!(
        "whole image, RGB texels                        {}",
        rate(texels as f64, || {
            material.decode_image(0, light, view, &mut scratch, &mut image).expect("buffers fit");
            black_box(&image);
        })
    );
}

/// Opens a file of about 5 MB: the records of a model over a taller image.
fn opening(mut model: MaterialModel) {
    let repeat = (5_000_000 / 400_000).min(16_000 / model.size[1]);
    model.size[1] *= repeat;
    for ensemble in ensembles_mut(&mut model) {
        let records = &mut ensemble.coefficients[0][0].records;
        let once = records.clone();
        (1..repeat).for_each(|_| records.extend(once.iter().cloned()));
    }
    let large = write::write_material(&model);
    selvedge::open(&large, &Limits::NONE).expect("legal");
    let open = rate(large.len() as f64, || {
        black_box(selvedge::open(&large, &Limits::NONE)).expect("legal");
    });
    println!("open, bytes of a file of {} bytes          {}", large.len(), open);
    println!("  so a file of 5,000,000 bytes of this kind opens in 5 s / (M/s)");
}

fn main() {
    // Cargo passes --bench; run as a test, there is nothing to do.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let (folder, size) = match std::env::var_os("SELVEDGE_DATA") {
        Some(data) => (PathBuf::from(data).join("sparsebtf"), None),
        None => (Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sparsebtf"), None),
    };
    println!("target features: avx2 {}, data {}", cfg!(target_feature = "avx2"), folder.display());
    let temporary = tempfile::tempdir().expect("a folder");
    encoded(temporary.path(), [256, 64, 64]);
    encoded(temporary.path(), [64, 16, 16]);
    let authors = sparsebtf::read_material(&folder, "carpet07", size).expect("data");
    let model = authors.to_model(10).expect("model");
    let bytes = write::write_material(&model);
    let material = selvedge::open(&bytes, &Limits::default()).expect("legal");
    let [sample, texel] = mean_operations(&model);
    println!("{} bytes, {} operations a filtered sample at worst", bytes.len(), material.header().operations);
    println!(
        "in the mean {sample:.0} operations for the records of a filtered sample, \
         {texel:.1} for a channel texel of an image"
    );
    let queries = queries(7);
    samples(&material, &queries);
    images(&material, [queries[0].light, queries[0].view]);
    opening(model);
}
