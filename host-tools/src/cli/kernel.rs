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
    /// Include this method; may be given several times. All if not given
    #[arg(long = "method", value_name = "NAME")]
    methods: Vec<String>,
}

/// Writes the kernel.
pub fn run(args: Arguments) -> Result<u8> {
    let all = kernel::method_names();
    let asked: Vec<&str> = args.methods.iter().map(String::as_str).collect();
    let methods = if asked.is_empty() { &all } else { &asked };
    let Some(folder) = args.out else {
        print(&kernel::source(methods)?)?;
        return Ok(0);
    };
    let translated = kernel::translate(methods)?;
    std::fs::create_dir_all(&folder).map_err(ToolError::io(&folder))?;
    translated.iter().try_for_each(|(name, bytes)| files::write(&folder.join(name), bytes))?;
    Ok(0)
}
