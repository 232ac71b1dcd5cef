//! `conform`: the conformance suite against a decoder.

use super::common::print;
use crate::check::{conform, vectors};
use crate::error::Result;
use clap::Args;
use std::path::PathBuf;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    /// Folder of the suite, with its manifest.tsv
    folder: PathBuf,
    /// Regenerate the files of the suite from its recipes first
    #[arg(long)]
    make: bool,
    /// The program and its arguments, behind --
    #[arg(last = true)]
    program: Vec<String>,
}

/// Runs the suite and reports every vector whose result differs from what the suite states.
pub fn run(args: Arguments) -> Result<u8> {
    let (folder, make, program) = (args.folder.as_path(), args.make, args.program.as_slice());
    if make {
        vectors::write(folder)?;
    }
    let suite = vectors::read(folder)?;
    let found =
        if program.is_empty() { conform::run_own(&suite)? } else { conform::run_program(&suite, program)? };
    for d in &found {
        print(&format!("{}: {} is stated, the answer is {}\n", d.path, d.stated, d.answered))?;
    }
    eprintln!("{} vectors, {} answers differ from those stated", suite.len(), found.len());
    Ok(if found.is_empty() { 0 } else { 3 })
}
