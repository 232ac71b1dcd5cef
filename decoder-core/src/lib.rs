//! Decoder of Selvedge files: compressed measured materials (bidirectional texture functions).
//!
//! The same file gives the same bits on every CPU, GPU and microcontroller: everything that decides a
//! result is 32-bit integer arithmetic, and the WGSL kernel in `selvedge-shaders` mirrors this crate
//! function by function. `no_std`, no allocation, no unsafe code, no dependency, no panic.
//!
//! [`open`] checks every rule of the specification once. What it returns cannot fail:
//!
//! ```
//! # let bytes = include_bytes!("../../tests/data/carpet07-excerpt.selv");
//! use selvedge::{Direction, Limits};
//!
//! let material = selvedge::open(bytes, &Limits::default())?;
//! let light = Direction::from_unit_vector([0.3, 0.1, 0.948]);
//! let view = Direction::from_unit_vector([0.0, 0.0, 1.0]);
//! let rgb = material.filtered(0x2000_0000, 0xc000_0000, light, view).to_f32();
//! assert!(rgb.iter().all(|c| c.is_finite() && *c >= 0.0));
//! # Ok::<(), selvedge::Finding>(())
//! ```
//!
//! The modules follow the chapters of the specification; those marked with a star have a twin in WGSL.
//!
//! | chapter | modules |
//! |---|---|
//! | 1 conventions | [`words`]*, [`material`]*, [`error`], `check` |
//! | 2 fixed-point arithmetic | [`fixed`]* |
//! | 3 container | [`header`], [`directory`], [`metadata`] |
//! | 4 stated cost | [`limits`], [`cost`] |
//! | 5 directions | [`direction`]*, [`direction_set`] |
//! | 6 position | [`position`]* |
//! | 7 colour | [`colour`]* |
//! | 8, 9 interpolation, levels | [`interpolation`]*, [`pair_table`] |
//! | 10 sparse ensemble | `ensemble`*, `ensemble_set` |
//! | 11 results and digest | [`result`] |
//! | 12 sparse tensor | `tensor`*, `tensor_set` |
//! | all of them together | `open`, and the fast paths `batch` and `image` |

#![no_std]
#![forbid(unsafe_code)]
#![allow(clippy::too_many_arguments, reason = "twins spell out every parameter, in the order of the kernel")]
#![allow(
    clippy::manual_clamp,
    clippy::manual_range_contains,
    reason = "twins are written in the dialect that WGSL can say"
)]

#[cfg(test)]
extern crate std;

#[cfg(feature = "batch")]
pub mod batch;
mod check;
pub mod colour;
pub mod cost;
mod crc32;
pub mod direction;
pub mod direction_set;
pub mod directory;
#[cfg(feature = "sparse-ensemble")]
pub mod ensemble;
#[cfg(feature = "sparse-ensemble")]
pub mod ensemble_set;
pub mod error;
pub mod fixed;
pub mod header;
#[cfg(feature = "batch")]
pub mod image;
pub mod interpolation;
pub mod limits;
pub mod material;
pub mod metadata;
#[cfg(not(feature = "sparse-ensemble"))]
mod no_ensemble;
#[cfg(not(feature = "sparse-tensor"))]
mod no_tensor;
mod open;
pub mod pair_table;
pub mod position;
#[cfg(feature = "batch")]
mod records;
pub mod result;
mod sha256;
#[cfg(any(feature = "sparse-ensemble", feature = "sparse-tensor"))]
pub mod stream;
#[cfg(feature = "sparse-tensor")]
pub mod tensor;
#[cfg(feature = "batch")]
mod tensor_paths;
#[cfg(feature = "sparse-tensor")]
pub mod tensor_set;
pub mod words;

#[cfg(feature = "batch")]
pub use batch::FilteredQuery;
pub use check::Section;
pub use colour::{Rgb, Values};
pub use crc32::crc32;
pub use direction::{Direction, Taps};
pub use error::{Family, Finding, First, Part, Rule, Sink};
pub use header::Header;
pub use limits::Limits;
pub use material::Material;
pub use metadata::Metadata;
pub use open::{Selvedge, open, open_telling, open_with, validate};
pub use result::{BufferTooSmall, position_from_f32};
pub use sha256::{Digest, Sha256, sha256};
