//! The kernel for other renderers, and run on an adapter here.

#[cfg(any(feature = "cli", feature = "gpu"))]
pub mod kernel;
#[cfg(feature = "gpu")]
pub mod runner;
