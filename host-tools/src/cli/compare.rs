//! `compare`: errors between two materials, with the exit codes of idiff.

use super::common::{Given, Threads, print, print_json};
use super::parse;
use crate::data::picture;
use crate::encode::parse::positive;
use crate::error::{Result, ToolError};
use crate::measure::compare::{self, Metrics, Place};
use crate::measure::radiance::{AtLevel, Radiance};
use crate::progress::Progress;
use clap::{Args, ValueEnum};
use selvedge::{Direction, Limits, Selvedge};
use std::path::PathBuf;

/// Metrics that can have a threshold.
#[derive(Clone, Copy, ValueEnum)]
enum Limited {
    LogRms,
    LinearRms,
    RelativeL2,
    Largest,
}

#[derive(Args)]
pub struct Arguments {
    /// The reference: a dataset or a file
    reference: PathBuf,
    /// The material under test: a dataset or a file
    other: PathBuf,
    /// External dictionary of the files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Metric that --warn and --fail are thresholds of
    #[arg(long, value_enum, default_value = "largest")]
    by: Limited,
    /// Warn if the metric is above this
    #[arg(long, default_value_t = 1e-6)]
    warn: f64,
    /// Fail if the metric is above this
    #[arg(long, default_value_t = 1e-6)]
    fail: f64,
    /// Peak value of the PSNR; the largest value of the reference if not given
    #[arg(long, value_parser = positive)]
    peak: Option<f64>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
    /// Write a picture of the material under test, the reference and the error in false colour, side by side
    #[arg(long)]
    picture: Option<PathBuf>,
    /// Light of the picture: angle from the normal and azimuth, degrees; snapped to the nearest direction of
    /// the reference
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "30,0", value_name = "POLAR,AZIMUTH")]
    light: Direction,
    /// View of the picture
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "0,0", value_name = "POLAR,AZIMUTH")]
    view: Direction,
    /// Error of ln(x + offset) that is white in the picture
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    white: f64,
    /// Exposure factor of the picture
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    exposure: f64,
    #[command(flatten)]
    threads: Threads,
}

/// Compares; an error is an exit code of its own.
pub fn run(args: Arguments) -> Result<u8> {
    compare_code(compare(args))
}

/// The exit code of `compare`, which is that of idiff.
fn compare_code(result: Result<u8>) -> Result<u8> {
    match result {
        Err(ToolError::Different(what)) => {
            eprintln!("selvedge: {what}");
            Ok(3)
        }
        Err(error @ (ToolError::Io { .. } | ToolError::Foreign { .. } | ToolError::Invalid { .. })) => {
            eprintln!("selvedge: {error}");
            Ok(4)
        }
        other => other,
    }
}

fn compare(args: Arguments) -> Result<u8> {
    args.threads.apply();
    let limits = Limits::NONE;
    let [a, b] = [&args.reference, &args.other].map(|path| Given::open(path, args.dictionary.as_deref()));
    let (a, b) = (a?, b?);
    let (file_a, file_b) = (a.opened(&args.reference, &limits)?, b.opened(&args.other, &limits)?);
    fn source<'a>(given: &'a Given, file: &'a Option<Selvedge<'a>>) -> Box<dyn Radiance + 'a> {
        match (given, file) {
            (Given::Data(data), _) => Box::new(data),
            (_, Some(file)) => Box::new(AtLevel::finest(file)),
            (Given::File(..), None) => unreachable!("a file is opened or refused"),
        }
    }
    let (reference, other) = (source(&a, &file_a), source(&b, &file_b));
    let (description, offset) = match (&a, &file_a) {
        (_, Some(file)) => (compare::describe(file), compare::log_offset(file)),
        (Given::Data(data), _) => (data.description().clone(), data.statistics().log_offset()),
        (Given::File(..), None) => unreachable!("a file is opened or refused"),
    };
    let progress = Progress::new();
    let metrics = compare::compare(&*reference, &*other, &description, offset, args.peak, &|done, all| {
        progress.report("comparing", done, all)
    })?;
    progress.clear();
    if args.json {
        print_json(&metrics)?;
    } else {
        print(&text(&metrics))?;
    }
    if let Some(path) = &args.picture {
        let [light, view] = [(&description.lights, args.light), (&description.views, args.view)]
            .map(|(set, asked)| compare::nearest(set, asked));
        let [a, b] = [&reference, &other].map(|source| compare::image(&**source, &description, light, view));
        picture::beside_error(&b?, &a?, description.size, offset, args.white as f32, args.exposure as f32)
            .save(path)?;
    }
    let value = match args.by {
        Limited::LogRms => metrics.log_rms,
        Limited::LinearRms => metrics.linear_rms,
        Limited::RelativeL2 => metrics.relative_l2,
        Limited::Largest => metrics.largest.difference as f64,
    };
    Ok(if value > args.fail || value.is_nan() {
        2
    } else if value > args.warn {
        1
    } else {
        0
    })
}

fn text(metrics: &Metrics) -> String {
    let Place { difference, texel, light, view } = metrics.largest;
    format!(
        "log RMS     {:.6}  of ln(x + {:e})\n\
         linear RMS  {:.6}\n\
         relative L2 {:.6}\n\
         PSNR        {:.2} dB  against {}\n\
         largest     {difference} at texel ({}, {}), light {light}, view {view}\n\
         different   {} of {}\n",
        metrics.log_rms,
        metrics.log_offset,
        metrics.linear_rms,
        metrics.relative_l2,
        metrics.psnr_db,
        metrics.peak,
        texel[0],
        texel[1],
        metrics.different,
        metrics.count
    )
}
