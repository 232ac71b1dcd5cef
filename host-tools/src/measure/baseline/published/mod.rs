//! The layout of SparseBTF as published (Kavoosighafi et al. 2023, sections 3.1, 3.3 and 3.4), decoded and
//! measured.
//!
//! `ln(x + 1e-5)`, YUV, one mean and one standard deviation for each image of a light and a view, blocks of
//! 10 x 10 texels, a fixed number of the largest coefficients in each channel (8 : 1 : 1), five bytes a
//! coefficient: four indices and a value. Wherever there is a choice, it is in the layout's favour: a value
//! is a binary16 number, although one byte is counted, and [`Published::own_ensembles`] are the eigenvectors
//! of the very material in all four modes (HOSVD, one dictionary a channel), although the published ones were
//! trained on other materials. Ensembles are an argument, and their bytes are told apart.

mod decoded;

pub use decoded::{Decoded, EDGE};

use super::{Row, Sums};
use crate::data::dataset::Dataset;
use crate::data::transfer::log2;
use crate::error::{Result, ToolError};
use crate::math::linear::{Basis, eigenbasis, product, product_at, product_bt};
use crate::methods::sparse_ensemble::dictionary::{self, Ensemble, Turn};
use crate::methods::sparse_ensemble::encode::candidates::magnitude_of_rank;
use crate::methods::sparse_ensemble::sparsebtf::{LOG_OFFSET, YUV_TO_RGB};
use crate::work::ordered;
use decoded::{Term, row_times};
use half::f16;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f32::consts::LN_2;

/// Bytes of a coefficient.
const COEFFICIENT_BYTES: u64 = 5;
/// Bytes of a block in a channel: its dictionary and its number of coefficients.
const BLOCK_BYTES: u64 = 4;
/// Bytes of a pair of directions: mean and standard deviation in binary16.
const PAIR_BYTES: u64 = 4;

/// A dataset in the normalised domain.
pub struct Published<'a> {
    dataset: &'a Dataset,
    /// `[view * lights + light]`, as binary16 holds them.
    means: Vec<f32>,
    deviations: Vec<f32>,
    from_rgb: [[f32; 3]; 3],
}

/// Scratch of one reader.
#[derive(Default)]
struct Reader {
    bytes: Vec<u8>,
    run: Vec<f32>,
}

/// Planes of the three channels and what decoding needs beside them.
type Planes = ([Vec<f32>; 3], Vec<f32>, Reader);

thread_local! {
    /// Reused from block to block: mapping fresh memory for each would take longer than the work.
    static PLANES: RefCell<Planes> = RefCell::default();
}

/// The largest coefficients of a block in one dictionary, largest first: place in `[y][x][view column][light
/// column]` and value.
type List = Vec<(u32, f32)>;

/// The coefficients of all blocks, and what was measured of them so far.
pub struct Layout<'a> {
    published: &'a Published<'a>,
    ensembles: &'a [Ensemble; 3],
    /// `lists[block][channel][dictionary]`.
    lists: Vec<[Vec<List>; 3]>,
    /// Most coefficients of a block, of all channels.
    most: usize,
    measured: BTreeMap<usize, Row>,
}

