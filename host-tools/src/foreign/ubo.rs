//! A dataset as a zip archive in the layout of UBO2003, which third-party readers open.
//!
//! `NAME/tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.jpg`: whole degrees in three digits, polar angle and
//! azimuth of light and view, a folder for each view; `NNNNN` counts the views. Pictures are JPEG of 8 bits
//! in sRGB, so values above 1 are clipped and every value has the error of a JPEG.

use super::images::{SAME_DEGREES, degrees_between};
use super::pixels::to_srgb;
use crate::data::dataset::Dataset;
use crate::data::directions::{from_degrees, to_degrees};
use crate::error::{Result, ToolError};
use crate::files::{folder_of, persist};
use glam::DVec3;
use rayon::prelude::*;
use std::io::{BufWriter, Write as _};
use std::path::Path;

/// Bytes of a texel of an image held, and its JPEG.
const EXPORT_BYTES: usize = 12 + 6;

/// How pictures are made.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Quality of the JPEG, 1 to 100.
    pub quality: u8,
    /// Factor before the values are clipped at 1.
    pub exposure: f32,
    /// Bytes for the images held at once.
    pub memory: usize,
}

/// What came of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exported {
    /// Values above 1, which were clipped.
    pub clipped: u64,
    /// Directions that whole degrees do not give, and how far the worst is away, in degrees.
    pub moved: (usize, f64),
}

/// Whole degrees of a direction, and how far they are from it.
fn whole(direction: DVec3) -> ([u32; 2], f64) {
    let [polar, azimuth] = to_degrees(direction).map(f64::round);
    let azimuth = if azimuth >= 360.0 || polar == 0.0 { 0.0 } else { azimuth };
    ([polar as u32, azimuth as u32], degrees_between(from_degrees(polar, azimuth), direction))
}

/// The whole degrees of a set of directions, which no two may share; counts those that they do not give.
fn named(what: &str, set: &[DVec3], moved: &mut (usize, f64)) -> Result<Vec<[u32; 2]>> {
    let mut angles: Vec<[u32; 2]> = Vec::new();
    for &direction in set {
        let (whole, away) = whole(direction);
        if angles.contains(&whole) {
            return Err(ToolError::Usage(format!(
                "two {what} directions are at {} and {} whole degrees, which the names of UBO2003 have",
                whole[0], whole[1]
            )));
        }
        if away > SAME_DEGREES {
            *moved = (moved.0 + 1, moved.1.max(away));
        }
        angles.push(whole);
    }
    Ok(angles)
}

/// The folder inside the archive: the material's name in characters that every system has.
fn folder_name(name: &str) -> String {
    let name: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).take(60).collect();
    if name.is_empty() { "material".into() } else { name }
}

/// Bytes of a JPEG, and how many values were clipped; `number` counts along the rows, three to a texel.
fn to_jpeg(
    [width, height]: [usize; 2],
    options: &Options,
    number: impl Fn(usize) -> f32,
) -> std::result::Result<(Vec<u8>, u64), String> {
    let mut clipped = 0;
    let shown: Vec<u8> = (0..width * height * 3)
        .map(|n| {
            let value = number(n) * options.exposure;
            clipped += u64::from(value > 1.0);
            (to_srgb(value.min(1.0)) * 255.0).round() as u8
        })
        .collect();
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, options.quality);
    encoder
        .encode(&shown, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok((bytes, clipped))
}

/// Writes the archive; `progress` gets how many of how many images are done.
///
/// # Errors
/// If two directions have the same whole degrees, and on I/O.
pub fn export(
    dataset: &Dataset,
    path: &Path,
    options: &Options,
    progress: &dyn Fn(usize, usize),
) -> Result<Exported> {
    let description = dataset.description();
    let mut exported = Exported::default();
    let lights = named("light", &description.lights, &mut exported.moved)?;
    let views = named("view", &description.views, &mut exported.moved)?;
    let name = folder_name(&description.texts[0]);
    let bad = |what: String| ToolError::Picture { path: path.to_owned(), what };
    let beside = tempfile::Builder::new()
        .prefix(".selvedge-")
        .tempfile_in(folder_of(path))
        .map_err(|error| ToolError::io(path)(error.kind().into()))?;
    let mut zip = zip::ZipWriter::new(BufWriter::new(beside));
    // JPEG does not get smaller.
    let entry = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let (texels, pairs) = (description.texels(), description.pairs());
    let batch = (options.memory / (texels * EXPORT_BYTES)).clamp(1, pairs);
    for first in (0..pairs).step_by(batch) {
        let count = batch.min(pairs - first);
        let values = dataset.read_images(first, count)?;
        let image = |i| to_jpeg(description.size, options, |n| values[(n / 3 * count + i) * 3 + n % 3]);
        let made: Vec<_> = (0..count).into_par_iter().map(image).collect();
        for (i, made) in made.into_iter().enumerate() {
            let (bytes, clipped) = made.map_err(bad)?;
            let (view, light) = ((first + i) / lights.len(), (first + i) % lights.len());
            let ([tl, pl], [tv, pv]) = (lights[light], views[view]);
            let file =
                format!("{name}/tv{tv:03}_pv{pv:03}/{view:05} tl{tl:03} pl{pl:03} tv{tv:03} pv{pv:03}.jpg");
            zip.start_file(file, entry).map_err(|error| bad(error.to_string()))?;
            zip.write_all(&bytes).map_err(ToolError::io(path))?;
            exported.clipped += clipped;
        }
        progress(first + count, pairs);
    }
    let buffer = zip.finish().map_err(|error| bad(error.to_string()))?;
    let beside = buffer.into_inner().map_err(|error| ToolError::io(path)(error.into_error()))?;
    persist(beside, path)?;
    Ok(exported)
}
