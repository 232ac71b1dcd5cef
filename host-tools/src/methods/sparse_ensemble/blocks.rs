//! Blocks of a dataset as training and encoding see them, and the one pass that comes before: means and
//! second moments.
//!
//! A block is `edge x edge` texels with all pairs of directions: for each channel a tensor
//! `[y][x][view][light]`. Texels beyond the image repeat its last ones; no decoder ever reads them.

use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::error::Result;
use crate::math::linear::product_at;
use crate::work::ordered;

/// A grid of blocks over a dataset, read through a transfer.
pub struct Blocks<'a> {
    /// Where values come from.
    pub dataset: &'a Dataset,
    /// What they become.
    pub forward: Forward,
    /// Texels along the side of a block.
    pub edge: usize,
    /// Subtracted from every channel: `means[channel][view * lights + light]`.
    pub means: &'a [Vec<f32>; 3],
}

/// Scratch of one reader.
#[derive(Default)]
pub struct Scratch {
    bytes: Vec<u8>,
    run: Vec<f32>,
}

impl Blocks<'_> {
    /// Blocks along x and y.
    pub fn counts(&self) -> [usize; 2] {
        self.dataset.description().size.map(|n| n.div_ceil(self.edge))
    }

    /// Blocks.
    pub fn total(&self) -> usize {
        let [x, y] = self.counts();
        x * y
    }

    /// Numbers of a block in one channel.
    pub fn block_len(&self) -> usize {
        self.edge * self.edge * self.dataset.description().pairs()
    }

    /// Reads a block: `out[channel]` receives `[y][x][view][light]`, less the means.
    ///
    /// # Errors
    /// If the dataset cannot be read.
    pub fn read(&self, block: usize, scratch: &mut Scratch, out: &mut [Vec<f32>; 3]) -> Result<()> {
        let description = self.dataset.description();
        let ([width, height], pairs, edge) = (description.size, description.pairs(), self.edge);
        let (left, top) = (block % self.counts()[0] * edge, block / self.counts()[0] * edge);
        let inside = edge.min(width - left);
        out.iter_mut().for_each(|plane| plane.resize(self.block_len(), 0.0));
        scratch.run.resize(inside * description.texel_len(), 0.0);
        for y in 0..edge {
            if top + y >= height {
                // Repeats the row above.
                out.iter_mut().for_each(|plane| {
                    plane.copy_within((y - 1) * edge * pairs..y * edge * pairs, y * edge * pairs)
                });
                continue;
            }
            self.dataset.read((top + y) * width + left, inside, &mut scratch.bytes, &mut scratch.run)?;
            for x in 0..edge {
                let texel = &scratch.run[x.min(inside - 1) * pairs * 3..][..pairs * 3];
                let at = (y * edge + x) * pairs;
                let [c0, c1, c2] = &mut *out;
                let planes =
                    c0[at..at + pairs].iter_mut().zip(&mut c1[at..at + pairs]).zip(&mut c2[at..at + pairs]);
                let means = self.means[0].iter().zip(&self.means[1]).zip(&self.means[2]);
                for ((((p0, p1), p2), &rgb), ((m0, m1), m2)) in
                    planes.zip(texel.as_chunks::<3>().0).zip(means)
                {
                    let [v0, v1, v2] = self.forward.channels(rgb);
                    (*p0, *p1, *p2) = (v0 - m0, v1 - m1, v2 - m2);
                }
            }
        }
        Ok(())
    }
}

/// What the first pass finds of each channel.
#[derive(Clone, Debug, Default)]
pub struct Moments {
    /// Mean for each pair, `[view * lights + light]`.
    pub means: [Vec<f64>; 3],
    /// Second moments between lights, summed over texels and views, of values less their means:
    /// `[lights][lights]`.
    pub lights: [Vec<f64>; 3],
    /// The same between views.
    pub views: [Vec<f64>; 3],
}

