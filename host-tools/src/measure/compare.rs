//! How far two materials are apart: what `compare` prints and what an encoder verifies its goal by.
//!
//! Errors are of linear radiance and of `ln(x + e)`, where `e` is one thousandth of the reference's mean, the
//! same for everything that is compared with that reference. Files are decoded by the core, at the directions
//! of the reference.

use crate::data::dataset::{Description, Statistics};
use crate::data::transfer::log2;
use crate::error::{Result, ToolError};
use crate::format::query::{query, vector};
use crate::measure::radiance::{AtLevel, Radiance};
use crate::work::ordered;
use selvedge::{Direction, Selvedge};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_2;
use std::ops::Range;

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

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.count += other.count;
        self.different += other.different;
        self.log += other.log;
        self.linear += other.linear;
        self.reference += other.reference;
        // The first of equal ones, and what is no number.
        if other.largest.difference > self.largest.difference || other.largest.difference.is_nan() {
            self.largest = other.largest;
        }
    }
}

/// Bytes of the images that all threads hold at once, and most pairs of a thread: runs of two kilobytes of a
/// dataset, and enough parts to share.
const BUDGET: usize = 512 << 20;
const MOST_PAIRS: usize = 256;

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
    if images(&AtLevel::finest(file), &description, &first_view, &mut images_at).is_ok() {
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
///
/// # Errors
/// If data cannot be read.
pub fn image(
    source: &dyn Radiance,
    description: &Description,
    light: usize,
    view: usize,
) -> Result<Vec<[f32; 3]>> {
    let mut out = Vec::new();
    images(source, description, &[view * description.lights.len() + light], &mut out)?;
    Ok(out)
}

/// As [`Radiance::images`], into a buffer that grows.
fn images(
    source: &dyn Radiance,
    description: &Description,
    pairs: &[usize],
    out: &mut Vec<[f32; 3]>,
) -> Result<()> {
    out.resize(description.texels() * pairs.len(), [0.0; 3]);
    source.images(description, pairs, out)
}

/// Images of a source one after the other, read or decoded as many at once as is good for it.
struct Images<'a> {
    source: &'a dyn Radiance,
    held: Range<usize>,
    pixels: Vec<[f32; 3]>,
}

impl<'a> Images<'a> {
    fn new(source: &'a dyn Radiance) -> Images<'a> {
        Images { source, held: 0..0, pixels: Vec::new() }
    }

    /// The image of pair `i` of a group.
    fn image(&mut self, description: &Description, group: &[usize], i: usize) -> Result<&[[f32; 3]]> {
        if !self.held.contains(&i) {
            let end = group.len().min(i.saturating_add(self.source.images_at_once()));
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

/// How two materials are compared.
#[derive(Clone, Copy, Debug)]
pub struct Comparison<'a> {
    /// The reference: all its texels and pairs are compared.
    pub description: &'a Description,
    /// Offset of the logarithm.
    pub log_offset: f32,
    /// The peak of the PSNR; the reference's largest value if `None`.
    pub peak: Option<f64>,
    /// Every so many-th light of each view is compared; the first of them changes from view to view.
    pub every: usize,
}

/// Compares a material with a reference, over all texels and pairs of `description`, which is that of the
/// reference.
///
/// `peak` is that of the PSNR; the reference's largest value if `None`.
///
/// # Errors
/// If the sizes differ or data cannot be read.
pub fn compare(
    reference: &dyn Radiance,
    other: &dyn Radiance,
    description: &Description,
    log_offset: f32,
    peak: Option<f64>,
    progress: &dyn Fn(usize, usize),
) -> Result<Metrics> {
    Comparison { description, log_offset, peak, every: 1 }.run(reference, other, progress)
}

impl Comparison<'_> {
    /// Compares; `progress` hears how many of how many parts are done.
    ///
    /// # Errors
    /// If the sizes differ or data cannot be read.
    pub fn run(
        &self,
        reference: &dyn Radiance,
        other: &dyn Radiance,
        progress: &dyn Fn(usize, usize),
    ) -> Result<Metrics> {
        for source in [reference, other] {
            source.check_directions(self.description)?;
            let size = source.size();
            if size != self.description.size {
                let [a, b] = [size, self.description.size].map(|[x, y]| format!("{x} x {y}"));
                return Err(ToolError::Different(format!("{a} texels where the reference has {b}")));
            }
        }
        let (lights, every) = (self.description.lights.len(), self.every);
        // The first on whose number leaves the same rest as the view's: every light has its turn.
        let pairs: Vec<usize> = (0..self.description.pairs())
            .filter(|pair| pair % lights % every == pair / lights % every)
            .collect();
        let groups: Vec<&[usize]> = pairs.chunks(self.at_once(reference, other)).collect();
        let work = |group: usize| self.group(reference, other, groups[group]);
        let start = (Sums::default(), 0.0f32);
        let (sums, found_peak) = ordered(groups.len(), work, start, |(total, peak), part, images| {
            for (sums, image_peak) in images {
                total.add(&sums);
                *peak = peak.max(image_peak);
            }
            progress(part + 1, groups.len());
        })?;
        Ok(self.metrics(&sums, found_peak))
    }

    /// Pairs that a thread compares together.
    fn at_once(&self, reference: &dyn Radiance, other: &dyn Radiance) -> usize {
        let is_held = |source: &&dyn Radiance| source.images_at_once() == usize::MAX;
        let held = [reference, other].iter().filter(|source| is_held(source)).count().max(1);
        let image = self.description.texels() * size_of::<[f32; 3]>();
        (BUDGET / (rayon::current_num_threads() * held * image)).clamp(1, (MOST_PAIRS / self.every).max(1))
    }

    /// Sums and peaks of a group of pairs: those of single images, so that they do not depend on how many are
    /// held.
    fn group(
        &self,
        reference: &dyn Radiance,
        other: &dyn Radiance,
        group: &[usize],
    ) -> Result<Vec<(Sums, f32)>> {
        let (lights, width) = (self.description.lights.len(), self.description.size[0]);
        let (mut a, mut b) = (Images::new(reference), Images::new(other));
        let each = |i| {
            let (a, b) = (a.image(self.description, group, i)?, b.image(self.description, group, i)?);
            Ok(differences(a, b, self.log_offset, (group[i] % lights, group[i] / lights), width))
        };
        (0..group.len()).map(each).collect()
    }

    fn metrics(&self, sums: &Sums, found_peak: f32) -> Metrics {
        let count = sums.count as f64;
        let peak = self.peak.unwrap_or(found_peak as f64);
        let relative =
            if sums.reference > 0.0 { (sums.linear / sums.reference).sqrt() } else { sums.linear.sqrt() };
        Metrics {
            count: sums.count,
            different: sums.different,
            log_rms: LN_2 * (sums.log / count).sqrt(),
            log_offset: self.log_offset,
            linear_rms: (sums.linear / count).sqrt(),
            relative_l2: relative,
            psnr_db: 10.0 * (peak * peak / (sums.linear / count)).log10(),
            peak,
            largest: sums.largest,
        }
    }
}
