//! A material in memory and its bytes; what is here knows no method.
//!
//! | module | holds |
//! |---|---|
//! | [`model`], [`texture`] | a material in memory; what a method stores, behind one trait |
//! | [`mod@write`], [`container`], [`tables`], [`bits`] | its bytes: header, directory, sections, checksums |
//! | [`triangulate`] | directions, their triangles and grid |
//! | [`mod@trim`], [`sector`], [`renumber`] | parts that a scene does not need, removed |
//! | [`mod@blend`] | two materials in coefficient space |
//! | [`units`] | ones of the fixed-point scales |
//!
//! A model is read from an open file, changed, and written again; what stays decodes to the same bits:
//!
//! ```
//! use selvedge_tools::format::trim::{Keep, Trim, trim};
//! use selvedge_tools::format::write::write_material;
//! use selvedge_tools::methods::read::model_of;
//! # let bytes = write_material(&(selvedge_tools::methods::METHODS[0].example)());
//!
//! let opened = selvedge::open(&bytes, &selvedge::Limits::default())?;
//! let model = model_of(&opened)?;
//! // The means alone: what an object far away needs.
//! let smaller = trim(&model, &Trim { channels: [Keep::Mean; 3], unused: true, ..Trim::default() })?;
//! assert!(write_material(&smaller).len() < bytes.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bits;
pub mod blend;
pub mod container;
pub mod draft;
pub mod model;
pub mod query;
pub mod renumber;
pub mod sector;
pub mod tables;
pub mod texture;
pub mod triangulate;
pub mod trim;
pub mod units;
pub mod write;
