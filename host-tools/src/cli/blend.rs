//! `blend`: a material between two.

use super::common::warn_of_triangles;
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::blend::blend;
use crate::format::texture::Blend;
use crate::format::write;
use crate::methods::read;
use clap::Args;
use selvedge::Limits;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Arguments {
    /// The material at alpha 0
    a: PathBuf,
    /// The material at alpha 1
    b: PathBuf,
    /// The file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Weight of B, 0 to 1
    #[arg(long, default_value_t = 0.5)]
    alpha: f64,
    /// External dictionary of both files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Keep the coefficients of both instead of changing the basis: exact, and a sample costs as much as both
    #[arg(long)]
    exact: bool,
    /// Maximum coefficients of a block; the sum of both if not given
    #[arg(long)]
    most: Option<u32>,
    /// Allow blending of materials whose scales differ
    #[arg(long)]
    scales_apart: bool,
}

/// Blends.
pub fn run(args: Arguments) -> Result<u8> {
    let dictionary = args.dictionary.as_deref().map(files::read).transpose()?;
    let open = |path: &Path| -> Result<_> {
        let bytes = files::read(path)?;
        let file = selvedge::open_with(&bytes, dictionary.as_deref(), &Limits::NONE);
        let file = file.map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding })?;
        warn_of_triangles(path, &file);
        read::model_of(&file).map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding })
    };
    let options =
        Blend { exact: args.exact, most: args.most, scales_apart: args.scales_apart, ..Blend::default() };
    let (model, report) = blend(&open(&args.a)?, &open(&args.b)?, args.alpha, options)?;
    if report.outside > 0.0 && report.energy > 0.0 {
        eprintln!(
            "{:.4} % of the energy was outside of the span of the dictionaries",
            100.0 * report.outside / report.energy
        );
    }
    files::write(&args.output, &write::write_material(&model))?;
    Ok(0)
}
