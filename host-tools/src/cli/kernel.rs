//! `kernel`: the kernel for other renderers.

use super::common::print;
use crate::error::{Result, ToolError};
use crate::files;
use crate::gpu::kernel;
use clap::Args;
use std::path::PathBuf;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    /// Folder for the files; without it the WGSL goes to stdout
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Writes the kernel.
pub fn run(args: Arguments) -> Result<u8> {
    let Some(folder) = args.out else {
        print(&kernel::source())?;
        return Ok(0);
    };
    let translated = kernel::translate()?;
    std::fs::create_dir_all(&folder).map_err(ToolError::io(&folder))?;
    translated.iter().try_for_each(|(name, bytes)| files::write(&folder.join(name), bytes))?;
    Ok(0)
}
