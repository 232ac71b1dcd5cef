//! Baselines as a renderer would use them: images at any pair of directions, and filtered samples.
//!
//! Every baseline becomes a [`Decoder`], made of what it would store, and is then timed and compared like a
//! file. A filtered sample is between four texels, three lights and three views, and each decoder takes it in
//! the order that costs least for its own layout.

use crate::data::transfer::Domain;
use crate::format::query::vector;
use crate::math::linear::product_bt;
use crate::math::pca::Pca;
use selvedge::kernel::position::axis_at_position;
use selvedge::{Direction, FilteredQuery, Selvedge, Taps};

/// Directions of a set between which a value is interpolated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Numbers of the directions.
    pub index: [usize; 3],
    /// Their weights, which sum to one.
    pub weight: [f32; 3],
}

impl Blend {
    /// One direction alone.
    pub fn one(index: usize) -> Blend {
        Blend { index: [index; 3], weight: [1.0, 0.0, 0.0] }
    }

    /// What the core located.
    pub fn of(taps: Taps) -> Blend {
        let weight = [taps.weight_a_q15, taps.weight_b_q15, taps.weight_c_q15].map(|w| w as f32 / 32_768.0);
        Blend { index: [taps.a, taps.b, taps.c].map(|i| i as usize), weight }
    }

    /// The two nearest directions, weighed as the shader published with SparseBTF does: half of the nearest's
    /// weight fades with the ratio of distances.
    pub fn two_nearest(set: &[glam::DVec3], asked: glam::DVec3) -> Blend {
        let mut near = [(0, f64::MAX); 2];
        for (i, direction) in set.iter().enumerate() {
            let square = direction.distance_squared(asked);
            if square < near[0].1 {
                near = [(i, square), near[0]];
            } else if square < near[1].1 {
                near[1] = (i, square);
            }
        }
        let share =
            if set.len() < 2 || near[1].1 <= 0.0 { 1.0 } else { 1.0 - 0.5 * (near[0].1 / near[1].1).sqrt() };
        Blend { index: [near[0].0, near[1].0, near[1].0], weight: [share as f32, 1.0 - share as f32, 0.0] }
    }

    /// Directions with a weight.
    #[inline(always)]
    pub fn parts(self) -> impl Iterator<Item = (usize, f32)> + Clone {
        (0..3).map(move |i| (self.index[i], self.weight[i])).filter(|part| part.1 != 0.0)
    }
}

/// Where a filtered sample is.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// Texels along x and their weights.
    pub x: [(usize, f32); 2],
    /// Texels along y.
    pub y: [(usize, f32); 2],
    /// Lights.
    pub light: Blend,
    /// Views.
    pub view: Blend,
}

impl At {
    /// The four texels, row by row, and their weights.
    #[inline(always)]
    pub fn texels(&self, width: usize) -> [(usize, f32); 4] {
        std::array::from_fn(|i| {
            let ((x, weight_x), (y, weight_y)) = (self.x[i & 1], self.y[i >> 1]);
            (y * width + x, weight_x * weight_y)
        })
    }

    /// Up to nine pairs of directions as `view * lights + light`, and their weights.
    #[inline(always)]
    pub fn pairs(&self, lights: usize) -> Pairs {
        Pairs::of(self.light, self.view, lights)
    }
}

/// Pairs of directions and their weights.
#[derive(Clone, Copy, Debug)]
pub struct Pairs {
    pairs: [(usize, f32); 9],
    count: usize,
}

impl Pairs {
    /// Of some lights and views, where the set has `lights` lights.
    #[inline(always)]
    pub fn of(light: Blend, view: Blend, lights: usize) -> Pairs {
        let mut pairs = Pairs { pairs: [(0, 0.0); 9], count: 0 };
        for (v, weight_v) in view.parts() {
            for (l, weight_l) in light.parts() {
                pairs.pairs[pairs.count] = (v * lights + l, weight_v * weight_l);
                pairs.count += 1;
            }
        }
        pairs
    }
}

impl std::ops::Deref for Pairs {
    type Target = [(usize, f32)];

    #[inline(always)]
    fn deref(&self) -> &[(usize, f32)] {
        &self.pairs[..self.count.min(9)]
    }
}

