//! Encoding: a dataset becomes a file that meets a goal.
//!
//! | module | holds |
//! |---|---|
//! | [`goal`] | what a file has to reach, and the loop that reaches it |
//! | [`encoder`] | what every encoder is, and encoding with one of them |
//! | [`auto`] | the choice between methods |
//! | [`parse`] | values of options in text |
//!
//! ```
//! use selvedge_tools::data::dataset::{Dataset, Description};
//! use selvedge_tools::data::directions::grid;
//! use selvedge_tools::encode::encoder::{Common, Levels, encode};
//! use selvedge_tools::encode::{ENCODERS, goal::Goal};
//! use selvedge_tools::progress::Quiet;
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("small.selvset");
//! // A dataset is a function of texel, view, light and colour; here a few directions of a known grid.
//! let grid = grid(81).ok_or("no such grid")?;
//! let (lights, views) = (grid[..9].to_vec(), grid[..5].to_vec());
//! let description = Description { size: [6, 4], lights, views, ..Description::default() };
//! let data = Dataset::from_fn(&path, description, |texel, i| 0.1 + ((texel * 7 + i) % 13) as f32 / 20.0)?;
//!
//! // The first encoder with its defaults; what it reports was measured on the decoded file.
//! let goal = Goal::Bytes(20_000);
//! let encoded = encode(ENCODERS[0], &Levels::of(&data), goal, &Common::default(), &Quiet)?;
//! assert!(encoded.bytes.len() <= 20_000 && encoded.metrics.log_rms < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod auto;
pub mod encoder;
pub mod goal;
pub mod parse;

use crate::methods::registry::each_method;
use encoder::Encoder;

macro_rules! encoders {
    ($($module:ident)*) => {
        /// The encoders of all methods with their default options, in the order of
        /// [`METHODS`](crate::methods::METHODS).
        pub static ENCODERS: &[&dyn Encoder] = &[$(&crate::methods::$module::encode::encoder::ENCODER),*];
    };
}
each_method!(encoders);
