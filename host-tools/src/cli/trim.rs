//! `trim`: leaves out what a scene does not need.

use super::common::{FileArgs, invalid, with_material};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::sector::Sector;
use crate::format::trim::{Keep, Trim, trim};
use crate::format::write;
use crate::methods::read;
use clap::Args;
use std::path::PathBuf;

fn parse_channels(text: &str) -> std::result::Result<[Keep; 3], String> {
    let keep = |word: &str| match word.trim() {
        "texture" => Ok(Keep::Texture),
        "mean" => Ok(Keep::Mean),
        "nothing" => Ok(Keep::Nothing),
        _ => Err("texture, mean or nothing for each channel, as texture,mean,mean".to_owned()),
    };
    let parts: Vec<Keep> = text.split(',').map(keep).collect::<std::result::Result<_, _>>()?;
    parts.try_into().map_err(|_| "three words, as texture,mean,mean".to_owned())
}

#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    source: FileArgs,
    /// The file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Keep this many quality layers
    #[arg(long)]
    layers: Option<u32>,
    /// Keep this many levels of detail, finest first
    #[arg(long)]
    levels: Option<u32>,
    /// What to keep of each channel, as texture,mean,mean
    #[arg(long, value_parser = parse_channels)]
    channels: Option<[Keep; 3]>,
    /// Drop unused dictionaries, atoms and columns
    #[arg(long)]
    unused: bool,
    /// Keep lights within this angle from the normal, and optionally between two azimuths: 60 or 60,350,10
    #[arg(long, value_parser = parse_sector)]
    lights: Option<Sector>,
    /// Keep views, as --lights
    #[arg(long, value_parser = parse_sector)]
    views: Option<Sector>,
    /// Allow re-triangulation (changes interpolated results)
    #[arg(long)]
    retriangulate: bool,
}

fn parse_sector(text: &str) -> std::result::Result<Sector, String> {
    let parts: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let sector = match parts.as_deref() {
        Some(&[polar]) => Sector::new(polar, None),
        Some(&[polar, from, to]) => Sector::new(polar, Some([from, to])),
        _ => return Err("an angle, or an angle and two azimuths, as 60,350,10".into()),
    };
    sector.map_err(|error| error.to_string())
}

/// Trims.
pub fn run(args: Arguments) -> Result<u8> {
    let model = with_material(&args.source, |file| {
        // 10.8-3: what is left has the results of the original.
        if !args.retriangulate && !read::same_triangles(&file) {
            let why = "its triangulation differs from the one that this tool computes, so interpolated \
                       results would change";
            return Err(ToolError::Usage(format!(
                "{}: {why}; --retriangulate allows it",
                args.source.file.display()
            )));
        }
        read::model_of(&file).map_err(invalid(&args.source))
    })?;
    let channels = args.channels.unwrap_or(Trim::default().channels);
    let options = Trim {
        layers: args.layers,
        levels: args.levels,
        channels,
        unused: args.unused,
        lights: args.lights,
        views: args.views,
    };
    let trimmed = trim(&model, &options)?;
    files::write(&args.output, &write::write_material(&trimmed))?;
    Ok(0)
}
