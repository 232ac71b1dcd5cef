//! The methods: a folder each, with everything that a method has.

pub mod sparse_ensemble;
pub mod sparse_tensor;
