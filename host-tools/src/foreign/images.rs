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

use super::archive::Archive;
use super::pixels::{self, to_srgb};
use super::{Clipped, ImportOptions, Imported};
use crate::data::dataset::{Dataset, Description, MOST_DIRECTIONS, Sample, Writer, first_beyond};
use crate::data::directions::{from_degrees, grid, to_degrees};
use crate::error::{Result, ToolError};
use crate::files;
use exr::prelude::{Image, IntoSample, SpecificChannels, Vec2, WritableImage as _, f16};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

/// The file that may list the images.
const LISTING: &str = "dataset.json";
/// Directions closer than this are the same, in degrees.
pub const SAME_DEGREES: f64 = 0.01;
/// Bytes per texel of an image that is held, and of one while it is encoded.
const IMPORT_BYTES: usize = 12;
const EXPORT_BYTES: usize = 12 + 12;
/// Bytes that a single image may take in any case, and beyond its pixels: for text and thumbnails.
const SINGLE: usize = 1 << 20;
/// Images decoded at once before the first error is looked for.
const WAVE: usize = 64;
/// Endings of names that are images.
const ENDINGS: [&str; 5] = ["exr", "png", "jpg", "jpeg", "hdr"];

/// What images an export writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Linear floats of the dataset's own width: nothing is lost.
    Exr,
    /// sRGB in 16 bits: values above 1 become 1, and the others are off by 2e-5 at most.
    Png,
}

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

/// A set of images whose names are read, in the order of its directions.
pub struct ImageSet {
    archive: Archive,
    /// Names of the images in the dataset's order of pairs.
    names: Vec<PathBuf>,
    description: Description,
}

impl ImageSet {
    /// Reads names, directions and the size of the first image.
    ///
    /// # Errors
    /// If the listing or a name is not as the module says; if a pair of directions is missing or there twice;
    /// if the first image cannot be decoded; on I/O.
    pub fn open(path: &Path, memory: usize) -> Result<ImageSet> {
        ImageSet::of(Archive::open(path)?, memory)
    }

    /// The same of an archive.
    ///
    /// # Errors
    /// As [`ImageSet::open`].
    pub fn of(archive: Archive, memory: usize) -> Result<ImageSet> {
        let path = &archive.path().to_owned();
        let memory = memory.max(SINGLE);
        let mut listing = Listing::default();
        let place = archive.find_shallow(LISTING);
        if let Some(name) = &place {
            let mut bytes = Vec::new();
            let file = archive.describe(name);
            archive.read(name, memory)?.read_to_end(&mut bytes).map_err(ToolError::io(&file))?;
            listing = serde_json::from_slice(&bytes).map_err(|error| bad(&file, error.to_string()))?;
        }
        let below = place.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        let entries = find(&archive, below, listing.images.take())?;
        let lights = set_of("light", path, listing.lights, entries.iter().map(|entry| entry.light))?;
        let views = set_of("view", path, listing.views, entries.iter().map(|entry| entry.view))?;
        let names: Vec<PathBuf> =
            arrange(path, &entries, &lights, &views)?.into_iter().map(Path::to_owned).collect();
        let first = pixels::open(archive.read(&names[0], memory)?, memory)
            .map_err(|what| bad(&archive.describe(&names[0]), what))?;
        let description = Description {
            size: first.size,
            lights,
            views,
            sample: Sample::default(),
            cosine_included: listing.cosine_included.unwrap_or(true),
            texel_nm: listing.texel_nm,
            texts: [listing.name, listing.origin, listing.licence],
        };
        Ok(ImageSet { archive, names, description })
    }

