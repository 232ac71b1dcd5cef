//! How far two materials are apart: what `compare` prints and what an encoder verifies its goal by.
//!
//! Errors are of linear radiance and of `ln(x + e)`, where `e` is one thousandth of the reference's mean, the
//! same for everything that is compared with that reference. Files are decoded by the core, at the directions
//! of the reference.

use crate::data::dataset::{Dataset, Description, Statistics};
use crate::data::transfer::log2;
use crate::error::{Result, ToolError};
use crate::format::triangulate::project;
use crate::measure::baseline::decoder::{Decoder, Locator};
use crate::work::ordered;
use selvedge::container::directions::cosine_of;
use selvedge::{Direction, Rgb, Selvedge};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_2;
use std::ops::Range;

/// One material to be compared: radiance at texels and pairs of directions.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    /// Data.
    Data(&'a Dataset),
    /// A file, decoded by the core at a level of detail.
    File(&'a Selvedge<'a>, u32),
    /// A baseline, and what finds its directions.
    Baseline(&'a dyn Decoder, &'a Locator<'a>),
}

/// Largest difference and where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Magnitude.
    pub difference: f32,
    /// Texel along x and y.
    pub texel: [usize; 2],
    /// Light and view direction.
    pub light: usize,
    /// View direction.
    pub view: usize,
}

/// Metrics over all texels, pairs and colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Numbers compared.
    pub count: u64,
    /// Numbers that differ at all.
    pub different: u64,
    /// Root mean squared error of `ln(x + offset)`.
    pub log_rms: f64,
    /// The offset.
    pub log_offset: f32,
    /// Root mean squared error of linear radiance.
    pub linear_rms: f64,
    /// Root of the squared error over the squared reference.
    pub relative_l2: f64,
    /// Peak signal to noise ratio, decibels, of linear radiance.
    pub psnr_db: f64,
    /// The peak it is stated against.
    pub peak: f64,
    /// The largest difference.
    pub largest: Place,
}

/// Sums of one part.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: u64,
    different: u64,
    log: f64,
    linear: f64,
    reference: f64,
    largest: Place,
}

/// Bytes of the images that all threads hold at once, and most pairs of a thread: runs of two kilobytes of a
/// dataset, and enough parts to share.
const BUDGET: usize = 512 << 20;
const MOST_PAIRS: usize = 256;
/// Images of a baseline that are decoded together.
const BASELINE_IMAGES: usize = 8;

/// A sample direction as a query: the point that an encoder writes for it (5.1-4).
pub fn query(direction: glam::DVec3) -> Direction {
    let [x, y] = project(direction);
    Direction { x_q18: x << 4, y_q18: y << 4, z_q15: cosine_of(x, y) as i32 }
}

/// The unit vector of a direction: the inverse of the projection x / (1 + z).
pub fn vector(direction: Direction) -> glam::DVec3 {
    let p = glam::DVec2::new(direction.x_q18 as f64, direction.y_q18 as f64) / 262_144.0;
    let scale = 1.0 + p.length_squared();
    glam::DVec3::new(2.0 * p.x / scale, 2.0 * p.y / scale, (1.0 - p.length_squared()) / scale)
}

/// What a file says of itself, as a reference: its size and the directions of its points.
pub fn describe(file: &Selvedge<'_>) -> Description {
    let header = file.header();
    // Points of the disc's border may be rounded beyond it.
    let vector = |d: Direction| {
        let v = vector(d);
        glam::DVec3::new(v.x, v.y, v.z.max(0.0))
    };
    Description {
        size: file.image_size(0).map(|n| n as usize),
        lights: (0..header.light_count).map(|i| vector(file.light_direction(i))).collect(),
        views: (0..header.view_count).map(|i| vector(file.view_direction(i))).collect(),
        ..Description::default()
    }
}

/// The offset by which errors against a file are measured: one thousandth of its mean over lights at its
/// first view.
pub fn log_offset(file: &Selvedge<'_>) -> f32 {
    let description = describe(file);
    let mut images_at = Vec::new();
    let mut statistics = Statistics::default();
    let first_view: Vec<usize> = (0..description.lights.len()).collect();
    if images(Source::File(file, 0), &description, &first_view, &mut images_at).is_ok() {
        let count = images_at.len().max(1) as f64;
        statistics.mean =
            std::array::from_fn(|c| images_at.iter().map(|rgb| rgb[c] as f64).sum::<f64>() / count);
    }
    statistics.log_offset()
}

