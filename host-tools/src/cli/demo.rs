//! `demo`: everything on a built-in material.

use crate::error::Result;
use crate::show::demo;
use clap::Args;
use std::path::PathBuf;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    /// Folder for the results
    #[arg(long)]
    out: PathBuf,
}

/// Runs the demo.
pub fn run(args: Arguments) -> Result<u8> {
    demo::run(&args.out, &mut |line| eprintln!("{line}")).map(|()| 0)
}