    /// What the set says of itself.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Makes a dataset; `progress` hears how many of how many images are done.
    ///
    /// # Errors
    /// If an image is damaged, not of the first one's size, or has a number that is no radiance, with the
    /// file and the pixel; on I/O. There is no dataset then.
    pub fn import(
        &self,
        output: &Path,
        options: &ImportOptions,
        progress: &dyn Fn(usize, usize),
    ) -> Result<Imported> {
        let size = self.description.size;
        let writer = Writer::create(output, options.describe(&self.description))?;
        let (texels, pairs) = (size[0] * size[1], self.names.len());
        let batch = (options.memory / (texels * IMPORT_BYTES)).clamp(1, pairs);
        let (mut negative, mut first) = (0, 0);
        while first < pairs {
            let count = batch.min(pairs - first);
            let mut images = Vec::with_capacity(count);
            for wave in (first..first + count).step_by(WAVE) {
                // All results are kept, so that the error is that of the first bad image, whichever thread
                // was first.
                let decoded: Vec<Result<(Vec<[f32; 3]>, u64)>> = (wave..(wave + WAVE).min(first + count))
                    .into_par_iter()
                    .map(|pair| self.image(pair, options))
                    .collect();
                for result in decoded {
                    let (image, cut) = result?;
                    negative += cut;
                    images.push(image);
                }
            }
            writer.put_images(first, &images)?;
            first += count;
            progress(first, pairs);
        }
        let notes = if negative == 0 {
            Vec::new()
        } else {
            vec![format!("{negative} values were negative, as of colours outside of RGB; they are 0 now")]
        };
        Ok(Imported { statistics: writer.finish()?, notes })
    }

    /// The linear pixels of a pair's image, row by row, and how many negative values became 0.
    ///
    /// # Errors
    /// If it is damaged, not of the first one's size, or has a number that is no radiance, with the file and
    /// the pixel.
    pub fn image(&self, pair: usize, options: &ImportOptions) -> Result<(Vec<[f32; 3]>, u64)> {
        let (size, name) = (self.description.size, &self.names[pair]);
        let path = || self.archive.describe(name);
        // As large as the first, and no more: many threads do this at once.
        let memory = (size[0] * size[1] * pixels::PIXEL_BYTES + SINGLE).min(options.memory.max(SINGLE));
        let opened =
            pixels::open(self.archive.read(name, memory)?, memory).map_err(|what| bad(&path(), what))?;
        if opened.size != size {
            let first = self.archive.describe(&self.names[0]);
            let [width, height] = opened.size;
            let what = format!(
                "{width} x {height} pixels, where the first image, {}, has {} x {}",
                first.display(),
                size[0],
                size[1]
            );
            return Err(bad(&path(), what));
        }
        let mut pixels = opened.pixels(options.colours).map_err(|what| bad(&path(), what))?;
        // Colours that sRGB does not have, and noise about black.
        let negative = Clipped::of(pixels.as_flattened_mut()).count;
        match first_beyond(pixels.as_flattened(), options.sample.largest()) {
            Some(i) => {
                let refused = options.refusal(pixels[i / 3][i % 3]);
                let (x, y, channel) = (i / 3 % size[0], i / 3 / size[0], ["red", "green", "blue"][i % 3]);
                Err(bad(&path(), format!("pixel ({x}, {y}), {channel}: {refused}")))
            }
            None => Ok((pixels, negative)),
        }
    }
}

