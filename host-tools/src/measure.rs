//! How far two materials are apart: what `compare` prints and what an encoder verifies its goal by.
//!
//! Errors are of linear radiance and of `ln(x + e)`, where `e` is one thousandth of the reference's mean, the same for
//! everything that is compared with that reference. Files are decoded by the core, at the directions of the reference.

use crate::baseline::decoder::{Blend, Decoder, Locator};
use crate::dataset::{Dataset, Description, Statistics};
use crate::error::{Result, ToolError};
use crate::linear::ordered;
use crate::transfer::log2;
use crate::triangulate::project;
use selvedge::direction_set::cosine_of;
use selvedge::{Direction, Rgb, Selvedge};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_2;
use std::iter::StepBy;
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

/// Images held at once, in numbers.
const BUDGET: usize = 1 << 23;

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

/// The offset by which errors against a file are measured: one thousandth of its mean over lights at its first view.
pub fn log_offset(file: &Selvedge<'_>) -> f32 {
    let description = describe(file);
    let mut images_at = Vec::new();
    let mut statistics = Statistics::default();
    if images(Source::File(file, 0), &description, 0, (0..description.lights.len()).step_by(1), &mut images_at).is_ok() {
        let count = images_at.len().max(1) as f64;
        statistics.mean = std::array::from_fn(|c| images_at.iter().map(|rgb| rgb[c] as f64).sum::<f64>() / count);
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
pub fn image(source: Source<'_>, description: &Description, light: usize, view: usize) -> Result<Vec<[f32; 3]>> {
    let mut out = Vec::new();
    images(source, description, view, (light..light + 1).step_by(1), &mut out)?;
    Ok(out)
}

/// Radiance of a source at one view and some lights: `[light][texel]`.
fn images(source: Source<'_>, description: &Description, view: usize, lights: StepBy<Range<usize>>, out: &mut Vec<[f32; 3]>) -> Result<()> {
    let texels = description.texels();
    let numbers: Vec<usize> = lights.collect();
    let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) else {
        out.clear();
        return Ok(());
    };
    out.resize(texels * numbers.len(), [0.0; 3]);
    match source {
        Source::Data(dataset) => {
            let mut bytes = Vec::new();
            let mut run = vec![0.0; (last + 1 - first) * 3];
            for texel in 0..texels {
                dataset.read_pairs(texel, view * description.lights.len() + first, &mut bytes, &mut run)?;
                let rgb = &run.as_chunks::<3>().0;
                numbers.iter().enumerate().for_each(|(i, light)| out[i * texels + texel] = rgb[light - first]);
            }
        }
        Source::File(file, level) => {
            let mut scratch = vec![0; file.image_scratch_len()];
            let mut image = vec![Rgb::default(); texels];
            let view = query(description.views[view]);
            for (i, light) in numbers.into_iter().enumerate() {
                let light = query(description.lights[light]);
                file.decode_image(level, light, view, &mut scratch, &mut image).expect("the buffers are as long as asked for");
                out[i * texels..][..texels].iter_mut().zip(&image).for_each(|(out, rgb)| *out = rgb.to_f32());
            }
        }
        Source::Baseline(decoder, locator) => {
            let lights: Vec<Blend> = numbers.into_iter().map(|light| locator.light(query(description.lights[light]), decoder.two_nearest())).collect();
            decoder.images(&lights, locator.view(query(description.views[view]), decoder.two_nearest()), out);
        }
    }
    Ok(())
}

/// Compares a material with a reference, over all texels and pairs of `description`, which is that of the reference.
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
                if (own.lights.len(), own.views.len()) != (description.lights.len(), description.views.len()) {
                    return Err(ToolError::Different(format!("{}: other directions than those of the reference", dataset.path().display())));
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
    let at_once = (BUDGET / 6 / texels).clamp(1, lights);
    let chunks = lights.div_ceil(at_once);
    let parts = description.views.len() * chunks;
    let work = |part: usize| -> Result<(Sums, f32)> {
        let (view, first) = (part / chunks, part % chunks * at_once);
        // The first from `first` on whose number leaves the same rest as the view's: every light has its turn.
        let start = first + (view % every + every - first % every) % every;
        let range = (start..(first + at_once).min(lights)).step_by(every);
        let (mut a, mut b) = (Vec::new(), Vec::new());
        images(reference, description, view, range.clone(), &mut a)?;
        images(other, description, view, range, &mut b)?;
        let mut sums = Sums::default();
        let mut peak = 0.0f32;
        for (i, (a, b)) in a.iter().zip(&b).enumerate() {
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
                    let texel = i % texels;
                    let place = [texel % description.size[0], texel / description.size[0]];
                    sums.largest = Place { difference: difference.abs(), texel: place, light: start + i / texels * every, view };
                }
            }
        }
        Ok((sums, peak))
    };
    let (sums, found_peak) = ordered(parts, work, (Sums::default(), 0.0f32), |(total, peak), part, (sums, part_peak)| {
        total.count += sums.count;
        total.different += sums.different;
        total.log += sums.log;
        total.linear += sums.linear;
        total.reference += sums.reference;
        if sums.largest.difference > total.largest.difference {
            total.largest = sums.largest;
        }
        *peak = peak.max(part_peak);
        progress(part + 1, parts);
    })?;
    let count = sums.count as f64;
    let peak = peak.unwrap_or(found_peak as f64);
    let relative = if sums.reference > 0.0 { (sums.linear / sums.reference).sqrt() } else { sums.linear.sqrt() };
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
