//! Sets of images, one per pair of directions, into the dataset file and back: folders, and zip archives as
//! UBO2003 and ATRIUM are published.
//!
//! Images are what [`super::pixels`] reads, in the folder, in folders below it, or in the archive. Row 0 of
//! an image is the row y = 0 of texels.
//!
//! The directions of an image stand in its name, which ends in `tl<n>pl<n>tv<n>pv<n>` before `.exr`, `.png`,
//! `.jpg`, `.jpeg` or `.hdr`: polar and azimuth of the light, then of the view, in degrees; or in the view's
//! and then the light's, `tv<n>pv<n>tl<n>pl<n>`. Any prefix may precede, anything but letters and digits may
//! separate, case does not matter: `tl023.5_pl030_tv000_pv000.exr`, `00008 tl000 pl000 tv030 pv030.jpg`. Or
//! the folder's `dataset.json` lists the images. All its fields may be left out; no others are allowed:
//!
//! ```json
//! { "cosine_included": true, "texel_nm": [100000, 100000], "name": "", "origin": "", "licence": "",
//!   "lights": [[0, 0, 1]], "views": [[0, 0, 1]],
//!   "images": [{ "file": "a.exr", "light": [0, 0], "view": [0, 0] }] }
//! ```
//!
//! With `images`, nothing else in the folder is looked at; without, every file with such an ending that is
//! not hidden must have its angles. `lights` and `views` are unit vectors that the dataset shall have, in its
//! order, and every direction of an image is one of them; an export writes them, so that its import has the
//! same bits. Without them a set has the directions of the images sorted by polar angle and azimuth, or a
//! known grid's, where they are one.
//!
//! Neither way holds the data: as many images as fit are turned from rows of texels into runs of pairs, or
//! back.
//!
//! | module | does |
//! |---|---|
//! | `names` | the images of a folder or an archive, and their angles |
//! | `pairs` | sets of directions, and the image of every pair |
//! | `read` | the set as a dataset |
//! | `write` | a dataset as a set |

mod names;
mod pairs;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub(super) use pairs::degrees_between;
pub use read::{ImageSet, import};
pub use write::{Format, export};

use crate::error::ToolError;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file that may list the images.
const LISTING: &str = "dataset.json";
/// Directions closer than this are the same, in degrees.
pub const SAME_DEGREES: f64 = 0.01;

/// `dataset.json`.
#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Listing {
    cosine_included: Option<bool>,
    texel_nm: [u32; 2],
    name: String,
    origin: String,
    licence: String,
    lights: Vec<DVec3>,
    views: Vec<DVec3>,
    images: Option<Vec<Entry>>,
}

/// An image of the listing; directions are polar angle and azimuth in degrees.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    file: PathBuf,
    light: [f64; 2],
    view: [f64; 2],
}

/// What is wrong with a file or a folder of images.
fn bad(path: &Path, what: impl Into<String>) -> ToolError {
    ToolError::Picture { path: path.to_owned(), what: what.into() }
}
