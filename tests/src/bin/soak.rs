//! Runs the bodies of the fuzz targets without a fuzzer: seeds, mutations of them, and random bytes, for a
//! count of executions.
//!
//! `soak EXECUTIONS [TARGET...]`; what fails is written beside as `soak-TARGET.bytes` before the panic is
//! reported. It has no feedback from coverage, so it finds less than libFuzzer in the same number of executions;
//! it needs nothing but a stable compiler.
//!
//! The heap is watched: reading third-party files may take twice what is given and a constant
//! (`Target::memory` of the targets).

use peak_alloc::PeakAlloc;
use selvedge_tests::targets::{TARGETS, suite};
use selvedge_tools::math::random::Random;
use std::path::Path;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

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
            _ if at < bytes.len() => {
                bytes[at] = random.pick(&[0, 1, 0x7f, 0x80, 0xff, random.clone().word() as u8])
            }
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
    for target in
        TARGETS.iter().filter(|target| names.is_empty() || names.iter().any(|name| name == target.name))
    {
        let mut seeds: Vec<Vec<u8>> =
            selvedge_tests::seeds(target.name).into_iter().map(|(_, bytes)| bytes).collect();
        if target.name == "open" {
            seeds.extend(suite().iter().map(|vector| vector.bytes.clone()));
        }
        let mut random = Random::new(executions);
        // What a process makes once is no cost of a file.
        seeds.iter().for_each(|seed| (target.run)(seed));
        let mut most = 0;
        for _ in 0..executions {
            let bytes = mutated(&mut random, &seeds);
            HEAP.reset_peak_usage();
            let before = HEAP.current_usage();
            let is_well = std::panic::catch_unwind(|| (target.run)(&bytes)).is_ok();
            let taken = HEAP.peak_usage().saturating_sub(before).saturating_sub(2 * bytes.len());
            most = most.max(taken);
            let is_small = target.memory.is_none_or(|memory| taken <= memory);
            if !is_small {
                eprintln!("{}: {taken} bytes beyond twice the input", target.name);
            }
            if !is_well || !is_small {
                let path = format!("soak-{}.bytes", target.name);
                std::fs::write(Path::new(&path), &bytes).expect("the failure is written");
                eprintln!("{}: {} bytes fail, in {path}", target.name, bytes.len());
                std::process::exit(3);
            }
        }
        println!(
            "{}: {executions} executions of {} seeds, nothing found; heap at most {most} bytes beyond twice the input",
            target.name,
            seeds.len()
        );
    }
}
