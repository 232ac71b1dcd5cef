//! The kernel for other renderers, and run on an adapter here.
//!
//! ```
//! use selvedge_tools::gpu::kernel;
//!
//! // Every translation of one method's kernel: a file's name and its bytes.
//! let files = kernel::translate(&["sparse-ensemble"])?;
//! let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
//! assert!(names.contains(&"selvedge.spv") && names.contains(&"selvedge.hlsl"));
//! # Ok::<(), selvedge_tools::error::ToolError>(())
//! ```
//!
//! With the feature `gpu`, `runner` loads materials and answers queries; it has no tolerance to choose, since
//! every adapter gives the bits of the core:
//!
#![cfg_attr(feature = "gpu", doc = "```no_run")]
#![cfg_attr(not(feature = "gpu"), doc = "```ignore")]
//! use selvedge_tools::gpu::runner::{Gpu, Query, direction_words};
//! # fn first(material: &selvedge::Selvedge<'_>) -> Result<(), Box<dyn std::error::Error>> {
//! let up = direction_words(selvedge::Direction::from_unit_vector([0.0, 0.0, 1.0]));
//! if let Some(gpu) = Gpu::any()? {
//!     let loaded = gpu.load(std::slice::from_ref(material));
//!     let query = Query { u: 1 << 31, v: 1 << 31, light: up, view: up, ..Query::default() };
//!     let answers = gpu.answer(&loaded, "filtered", &[query])?;
//!     println!("{:?}", answers[0].rgb.map(f32::from_bits));
//! }
//! # Ok(())
//! # }
//! ```

#[cfg(any(feature = "cli", feature = "gpu"))]
pub mod kernel;
#[cfg(feature = "gpu")]
pub mod runner;
