//! The methods: a folder each, with everything that a method has, and what several of them share.
//!
//! ```
//! use selvedge_tools::format::write::write_material;
//! use selvedge_tools::methods::{METHODS, by_name, of};
//!
//! for method in METHODS {
//!     println!("{}: {} ({})", method.number, method.name, method.paper);
//! }
//! // The smallest file of a method, and the method of a file.
//! let bytes = write_material(&(by_name("sparse-tensor")?.example)());
//! let opened = selvedge::open(&bytes, &selvedge::Limits::default())?;
//! assert_eq!(of(&opened)?.name, "sparse-tensor");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod advice;
pub mod means;
pub mod method;
pub mod reach;
pub mod read;
pub mod registry;
pub mod sample;
pub mod sparse_ensemble;
pub mod sparse_tensor;

pub use method::Method;
pub use registry::{METHODS, by_name, by_number, of};
