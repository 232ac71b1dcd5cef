//! A material in memory and its bytes; what is here knows no method.

pub mod info;
pub mod model;
pub mod read;
pub mod sector;
pub mod triangulate;
pub mod trim;
pub mod write;