impl<'a> Published<'a> {
    /// Finds mean and standard deviation of every image, over all its texels and all three channels.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn new(dataset: &'a Dataset) -> Result<Published<'a>> {
        let (texels, pairs, batch) =
            (dataset.description().texels(), dataset.description().pairs(), dataset.batch());
        let inverse = glam::DMat3::from_cols_array(&std::array::from_fn(|i| YUV_TO_RGB[i / 3][i % 3]))
            .transpose()
            .inverse();
        let from_rgb = std::array::from_fn(|r| std::array::from_fn(|c| inverse.row(r)[c] as f32));
        let mut published = Published { dataset, means: Vec::new(), deviations: Vec::new(), from_rgb };
        let work = |i: usize| -> Result<Vec<[f64; 2]>> {
            let count = batch.min(texels - i * batch);
            let mut values = vec![0.0; count * pairs * 3];
            dataset.read(i * batch, count, &mut Vec::new(), &mut values)?;
            let mut sums = vec![[0.0; 2]; pairs];
            for (n, &rgb) in values.as_chunks::<3>().0.iter().enumerate() {
                let yuv = published.yuv(rgb).map(f64::from);
                let sums = &mut sums[n % pairs];
                sums[0] += yuv.iter().sum::<f64>();
                sums[1] += yuv.iter().map(|v| v * v).sum::<f64>();
            }
            Ok(sums)
        };
        let sums = ordered(
            texels.div_ceil(batch),
            work,
            vec![[0.0; 2]; pairs],
            |total: &mut Vec<[f64; 2]>, _, part| {
                total.iter_mut().zip(part).for_each(|(total, part)| (0..2).for_each(|k| total[k] += part[k]));
            },
        )?;
        let count = (3 * texels) as f64;
        let half = |x: f64| f16::from_f64(x).to_f32();
        published.means = sums.iter().map(|sums| half(sums[0] / count)).collect();
        let deviation = |sums: &[f64; 2]| half((sums[1] / count - (sums[0] / count).powi(2)).max(0.0).sqrt());
        published.deviations = sums.iter().map(deviation).map(|s| if s > 0.0 { s } else { 1.0 }).collect();
        Ok(published)
    }

    fn yuv(&self, rgb: [f32; 3]) -> [f32; 3] {
        let logs = rgb.map(|x| LN_2 * log2(x + LOG_OFFSET));
        self.from_rgb.each_ref().map(|row| row_times(row, logs))
    }

    /// Blocks along x and y; those at the end repeat the last texels.
    fn counts(&self) -> [usize; 2] {
        self.dataset.description().size.map(|n| n.div_ceil(EDGE))
    }

    /// Blocks.
    pub fn blocks(&self) -> usize {
        self.counts()[0] * self.counts()[1]
    }

    /// Visits the linear colours of a block: `visit(place in [y][x][pair], pair, colour, whether the texel is
    /// in the image)`.
    fn visit(
        &self,
        block: usize,
        reader: &mut Reader,
        mut visit: impl FnMut(usize, usize, [f32; 3], bool),
    ) -> Result<()> {
        let description = self.dataset.description();
        let ([width, height], pairs) = (description.size, description.pairs());
        let (left, top) = (block % self.counts()[0] * EDGE, block / self.counts()[0] * EDGE);
        let inside = EDGE.min(width - left);
        reader.run.resize(inside * pairs * 3, 0.0);
        for y in 0..EDGE {
            if top + y < height {
                self.dataset.read((top + y) * width + left, inside, &mut reader.bytes, &mut reader.run)?;
            }
            for x in 0..EDGE {
                let real = x < inside && top + y < height;
                let texel = &reader.run[x.min(inside - 1) * pairs * 3..][..pairs * 3];
                texel
                    .as_chunks::<3>()
                    .0
                    .iter()
                    .enumerate()
                    .for_each(|(pair, &rgb)| visit((y * EDGE + x) * pairs + pair, pair, rgb, real));
            }
        }
        Ok(())
    }

    /// The normalised channels of a block: `planes[channel]` receives `[y][x][view][light]`.
    fn read(&self, block: usize, reader: &mut Reader, planes: &mut [Vec<f32>; 3]) -> Result<()> {
        planes.iter_mut().for_each(|plane| plane.resize(EDGE * EDGE * self.means.len(), 0.0));
        self.visit(block, reader, |place, pair, rgb, _| {
            let yuv = self.yuv(rgb);
            (0..3).for_each(|c| planes[c][place] = (yuv[c] - self.means[pair]) / self.deviations[pair]);
        })
    }

    /// One dictionary a channel: the material's own eigenvectors in all four modes (HOSVD) of the normalised
    /// data.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn own_ensembles(&self) -> Result<[Ensemble; 3]> {
        let (lights, views) =
            (self.dataset.description().lights.len(), self.dataset.description().views.len());
        let pairs = lights * views;
        let work = |block: usize| -> Result<[[Vec<f32>; 4]; 3]> {
            let mut planes: [Vec<f32>; 3] = Default::default();
            self.read(block, &mut Reader::default(), &mut planes)?;
            Ok(planes.map(|plane| {
                let mut grams = [lights, views, EDGE, EDGE].map(|n| vec![0.0; n * n]);
                product_at(&mut grams[0], &plane, &plane, [lights, EDGE * EDGE * views, lights], false);
                plane
                    .chunks(pairs)
                    .for_each(|texel| product_bt(&mut grams[1], texel, texel, [views, lights, views], true));
                plane
                    .chunks(EDGE * pairs)
                    .for_each(|row| product_bt(&mut grams[2], row, row, [EDGE, pairs, EDGE], true));
                product_bt(&mut grams[3], &plane, &plane, [EDGE, EDGE * pairs, EDGE], false);
                grams
            }))
        };
        let start: [[Vec<f64>; 4]; 3] =
            std::array::from_fn(|_| [lights, views, EDGE, EDGE].map(|n| vec![0.0; n * n]));
        let grams = ordered(self.blocks(), work, start, |total, _, part| {
            for (total, part) in total.iter_mut().flatten().zip(part.iter().flatten()) {
                total.iter_mut().zip(part).for_each(|(total, &part)| *total += part as f64);
            }
        })?;
        Ok(grams.map(|[light, view, x, y]| {
            let basis = |gram: &[f64], n: usize| eigenbasis(gram, n).0;
            let turn = Turn { light: None, view: None, x: basis(&x, EDGE), y: basis(&y, EDGE) };
            Ensemble {
                light: basis(&light, lights),
                view: basis(&view, views),
                turns: vec![turn],
                tables: None,
            }
        }))
    }

    /// Coefficients of each channel for a sum, in the ratio of the paper (256 : 32 : 32).
    pub fn sparsity(coefficients: usize) -> [usize; 3] {
        let colour = coefficients / 10;
        [coefficients - 2 * colour, colour, colour]
    }

    /// Bytes with this many coefficients of each block: these, memberships, counts, means and standard
    /// deviations.
    pub fn bytes(&self, coefficients: usize) -> u64 {
        let blocks = self.blocks() as u64;
        self.means.len() as u64 * PAIR_BYTES
            + blocks * (3 * BLOCK_BYTES + coefficients as u64 * COEFFICIENT_BYTES)
    }

    /// Projects all blocks on the dictionaries and keeps what at most `bytes` can hold (equation 3).
    ///
    /// # Errors
    /// If the data cannot be read, or the ensembles do not fit to it.
    pub fn layout<'b>(&'b self, ensembles: &'b [Ensemble; 3], bytes: u64) -> Result<Layout<'b>> {
        let description = self.dataset.description();
        let rows = |ensemble: &Ensemble| [ensemble.light.rows, ensemble.view.rows, ensemble.edge()];
        if ensembles
            .iter()
            .any(|ensemble| rows(ensemble) != [description.lights.len(), description.views.len(), EDGE])
        {
            return Err(ToolError::Usage("these ensembles are of other directions or another edge".into()));
        }
        let fixed = self.bytes(0);
        if bytes < fixed {
            return Err(ToolError::Usage(format!(
                "{bytes} bytes are too few; without a coefficient the layout has {fixed}"
            )));
        }
        let most = (((bytes - fixed) / (self.bytes(1) - fixed)) as usize).min(ensembles[0].core_len());
        let sparsity = Published::sparsity(most);
        let work = |block: usize| -> Result<[Vec<List>; 3]> {
            let (mut planes, mut products) = (Default::default(), dictionary::Scratch::default());
            let (mut core, mut tensor, mut buckets) = (Vec::new(), Vec::new(), Vec::new());
            self.read(block, &mut Reader::default(), &mut planes)?;
            Ok(std::array::from_fn(|c| {
                ensembles[c].to_core(&planes[c], &mut products, &mut core);
                let mut list = |k: usize| {
                    ensembles[c].to_coefficients(k, &core, &mut products, &mut tensor);
                    let (limit, _) = magnitude_of_rank(&tensor, sparsity[c], &mut buckets);
                    let mut list: List = (0u32..)
                        .zip(&tensor)
                        .filter(|(_, v)| v.abs() >= limit)
                        .map(|(i, &v)| (i, v))
                        .collect();
                    list.sort_unstable_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
                    list.truncate(sparsity[c]);
                    list.shrink_to_fit();
                    list
                };
                (0..ensembles[c].turns.len()).map(&mut list).collect()
            }))
        };
        let lists = ordered(self.blocks(), work, Vec::new(), |all, _, lists| all.push(lists))?;
        Ok(Layout { published: self, ensembles, lists, most, measured: BTreeMap::new() })
    }
}

