//! Pictures of balls, and the demo.

pub mod ball;
pub mod demo;
pub mod story;
