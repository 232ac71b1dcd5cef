//! The kernel: the functions that decide bits, each with a twin in WGSL (chapters 1, 2 and 5 to 9).
//!
//! This module is for tools, tests and second implementations. **Its items may change with any release**:
//! an embedder calls [`crate::Selvedge`] instead. The twins of methods are in [`crate::method`]. They are written in the dialect that WGSL can say: words,
//! explicit wrapping, indexed loops. Nothing here fails or panics, whatever it is given.

pub mod colour;
pub mod direction;
pub mod fixed;
pub mod interpolation;
pub mod levels;
pub mod material;
pub mod method;
pub mod position;
pub mod words;