/// The direction of a set that is nearest to a query.
pub fn nearest(set: &[glam::DVec3], asked: Direction) -> usize {
    let distance = |d: &glam::DVec3| {
        let q = query(*d);
        ((q.x_q18 - asked.x_q18) as i64).pow(2) + ((q.y_q18 - asked.y_q18) as i64).pow(2)
    };
    (0..set.len()).min_by_key(|&i| distance(&set[i])).unwrap_or(0)
}

/// The image of one pair of a reference's directions, row by row.
pub fn image(
    source: Source<'_>,
    description: &Description,
    light: usize,
    view: usize,
) -> Result<Vec<[f32; 3]>> {
    let mut out = Vec::new();
    images(source, description, &[view * description.lights.len() + light], &mut out)?;
    Ok(out)
}

/// Radiance of a source at some pairs, `view * lights + light`, ascending: `[pair][texel]`.
fn images(
    source: Source<'_>,
    description: &Description,
    pairs: &[usize],
    out: &mut Vec<[f32; 3]>,
) -> Result<()> {
    let (texels, lights) = (description.texels(), description.lights.len());
    out.resize(texels * pairs.len(), [0.0; 3]);
    let (Some(&first), Some(&last)) = (pairs.first(), pairs.last()) else { return Ok(()) };
    match source {
        Source::Data(dataset) => {
            let mut bytes = Vec::new();
            let mut run = vec![0.0; (last + 1 - first) * 3];
            for texel in 0..texels {
                dataset.read_pairs(texel, first, &mut bytes, &mut run)?;
                let rgb = &run.as_chunks::<3>().0;
                pairs.iter().enumerate().for_each(|(i, pair)| out[i * texels + texel] = rgb[pair - first]);
            }
        }
        Source::File(file, level) => {
            let mut scratch = vec![0; file.image_scratch_len()];
            let mut image = vec![Rgb::default(); texels];
            for (&pair, out) in pairs.iter().zip(out.chunks_mut(texels)) {
                let [light, view] =
                    [description.lights[pair % lights], description.views[pair / lights]].map(query);
                file.decode_image(level, light, view, &mut scratch, &mut image)
                    .expect("the buffers are as long as asked for");
                out.iter_mut().zip(&image).for_each(|(out, rgb)| *out = rgb.to_f32());
            }
        }
        Source::Baseline(decoder, locator) => {
            let mut begun = 0;
            for same in pairs.chunk_by(|a, b| a / lights == b / lights) {
                let blend = |pair: &usize| {
                    locator.light(query(description.lights[pair % lights]), decoder.two_nearest())
                };
                let view = locator.view(query(description.views[same[0] / lights]), decoder.two_nearest());
                decoder.images(
                    &same.iter().map(blend).collect::<Vec<_>>(),
                    view,
                    &mut out[begun * texels..][..same.len() * texels],
                );
                begun += same.len();
            }
        }
    }
    Ok(())
}

/// Images of a source one after the other, read or decoded as many at once as is good for it.
struct Images<'a> {
    source: Source<'a>,
    held: Range<usize>,
    pixels: Vec<[f32; 3]>,
}