/// Equation 4: `[y][x][view][light]` from coefficients, through the bases of lights and views and those over
/// texels.
fn decode(list: &[(u32, f32)], angular: &[Basis; 2], turn: &Turn, a: &mut Vec<f32>, b: &mut Vec<f32>) {
    let [light, view] = angular;
    let (cl, cv) = (light.columns, view.columns);
    a.clear();
    a.resize(EDGE * EDGE * cl * cv, 0.0);
    list.iter().for_each(|&(place, value)| a[place as usize] = f16::from_f32(value).to_f32());
    b.resize(a.len(), 0.0);
    product(b, &turn.y.entries, a, [EDGE, EDGE, EDGE * cl * cv], false);
    for (out, from) in a.chunks_mut(EDGE * cl * cv).zip(b.chunks(EDGE * cl * cv)) {
        product(out, &turn.x.entries, from, [EDGE, EDGE, cl * cv], false);
    }
    b.resize(EDGE * EDGE * view.rows * cl, 0.0);
    for (out, from) in b.chunks_mut(view.rows * cl).zip(a.chunks(cv * cl)) {
        product(out, &view.entries, from, [view.rows, cv, cl], false);
    }
    a.resize(EDGE * EDGE * view.rows * light.rows, 0.0);
    product_bt(a, b, &light.entries, [EDGE * EDGE * view.rows, cl, light.rows], false);
}

