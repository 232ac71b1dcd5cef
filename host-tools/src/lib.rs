//! Host side of Selvedge: importers, the writer, checks, pictures, and the kernel on a GPU.
//!
//! | folder | holds |
//! |---|---|
//! | [`data`] | datasets of measured or modelled radiance, their directions, levels and pictures |
//! | [`foreign`], [`synth`] | where data come from: third-party formats, modelled mesostructures |
//! | [`methods`] | a folder for each method: model, encoder, and everything else that it has |
//! | [`format`](mod@format) | a material in memory and its bytes: written, read, trimmed; knows no method |
//! | [`measure`] | errors, similarity and speed of materials and baselines |
//! | [`check`] | validation, explanations, costs, the conformance suite |
//! | [`report`], [`show`] | error against run time; pictures and the demo |
//! | [`gpu`] | the kernel for other renderers, and run here |
//! | [`math`] | matrices, decompositions, random numbers |
//! | [`cli`] | the program |
//! | [`files`], [`error`], [`progress`] | whole writes, exit codes, progress on a terminal |

pub mod check;
pub mod cli;
pub mod data;
pub mod encode;
pub mod error;
pub mod files;
pub mod foreign;
pub mod format;
pub mod gpu;
pub mod math;
pub mod measure;
pub mod methods;
pub mod progress;
pub mod report;
pub mod show;
pub mod synth;
