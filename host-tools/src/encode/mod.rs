//! Encoding: a dataset becomes a file that meets a goal.
//!
//! | module | holds |
//! |---|---|
//! | [`goal`] | what a file has to reach, and the loop that reaches it |
//! | [`encoder`] | what every encoder is, and encoding with one of them |
//! | [`auto`] | the choice between methods |
//! | [`parse`] | values of options in text |

pub mod auto;
pub mod encoder;
pub mod goal;
pub mod parse;

use crate::methods::sparse_ensemble::encode::encoder::SparseEnsemble;
use crate::methods::sparse_tensor::encode::encoder::SparseTensor;
use encoder::Encoder;

/// The encoders with their default options, a line a method.
pub static ENCODERS: &[&dyn Encoder] = &[&SparseEnsemble::DEFAULT, &SparseTensor::DEFAULT];
