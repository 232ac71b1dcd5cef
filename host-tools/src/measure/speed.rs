//! How fast filtered samples are, of files and of baselines: in turn with a reference in one run, medians
//! with their range.
//!
//! Machines differ and are never quiet, so every measurement is paired: a run of the subject follows a run of
//! the reference, which is a routine of fixed work, and the ratio of both is told beside the rate. Ratios are
//! what two lines of a table may be compared by.

use crate::math::random::Random;
use crate::measure::baseline::decoder::{Decoder, Locator};
use rayon::prelude::*;
use selvedge::{Direction, FilteredQuery, Rgb, Selvedge};
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::time::Instant;

/// Runs of each measurement.
const RUNS: usize = 5;
/// Seconds of a run, about.
const SECONDS: f64 = 0.04;
/// Samples of a batch.
const BATCH: usize = 8192;
/// Queries that runs go through, again and again.
const QUERIES: usize = 1 << 16;

/// A rate in samples a second, and how it spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Rate {
    /// Median.
    pub median: f64,
    /// Slowest run.
    pub least: f64,
    /// Fastest run.
    pub most: f64,
    /// Median of the ratios to the reference's run before it.
    pub to_reference: f64,
}

/// Rates of filtered RGB samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Speed {
    /// Random positions and directions, one core, in batches.
    pub random: Rate,
    /// Scan lines of a picture: neighbours in position, one light, views that move slowly; one core, in
    /// batches.
    pub coherent: Rate,
    /// Random, one by one.
    pub single: Rate,
    /// Random, in batches on all cores.
    pub random_all: Rate,
    /// Coherent, in batches on all cores.
    pub coherent_all: Rate,
    /// Random, by the kernel on an adapter, transfers included.
    pub kernel: Option<Rate>,
    /// The reference itself.
    pub reference: Rate,
}

/// What a kernel's rate is taken on: an adapter, if there is one.
pub struct Adapter {
    #[cfg(feature = "gpu")]
    gpu: Option<crate::gpu::runner::Gpu>,
    /// Its name, or why there is none.
    pub name: String,
}

impl Adapter {
    /// The first that is there.
    #[cfg(feature = "gpu")]
    pub fn any() -> Adapter {
        match crate::gpu::runner::Gpu::any() {
            Ok(Some(gpu)) => Adapter { name: gpu.description.clone(), gpu: Some(gpu) },
            Ok(None) => Adapter { name: "no adapter was found".into(), gpu: None },
            Err(error) => Adapter { name: error.to_string(), gpu: None },
        }
    }

    /// None: this build has no kernel runner.
    #[cfg(not(feature = "gpu"))]
    pub fn any() -> Adapter {
        Adapter { name: "built without the kernel's runner".into() }
    }
}

/// Random queries over the hemisphere.
pub fn random_queries(count: usize) -> Vec<FilteredQuery> {
    let mut random = Random::new(9);
    (0..count)
        .map(|_| {
            let (u_q32, v_q32) = (random.word(), random.word());
            FilteredQuery { u_q32, v_q32, light: upward(&mut random), view: upward(&mut random) }
        })
        .collect()
}

fn upward(random: &mut Random) -> Direction {
    let unit = |word: u32| word as f64 / 4_294_967_296.0;
    let (z, azimuth) = (unit(random.word()), unit(random.word()) * std::f64::consts::TAU);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Direction::from_unit_vector([r * azimuth.cos(), r * azimuth.sin(), z].map(|c| c as f32))
}

/// Queries of pictures of 256 x 64 pixels: two texels a pixel, one light each.
pub fn coherent_queries(count: usize, [width, height]: [usize; 2]) -> Vec<FilteredQuery> {
    let mut random = Random::new(10);
    let mut light = upward(&mut random);
    let (mut start, mut tilt) = ([0; 2], 0.0f64);
    (0..count)
        .map(|i| {
            let (x, y) = (i % 256, i / 256 % 64);
            if x == 0 && y == 0 {
                light = upward(&mut random);
                start = [random.word(), random.word()];
                tilt = random.range(100, 1200) as f64 / 1000.0;
            }
            let step = |size: usize| (1u64 << 31) / size as u64;
            let position =
                |start: u32, at: usize, size: usize| start.wrapping_add((at as u64 * step(size)) as u32);
            let (angle, azimuth) = (tilt + x as f64 / 2000.0, y as f64 / 1000.0);
            let view =
                [angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos()].map(|c| c as f32);
            FilteredQuery {
                u_q32: position(start[0], x, width),
                v_q32: position(start[1], y, height),
                light,
                view: Direction::from_unit_vector(view),
            }
        })
        .collect()
}

