//! The fast paths of the sparse ensemble: records unpacked once, for blocks of queries and for images.

mod batch;
mod image;
mod records;

pub(crate) use batch::{batch, batch_scratch_len};
pub(crate) use image::{image, image_scratch_len};
