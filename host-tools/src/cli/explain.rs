//! `explain`: which parts of a file made a sample.

use super::common::{FileArgs, invalid, print, print_json, with_material};
use super::parse;
use crate::check::explain;
use crate::error::{Result, ToolError};
use clap::Args;
use selvedge::Direction;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    source: FileArgs,
    /// The texel to explain, x and y, as 10,20
    #[arg(long, value_parser = parse::texel)]
    texel: [u32; 2],
    /// Light: angle from the normal and azimuth, degrees
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "30,0", value_name = "POLAR,AZIMUTH")]
    light: Direction,
    /// View: angle from the normal and azimuth, degrees
    #[arg(long, value_parser = parse::angles, allow_hyphen_values = true)]
    #[arg(default_value = "0,0", value_name = "POLAR,AZIMUTH")]
    view: Direction,
    /// Coefficients listed per record
    #[arg(long, default_value_t = 8)]
    most: usize,
    /// Print as JSON, with all coefficients
    #[arg(long)]
    json: bool,
}

/// Explains.
pub fn run(args: Arguments) -> Result<u8> {
    let texel = args.texel;
    with_material(&args.source, |material| {
        let size = material.image_size(0);
        if texel[0] >= size[0] || texel[1] >= size[1] {
            let [width, height] = size;
            return Err(ToolError::Usage(format!("--texel: the image has {width} x {height} texels")));
        }
        let explanation =
            explain::explain(&material, texel, args.light, args.view).map_err(invalid(&args.source))?;
        if args.json {
            print_json(&explanation)?
        } else {
            print(&explain::text(&explanation, args.most))?
        }
        Ok(0)
    })
}
