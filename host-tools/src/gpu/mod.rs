//! The kernel for other renderers, and run on an adapter here.

pub mod kernel;
#[cfg(feature = "gpu")]
pub mod runner;
