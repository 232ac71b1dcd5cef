//! Encoding: a dataset becomes a file that meets a goal.

pub mod parse;