/// Finds what a sample is between: texels by 9.1, directions by the core's triangles, which all baselines
/// share with the files, or by the two nearest.
pub struct Locator<'a> {
    /// A file of the same directions.
    pub file: &'a Selvedge<'a>,
    /// Texels.
    pub size: [usize; 2],
    /// Lights of the set.
    pub lights: Vec<glam::DVec3>,
    /// Views of the set.
    pub views: Vec<glam::DVec3>,
}

impl Locator<'_> {
    /// Lights between which a direction is.
    pub fn light(&self, direction: Direction, two_nearest: bool) -> Blend {
        if two_nearest {
            Blend::two_nearest(&self.lights, vector(direction))
        } else {
            Blend::of(self.file.locate_light(direction).taps)
        }
    }

    /// Views between which a direction is.
    pub fn view(&self, direction: Direction, two_nearest: bool) -> Blend {
        if two_nearest {
            Blend::two_nearest(&self.views, vector(direction))
        } else {
            Blend::of(self.file.locate_view(direction).taps)
        }
    }

    /// Where a query is.
    #[inline(always)]
    pub fn at(&self, query: &FilteredQuery, two_nearest: bool) -> At {
        let axis = |size: usize, position: u32| {
            let axis = axis_at_position(1, 1 << 18, size as u32, position);
            let weight = |q15: i32| q15 as f32 / 32_768.0;
            if axis.count == 2 {
                [
                    (axis.first.block as usize, weight(axis.first.weight_a_q15)),
                    (axis.second.block as usize, weight(axis.second.weight_a_q15)),
                ]
            } else {
                [(axis.first.block as usize, 1.0), (axis.first.block as usize, 0.0)]
            }
        };
        At {
            x: axis(self.size[0], query.u_q32),
            y: axis(self.size[1], query.v_q32),
            light: self.light(query.light, two_nearest),
            view: self.view(query.view, two_nearest),
        }
    }
}

/// A baseline, decoded from what it would store.
pub trait Decoder: Sync + Send {
    /// Bytes that it would store.
    fn bytes(&self) -> u64;

    /// Linear radiance of every texel at some lights and one view: `[light][texel]`.
    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]);

    /// A filtered sample.
    fn filtered(&self, at: &At) -> [f32; 3];

    /// Multiplications of that sample, beside those that find where it is. An exponential counts as
    /// [`EXPONENTIAL`].
    fn operations(&self, at: &At) -> u64;

    /// Whether directions are interpolated between the two nearest instead of three around.
    fn two_nearest(&self) -> bool {
        false
    }
}

/// Multiplications that the exponential of a channel counts for: a polynomial of degree five, as common
/// libraries have, and its scaling.
pub const EXPONENTIAL: u64 = 7;

/// Multiplications of [`Domain::back`] for three channels.
pub(crate) fn inverse_operations(domain: Domain) -> u64 {
    if domain == Domain::Log { 3 * EXPONENTIAL } else { 0 }
}

/// Multiplications of a sample's position and weights of directions, which files and baselines share; the
/// rest of finding directions is compared apart.
pub const POSITION: u64 = 18;

/// What decompositions share: the mean of each pair, and how their values become radiance.
pub(crate) struct Frame {
    /// `[view][light][colour]`.
    pub mean: Vec<f32>,
    /// What is decomposed.
    pub domain: Domain,
    /// Offset of the logarithm.
    pub offset: f32,
    /// Texels of a row.
    pub width: usize,
    /// Lights of the set.
    pub lights: usize,
}

impl Frame {
    /// Of the components' dataset, with a mean as it is decoded.
    pub fn new(pca: &Pca<'_>, mean: Vec<f32>) -> Frame {
        let description = pca.dataset.description();
        let (width, lights) = (description.size[0], description.lights.len());
        Frame { mean, domain: pca.domain, offset: pca.dataset.statistics().log_offset(), width, lights }
    }

    /// Radiance of values.
    #[inline(always)]
    pub fn back(&self, values: [f32; 3]) -> [f32; 3] {
        values.map(|y| self.domain.back(y, self.offset))
    }

