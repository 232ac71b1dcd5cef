//! What the kernel costs on an adapter: seconds to compile a pipeline, and microseconds a sample, for each entry
//! point and file. Answers are compared with the core's before anything is timed.
//!
//! `cargo bench -p selvedge-tools --bench kernel -- FILE...`

use selvedge::Limits;
use selvedge_tools::gpu::runner::{Gpu, Query, answer_on_cpu, random_query};
use selvedge_tools::math::random::Random;
use std::time::Instant;

const ENTRIES: [&str; 4] = ["texel", "filtered", "trilinear", "floats"];
/// Queries of a timed dispatch.
const SAMPLES: usize = 1 << 14;
/// Timed dispatches, of which the fastest counts.
const REPEATS: usize = 5;

fn main() {
    let files: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    println!("file\tentry\tcompile_s\tus_a_sample");
    for file in &files {
        let bytes = std::fs::read(file).expect("a file");
        let material = selvedge::open(&bytes, &Limits::NONE).expect("a legal file");
        for entry in ENTRIES {
            // An adapter of its own for each, so that nothing is compiled yet.
            let gpu = Gpu::any().expect("an adapter that works").expect("an adapter");
            let loaded = gpu.load(&[material]);
            let mut random = Random::new(7);
            let queries: Vec<Query> = (0..SAMPLES).map(|_| random_query(&mut random, entry, 0)).collect();
            let start = Instant::now();
            let first = gpu.answer(&loaded, entry, &queries[..64]).expect("answers");
            let with_compiling = start.elapsed().as_secs_f64();
            for (query, answer) in queries.iter().zip(&first) {
                assert_eq!(answer_on_cpu(&material, entry, query), *answer);
            }
            let start = Instant::now();
            gpu.answer(&loaded, entry, &queries[..64]).expect("answers");
            let compile = with_compiling - start.elapsed().as_secs_f64();
            let times = (0..REPEATS).map(|_| {
                let start = Instant::now();
                gpu.answer(&loaded, entry, &queries).expect("answers");
                start.elapsed().as_secs_f64()
            });
            let best = times.fold(f64::INFINITY, f64::min);
            println!("{file}\t{entry}\t{compile:.3}\t{:.2}", best / SAMPLES as f64 * 1e6);
        }
    }
}
