//! Runs the bodies of the fuzz targets without a fuzzer: seeds, mutations of them, and random bytes, for a count of executions.
//!
//! `soak EXECUTIONS [TARGET...]`; what fails is written beside as `soak-TARGET.bytes` before the panic is told. It has no feedback
//! from coverage, so it finds less than libFuzzer in the same number of executions; it needs nothing but a stable compiler.

use selvedge_tests::targets::{TARGETS, suite};
use selvedge_tools::random::Random;
use std::path::Path;

/// A seed with a few bytes changed, cut or added.
fn mutated(random: &mut Random, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = match seeds.len() {
        0 => Vec::new(),
        n => seeds[random.range(0, n as i64 - 1) as usize].clone(),
    };
    if random.once_in(4) {
        bytes.resize(random.range(0, 64) as usize, 0);
        bytes.iter_mut().for_each(|byte| *byte = random.word() as u8);
    }
    for _ in 0..random.range(0, 8) {
        let at = random.range(0, bytes.len() as i64) as usize;
        match random.range(0, 9) {
            0 => bytes.truncate(at),
            1 => bytes.insert(at, random.word() as u8),
            _ if at < bytes.len() => bytes[at] = random.pick(&[0, 1, 0x7f, 0x80, 0xff, random.clone().word() as u8]),
            _ => {}
        }
    }
    bytes
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(executions) = arguments.next().and_then(|count| count.parse::<u64>().ok()) else {
        eprintln!("soak EXECUTIONS [TARGET...]");
        std::process::exit(1);
    };
    let names: Vec<String> = arguments.collect();
    for target in TARGETS.iter().filter(|target| names.is_empty() || names.iter().any(|name| name == target.name)) {
        let mut seeds: Vec<Vec<u8>> = selvedge_tests::seeds(target.name).into_iter().map(|(_, bytes)| bytes).collect();
        if target.name == "open" {
            seeds.extend(suite().iter().map(|vector| vector.bytes.clone()));
        }
        let mut random = Random::new(executions);
        for _ in 0..executions {
            let bytes = mutated(&mut random, &seeds);
            if std::panic::catch_unwind(|| (target.run)(&bytes)).is_err() {
                let path = format!("soak-{}.bytes", target.name);
                std::fs::write(Path::new(&path), &bytes).expect("the failure is written");
                eprintln!("{}: {} bytes fail, in {path}", target.name, bytes.len());
                std::process::exit(3);
            }
        }
        println!("{}: {executions} executions of {} seeds, nothing found", target.name, seeds.len());
    }
}
