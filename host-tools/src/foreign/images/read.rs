//! A set of images as a dataset.

use super::listing::{LISTING, Listing, bad};
use super::names::find;
use super::pairs::{arrange, set_of};
use crate::data::dataset::{Description, Sample, Writer, first_beyond};
use crate::error::{Result, ToolError};
use crate::foreign::archive::Archive;
use crate::foreign::options::{Clipped, ImportOptions, Imported};
use crate::foreign::pixels;
use rayon::prelude::*;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Bytes per texel of an image that is held.
const IMPORT_BYTES: usize = 12;
/// Bytes that a single image may take in any case, and beyond its pixels: for text and thumbnails.
const SINGLE: usize = 1 << 20;
/// Images decoded at once before the first error is looked for.
const WAVE: usize = 64;

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
    /// If the listing or a name is not as the module says; if a pair of directions is missing or given twice;
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

    /// The set as a dataset would be described.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Makes a dataset; `progress` gets how many of how many images are done.
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

/// Makes a dataset of a folder or an archive of images; `progress` gets how many of how many images are
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
