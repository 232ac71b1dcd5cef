//! The methods: a folder each, with everything that a method has, and what several of them share.

pub mod advice;
pub mod means;
pub mod method;
pub mod reach;
pub mod read;
pub mod registry;
pub mod sample;
pub mod sparse_ensemble;
pub mod sparse_tensor;

pub use method::Method;
pub use registry::{METHODS, by_name, by_number, of};
