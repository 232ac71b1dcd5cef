//! Host side of Selvedge: importers, the writer, checks, pictures, and the kernel on a GPU.
//!
//! | module | does |
//! |---|---|
//! | [`sparsebtf`] | reads the files of SparseBTF 2023 |
//! | [`foreign`] | materials in the formats of others become datasets, and back: folders and zips of images, `.btf` of Bonn |
//! | [`model`], [`write`](mod@write), [`triangulate`] | a quantised material in memory, and its bytes |
//! | [`dataset`], [`directions`], [`pyramid`] | the working file of a material's data, its grids, its levels of detail |
//! | [`synth`] | data of modelled mesostructures |
//! | [`transfer`], [`blocks`], [`linear`] | radiance to channels, blocks and moments, matrices |
//! | [`dictionary`], [`train`](mod@train), [`dictionary_file`] | ensembles in floats, their training, their files |
//! | [`encode`](mod@encode), [`measure`] | data become a file for a goal; how far two materials are apart |
//! | [`quantise`] | coefficients become integers |
//! | [`tensor`] | the encoder of the sparse tensor |
//! | [`read`], [`trim`](mod@trim), [`sector`] | a file becomes a model again, and a smaller one |
//! | [`expand`](mod@expand) | a file decoded whole becomes a dataset |
//! | [`blend`](mod@blend), [`basis`] | a material between two |
//! | [`story`], [`progress`] | the encoder's part of the demo; a line on a terminal |
//! | [`validate`](mod@validate) | every finding of a file, in words |
//! | [`inspect`], [`explain`](mod@explain), [`picture`], [`show`], [`demo`] | what `info`, `explain`, `decode` and `demo` show |
//! | [`kernel`], [`gpu`] | the kernel for other renderers, and run here |
//! | [`example`], [`extreme`], [`random`] | files that the specification and the tests use |
//! | [`count`] | the price of a sample, walked |
//! | [`vectors`], [`conform`] | the conformance suite, made of recipes; decoders held against it |
//! | [`baseline`], [`similarity`], [`speed`], [`report`] | what the encoder is measured against, how pictures and run times are compared, and the report of all |
//! | [`cli`] | the program |
//! | [`files`], [`error`] | whole writes, exit codes |

pub mod baseline;
pub mod basis;
pub mod blend;
pub mod blocks;
pub mod cli;
pub mod conform;
pub mod count;
pub mod dataset;
pub mod demo;
pub mod dictionary;
pub mod dictionary_file;
pub mod directions;
pub mod encode;
pub mod error;
pub mod example;
pub mod expand;
pub mod explain;
pub mod extreme;
pub mod files;
pub mod foreign;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod inspect;
pub mod kernel;
pub mod linear;
pub mod measure;
pub mod model;
pub mod picture;
pub mod progress;
pub mod pyramid;
pub mod quantise;
pub mod random;
pub mod read;
pub mod report;
pub mod sector;
pub mod show;
pub mod similarity;
pub mod sparsebtf;
pub mod speed;
pub mod stability;
pub mod story;
pub mod synth;
pub mod tensor;
pub mod train;
pub mod transfer;
pub mod triangulate;
pub mod trim;
pub mod validate;
pub mod vectors;
pub mod write;
