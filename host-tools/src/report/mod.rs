//! Error against run time: every method and baseline over a sweep of its quality on some datasets, as tables,
//! plots, pictures and one page.
//!
//! A line of the table ([`Line`]) is complete when it is written: it is appended to `measured.jsonl` in the
//! folder of the report, and a later run with the same dataset, method and setting takes it from there. Files
//! that were encoded lie in `files/`.

mod bench;
mod line;
mod memory;
pub mod page;
mod plot;
pub mod stability;
mod store;
pub mod sweep;
mod table;

pub use line::{HeldOut, Kind, Line, Operations, Request};
pub use store::Store;
