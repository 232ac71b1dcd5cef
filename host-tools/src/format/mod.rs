//! A material in memory and its bytes; what is here knows no method.

pub mod bits;
pub mod blend;
pub mod container;
pub mod model;
pub mod query;
pub mod renumber;
pub mod sector;
pub mod tables;
pub mod texture;
pub mod triangulate;
pub mod trim;
pub mod units;
pub mod write;