    /// The mean of a sample.
    #[inline(always)]
    pub fn mean_at(&self, at: &At) -> [f32; 3] {
        let mut sum = [0.0f32; 3];
        at.pairs(self.lights)
            .iter()
            .for_each(|&(pair, weight)| add_row(&mut sum, weight, &self.mean[pair * 3..][..3]));
        sum
    }

    /// Images of the mean and of products: `rows` are `[light][colour][column]`, `texels` are
    /// `[texel][column]`.
    pub fn images(&self, lights: &[Blend], view: Blend, rows: &[f32], texels: &[f32], out: &mut [[f32; 3]]) {
        let count = out.len() / lights.len();
        let columns = rows.len() / (lights.len() * 3);
        let mut values = vec![0.0f32; lights.len() * 3 * count];
        for (&light, values) in lights.iter().zip(values.chunks_mut(3 * count)) {
            for &(pair, weight) in Pairs::of(light, view, self.lights).iter() {
                for (values, mean) in values.chunks_mut(count).zip(&self.mean[pair * 3..][..3]) {
                    values.iter_mut().for_each(|v| *v += weight * mean);
                }
            }
        }
        if columns > 0 {
            product_bt(&mut values, rows, texels, [lights.len() * 3, columns, count], true);
        }
        for (i, rgb) in out.iter_mut().enumerate() {
            *rgb = self.back(std::array::from_fn(|c| values[(i / count * 3 + c) * count + i % count]));
        }
    }
}

/// `sum += weight * row`, side by side.
#[inline(always)]
pub(crate) fn add_row(sum: &mut [f32], weight: f32, row: &[f32]) {
    sum.iter_mut().zip(row).for_each(|(sum, r)| *sum += weight * r);
}

