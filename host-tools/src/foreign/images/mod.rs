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
//! | `listing` | the listing of a folder |
//! | `names` | the images of a folder or an archive, and their angles |
//! | `pairs` | sets of directions, and the image of every pair |
//! | `read` | the set as a dataset |
//! | `write` | a dataset as a set |

mod listing;
mod names;
mod pairs;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use listing::SAME_DEGREES;
pub(super) use pairs::degrees_between;
pub use read::{ImageSet, import};
pub use write::{Format, export};
