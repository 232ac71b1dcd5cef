//! Decoder of Selvedge files: compressed measured materials (bidirectional texture functions).
//!
//! The same file gives the same bits on every CPU, GPU and microcontroller: everything that decides a
//! result is 32-bit integer arithmetic, and the WGSL kernel in `selvedge-shaders` mirrors this crate
//! function by function. `no_std`, no allocation, no unsafe code, no dependency, no panic.
//!
//! [`open`] checks every rule of the specification once. What it returns cannot fail:
//!
//! ```
//! # let bytes = include_bytes!("../tests/data/carpet07-excerpt.selv");
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
//! | chapter | modules; those marked with a star have a twin in WGSL |
//! |---|---|
//! | 1 conventions | [`words`](kernel::words)*, [`material`](kernel::material)*, [`Rule`], `walk` |
//! | 2 fixed-point arithmetic | [`fixed`](kernel::fixed)* |
//! | 3 container | [`container`] |
//! | 4 stated cost | [`Limits`], [`walk::cost`] |
//! | 5 directions | [`direction`](kernel::direction)*, [`container::directions`] |
//! | 6 position | [`position`](kernel::position)* |
//! | 7 colour | [`colour`](kernel::colour)* |
//! | 8, 9 interpolation, levels | [`interpolation`](kernel::interpolation)*, [`container::pair_table`] |
//! | 10 sparse ensemble | `method::sparse_ensemble`* and its checks |
//! | 11 decode digest | [`Selvedge::decode_digest`] |
//! | 12 sparse tensor | `method::sparse_tensor`* and its checks |
//! | all of them together | [`open`], [`Selvedge`], and the fast paths `batch` and `image` |
//!
//! What stands at the root is for embedders and stable within a version. [`kernel`], [`container`], [`method`]
//! and [`walk`] are for tools, tests and second implementations, without a promise.

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
mod batch;
pub mod container;
mod digest;
mod error;
#[cfg(feature = "batch")]
mod fast;
#[cfg(feature = "batch")]
mod image;
pub mod kernel;
pub mod method;
mod open;
#[cfg(feature = "batch")]
mod query;
mod selvedge;
pub mod walk;

pub use container::header::Header;
pub use container::metadata::Metadata;
pub use digest::{DIGEST_QUERIES, next_query_word};
pub use error::{Family, Finding, First, Part, Rule, Sink};
pub use kernel::colour::{Rgb, Values};
pub use kernel::direction::{Direction, Located, Taps};
pub use kernel::material::Material;
pub use open::{open, open_reporting, open_with, validate};
#[cfg(feature = "batch")]
pub use query::FilteredQuery;
pub use selvedge::{BufferTooSmall, Selvedge, position_from_f32};
pub use walk::check::Section;
pub use walk::crc32::crc32;
pub use walk::limits::Limits;
pub use walk::sha256::{Digest, Sha256, sha256};
