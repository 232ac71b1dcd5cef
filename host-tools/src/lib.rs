//! Host side of Selvedge.
#![allow(missing_docs)]
pub mod error; pub mod model; pub mod sparsebtf; pub mod triangulate; pub mod write;