/// Makes a dataset of a folder or an archive of images; `progress` hears how many of how many images are
/// done.
///
/// # Errors
/// As [`ImageSet::open`] and [`ImageSet::import`].
pub fn import(
    path: &Path,
    output: &Path,
    options: &ImportOptions,
    progress: &dyn Fn(usize, usize),
) -> Result<Imported> {
    ImageSet::open(path, options.memory)?.import(output, options, progress)
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
                "{what} direction {i} is within {SAME_DEGREES} degrees of an earlier one; an import would take them for the same"
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

/// What is wrong with a file or a folder of images.
fn bad(path: &Path, what: impl Into<String>) -> ToolError {
    ToolError::Picture { path: path.to_owned(), what: what.into() }
}

/// Whether a name ends as that of an image does.
fn is_image(path: &Path) -> bool {
    path.extension().is_some_and(|found| ENDINGS.iter().any(|ending| found.eq_ignore_ascii_case(ending)))
}

/// The images of the listing, or of the archive in the order of their names, with sound angles.
fn find(archive: &Archive, below: &Path, listed: Option<Vec<Entry>>) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    if let Some(listed) = listed {
        for mut entry in listed {
            // A listing from elsewhere reads nothing outside its folder.
            if entry.file.components().any(|part| !matches!(part, Component::Normal(_))) {
                return Err(bad(
                    &archive.describe(Path::new(LISTING)),
                    format!("{}: not a path inside the folder", entry.file.display()),
                ));
            }
            entry.file = below.join(&entry.file);
            // Before hours of reading the others.
            if !archive.has(&entry.file) {
                return Err(bad(&archive.describe(&entry.file), "there is no such file"));
            }
            entries.push(entry);
        }
    } else {
        for file in archive.names()?.into_iter().filter(|name| is_image(name)) {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
            let Some([light, view]) = angles_of(&stem) else {
                return Err(bad(
                    &archive.describe(&file),
                    format!(
                        "the name does not end in tl<n>pl<n>tv<n>pv<n>, and no {LISTING} lists the images"
                    ),
                ));
            };
            entries.push(Entry { file, light, view });
        }
    }
    for entry in &mut entries {
        for (what, angles) in [("light", &mut entry.light), ("view", &mut entry.view)] {
            let [polar, azimuth] = *angles;
            if !(0.0..=90.0).contains(&polar) || !azimuth.is_finite() {
                return Err(bad(
                    &archive.describe(&entry.file),
                    format!("{what} at ({polar}, {azimuth}) degrees; the polar angle is from 0 to 90"),
                ));
            }
            // A remainder of minus a trifle rounds to 360.
            let turned = azimuth.rem_euclid(360.0);
            // At the normal every azimuth is the same, and minus zero is zero.
            *angles =
                if polar < 1e-9 { [0.0; 2] } else { [polar, if turned >= 360.0 { 0.0 } else { turned }] };
        }
    }
    if entries.is_empty() {
        Err(bad(archive.path(), "there are no images: no EXR, PNG, JPEG or Radiance pictures"))
    } else {
        Ok(entries)
    }
}

/// The angles that a stem ends in, light before view or view before light, from the first tag after which all
/// is as it should be.
fn angles_of(stem: &str) -> Option<[[f64; 2]; 2]> {
    let after = |tags: [&str; 4]| {
        stem.match_indices(tags[0]).find_map(|(at, _)| {
            let mut rest = &stem[at..];
            let mut next = |tag: &str| {
                let after =
                    rest.trim_start_matches(|c: char| !c.is_ascii_alphanumeric()).strip_prefix(tag)?;
                let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
                let sign = usize::from(after.starts_with('-'));
                let whole = sign + digits(&after[sign..]);
                // A point is part of the number only before a digit; else it separates.
                let part = after[whole..].strip_prefix('.').map_or(0, digits);
                let (number, behind) = after.split_at(if part > 0 { whole + 1 + part } else { whole });
                rest = behind;
                number.parse::<f64>().ok()
            };
            let angles = [[next(tags[0])?, next(tags[1])?], [next(tags[2])?, next(tags[3])?]];
            rest.is_empty().then_some(angles)
        })
    };
    after(["tl", "pl", "tv", "pv"])
        .or_else(|| after(["tv", "pv", "tl", "pl"]).map(|[view, light]| [light, view]))
}

