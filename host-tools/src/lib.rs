//! Host side of Selvedge: importers, the writer, checks, pictures, and the kernel on a GPU.
//!
//! | folder | holds | feature |
//! |---|---|---|
//! | [`data`] | datasets of measured or modelled radiance, their directions, levels and pictures | |
//! | [`synth`] | modelled mesostructures, rendered into datasets | |
//! | `foreign` | third-party formats, read into datasets and written | `import` |
//! | [`methods`] | a folder for each method: model, encoder, and everything else that it has | |
//! | [`encode`] | goals, and the encoders that meet them | |
//! | [`format`](mod@format) | a material in memory and its bytes: written, read, trimmed; knows no method | |
//! | [`measure`] | errors, similarity and speed of materials and baselines | |
//! | [`check`] | validation, explanations, costs, the conformance suite | |
//! | `report` | error against run time: tables, plots, a page | `report` |
//! | `gpu` | the kernel for other renderers (`cli` or `gpu`), and run on an adapter here | `gpu` |
//! | [`show`] | pictures of balls; the demo | `cli` and `import` for the demo |
//! | [`math`] | matrices, decompositions, random numbers | |
//! | `cli` | the program | `cli` |
//! | [`work`] | parallel work, added up in order | |
//! | [`files`], [`error`], [`progress`] | whole writes, exit codes, progress on a terminal | |
//!
//! All features are on by default. A trainer or a binding for another language takes the library with
//! `default-features = false`.

pub mod check;
#[cfg(feature = "cli")]
pub mod cli;
pub mod data;
pub mod encode;
pub mod error;
pub mod files;
#[cfg(feature = "import")]
pub mod foreign;
pub mod format;
#[cfg(any(feature = "cli", feature = "gpu"))]
pub mod gpu;
pub mod math;
pub mod measure;
pub mod methods;
pub mod progress;
#[cfg(feature = "report")]
pub mod report;
pub mod show;
pub mod synth;
pub mod work;
