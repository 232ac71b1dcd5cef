//! A file decoded whole: every texel at all its own directions, as a dataset.

use crate::data::dataset::{Dataset, Description, Sample, Writer};
use crate::error::Result;
use crate::measure::compare;
use crate::measure::radiance::AtLevel;
use rayon::prelude::*;
use selvedge::Selvedge;
use std::path::Path;

/// What a dataset of a file is.
pub fn description(file: &Selvedge<'_>) -> Description {
    let (header, metadata) = (file.header(), file.metadata());
    Description {
        sample: Sample::Float,
        cosine_included: header.cosine_included != 0,
        texel_nm: [metadata.texel_width_nm, metadata.texel_height_nm],
        texts: [metadata.name.into(), metadata.origin.into(), metadata.licence.into()],
        ..compare::describe(file)
    }
}

/// Decodes a file into a dataset of binary32; `progress` hears how many of how many pairs of directions are
/// done.
///
/// # Errors
/// On I/O.
pub fn expand(
    file: &Selvedge<'_>,
    output: &Path,
    memory: usize,
    progress: &dyn Fn(usize, usize),
) -> Result<Dataset> {
    let description = description(file);
    let writer = Writer::create(output, description.clone())?;
    let (texels, pairs, lights) = (description.texels(), description.pairs(), description.lights.len());
    let batch = (memory / (texels * 12)).clamp(1, pairs);
    for first in (0..pairs).step_by(batch) {
        let count = batch.min(pairs - first);
        let image = |i: usize| {
            let pair = first + i;
            compare::image(&AtLevel::finest(file), &description, pair % lights, pair / lights)
        };
        let images = (0..count).into_par_iter().map(image).collect::<Result<Vec<_>>>()?;
        writer.put_images(first, &images)?;
        progress(first + count, pairs);
    }
    writer.finish()?;
    Dataset::open(output)
}