impl<'a> Images<'a> {
    fn new(source: Source<'a>) -> Images<'a> {
        Images { source, held: 0..0, pixels: Vec::new() }
    }

    /// How many images of a group it holds.
    fn most(source: Source<'_>) -> usize {
        match source {
            Source::Data(_) => usize::MAX,
            Source::File(..) => 1,
            Source::Baseline(..) => BASELINE_IMAGES,
        }
    }

    /// The image of pair `i` of a group.
    fn image(&mut self, description: &Description, group: &[usize], i: usize) -> Result<&[[f32; 3]]> {
        if !self.held.contains(&i) {
            let end = group.len().min(i.saturating_add(Images::most(self.source)));
            images(self.source, description, &group[i..end], &mut self.pixels)?;
            self.held = i..end;
        }
        Ok(&self.pixels[(i - self.held.start) * description.texels()..][..description.texels()])
    }
}

/// Sums of the differences of two images, and the largest value of the first.
fn differences(
    reference: &[[f32; 3]],
    other: &[[f32; 3]],
    log_offset: f32,
    (light, view): (usize, usize),
    width: usize,
) -> (Sums, f32) {
    let mut sums = Sums::default();
    let mut peak = 0.0f32;
    for (texel, (a, b)) in reference.iter().zip(other).enumerate() {
        for (&a, &b) in a.iter().zip(b) {
            let difference = b - a;
            sums.count += 1;
            sums.different += u64::from(a.to_bits() != b.to_bits());
            sums.log += (log2(b + log_offset) as f64 - log2(a + log_offset) as f64).powi(2);
            sums.linear += (difference as f64).powi(2);
            sums.reference += (a as f64).powi(2);
            peak = peak.max(a);
            // The first of equal ones, and what is no number.
            if difference.abs() > sums.largest.difference || difference.is_nan() {
                sums.largest = Place {
                    difference: difference.abs(),
                    texel: [texel % width, texel / width],
                    light,
                    view,
                };
            }
        }
    }
    (sums, peak)
}

/// Compares a material with a reference, over all texels and pairs of `description`, which is that of the
/// reference.
///
/// `peak` is that of the PSNR; the reference's largest value if `None`.
///
/// # Errors
/// If the sizes differ or data cannot be read.
pub fn compare(
    reference: Source<'_>,
    other: Source<'_>,
    description: &Description,
    log_offset: f32,
    peak: Option<f64>,
    progress: &dyn Fn(usize, usize),
) -> Result<Metrics> {
    compare_every(1, reference, other, description, log_offset, peak, progress)
}

/// As [`compare`], over every so many-th light of each view; the first of them moves from view to view.
pub fn compare_every(
    every: usize,
    reference: Source<'_>,
    other: Source<'_>,
    description: &Description,
    log_offset: f32,
    peak: Option<f64>,
    progress: &dyn Fn(usize, usize),
) -> Result<Metrics> {
    for source in [reference, other] {
        let size = match source {
            Source::Data(dataset) => {
                let own = dataset.description();
                if (own.lights.len(), own.views.len()) != (description.lights.len(), description.views.len())
                {
                    return Err(ToolError::Different(format!(
                        "{}: other directions than those of the reference",
                        dataset.path().display()
                    )));
                }
                own.size
            }
            Source::File(file, level) => file.image_size(level).map(|n| n as usize),
            Source::Baseline(_, locator) => locator.size,
        };
        if size != description.size {
            let [a, b] = [size, description.size].map(|[x, y]| format!("{x} x {y}"));
            return Err(ToolError::Different(format!("{a} texels where the reference has {b}")));
        }
    }
    let (texels, lights) = (description.texels(), description.lights.len());
    // The first on whose number leaves the same rest as the view's: every light has its turn.
    let pairs: Vec<usize> =
        (0..description.pairs()).filter(|pair| pair % lights % every == pair / lights % every).collect();
    let of_data =
        [reference, other].into_iter().filter(|source| matches!(source, Source::Data(_))).count().max(1);
    let at_once = (BUDGET / (rayon::current_num_threads() * of_data * texels * size_of::<[f32; 3]>()))
        .clamp(1, (MOST_PAIRS / every).max(1));
    let groups: Vec<&[usize]> = pairs.chunks(at_once).collect();
    // Sums are those of single images, so that they do not depend on how many are held.
    let work = |group: usize| -> Result<Vec<(Sums, f32)>> {
        let group = groups[group];
        let (mut a, mut b) = (Images::new(reference), Images::new(other));
        let each = |i| {
            let place = (group[i] % lights, group[i] / lights);
            Ok(differences(
                a.image(description, group, i)?,
                b.image(description, group, i)?,
                log_offset,
                place,
                description.size[0],
            ))
        };
        (0..group.len()).map(each).collect()
    };
    let (sums, found_peak) =
        ordered(groups.len(), work, (Sums::default(), 0.0f32), |(total, peak), part, images| {
            for (sums, image_peak) in images {
                total.count += sums.count;
                total.different += sums.different;
                total.log += sums.log;
                total.linear += sums.linear;
                total.reference += sums.reference;
                if sums.largest.difference > total.largest.difference || sums.largest.difference.is_nan() {
                    total.largest = sums.largest;
                }
                *peak = peak.max(image_peak);
            }
            progress(part + 1, groups.len());
        })?;
    let count = sums.count as f64;
    let peak = peak.unwrap_or(found_peak as f64);
    let relative =
        if sums.reference > 0.0 { (sums.linear / sums.reference).sqrt() } else { sums.linear.sqrt() };
    Ok(Metrics {
        count: sums.count,
        different: sums.different,
        log_rms: LN_2 * (sums.log / count).sqrt(),
        log_offset,
        linear_rms: (sums.linear / count).sqrt(),
        relative_l2: relative,
        psnr_db: 10.0 * (peak * peak / (sums.linear / count)).log10(),
        peak,
        largest: sums.largest,
    })
}
