//! A dataset as a folder of images.

use super::listing::{Entry, LISTING, Listing, SAME_DEGREES, bad};
use super::names::in_name;
use super::pairs::degrees_between;
use crate::data::dataset::{Dataset, Sample};
use crate::data::directions::to_degrees;
use crate::error::{Result, ToolError};
use crate::files;
use crate::foreign::pixels::to_srgb;
use exr::prelude::{Image, IntoSample, SpecificChannels, Vec2, WritableImage as _, f16};
use rayon::prelude::*;
use std::path::Path;

/// Bytes per texel of an image that is held and encoded.
const EXPORT_BYTES: usize = 12 + 12;

/// What images an export writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Linear floats of the dataset's own width: nothing is lost.
    Exr,
    /// sRGB in 16 bits: values above 1 become 1, and the others are off by 2e-5 at most.
    Png,
}

/// Writes a dataset as a folder of images and a `dataset.json`, which comes last; returns how many values a
/// PNG clamped.
///
/// # Errors
/// If the folder has a `dataset.json` already, if two directions are closer than 0.01 degrees, and on I/O.
pub fn export(
    dataset: &Dataset,
    folder: &Path,
    format: Format,
    memory: usize,
    progress: &dyn Fn(usize, usize),
) -> Result<u64> {
    let description = dataset.description();
    let listing_path = folder.join(LISTING);
    std::fs::create_dir_all(folder).map_err(ToolError::io(folder))?;
    if listing_path.try_exists().map_err(ToolError::io(&listing_path))? {
        return Err(ToolError::Usage(format!("{}: there is a dataset already", listing_path.display())));
    }
    for (what, set) in [("light", &description.lights), ("view", &description.views)] {
        if let Some(i) = (1..set.len())
            .find(|&i| set[..i].iter().any(|&other| degrees_between(other, set[i]) < SAME_DEGREES))
        {
            let what = format!(
                "{what} direction {i} is within {SAME_DEGREES} degrees of an earlier one; an import would take them \
                 for the same"
            );
            return Err(bad(dataset.path(), what));
        }
    }
    let ending = if format == Format::Exr { "exr" } else { "png" };
    let entry = |pair: usize| {
        let ends = [
            description.lights[pair % description.lights.len()],
            description.views[pair / description.lights.len()],
        ];
        let [light, view] = ends.map(|d| to_degrees(d).map(|angle| (angle * 1e6).round() / 1e6));
        let [[tl, pl], [tv, pv]] = [light, view].map(|angles| angles.map(in_name));
        Entry { file: format!("tl{tl}_pl{pl}_tv{tv}_pv{pv}.{ending}").into(), light, view }
    };

    let (texels, pairs) = (description.texels(), description.pairs());
    let batch = (memory / (texels * EXPORT_BYTES)).clamp(1, pairs);
    let mut clamped = 0;
    for first in (0..pairs).step_by(batch) {
        let count = batch.min(pairs - first);
        let values = dataset.read_images(first, count)?;
        let written: Vec<Result<u64>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let path = folder.join(entry(first + i).file);
                let number = |texel: usize, c: usize| values[(texel * count + i) * 3 + c];
                let (bytes, clamped) = match format {
                    Format::Exr => (
                        to_exr(description.size, description.sample, number)
                            .map_err(|error| bad(&path, error.to_string()))?,
                        0,
                    ),
                    Format::Png => {
                        to_png(description.size, number).map_err(|error| bad(&path, error.to_string()))?
                    }
                };
                files::write(&path, &bytes).map(|()| clamped)
            })
            .collect();
        for result in written {
            clamped += result?;
        }
        progress(first + count, pairs);
    }
    let [name, origin, licence] = description.texts.clone();
    let listing = Listing {
        cosine_included: Some(description.cosine_included),
        texel_nm: description.texel_nm,
        name,
        origin,
        licence,
        lights: description.lights.clone(),
        views: description.views.clone(),
        images: Some((0..pairs).map(entry).collect()),
    };
    files::write(&listing_path, &serde_json::to_vec_pretty(&listing).expect("plain data"))?;
    Ok(clamped)
}

/// The 16-bit sRGB value of a linear one from 0 to 1.
pub(super) fn to_srgb16(linear: f32) -> u16 {
    (to_srgb(linear) * 65_535.0).round() as u16
}

/// Bytes of a PNG, and how many values were clamped; `number` is of a texel and a colour.
pub(super) fn to_png(
    [width, height]: [usize; 2],
    number: impl Fn(usize, usize) -> f32,
) -> std::result::Result<(Vec<u8>, u64), png::EncodingError> {
    let mut clamped = 0;
    let mut data = Vec::with_capacity(width * height * 6);
    for i in 0..width * height * 3 {
        let value = number(i / 3, i % 3);
        clamped += u64::from(value > 1.0);
        data.extend(to_srgb16(value.min(1.0)).to_be_bytes());
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&data)?;
    writer.finish()?;
    Ok((bytes, clamped))
}

/// Bytes of an EXR of the dataset's own numbers.
pub(super) fn to_exr(
    size: [usize; 2],
    sample: Sample,
    number: impl Fn(usize, usize) -> f32 + Sync,
) -> exr::error::Result<Vec<u8>> {
    fn rgb<T: IntoSample>(
        [width, height]: [usize; 2],
        number: impl Fn(usize, usize) -> T + Sync,
    ) -> exr::error::Result<Vec<u8>> {
        let pixel = |at: Vec2<usize>| {
            let texel = at.y() * width + at.x();
            (number(texel, 0), number(texel, 1), number(texel, 2))
        };
        let mut bytes = std::io::Cursor::new(Vec::new());
        Image::from_channels((width, height), SpecificChannels::rgb(pixel))
            .write()
            .non_parallel()
            .to_buffered(&mut bytes)?;
        Ok(bytes.into_inner())
    }
    match sample {
        // Exact: the numbers come from binary16.
        Sample::Half => rgb(size, |texel, c| f16::from_f32(number(texel, c))),
        Sample::Float => rgb(size, number),
    }
}