/// A product of two rows in eight running sums, so that it is done side by side.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    let (a, b) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.0.iter().zip(b.0) {
        (0..8).for_each(|i| sums[i] += a[i] * b[i]);
    }
    sums.iter().sum::<f32>() + a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset::Dataset;
    use crate::format::model::TransferModel;
    use crate::math::random::Random;
    use crate::measure::baseline::pca::components;
    use crate::measure::baseline::{Row, clusters, data, published, tests::small, tucker};
    use crate::measure::compare::compare;
    use crate::measure::radiance::Baseline;
    use crate::methods::sparse_ensemble::encode::{Criterion, Options, encode, prepare};
    use selvedge::Limits;

    /// Baselines of a small dataset, and what each measured of itself in its own way. The last is the data
    /// in binary16.
    fn baselines(dataset: &Dataset, domain: Domain) -> [(Box<dyn Decoder>, Option<Row>); 5] {
        let mut components = components(dataset, domain, 12).expect("made");
        let of_three = components.measure(3, 8).expect("measured");
        let clustered = clusters::clusters(&components, 3, 2);
        let decomposed = tucker::tucker(&components, 4, 9).expect("made");
        let layout_of = published::Published::new(dataset).expect("made");
        let ensembles = layout_of.own_ensembles().expect("made");
        let mut layout = layout_of.layout(&ensembles, u64::MAX).expect("projected");
        let of_layout = layout.measure(40).expect("measured");
        [
            (Box::new(components.decoder(3, 8)), Some(of_three)),
            (Box::new(clustered.decoder(8)), Some(clustered.measure(8).expect("measured"))),
            (Box::new(decomposed.decoder(4, 9, 16)), Some(decomposed.measure(4, 9, 16).expect("measured"))),
            (Box::new(layout.decoder(40)), Some(of_layout)),
            (Box::new(data::Uncompressed::new(dataset).expect("read")), None),
        ]
    }

    /// A file of the directions of a dataset, whose triangles a locator uses.
    fn file_of(dataset: &Dataset) -> Vec<u8> {
        let prepared =
            prepare(vec![dataset], TransferModel::Log2 { offset: 0.01 }, &|_, _| ()).expect("prepared");
        let options = Options { criterion: Criterion::Bytes(8000), ..Options::default() };
        encode(&prepared, &prepared.own_ensembles(4), &options, &|_, _| ()).expect("encoded").bytes
    }

    /// Compares a filtered sample between two lights, two views and four texels with a blend of images.
    /// `exact`: values are not bent between texels, so that the sample may be between them too. Gives the
    /// number of colours that were compared.
    fn check_sample(
        decoder: &dyn Decoder,
        random: &mut Random,
        [width, height]: [usize; 2],
        exact: bool,
    ) -> usize {
        let (light, view) = (random.range(0, 7) as usize, random.range(0, 4) as usize);
        let weight = [0.5, 0.25, 0.25];
        let (light, view) = (
            Blend { index: [light, light + 1, light], weight },
            Blend { index: [view, view + 1, view], weight },
        );
        let mut image = vec![[0.0; 3]; width * height];
        decoder.images(&[light], view, &mut image);
        let (x, y) = (random.range(0, 19) as usize, random.range(0, 10) as usize);
        let weights = if exact { [0.25, 0.75] } else { [1.0, 0.0] };
        let at = At {
            x: [(x, weights[0]), (x + 1, weights[1])],
            y: [(y, weights[0]), (y + 1, weights[1])],
            light,
            view,
        };
        let (found, mut wanted) = (decoder.filtered(&at), [0.0f32; 3]);
        let texels = at.texels(width);
        texels.iter().for_each(|&(texel, weight)| add_row(&mut wanted, weight, &image[texel]));
        assert!(decoder.operations(&at) > 0);
        // Values below zero are cut at each texel of an image, and once of a sample: colours with such a
        // texel say nothing.
        let comparable = (0..3).filter(|&c| texels.iter().all(|&(texel, _)| image[texel][c] > 0.0));
        comparable
            .inspect(|&c| {
                let difference = (found[c] - wanted[c]).abs();
                assert!(difference < 1e-4 * (1.0 + wanted[c].abs()), "{found:?} {wanted:?}");
            })
            .count()
    }

    /// Every decoder gives the errors that its baseline measures in its own way, and a filtered sample is the
    /// blend of what the images have.
    #[test]
    fn decoders_agree_with_their_baselines_and_samples_with_images() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [21, 12]);
        let description = dataset.description();
        let bytes = file_of(&dataset);
        let file = selvedge::open(&bytes, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"));
        let (lights, views) = (description.lights.clone(), description.views.clone());
        let locator = Locator { file: &file, size: description.size, lights, views };
        let offset = dataset.statistics().log_offset();
        for domain in [Domain::Linear, Domain::Log] {
            let mut random = Random::new(3);
            for (number, (decoder, row)) in baselines(&dataset, domain).iter().enumerate() {
                let source = Baseline { decoder: decoder.as_ref(), locator: &locator };
                let metrics =
                    compare(&dataset, &source, description, offset, None, &|_, _| ()).expect("compared");
                if let Some(row) = row {
                    assert_eq!(row.bytes, decoder.bytes());
                    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
                    assert!(near(row.linear_rms, metrics.linear_rms), "{number}: {row:?} {metrics:?}");
                    assert!(near(row.log_rms, metrics.log_rms), "{number}: {row:?} {metrics:?}");
                } else {
                    // What binary16 rounds.
                    assert!(metrics.log_rms < 1e-3, "{metrics:?}");
                }
                let bent = domain == Domain::Log || number == 3;
                let mut check =
                    || check_sample(decoder.as_ref(), &mut random, description.size, !bent || number == 4);
                let compared: usize = (0..20).map(|_| check()).sum();
                assert!(compared > 30, "{number}: {compared}");
            }
        }
    }

    #[test]
    fn two_nearest_are_the_nearest() {
        let set = [glam::DVec3::Z, glam::DVec3::X, glam::DVec3::Y];
        let blend = Blend::two_nearest(&set, glam::DVec3::new(0.6, 0.0, 0.8));
        assert_eq!(blend.index[..2], [0, 1]);
        // Chords of sqrt(0.4) and sqrt(0.8).
        assert!((blend.weight[0] - (1.0 - 0.5 / 2f32.sqrt())).abs() < 1e-6, "{blend:?}");
        assert_eq!(Blend::two_nearest(&set, glam::DVec3::Y).weight[0], 1.0);
        assert_eq!(Blend::two_nearest(&set[..1], glam::DVec3::Y).weight, [1.0, 0.0, 0.0]);
    }
}