impl Layout<'_> {
    /// Bytes of the dictionaries as binary16; no other number contains them.
    pub fn dictionary_bytes(&self) -> u64 {
        let of = |ensemble: &Ensemble| {
            let entries = 2 * EDGE * EDGE + ensemble.light.entries.len() + ensemble.view.entries.len();
            (ensemble.turns.len() * entries * 2) as u64
        };
        self.ensembles.iter().map(of).sum()
    }

    /// Errors over all values with this many coefficients of each block, each block in its best dictionary.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn measure(&mut self, coefficients: usize) -> Result<Row> {
        let coefficients = coefficients.min(self.most);
        if let Some(row) = self.measured.get(&coefficients) {
            return Ok(*row);
        }
        let published = self.published;
        let offset = published.dataset.statistics().log_offset();
        let sparsity = Published::sparsity(coefficients);
        let angular: [Vec<[Basis; 2]>; 3] = self
            .ensembles
            .each_ref()
            .map(|ensemble| (0..ensemble.turns.len()).map(|k| ensemble.angular(k)).collect());
        let to_rgb = YUV_TO_RGB.map(|row| row.map(|m| m as f32));
        let work = |block: usize| -> Result<Sums> {
            PLANES.with_borrow_mut(|(planes, scratch, reader)| {
                for (c, plane) in planes.iter_mut().enumerate() {
                    let kept = |list: &'_ List| sparsity[c].min(list.len());
                    let energy =
                        |list: &List| list[..kept(list)].iter().map(|v| (v.1 as f64).powi(2)).sum::<f64>();
                    let lists = &self.lists[block][c];
                    let energies: Vec<f64> = lists.iter().map(energy).collect();
                    let k = (1..lists.len())
                        .fold(0, |best, k| if energies[k] > energies[best] { k } else { best });
                    decode(
                        &lists[k][..kept(&lists[k])],
                        &angular[c][k],
                        &self.ensembles[c].turns[k],
                        plane,
                        scratch,
                    );
                }
                let mut sums = Sums::default();
                published.visit(block, reader, |place, pair, rgb, real| {
                    if real {
                        let yuv: [f32; 3] = std::array::from_fn(|c| {
                            planes[c][place] * published.deviations[pair] + published.means[pair]
                        });
                        let decoded =
                            to_rgb.each_ref().map(|row| (row_times(row, yuv).exp() - LOG_OFFSET).max(0.0));
                        (0..3).for_each(|c| sums.compare(rgb[c], decoded[c], offset));
                    }
                })?;
                Ok(sums)
            })
        };
        let sums = ordered(published.blocks(), work, Sums::default(), |total, _, sums| total.add(sums))?;
        let row = sums.row(published.bytes(coefficients));
        self.measured.insert(coefficients, row);
        Ok(row)
    }

    /// Most coefficients of a block that were kept.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Decodes what so many coefficients of each block would store.
    pub fn decoder(&self, coefficients: usize) -> Decoded {
        let coefficients = coefficients.min(self.most);
        let sparsity = Published::sparsity(coefficients);
        let description = self.published.dataset.description();
        let mut terms = Vec::new();
        let mut ends = Vec::new();
        for lists in &self.lists {
            for c in 0..3 {
                let kept = |k: usize| &lists[c][k][..sparsity[c].min(lists[c][k].len())];
                let energy = |k: usize| kept(k).iter().map(|v| (v.1 as f64).powi(2)).sum::<f64>();
                let k =
                    (1..lists[c].len()).fold(0, |best, k| if energy(k) > energy(best) { k } else { best });
                let (cl, cv) =
                    (self.ensembles[c].light.columns as u32, self.ensembles[c].view.columns as u32);
                terms.extend(kept(k).iter().map(|&(place, value)| Term {
                    value: f16::from_f32(value).to_f32(),
                    light: (place % cl) as u16,
                    view: (place / cl % cv) as u16,
                    x: (place / (cl * cv) % EDGE as u32) as u8,
                    y: (place / (cl * cv) / EDGE as u32) as u8,
                    dictionary: k as u16,
                }));
                ends.push(terms.len());
            }
        }
        Decoded {
            terms,
            ends,
            bases: self.ensembles.each_ref().map(|e| {
                (0..e.turns.len())
                    .map(|k| (e.angular(k), e.turns[k].x.clone(), e.turns[k].y.clone()))
                    .collect()
            }),
            means: self.published.means.clone(),
            deviations: self.published.deviations.clone(),
            size: description.size,
            lights: description.lights.len(),
            bytes: self.published.bytes(coefficients),
        }
    }

    /// Coefficients of a block within a budget, and what they reach; `None` if not even the tables fit.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn at(&mut self, bytes: u64) -> Result<Option<(usize, Row)>> {
        let fixed = self.published.bytes(0);
        let Some(rest) = bytes.checked_sub(fixed) else { return Ok(None) };
        let coefficients = ((rest / (self.published.bytes(1) - fixed)) as usize).min(self.most);
        Ok(Some((coefficients, self.measure(coefficients)?)))
    }

    /// The fewest coefficients, within one part in 200, that reach an error of the logarithms; `None` if all
    /// kept do not.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn reach(&mut self, log_rms: f64) -> Result<Option<(usize, Row)>> {
        if self.measure(0)?.log_rms <= log_rms {
            return Ok(Some((0, self.measure(0)?)));
        }
        if self.measure(self.most)?.log_rms > log_rms {
            return Ok(None);
        }
        // Errors fall with coefficients, so what was measured before narrows the interval.
        let mut high =
            *self.measured.iter().find(|(_, row)| row.log_rms <= log_rms).expect("the last does").0;
        let mut low = self.measured.range(..high).next_back().map_or(0, |(&low, _)| low);
        let mut straight = true;
        while high - low > (high / 200).max(1) {
            let position = |n: usize| (n as f64 + 1.0).ln();
            let (a, b) = (self.measure(low)?.log_rms.ln(), self.measure(high)?.log_rms.ln());
            // Along a straight line of logarithms, and by halves in turn, so that the interval always
            // shrinks.
            let part = if straight { (a - log_rms.ln()) / (a - b) } else { 0.5 };
            let guess = (position(low) + part * (position(high) - position(low))).exp() - 1.0;
            let margin = ((high - low) / 20).max(1);
            let middle = (guess.round() as usize).clamp(low + margin, high - margin);
            if self.measure(middle)?.log_rms <= log_rms {
                high = middle
            } else {
                low = middle
            }
            straight = !straight;
        }
        Ok(Some((high, self.measure(high)?)))
    }
}

