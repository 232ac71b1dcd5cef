//! Host side of Selvedge.
#![allow(missing_docs)]
pub mod error; pub mod example; pub mod extreme; pub mod gpu; pub mod model; pub mod random; pub mod sparsebtf; pub mod triangulate; pub mod write;
