//! The ground of the checks: the walk over a file, its bits and digests, limits and stated cost.
//!
//! For tools, tests and second implementations; its items may change with any release.
#![deny(clippy::arithmetic_side_effects)]

pub mod check;
pub mod cost;
pub mod crc32;
pub mod limits;
pub mod sha256;
pub mod stream;
