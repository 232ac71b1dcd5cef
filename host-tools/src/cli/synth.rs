//! `synth`: renders a BTF of a modelled mesostructure.

use super::common::Threads;
use super::parse;
use crate::data::dataset::Sample;
use crate::error::Result;
use crate::progress::Progress;
use crate::synth::{self, Mesostructure};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Arguments {
    /// Mesostructure: checker, rings, tissue, cloth, knit or hammered
    kind: String,
    /// The dataset to write, NAME.selvset
    #[arg(short, long)]
    output: PathBuf,
    /// Texels along x and y, as 128 or 128x64
    #[arg(long, default_value = "128", value_parser = parse::size)]
    size: [usize; 2],
    /// Directions of the light and of the view: 81 or 151 of each
    #[arg(long, default_value_t = 81)]
    directions: usize,
    /// Rays per texel and view: 1, 4, 9 or 16
    #[arg(long, default_value_t = 4)]
    samples: usize,
    /// Random seed of the geometry
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Store 32-bit floats instead of binary16
    #[arg(long)]
    float: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Renders a material.
pub fn run(args: Arguments) -> Result<u8> {
    args.threads.apply();
    let kind: Mesostructure = args.kind.parse()?;
    let sample = if args.float { Sample::Float } else { Sample::Half };
    let request = synth::Request {
        kind,
        size: args.size,
        directions: args.directions,
        seed: args.seed,
        samples: args.samples,
        sample,
    };
    let progress = Progress::new();
    synth::synthesise(&request, &args.output, &|done, all| progress.report("rendering", done, all))?;
    progress.clear();
    Ok(0)
}