/// An angle in a name: three digits, and up to three decimals.
fn in_name(angle: f64) -> String {
    let text = format!("{angle:07.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "360" { "000".into() } else { text.into() }
}

/// The angle between two directions; NaN if one has no length.
pub(super) fn degrees_between(a: DVec3, b: DVec3) -> f64 {
    // The chord, which is precise where the arc's cosine is not, and the arc wherever it matters here.
    (a.normalize() - b.normalize()).length().to_degrees()
}

/// The set of directions: the listed one, or the images' own, sorted, or the known grid that they are.
fn set_of(
    what: &str,
    folder: &Path,
    listed: Vec<DVec3>,
    angles: impl Iterator<Item = [f64; 2]>,
) -> Result<Vec<DVec3>> {
    let too_many = || bad(folder, format!("more than {MOST_DIRECTIONS} {what} directions"));
    if !listed.is_empty() {
        return if listed.len() > MOST_DIRECTIONS { Err(too_many()) } else { Ok(listed) };
    }
    let mut angles: Vec<[f64; 2]> = angles.collect();
    angles.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    angles.dedup();
    let mut set: Vec<DVec3> = Vec::new();
    for [polar, azimuth] in angles {
        let direction = from_degrees(polar, azimuth);
        if !set.iter().any(|&other| degrees_between(other, direction) < SAME_DEGREES) {
            if set.len() == MOST_DIRECTIONS {
                return Err(too_many());
            }
            set.push(direction);
        }
    }
    let is_grid = |grid: &Vec<DVec3>| {
        grid.iter().all(|&g| set.iter().filter(|&&d| degrees_between(d, g) < SAME_DEGREES).count() == 1)
    };
    Ok(grid(set.len()).filter(is_grid).unwrap_or(set))
}

/// The file of every pair in the dataset's order.
fn arrange<'a>(
    folder: &Path,
    entries: &'a [Entry],
    lights: &[DVec3],
    views: &[DVec3],
) -> Result<Vec<&'a Path>> {
    let nearest = |set: &[DVec3], [polar, azimuth]: [f64; 2]| {
        let asked = from_degrees(polar, azimuth);
        let distances = set.iter().map(|&other| degrees_between(other, asked)).enumerate();
        // An image's direction may be this far from the one that stands for it, and that one as far from a
        // grid's.
        distances
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|&(_, distance)| distance <= 2.0 * SAME_DEGREES)
            .map(|(i, _)| i)
    };
    // The same angles come in thousands of names.
    let mut known: [HashMap<[u64; 2], Option<usize>>; 2] = Default::default();
    let mut find = |entry: &Entry, side: usize| {
        let (what, set, angles) =
            if side == 0 { ("light", lights, entry.light) } else { ("view", views, entry.view) };
        let index = *known[side].entry(angles.map(f64::to_bits)).or_insert_with(|| nearest(set, angles));
        index.ok_or_else(|| {
            bad(
                &folder.join(&entry.file),
                format!(
                    "{what} at ({}, {}) degrees is none of those that {LISTING} has",
                    angles[0], angles[1]
                ),
            )
        })
    };
    let mut files: Vec<Option<&Path>> = vec![None; lights.len() * views.len()];
    for entry in entries {
        let light = find(entry, 0)?;
        let view = find(entry, 1)?;
        if let Some(other) = files[view * lights.len() + light].replace(&entry.file) {
            return Err(bad(
                &folder.join(&entry.file),
                format!("the same pair of directions as {}", other.display()),
            ));
        }
    }
    if let Some(pair) = files.iter().position(Option::is_none) {
        let missing = files.iter().filter(|file| file.is_none()).count();
        let [[tl, pl], [tv, pv]] =
            [lights[pair % lights.len()], views[pair / lights.len()]].map(|d| to_degrees(d).map(in_name));
        let what = format!(
            "{missing} of {} pairs of directions are missing, the first of them tl{tl}_pl{pl}_tv{tv}_pv{pv}",
            files.len()
        );
        return Err(bad(folder, what));
    }
    Ok(files.into_iter().flatten().collect())
}

/// The 16-bit sRGB value of a linear one from 0 to 1.
fn to_srgb16(linear: f32) -> u16 {
    (to_srgb(linear) * 65_535.0).round() as u16
}

