//! `info`: what a file, a dataset or third-party data are.

use super::common::{FileArgs, invalid, print, print_json, with_material};
use crate::check::info;
use crate::error::Result;
use crate::foreign::{self, Kind};
use clap::Args;
use std::path::Path;

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    source: FileArgs,
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Reports what a file, a dataset or third-party data are.
pub fn run(args: Arguments) -> Result<u8> {
    let (source, json) = (&args.source, args.json);
    // Standard input holds a file of this format; anything else is refused by its first broken rule.
    let is_stream = source.file == Path::new("-");
    match if is_stream { Kind::Material } else { foreign::detect(&source.file)? } {
        Kind::Material | Kind::Dictionary => with_material(source, |material| {
            let info = info::info(&material).map_err(invalid(&args.source))?;
            if json {
                print_json(&info)?
            } else {
                print(&info::info_text(&info))?
            }
            Ok(0)
        }),
        kind => {
            let info = foreign::info(&source.file, kind, foreign::ImportOptions::default().memory)?;
            if json {
                print_json(&info)?
            } else {
                print(&info.text())?
            }
            Ok(0)
        }
    }
}