/// The layout within a budget, with the material's own dictionaries, whose bytes are not counted.
///
/// # Errors
/// If the data cannot be read or the budget is below that of the tables.
pub fn published(dataset: &Dataset, bytes: u64) -> Result<Row> {
    let published = Published::new(dataset)?;
    let ensembles = published.own_ensembles()?;
    let mut layout = published.layout(&ensembles, bytes)?;
    let most = layout.most;
    layout.measure(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::baseline::tests::small;

    #[test]
    fn all_coefficients_give_the_data_and_fewer_give_less() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [21, 12]);
        let data = Published::new(&dataset).expect("made");
        let ensembles = data.own_ensembles().expect("made");
        assert_eq!(data.bytes(10), 54 * 4 + 6 * (12 + 50));
        let mut layout = data.layout(&ensembles, u64::MAX).expect("projected");
        assert_eq!(layout.dictionary_bytes(), 3 * 2 * (200 + 81 + 36));
        let errors = [0, 10, 100, 1000].map(|n| layout.measure(n).expect("measured").log_rms);
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
        // Eight tenths of all numbers of a block in Y; the other channels have the same dictionaries.
        let goal = errors[1];
        let (n, row) = layout.reach(goal * 1.0001).expect("measured").expect("reached");
        assert!(n <= 10 && row.log_rms <= goal * 1.0001);
        let bytes = data.bytes(100);
        assert_eq!(
            published(&dataset, bytes).expect("measured"),
            layout.at(bytes).expect("measured").expect("fits").1
        );
        assert!(data.layout(&ensembles, 10).is_err());
    }

    #[test]
    fn a_complete_tensor_decodes_to_its_block() {
        let folder = tempfile::tempdir().expect("a folder");
        let dataset = small(folder.path(), [13, 10]);
        let data = Published::new(&dataset).expect("made");
        let ensembles = data.own_ensembles().expect("made");
        let mut planes = Default::default();
        data.read(1, &mut Reader::default(), &mut planes).expect("read");
        let (mut core, mut tensor, mut scratch) = (Vec::new(), Vec::new(), dictionary::Scratch::default());
        for c in 0..3 {
            ensembles[c].to_core(&planes[c], &mut scratch, &mut core);
            ensembles[c].to_coefficients(0, &core, &mut scratch, &mut tensor);
            let list: List = (0u32..).zip(tensor.iter().copied()).collect();
            let (mut a, mut b) = (Vec::new(), Vec::new());
            decode(&list, &ensembles[c].angular(0), &ensembles[c].turns[0], &mut a, &mut b);
            // Binary16 leaves eleven bits of the largest coefficient.
            assert!(a.iter().zip(&planes[c]).all(|(a, b)| (a - b).abs() < 2e-2));
        }
    }
}