/// A routine of fixed work that other rates are divided by: thirty-six fetches of three numbers, weighed,
/// from a table that fits into a second-level cache.
struct Reference {
    table: Vec<[f32; 3]>,
}

impl Reference {
    fn new() -> Reference {
        Reference { table: (0..1 << 15).map(|i| [i as f32, 1.0, 0.5]).collect() }
    }

    fn run(&self, samples: usize) -> [f32; 3] {
        let mut state = 1u32;
        let mut sum = [0.0f32; 3];
        for _ in 0..samples * 36 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let entry = self.table[(state >> 17) as usize];
            (0..3).for_each(|c| sum[c] += entry[c] * 0.25);
        }
        sum
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Times a routine that makes so many samples, in turn with the reference.
fn timed(reference: &Reference, reference_rates: &mut Vec<f64>, mut run: impl FnMut(usize)) -> Rate {
    let rate_of = |samples: usize, run: &mut dyn FnMut(usize)| {
        let begun = Instant::now();
        run(samples);
        samples as f64 / begun.elapsed().as_secs_f64().max(1e-9)
    };
    // Warm, and long enough to be measured.
    let mut samples = 256;
    let mut rate = rate_of(samples, &mut run);
    while (samples as f64) < rate * SECONDS * 0.5 {
        samples = (samples * 4).min((rate * SECONDS) as usize).max(samples + 1);
        rate = rate_of(samples, &mut run);
    }
    let mut by_reference = |samples: usize| {
        black_box(reference.run(samples));
    };
    let reference_samples = (rate_of(20_000, &mut by_reference) * SECONDS * 0.5) as usize;
    let (mut rates, mut ratios) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let of_reference = rate_of(reference_samples, &mut by_reference);
        let of_subject = rate_of(samples, &mut run);
        reference_rates.push(of_reference);
        rates.push(of_subject);
        ratios.push(of_subject / of_reference);
    }
    let median_rate = median(&mut rates);
    Rate { median: median_rate, least: rates[0], most: rates[RUNS - 1], to_reference: median(&mut ratios) }
}

/// Parts of `length` of a list that is gone through again and again, `samples` in all.
fn parts(queries: &[FilteredQuery], samples: usize, length: usize) -> impl Iterator<Item = &[FilteredQuery]> {
    let count = queries.len() / length;
    (0..samples.div_ceil(length)).map(move |i| {
        let part = &queries[i % count * length..][..length];
        &part[..length.min(samples - i * length)]
    })
}

/// Measures the two orders of queries, on one core and all; `batch` answers some queries and gives something
/// that depends on all answers.
fn measure<S>(
    size: [usize; 2],
    scratch: impl Fn() -> S + Sync,
    batch: impl Fn(&mut S, &[FilteredQuery]) -> u32 + Sync,
    single: impl Fn(&FilteredQuery) -> u32,
) -> Speed {
    let reference = Reference::new();
    let (random, coherent) = (random_queries(QUERIES), coherent_queries(QUERIES, size));
    let mut of_reference = Vec::new();
    let mut one = scratch();
    let mut on_one = |queries: &[FilteredQuery], of_reference: &mut Vec<f64>| {
        timed(&reference, of_reference, |samples| {
            parts(queries, samples, BATCH).for_each(|part| {
                black_box(batch(&mut one, part));
            })
        })
    };
    let (random_one, coherent_one) =
        (on_one(&random, &mut of_reference), on_one(&coherent, &mut of_reference));
    let on_all = |queries: &[FilteredQuery], of_reference: &mut Vec<f64>| {
        timed(&reference, of_reference, |samples| {
            // Several for each core, so that none waits for long.
            let length = (samples / (4 * rayon::current_num_threads())).clamp(64, BATCH);
            let all: Vec<&[FilteredQuery]> = parts(queries, samples, length).collect();
            all.par_iter().for_each_init(&scratch, |scratch, part| {
                black_box(batch(scratch, part));
            });
        })
    };
    let (random_all, coherent_all) =
        (on_all(&random, &mut of_reference), on_all(&coherent, &mut of_reference));
    let by_one = timed(&reference, &mut of_reference, |samples| {
        (0..samples).for_each(|i| {
            black_box(single(&random[i % QUERIES]));
        })
    });
    let median_rate = median(&mut of_reference);
    let last = of_reference.len() - 1;
    Speed {
        random: random_one,
        coherent: coherent_one,
        single: by_one,
        random_all,
        coherent_all,
        kernel: None,
        reference: Rate {
            median: median_rate,
            least: of_reference[0],
            most: of_reference[last],
            to_reference: 1.0,
        },
    }
}

