//! Files against the specification: findings, advice, costs, explained samples, and the conformance suite.

pub mod conform;
pub mod count;
mod edits;
pub mod example;
pub mod explain;
pub mod extreme;
pub mod info;
pub mod validate;
pub mod vectors;
