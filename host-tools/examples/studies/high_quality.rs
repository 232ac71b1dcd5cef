//! Prints what files cost at high quality, where a search for a goal would take long: one encoding for each
//! threshold.
//!
//! `high_quality DATASET EDGE THRESHOLD...`; a threshold is the magnitude below which a coefficient is not
//! kept, in units of the channels. The error is decoded by the core at every texel, every view and every 16th
//! light, the first of which moves from view to view.
//!
//! With an edge of 10 it prints instead what the published layout needs at least: five bytes for each
//! coefficient that a threshold keeps, whatever its atom, over all blocks at once, unrounded, with the
//! material's own bases free of charge.

use selvedge::Limits;
use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::format::model::TransferModel;
use selvedge_tools::measure::compare::Comparison;
use selvedge_tools::measure::radiance::AtLevel;
use selvedge_tools::methods::sparse_ensemble::encode::candidates::{Keep, collect};
use selvedge_tools::methods::sparse_ensemble::encode::{Criterion, Options, encode, prepare};
use std::path::Path;

/// Texels along the side of a block in the published layout.
const PUBLISHED_EDGE: usize = 10;
/// Of how many lights one is decoded.
const EVERY: usize = 16;

fn run(path: &Path, edge: usize, thresholds: &[f64]) -> Result<()> {
    let dataset = Dataset::open(path)?;
    let offset = dataset.statistics().log_offset();
    let prepared = prepare(vec![&dataset], TransferModel::Log2 { offset }, &|_, _| ())?;
    let ensembles = prepared.own_ensembles(edge);
    if edge == PUBLISHED_EDGE {
        println!(
            "| threshold | coefficients | bytes at least | log RMS at most as good |\n|---:|---:|---:|---:|"
        );
        for &threshold in thresholds {
            let found = collect(
                &prepared.blocks(0, edge),
                &ensembles,
                Keep::Above(threshold as f32, threshold as f32),
                1,
                &|_, _| (),
            )?;
            let count: usize = found.iter().map(|channel| channel.values.len()).sum();
            let square = |v: &f32| (*v as f64).powi(2);
            let lost: f64 = found
                .iter()
                .map(|channel| channel.energy - channel.values.iter().map(square).sum::<f64>())
                .sum();
            let values =
                (dataset.description().size.iter().map(|n| n.div_ceil(edge) * edge).product::<usize>()
                    * dataset.description().pairs()
                    * 3) as f64;
            println!(
                "| {threshold} | {count} | {} | {:.4} |",
                count * 5,
                std::f64::consts::LN_2 * (lost / values).sqrt()
            );
        }
        return Ok(());
    }
    println!(
        "| threshold | edge | bytes | ratio | coefficients | predicted log RMS | decoded log RMS | decoded linear RMS | operations |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for &threshold in thresholds {
        let options = Options { edge, criterion: Criterion::Threshold(threshold), ..Options::default() };
        let encoded = encode(&prepared, &ensembles, &options, &|_, _| ())?;
        let file = selvedge::open(&encoded.bytes, &Limits::NONE)
            .map_err(|finding| ToolError::Mismatch(format!("a file just written: {finding}")))?;
        let comparison =
            Comparison { description: dataset.description(), log_offset: offset, peak: None, every: EVERY };
        let found = comparison.run(&dataset, &AtLevel::finest(&file), &|_, _| ())?;
        let (bytes, count) = (encoded.bytes.len() as u64, encoded.coefficients.iter().sum::<usize>());
        let (ratio, operations) =
            (dataset.description().half_bytes() as f64 / bytes as f64, file.header().operations);
        println!(
            "| {threshold} | {edge} | {bytes} | {ratio:.1} | {count} | {:.4} | {:.4} | {:.5} | {operations} |",
            encoded.predicted_rms, found.log_rms, found.linear_rms
        );
    }
    Ok(())
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next();
    let edge = arguments.next().and_then(|edge| edge.parse().ok());
    let thresholds: Option<Vec<f64>> = arguments.map(|t| t.parse().ok()).collect();
    let (Some(path), Some(edge), Some(thresholds)) = (path, edge, thresholds) else {
        eprintln!("high_quality DATASET EDGE THRESHOLD...");
        std::process::exit(1);
    };
    if let Err(error) = run(Path::new(&path), edge, &thresholds) {
        eprintln!("{error}");
        std::process::exit(error.exit_code().into());
    }
}