/// Of a run of texels: sums for each pair, and second moments between lights and between views.
type Sums = ([Vec<f64>; 3], [Vec<f32>; 3], [Vec<f32>; 3]);

/// Means and second moments of a whole dataset in one pass.
///
/// # Errors
/// If the dataset cannot be read.
pub fn moments(dataset: &Dataset, forward: Forward, progress: &dyn Fn(usize, usize)) -> Result<Moments> {
    let description = dataset.description();
    let (lights, views, pairs) = (description.lights.len(), description.views.len(), description.pairs());
    let (texels, batch) = (description.texels(), dataset.batch().max(4).min(description.texels()));
    // About the middle, so that little is lost when the means are taken out at the end.
    let middle = forward.channels(dataset.statistics().mean.map(|m| m as f32));
    let constant = middle.map(|m| vec![m; pairs]);
    // Runs of texels are blocks of one row, whatever the image's shape.
    let part = |i: usize| -> Result<Sums> {
        let count = batch.min(texels - i * batch);
        let mut values = vec![0.0; count * pairs * 3];
        dataset.read(i * batch, count, &mut Vec::new(), &mut values)?;
        let mut planes: [Vec<f32>; 3] = Default::default();
        planes.iter_mut().for_each(|plane| plane.reserve(count * pairs));
        for (n, &rgb) in values.as_chunks::<3>().0.iter().enumerate() {
            let v = forward.channels(rgb);
            (0..3).for_each(|c| planes[c].push(v[c] - constant[c][n % pairs]));
        }
        let mut sums: [Vec<f64>; 3] = [const { Vec::new() }; 3];
        let (mut by_light, mut by_view): ([Vec<f32>; 3], [Vec<f32>; 3]) = Default::default();
        for c in 0..3 {
            sums[c] = vec![0.0; pairs];
            planes[c]
                .chunks(pairs)
                .for_each(|texel| sums[c].iter_mut().zip(texel).for_each(|(sum, &v)| *sum += v as f64));
            by_light[c] = vec![0.0; lights * lights];
            product_at(&mut by_light[c], &planes[c], &planes[c], [lights, count * views, lights], false);
            by_view[c] = vec![0.0; views * views];
            for texel in planes[c].chunks(pairs) {
                crate::math::linear::product_bt(&mut by_view[c], texel, texel, [views, lights, views], true);
            }
        }
        Ok((sums, by_light, by_view))
    };
    let mut total = Moments::default();
    for c in 0..3 {
        total.means[c] = vec![0.0; pairs];
        total.lights[c] = vec![0.0; lights * lights];
        total.views[c] = vec![0.0; views * views];
    }
    let parts = texels.div_ceil(batch);
    let mut total = ordered(parts, part, total, |total, i, (sums, by_light, by_view)| {
        let add =
            |into: &mut Vec<f64>, from: &[f32]| into.iter_mut().zip(from).for_each(|(a, &b)| *a += b as f64);
        for c in 0..3 {
            total.means[c].iter_mut().zip(&sums[c]).for_each(|(a, b)| *a += b);
            add(&mut total.lights[c], &by_light[c]);
            add(&mut total.views[c], &by_view[c]);
        }
        progress(i + 1, parts);
    })?;
    let count = texels as f64;
    for (c, middle) in middle.into_iter().enumerate() {
        let mean: Vec<f64> = total.means[c].iter().map(|sum| sum / count).collect();
        let at = |v: usize, l: usize| mean[v * lights + l];
        for (a, b) in (0..lights).flat_map(|a| (0..lights).map(move |b| (a, b))) {
            total.lights[c][a * lights + b] -= count * (0..views).map(|v| at(v, a) * at(v, b)).sum::<f64>();
        }
        for (a, b) in (0..views).flat_map(|a| (0..views).map(move |b| (a, b))) {
            total.views[c][a * views + b] -= count * (0..lights).map(|l| at(a, l) * at(b, l)).sum::<f64>();
        }
        total.means[c] = mean.iter().map(|m| m + middle as f64).collect();
    }
    Ok(total)
}