fn folded(rgb: Rgb) -> u32 {
    let [r, g, b] = rgb.to_words();
    r ^ g ^ b
}

/// A file's rates.
pub fn of_file(file: &Selvedge<'_>, adapter: &Adapter) -> Speed {
    let size = file.image_size(0).map(|n| n as usize);
    let scratch = || (vec![0i32; file.batch_scratch_len(BATCH)], vec![Rgb::default(); BATCH]);
    let batch = |(scratch, out): &mut (Vec<i32>, Vec<Rgb>), queries: &[FilteredQuery]| {
        file.sample_batch(queries, scratch, out).expect("the buffers are as long as asked for");
        out[..queries.len()].iter().fold(0, |all, &rgb| all ^ folded(rgb))
    };
    let single = |q: &FilteredQuery| folded(file.filtered(q.u_q32, q.v_q32, q.light, q.view));
    let mut speed = measure(size, scratch, batch, single);
    speed.kernel = of_kernel(file, adapter);
    speed
}

/// A baseline's rates, its directions located as it does.
pub fn of_baseline(decoder: &dyn Decoder, locator: &Locator<'_>) -> Speed {
    let sample = |q: &FilteredQuery| {
        let [r, g, b] = decoder.filtered(&locator.at(q, decoder.two_nearest())).map(f32::to_bits);
        r ^ g ^ b
    };
    measure(locator.size, || (), |(), queries| queries.iter().fold(0, |all, q| all ^ sample(q)), sample)
}

#[cfg(feature = "gpu")]
fn of_kernel(file: &Selvedge<'_>, adapter: &Adapter) -> Option<Rate> {
    use crate::gpu::runner::{Query, direction_words};
    let gpu = adapter.gpu.as_ref()?;
    let loaded = gpu.load(std::slice::from_ref(file));
    let of = |q: &FilteredQuery| Query {
        u: q.u_q32,
        v: q.v_q32,
        light: direction_words(q.light),
        view: direction_words(q.view),
        ..Query::default()
    };
    let queries: Vec<Query> = random_queries(QUERIES).iter().map(of).collect();
    // The first run makes the pipeline; what fails there has no rate.
    gpu.answer(&loaded, "filtered", &queries[..64]).ok()?;
    let rate = timed(&Reference::new(), &mut Vec::new(), |samples| {
        let mut left = samples;
        while left > 0 {
            let part = left.min(QUERIES);
            black_box(gpu.answer(&loaded, "filtered", &queries[..part]).ok());
            left -= part;
        }
    });
    Some(rate)
}

#[cfg(not(feature = "gpu"))]
fn of_kernel(_: &Selvedge<'_>, _: &Adapter) -> Option<Rate> {
    None
}

/// Seconds that `open` takes: the median of some runs.
pub fn open_seconds(bytes: &[u8], dictionary: Option<&[u8]>) -> f64 {
    let run = || {
        let begun = Instant::now();
        let opened = selvedge::open_with(black_box(bytes), dictionary, &selvedge::Limits::NONE).is_ok();
        black_box(opened);
        begun.elapsed().as_secs_f64()
    };
    let mut seconds: Vec<f64> = (0..9).map(|_| run()).collect();
    median(&mut seconds)
}
