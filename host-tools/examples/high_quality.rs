//! Prints what files cost at high quality, where a search for a goal would take long: one encoding for each threshold.
//!
//! `high_quality DATASET EDGE THRESHOLD...`; a threshold is the magnitude below which a coefficient is not kept, in units of the channels. The
//! error is decoded by the core at every texel, every view and every 16th light, the first of which moves from view to view.

use selvedge::Limits;
use selvedge_tools::dataset::Dataset;
use selvedge_tools::encode::{Goal, Options, encode, prepare};
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::measure::{Source, compare_every};
use selvedge_tools::model::TransferModel;
use std::path::Path;

/// Of how many lights one is decoded.
const EVERY: usize = 16;

fn run(path: &Path, edge: usize, thresholds: &[f64]) -> Result<()> {
    let dataset = Dataset::open(path)?;
    let offset = dataset.statistics().log_offset();
    let prepared = prepare(vec![&dataset], TransferModel::Log2 { offset }, &|_, _| ())?;
    let ensembles = prepared.own_ensembles(edge);
    println!("| threshold | edge | bytes | ratio | coefficients | predicted log RMS | decoded log RMS | decoded linear RMS | operations |");
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for &threshold in thresholds {
        let options = Options { edge, goal: Goal::Threshold(threshold), ..Options::default() };
        let encoded = encode(&prepared, &ensembles, &options, &|_, _| ())?;
        let file = selvedge::open(&encoded.bytes, &Limits::NONE).map_err(|finding| ToolError::Mismatch(format!("a file just written: {finding}")))?;
        let found = compare_every(EVERY, Source::Data(&dataset), Source::File(&file, 0), dataset.description(), offset, None, &|_, _| ())?;
        let (bytes, count) = (encoded.bytes.len() as u64, encoded.coefficients.iter().sum::<usize>());
        let (ratio, operations) = (dataset.description().half_bytes() as f64 / bytes as f64, file.header().operations);
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
