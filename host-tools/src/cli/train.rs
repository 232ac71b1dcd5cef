//! `train`: an ensemble of dictionaries for materials that are not among the training data.

use super::common::Threads;
use crate::data::dataset::Dataset;
use crate::encode::parse::counts;
use crate::error::Result;
use crate::files;
use crate::format::model::MetadataModel;
use crate::methods::sparse_ensemble::dictionary_file::{self, Training};
use crate::methods::sparse_ensemble::train;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Arguments {
    /// Datasets with the same directions
    #[arg(required = true)]
    datasets: Vec<PathBuf>,
    /// The dictionary to write, NAME.selvdict
    #[arg(short, long)]
    output: PathBuf,
    /// Dictionaries of each channel, 1 to 256
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    dictionaries: u16,
    /// Coefficients of a block in each channel during training, as 256,32,32
    #[arg(long, default_value = "256,32,32", value_parser = counts)]
    sparsity: [usize; 3],
    /// Texels along the side of a block, 1 to 16
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=16))]
    edge: u16,
    /// Columns of the light and view bases that are trained
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u16).range(1..=1024))]
    subspace: u16,
    /// Blocks to train on, over all datasets
    #[arg(long, default_value_t = 2880, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    blocks: u32,
    /// Maximum iterations of each channel
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    iterations: u32,
    /// Random seed of the choice of blocks
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Do not log the objective
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Trains; the state of an interrupted run is kept beside the output and resumed.
pub fn run(args: Arguments) -> Result<u8> {
    args.threads.apply();
    let datasets: Vec<Dataset> =
        args.datasets.iter().map(|path| Dataset::open(path)).collect::<Result<_>>()?;
    let options = train::Options {
        dictionaries: args.dictionaries as usize,
        sparsity: args.sparsity,
        edge: args.edge as usize,
        subspace: args.subspace as usize,
        blocks: args.blocks as usize,
        iterations: args.iterations as usize,
        seed: args.seed,
        ..train::Options::default()
    };
    let mut state = args.output.clone().into_os_string();
    state.push(".training");
    let state = PathBuf::from(state);
    if state.exists() && !args.quiet {
        eprintln!("resuming {}", state.display());
    }
    let begun = std::time::Instant::now();
    let mut steps = 0u32;
    let mut report = |step: train::Step| {
        steps += 1;
        if !args.quiet {
            let passed = begun.elapsed().as_secs_f64();
            let left = ((3 - step.channel) * options.iterations).saturating_sub(step.iteration + 1);
            let revived = if step.revived > 0 {
                format!(", {} dictionaries restarted", step.revived)
            } else {
                String::new()
            };
            let most = passed / steps as f64 * left as f64;
            eprintln!(
                "channel {} iteration {:2}: error {:.6} of the energy{revived}; at most {most:.0} s left",
                step.channel, step.iteration, step.objective
            );
        }
        true
    };
    let references: Vec<&Dataset> = datasets.iter().collect();
    let Some(trained) = train::train(&references, &options, Some(&state), &mut report)? else { return Ok(0) };
    let description = datasets[0].description();
    let materials: Vec<String> = datasets.iter().map(|d| d.description().texts[0].clone()).collect();
    let name = args.output.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let metadata = MetadataModel {
        texts: [name, format!("trained on {}", materials.join(", ")), licences(&datasets)],
        ..MetadataModel::default()
    };
    let training = Training {
        lights: description.lights.clone(),
        views: description.views.clone(),
        options,
        materials,
        objectives: trained.objectives.clone(),
        members: trained.members.clone(),
    };
    files::write(&args.output, &dictionary_file::to_bytes(&trained, &training, metadata))?;
    Ok(0)
}

fn licences(datasets: &[Dataset]) -> String {
    let mut all: Vec<&str> = datasets.iter().map(|d| d.description().texts[2].as_str()).collect();
    all.sort_unstable();
    all.dedup();
    all.join("; ")
}
