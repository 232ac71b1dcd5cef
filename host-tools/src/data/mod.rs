//! The data of a material: the working file, its grids, levels of detail, transfer and pictures.

pub mod dataset;
pub mod directions;
pub mod expand;
pub mod pass;
pub mod picture;
pub mod pyramid;
pub mod transfer;
