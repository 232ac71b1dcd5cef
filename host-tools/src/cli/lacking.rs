//! Commands of features that this build is without: they are listed in the help, and refuse by the
//! feature's name.

use clap::Args;
use std::ffi::OsString;

/// Whatever the command is given.
#[derive(Args)]
pub struct Arguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _given: Vec<OsString>,
}

macro_rules! lacking {
    ($($feature:literal: $($command:ident),*;)*) => {$($(
        #[cfg(not(feature = $feature))]
        pub mod $command {
            use crate::error::{Result, ToolError};

            pub use crate::cli::lacking::Arguments;

            /// Refuses.
            pub fn run(_: Arguments) -> Result<u8> {
                Err(ToolError::lacking(concat!("selvedge ", stringify!($command)), $feature))
            }
        }
    )*)*};
}

lacking! {
    "import": demo, export, import;
    "report": bench, report;
}
