//! Pictures of balls, and the demo.

pub mod ball;
#[cfg(all(feature = "cli", feature = "import"))]
pub(crate) mod demo;
#[cfg(all(feature = "cli", feature = "import"))]
pub mod excerpt;
#[cfg(all(feature = "cli", feature = "import"))]
mod pipeline;
