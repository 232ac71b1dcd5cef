//! What chapters 3, 5 and 8 demand of the bytes of a file, whatever its method: layout constants and checks.
//!
//! For tools, tests and second implementations; its items may change with any release.
#![deny(clippy::arithmetic_side_effects)]

pub mod directions;
pub mod directory;
pub(crate) mod directory_checks;
pub mod header;
pub(crate) mod header_checks;
pub mod metadata;
pub mod pair_table;
