//! `info`: what a file, a dataset or third-party data are.

use super::common::{FileArgs, invalid, print, print_json, with_material};
use crate::check::info;
use crate::error::{Result, ToolError};
#[cfg(feature = "import")]
use crate::foreign;
use clap::Args;
use std::io::Read as _;
use std::path::Path;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    source: FileArgs,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Reports what a file, a dataset or third-party data are.
///
/// # Errors
/// If a file breaks a rule or its layout, on I/O, and for anything but a Selvedge file in a build without
/// the feature `import`.
pub fn run(args: Arguments) -> Result<u8> {
    // Standard input holds a file of this format; anything else is refused by its first broken rule.
    if args.source.file != Path::new("-") && !is_selvedge(&args.source.file)? {
        return foreign_info(&args.source.file, args.json);
    }
    with_material(&args.source, |material| {
        let info = info::info(&material).map_err(invalid(&args.source))?;
        if args.json { print_json(&info) } else { print(&info::info_text(&info)) }
    })?;
    Ok(0)
}

/// Whether a path holds a material or a dictionary of this format.
fn is_selvedge(path: &Path) -> Result<bool> {
    if path.is_dir() {
        return Ok(false);
    }
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(ToolError::io(path))?;
    file.take(64).read_to_end(&mut start).map_err(ToolError::io(path))?;
    Ok(start.starts_with(&selvedge::container::header::MAGIC))
}

/// Reports on a dataset or on third-party data.
#[cfg(feature = "import")]
fn foreign_info(path: &Path, json: bool) -> Result<u8> {
    let info = foreign::info(path, foreign::detect(path)?, foreign::ImportOptions::default().memory)?;
    if json { print_json(&info) } else { print(&info.text()) }?;
    Ok(0)
}

/// Refuses: this build has no reader of third-party formats.
#[cfg(not(feature = "import"))]
fn foreign_info(path: &Path, _: bool) -> Result<u8> {
    Err(ToolError::lacking(&format!("{}: this is no Selvedge file", path.display()), "import"))
}
