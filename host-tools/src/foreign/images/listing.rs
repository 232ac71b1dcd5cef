//! The listing of a folder of images, `dataset.json`.

use crate::error::ToolError;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file that may list the images.
pub(super) const LISTING: &str = "dataset.json";
/// Directions closer than this are the same, in degrees.
pub const SAME_DEGREES: f64 = 0.01;

/// `dataset.json`.
#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Listing {
    pub(super) cosine_included: Option<bool>,
    pub(super) texel_nm: [u32; 2],
    pub(super) name: String,
    pub(super) origin: String,
    pub(super) licence: String,
    pub(super) lights: Vec<DVec3>,
    pub(super) views: Vec<DVec3>,
    pub(super) images: Option<Vec<Entry>>,
}

/// An image of the listing; directions are polar angle and azimuth in degrees.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) file: PathBuf,
    pub(super) light: [f64; 2],
    pub(super) view: [f64; 2],
}

/// What is wrong with a file or a folder of images.
pub(super) fn bad(path: &Path, what: impl Into<String>) -> ToolError {
    ToolError::Picture { path: path.to_owned(), what: what.into() }
}
