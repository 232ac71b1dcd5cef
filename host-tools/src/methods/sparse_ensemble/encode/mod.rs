//! The encoder of the sparse ensemble: a dataset becomes a file for a goal in error, bytes or coefficients.
//!
//! Two passes over the data: [`prepare`](mod@prepare) gives means and bases, [`candidates::collect`] the
//! coefficients that may matter. The goal is then met by one threshold over all blocks, channels and levels
//! ([`select`], searched by `search`), since with orthonormal dictionaries and channels the square of a
//! coefficient is the error of leaving it out. [`verified`] decodes what comes out and encodes again until
//! the goal holds; [`encoder`] is all of it behind the trait of encoders.

#[cfg(feature = "cli")]
mod arguments;
pub mod assemble;
pub mod candidates;
pub(crate) mod columns;
pub mod encoder;
pub mod options;
pub mod prepare;
mod records;
mod search;
pub mod select;
pub mod settings;
pub mod threshold;
pub mod verified;

pub use options::{Criterion, Encoded, Options};
pub use prepare::{Prepared, prepare};
pub use threshold::encode;