/// Bytes of a PNG, and how many values were clamped; `number` is of a texel and a colour.
fn to_png(
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
fn to_exr(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::pixels::{Colours, from_srgb16};
    use std::fs::{self, File};
    use std::io::BufReader;

    /// The pixels of an image on disk.
    fn decode(path: &Path) -> std::result::Result<Vec<[f32; 3]>, String> {
        let stream = Box::new(BufReader::new(File::open(path).expect("there")));
        pixels::open(stream, 1 << 20)?.pixels(Colours::Auto)
    }

    const QUIET: &dyn Fn(usize, usize) = &|_, _| {};

    fn options(sample: Sample) -> ImportOptions {
        ImportOptions { sample, memory: 1 << 20, ..ImportOptions::default() }
    }

    fn write_dataset(path: &Path, description: Description, value: impl Fn(usize) -> f32) -> Dataset {
        let length = description.texel_len();
        Dataset::from_fn(path, description, |texel, i| value(texel * length + i)).expect("written")
    }

    /// Lights and views that differ, of no grid, out of order, with angles that no decimals write.
    fn odd(sample: Sample, size: [usize; 2]) -> Description {
        let lights =
            vec![from_degrees(23.5, 359.9), from_degrees(0.0, 0.0), from_degrees(61.234_567_891, 30.1)];
        let views = vec![DVec3::new(0.3, -0.2, 0.9).normalize(), from_degrees(0.1, 200.0)];
        let texts = ["Linen".into(), "measured".into(), "CC0".into()];
        Description { size, lights, views, sample, cosine_included: true, texel_nm: [70_000, 80_000], texts }
    }

    #[test]
    fn exr_round_trips_have_the_same_bytes() {
        let place = tempfile::tempdir().expect("a folder");
        for sample in [Sample::Half, Sample::Float] {
            let grid = grid(81).expect("known");
            let some = Description {
                size: [3, 2],
                lights: grid[..9].to_vec(),
                views: grid[20..25].to_vec(),
                sample,
                ..Description::default()
            };
            let all = Description {
                size: [1, 1],
                views: grid.clone(),
                lights: grid[..1].to_vec(),
                sample,
                ..Description::default()
            };
            let single = Description {
                size: [4, 4],
                lights: grid[..1].to_vec(),
                views: grid[3..4].to_vec(),
                sample,
                ..Description::default()
            };
            for (i, description) in [odd(sample, [5, 3]), some, all, single].into_iter().enumerate() {
                for black in [false, true] {
                    // One image at a time, some, and all.
                    for memory in [0, 1000, 1 << 20] {
                        let name =
                            |what: &str| place.path().join(format!("{what}-{sample:?}-{i}-{black}-{memory}"));
                        let value = |n: usize| if black { 0.0 } else { (n % 1999) as f32 * 0.37 };
                        let half = |n: usize| f16::from_f32(value(n)).to_f32();
                        let dataset = write_dataset(&name("a"), description.clone(), half);
                        assert_eq!(
                            export(&dataset, &name("f"), Format::Exr, memory, QUIET).expect("exported"),
                            0
                        );
                        let statistics = import(
                            &name("f"),
                            &name("b"),
                            &ImportOptions { memory, ..options(sample) },
                            QUIET,
                        )
                        .expect("imported");
                        assert_eq!(&statistics.statistics, dataset.statistics());
                        assert!(
                            fs::read(name("a")).expect("read") == fs::read(name("b")).expect("read"),
                            "{:?}",
                            name("b")
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn png_round_trips_within_its_steps_and_counts_what_it_clamps() {
        let place = tempfile::tempdir().expect("a folder");
        let at = |name: &str| place.path().join(name);
        let dataset = write_dataset(&at("a"), odd(Sample::Float, [7, 5]), |n| n as f32 / 600.0);
        let clamped = export(&dataset, &at("f"), Format::Png, 5000, QUIET).expect("exported");
        assert_eq!(clamped, 7 * 5 * 18 - 601);
        import(&at("f"), &at("b"), &options(Sample::Float), QUIET).expect("imported");
        let back = Dataset::open(&at("b")).expect("opened");
        assert_eq!(back.description(), dataset.description());
        let mut values = [0.0; 7 * 5 * 18];
        back.read(0, 35, &mut Vec::new(), &mut values).expect("read");
        assert!(values.iter().enumerate().all(|(n, v)| (v - (n as f32 / 600.0).min(1.0)).abs() <= 2e-5));
        assert!((0..=u16::MAX).all(|n| to_srgb16(from_srgb16(n)) == n));
        let again = export(&dataset, &at("f"), Format::Png, 5000, QUIET).expect_err("refused").to_string();
        assert!(again.contains("dataset.json"), "{again}");
    }

    fn exr(path: &Path, size: [usize; 2], value: impl Fn(usize, usize) -> f32 + Sync) {
        fs::write(path, to_exr(size, Sample::Float, value).expect("encoded")).expect("written");
    }

    #[test]
    fn names_decide_and_known_grids_are_found() {
        let place = tempfile::tempdir().expect("a folder");
        let known = grid(81).expect("known");
        for (i, direction) in known.iter().enumerate().rev() {
            let [polar, azimuth] = to_degrees(*direction);
            let name = if i % 2 == 0 {
                format!("bottle7_TL{polar:.0}-pl{:.3}.tv0 PV45.eXr", azimuth - 360.0)
            } else {
                format!("tl{polar:.1}pl{azimuth:.2}tv0pv0.exr")
            };
            exr(&place.path().join(name), [2, 1], |texel, _| (i * 2 + texel) as f32);
        }
        fs::write(place.path().join("read me.txt"), "").expect("written");
        let output = place.path().join("a.selvset");
        import(place.path(), &output, &options(Sample::Float), QUIET).expect("imported");
        let dataset = Dataset::open(&output).expect("opened");
        assert_eq!(dataset.description().views, [DVec3::Z]);
        assert_eq!(dataset.description().lights, known);
        assert!(
            (0..81)
                .all(|i| dataset.image(i, 0).expect("read")
                    == [[i as f32 * 2.0; 3], [i as f32 * 2.0 + 1.0; 3]])
        );
        assert_eq!(
            dataset.description().lights[0].to_array().map(f64::to_bits),
            DVec3::Z.to_array().map(f64::to_bits)
        );
        assert_eq!(angles_of("x-tl023.5_pl030_tv000_pv007.25"), Some([[23.5, 30.0], [0.0, 7.25]]));
        for none in
            ["", "tl1", "tl1pl2tv3pv", "tl1pl2tv3pv4b", "tl1xpl2tv3pv4", "tl1pl2pv4tv3", "tl--1pl2tv3pv4"]
        {
            assert_eq!(angles_of(none), None, "{none}");
        }
    }

    #[test]
    fn grey_and_alpha_are_read_and_palettes_refused() {
        let place = tempfile::tempdir().expect("a folder");
        let path = place.path().join("tl0pl0tv0pv0.png");
        let write = |colour: png::ColorType, depth: png::BitDepth, data: &[u8]| {
            let mut encoder = png::Encoder::new(File::create(&path).expect("created"), 1, 1);
            encoder.set_color(colour);
            encoder.set_depth(depth);
            encoder.set_palette(vec![0; 6]);
            encoder.write_header().expect("head").write_image_data(data).expect("data");
            decode(&path)
        };
        let grey = from_srgb16(257 * 100);
        assert_eq!(
            write(png::ColorType::Grayscale, png::BitDepth::Eight, &[100]).expect("read"),
            [[grey; 3]]
        );
        assert_eq!(
            write(png::ColorType::GrayscaleAlpha, png::BitDepth::Sixteen, &[100, 100, 0, 0]).expect("read"),
            [[grey; 3]]
        );
        assert_eq!(
            write(png::ColorType::Rgba, png::BitDepth::Eight, &[255, 0, 100, 7]).expect("read"),
            [[1.0, 0.0, grey]]
        );
        assert!(
            write(png::ColorType::Indexed, png::BitDepth::Eight, &[1])
                .expect_err("refused")
                .to_string()
                .contains("Indexed")
        );
        let path = place.path().join("grey.exr");
        let channels = SpecificChannels::build()
            .with_channel::<f32>("Y")
            .with_channel::<f32>("Z")
            .with_pixel_fn(|_| (0.25, -1.0));
        Image::from_channels((2, 1), channels).write().to_file(&path).expect("written");
        assert_eq!(decode(&path).expect("read"), [[0.25; 3]; 2]);
        // Elsewhere on the canvas, and written from the last row on.
        let encoding = exr::image::Encoding {
            line_order: exr::meta::attribute::LineOrder::Decreasing,
            ..exr::image::Encoding::UNCOMPRESSED
        };
        let attributes = exr::meta::header::LayerAttributes::named("a").with_position(Vec2(5, -3));
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.0f32));
        let layer = exr::image::Layer::new((2, 3), attributes, encoding, channels);
        Image::from_layer(layer).write().to_file(&path).expect("written");
        let wanted: Vec<[f32; 3]> = (0..6).map(|i| [(i % 2) as f32, (i / 2) as f32, 0.0]).collect();
        assert_eq!(decode(&path).expect("read"), wanted);
        let channels = SpecificChannels::build().with_channel::<f32>("Z").with_pixel_fn(|_| (0.25f32,));
        Image::from_channels((2, 1), channels).write().to_file(&path).expect("written");
        assert!(decode(&path).expect_err("refused").to_string().contains("neither"));
    }

    /// What an import says of two lights and one view after `spoil`, with everything that must be in it.
    fn refused(wanted: &[&str], spoil: impl Fn(&Path)) {
        let place = tempfile::tempdir().expect("a folder");
        for light in [0, 30] {
            exr(&place.path().join(format!("tl{light:03}_pl000_tv000_pv000.exr")), [3, 2], |_, _| 0.5);
        }
        let output = place.path().join("a.selvset");
        import(place.path(), &output, &options(Sample::Half), QUIET).expect("good as it is");
        fs::remove_file(&output).expect("removed");
        spoil(place.path());
        let said =
            import(place.path(), &output, &options(Sample::Half), QUIET).expect_err("refused").to_string();
        assert!(wanted.iter().all(|part| said.contains(part)), "{said}");
        assert!(!output.exists());
    }

    #[test]
    fn bad_folders_are_refused_with_the_file_and_the_place() {
        const BAD: &str = "tl030_pl000_tv000_pv000.exr";
        for (value, text) in [
            (f32::NAN, "NaN"),
            (f32::INFINITY, "inf"),
            (f32::NEG_INFINITY, "-inf"),
            (70_000.0, "--float holds it"),
        ] {
            let spoil = |texel, c| if (texel, c) == (4, 2) { value } else { 0.5 };
            refused(&[BAD, "pixel (1, 1), blue", text], |folder| exr(&folder.join(BAD), [3, 2], spoil));
        }
        refused(&[BAD, "tl000_pl000", "2 x 3", "3 x 2"], |folder| exr(&folder.join(BAD), [2, 3], |_, _| 0.5));
        refused(&["1 of 4 pairs", "tl000_pl000_tv060_pv000"], |folder| {
            exr(&folder.join("tl30pl0tv60pv0.exr"), [3, 2], |_, _| 0.5)
        });
        refused(&[BAD, "TL30.004pl359.999tv0pv9.exr"], |folder| {
            exr(&folder.join("TL30.004pl359.999tv0pv9.exr"), [3, 2], |_, _| 0.5)
        });
        refused(&["preview.png", "name"], |folder| {
            fs::write(folder.join("preview.png"), "").expect("written")
        });
        refused(&["tl91", "polar"], |folder| exr(&folder.join("tl91pl0tv0pv0.exr"), [3, 2], |_, _| 0.5));
        refused(&["no EXR, PNG"], |folder| {
            fs::read_dir(folder)
                .expect("read")
                .for_each(|file| fs::remove_file(file.expect("one").path()).expect("removed"))
        });
        refused(&[BAD], |folder| fs::write(folder.join(BAD), "no image").expect("written"));
        refused(&["tl60"], |folder| {
            fs::write(folder.join("tl60pl0tv0pv0.png"), "no image").expect("written")
        });
        let json =
            |text: &'static str| move |folder: &Path| fs::write(folder.join(LISTING), text).expect("written");
        refused(&[LISTING], json("{"));
        refused(&[LISTING, "colour"], json(r#"{"colour": 1}"#));
        refused(&["no EXR, PNG"], json(r#"{"images": []}"#));
        refused(
            &["missing.exr"],
            json(r#"{"images": [{"file": "missing.exr", "light": [0, 0], "view": [0, 0]}]}"#),
        );
        refused(
            &["../a.exr", "inside"],
            json(r#"{"images": [{"file": "../a.exr", "light": [0, 0], "view": [0, 0]}]}"#),
        );
        refused(&[BAD, "none of those"], json(r#"{"lights": [[0, 0, 1]]}"#));
        refused(
            &[BAD, "none of those"],
            json(
                r#"{"lights": [[0, 0, 0]], "images": [{"file": "tl030_pl000_tv000_pv000.exr", "light": [0, 0], "view": [0, 0]}]}"#,
            ),
        );
    }

    #[test]
    fn damaged_images_are_errors_and_no_panics() {
        let place = tempfile::tempdir().expect("a folder");
        let value = |texel: usize, c: usize| (texel * 3 + c) as f32 / 100.0;
        let good = [
            ("a.exr", to_exr([6, 5], Sample::Half, value).expect("encoded")),
            ("a.png", to_png([6, 5], value).expect("encoded").0),
        ];
        for (name, good) in good {
            let path = place.path().join(name);
            for at in 0..good.len() {
                for damaged in
                    [good[..at].to_vec(), [&good[..at], &[good[at] ^ 0x81], &good[at + 1..]].concat()]
                {
                    fs::write(&path, damaged).expect("written");
                    if let Ok(pixels) = decode(&path) {
                        assert_eq!(pixels.len(), 30);
                    }
                }
            }
        }
    }
}
