//! `export`: a dataset or a decoded file in a third-party format.

use super::common::{Given, Threads};
use super::exchange::{MEMORY, check_applies, check_output};
use super::parse;
use crate::data::expand::expand;
use crate::error::{Result, ToolError};
use crate::files;
use crate::foreign::{btf, images, ubo};
use crate::progress::Progress;
use clap::{Args, ValueEnum};
use selvedge::Limits;
use std::path::PathBuf;

/// Third-party formats.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    /// Folder of EXR, lossless
    Exr,
    /// Folder of PNG: 16-bit sRGB, values above 1 clipped
    Png,
    /// Zip archive of JPEG, named as those of UBO2003
    Ubo2003,
    /// Full-matrix factorisation in a .btf (Bonn, FMF06FC)
    Btf,
}

#[derive(Args)]
pub struct Arguments {
    /// A dataset, or a Selvedge file, which is decoded at its own directions
    source: PathBuf,
    /// Folder for images and dataset.json, or the file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Format to write
    #[arg(long, value_enum, default_value = "exr")]
    format: Format,
    /// Components of a .btf, its mean included; 100 if not given
    #[arg(long, value_parser = clap::value_parser!(u16).range(2..=4096))]
    components: Option<u16>,
    /// Quality of a JPEG, 1 to 100; 95 if not given
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: Option<u8>,
    /// Scale of the values of a JPEG; 1 if not given
    #[arg(long, value_parser = parse::exposure)]
    exposure: Option<f32>,
    /// External dictionary of the source, if that is a file
    #[arg(long)]
    dictionary: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// Exports.
pub fn run(args: Arguments) -> Result<u8> {
    args.threads.apply();
    let is = |format| args.format == format;
    check_applies("--components", args.components.is_some(), is(Format::Btf), "a .btf")?;
    check_applies("--quality", args.quality.is_some(), is(Format::Ubo2003), "an archive of JPEGs")?;
    check_applies("--exposure", args.exposure.is_some(), is(Format::Ubo2003), "an archive of JPEGs")?;
    check_output(&args.source, &args.output, matches!(args.format, Format::Exr | Format::Png))?;
    let progress = Progress::new();
    // A file is expanded beside the result, on disk.
    let place;
    let dataset = match Given::open(&args.source, args.dictionary.as_deref())? {
        Given::Data(dataset) => dataset,
        given @ Given::File(..) => {
            let folder = files::folder_of(&args.output);
            place = tempfile::Builder::new()
                .prefix(".selvedge-")
                .tempdir_in(folder)
                .map_err(ToolError::io(folder))?;
            let opened = given.opened(&args.source, &Limits::NONE)?;
            let file = opened.as_ref().ok_or_else(|| {
                ToolError::Usage(format!("{}: not a file to decode", args.source.display()))
            })?;
            expand(file, &place.path().join("all.selvset"), MEMORY, &|done, all| {
                progress.report("decoding", done, all)
            })?
        }
    };
    let writing = |done, all| progress.report("writing", done, all);
    let mut notes = Vec::new();
    let mut count_clipped = |clipped: u64| {
        if clipped > 0 {
            notes.push(format!("{clipped} values above 1 were clipped"));
        }
    };
    match args.format {
        Format::Exr => {
            count_clipped(images::export(&dataset, &args.output, images::Format::Exr, MEMORY, &writing)?)
        }
        Format::Png => {
            count_clipped(images::export(&dataset, &args.output, images::Format::Png, MEMORY, &writing)?)
        }
        Format::Ubo2003 => {
            let options = ubo::Options {
                quality: args.quality.unwrap_or(95),
                exposure: args.exposure.unwrap_or(1.0),
                memory: MEMORY,
            };
            let exported = ubo::export(&dataset, &args.output, &options, &writing)?;
            count_clipped(exported.clipped);
            if let (count @ 1.., worst) = exported.moved {
                notes.push(format!(
                    "{count} directions are not of whole degrees: the names are up to {worst:.2} degrees off"
                ));
            }
        }
        Format::Btf => {
            let rms = btf::write::export(&dataset, &args.output, args.components.unwrap_or(100) as usize)?;
            if dataset.description().lights.len() != dataset.description().views.len() {
                notes.push(
                    "there are not as many lights as views, which readers made with btf.hh refuse".into(),
                );
            }
            notes.push(format!("the components leave an RMS error of {rms:.3e} of linear radiance"));
        }
    }
    progress.clear();
    notes.iter().for_each(|note| eprintln!("{note}"));
    Ok(0)
}
