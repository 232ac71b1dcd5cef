//! Matrices, decompositions and random numbers of training and encoding.

pub mod ksvd;
pub mod linear;
pub mod pca;
pub mod random;
