//! `decode`: the image of one pair of directions.

use super::common::{FileArgs, with_material};
use super::parse;
use crate::error::{Result, ToolError};
use crate::show::ball;
use clap::Args;
use selvedge::Direction;
use std::path::PathBuf;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    source: FileArgs,
    /// The picture to write, .png or .exr
    #[arg(short, long)]
    output: PathBuf,
    /// Light: angle from the normal and azimuth, degrees
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "30,0", value_name = "POLAR,AZIMUTH")]
    light: Direction,
    /// View: angle from the normal and azimuth, degrees
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "0,0", value_name = "POLAR,AZIMUTH")]
    view: Direction,
    /// Level of detail
    #[arg(long, default_value_t = 0)]
    level: u32,
    /// Quality layers to decode; all if not given
    #[arg(long)]
    layers: Option<u32>,
    /// Exposure factor of a .png; an .exr has the decoder's bits
    #[arg(long, default_value_t = 1.0, value_parser = parse::exposure, allow_negative_numbers = true)]
    exposure: f32,
}

/// Decodes.
pub fn run(args: Arguments) -> Result<u8> {
    with_material(&args.source, |material| {
        let header = material.header();
        let ranges = [
            ("--level", args.level, 0, header.level_count - 1),
            ("--layers", args.layers.unwrap_or(1), 1, header.layer_count),
        ];
        if let Some((name, _, low, high)) =
            ranges.iter().find(|(_, given, low, high)| !(low..=high).contains(&given))
        {
            return Err(ToolError::Usage(format!("{name}: this file has {low} to {high}")));
        }
        let material = args.layers.map_or(material, |layers| material.with_layers(layers));
        let picture = ball::decode_picture(&material, args.level, args.light, args.view)?;
        let is_exr = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
        let picture = if is_exr { picture } else { picture.exposed(args.exposure) };
        picture.save(&args.output).map(|()| 0)
    })
}
