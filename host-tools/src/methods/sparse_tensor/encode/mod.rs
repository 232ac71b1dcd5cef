//! The encoder of the sparse tensor (chapter 12): a dataset becomes a file for a goal in bytes or error.
//!
//! [`fit`](mod@fit) decomposes in floats as the paper does; [`integers`] turns light atoms and fibres into
//! the numbers of a file. The texels are then coded against *those* numbers, from the data themselves, so
//! that rounding of the atoms is made up for as far as coefficients can, and the error is known before
//! anything is decoded.

pub mod fit;
pub mod integers;

use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::error::{Result, ToolError};
use crate::format::model::{MaterialModel, TransferModel};
use crate::format::texture::Texture;
use crate::format::write::write_material;
use crate::math::ksvd::{Pursuit, Rows, dot, gram, pursue};
use crate::math::linear::{ordered, product_bt};
use crate::measure::baseline::pca::{Domain, Pca};
use crate::methods::means::{described, mean_tables};
use crate::methods::sparse_tensor::model::{ListsModel, TensorModel};
use fit::{Fit, Shape, Trained, Training, fit};
use integers::{Atoms, Quantiser};
use rayon::prelude::*;
use std::f64::consts::LN_2;

/// What a file has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Bytes of the whole file, at most.
    Size(u64),
    /// Root of the mean squared error in the domain that is coded: of `ln(x + offset)`, or of linear
    /// radiance.
    Rms(f64),
    /// As many coefficients as the shape allows, for every texel.
    All,
}

impl Goal {
    /// What a file is worth that reaches the goal; the least is the best.
    fn worth(self, rms: f64, bytes: f64) -> f64 {
        match self {
            Goal::Rms(_) => bytes,
            Goal::Size(_) => rms,
            // Bytes to the power at which error falls with them, about: no goal says what either is worth.
            Goal::All => rms * bytes.sqrt(),
        }
    }
}

/// Whether so many coefficients are limited that ranges do not fit.
fn are_many(limited: usize, coefficients: usize) -> bool {
    limited * 100 > coefficients
}

/// How to encode.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Sizes of the dictionaries and lists.
    pub shape: Shape,
    /// What to reach.
    pub goal: Goal,
    /// Bits of a coefficient; chosen by their worth if `None`.
    pub value_bits: Option<u32>,
    /// How long to train.
    pub training: Training,
}

/// A finished file and what is known of it without decoding it.
pub struct Encoded {
    /// The material.
    pub model: MaterialModel,
    /// Its file.
    pub bytes: Vec<u8>,
    /// Coefficients of level 0.
    pub coefficients: usize,
    /// Predicted root mean squared error over level 0, in the domain that is coded, all rounding of stored
    /// numbers included.
    pub predicted_rms: f64,
    /// Coefficients beyond the range of their ABRDF atom, which were limited to it.
    pub limited: usize,
    /// What training found.
    pub trained: Trained,
}

impl Encoded {
    /// What training and coding found, in words.
    pub fn found(&self) -> String {
        let Trained { revived, breakdowns, condition, .. } = &self.trained;
        format!(
            "{revived} atoms revived, {breakdowns} breakdowns, energies of atoms within {condition:.0}:1, {} coefficients limited",
            self.limited
        )
    }

    /// Whether any of it is out of the common.
    pub fn is_stiff(&self) -> bool {
        self.trained.revived > 0
            || self.trained.breakdowns > 0
            || self.trained.condition > STIFF
            || are_many(self.limited, self.coefficients)
    }
}

/// The transfer and offset that a domain is coded with.
pub fn transfer_of(data: &Dataset, domain: Domain) -> TransferModel {
    let statistics = data.statistics();
    match domain {
        Domain::Log => TransferModel::Log2 { offset: statistics.coded_offset() },
        // Values below 16, so that a texture is far below its bound.
        Domain::Linear => TransferModel::Linear {
            exponent: (statistics.largest.max(1e-30).log2().ceil() as i32 - 4).clamp(-60, 60),
        },
    }
}

/// Products of every texel with all atoms, and its energy, both about the mean.
struct Correlations {
    /// `[texel][atom]`.
    alpha: Vec<f32>,
    energy: Vec<f64>,
}

/// Texels of a part of a pass.
const BATCH: usize = 32;

fn correlate(data: &Dataset, forward: &Forward, means: &[Vec<f32>; 3], atoms: &Rows) -> Result<Correlations> {
    let (texels, columns, n) = (data.description().texels(), data.description().texel_len(), atoms.count());
    let work = |batch: usize| -> Result<(Vec<f32>, Vec<f64>)> {
        let count = BATCH.min(texels - batch * BATCH);
        let (mut bytes, mut values) = (Vec::new(), vec![0.0f32; count * columns]);
        data.read(batch * BATCH, count, &mut bytes, &mut values)?;
        for texel in values.chunks_mut(columns) {
            for (pair, rgb) in texel.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let channels = forward.channels(*rgb);
                *rgb = std::array::from_fn(|c| channels[c] - means[c][pair]);
            }
        }
        let mut alpha = vec![0.0; count * n];
        product_bt(&mut alpha, &values, &atoms.values, [count, columns, n], false);
        let energy = values.chunks(columns).map(|texel| dot(texel, texel)).collect();
        Ok((alpha, energy))
    };
    let start = Correlations { alpha: Vec::with_capacity(texels * n), energy: Vec::with_capacity(texels) };
    ordered(texels.div_ceil(BATCH), work, start, |all, _, (alpha, energy): (Vec<f32>, Vec<f64>)| {
        all.alpha.extend(alpha);
        all.energy.extend(energy);
    })
}

/// The lists of a level and what they come to.
struct Lists {
    model: Vec<Vec<(u32, u16)>>,
    /// Squared error in units of the channels.
    error: f64,
    count: usize,
    limited: usize,
}

impl Correlations {
    /// Codes every texel with what each coefficient is worth, and rounds.
    fn lists(&self, gram: &[f64], quantiser: &Quantiser, pursuit: Pursuit) -> Lists {
        let n = quantiser.atoms();
        let coded = |texel: usize, pursuit: Pursuit| {
            let alpha = &self.alpha[texel * n..][..n];
            let code = pursue(alpha, self.energy[texel], gram, pursuit);
            let mut limited = 0;
            let mut list: Vec<(u32, u16)> = Vec::with_capacity(code.terms.len());
            for &(atom, value) in &code.terms {
                let (stored, is_limited) = quantiser.value(atom, value);
                list.push((atom, stored));
                limited += is_limited as usize;
            }
            list.sort_unstable();
            let rounded: Vec<(usize, f64)> = list
                .iter()
                .map(|&(atom, stored)| (atom as usize, quantiser.coefficient(atom, stored)))
                .collect();
            let mut error = self.energy[texel];
            for &(a, x) in &rounded {
                error -= 2.0 * x * alpha[a] as f64;
                error += rounded.iter().map(|&(b, y)| x * y * gram[a * n + b]).sum::<f64>();
            }
            (list, error.max(0.0), limited)
        };
        let of = |texel: usize| {
            let mut best = coded(texel, pursuit);
            // Nearly parallel atoms get large coefficients that cancel; where these are limited they do not,
            // and fewer come nearer.
            if best.2 > 0 {
                for most in (0..best.0.len()).rev() {
                    let shorter = coded(texel, Pursuit { most, ..pursuit });
                    let is_whole = shorter.2 == 0;
                    if shorter.1 < best.1 {
                        best = shorter;
                    }
                    if is_whole {
                        break;
                    }
                }
            }
            if best.1 > self.energy[texel] { (Vec::new(), self.energy[texel], 0) } else { best }
        };
        let all: Vec<_> = (0..self.energy.len()).into_par_iter().map(of).collect();
        let mut lists = Lists { model: Vec::with_capacity(all.len()), error: 0.0, count: 0, limited: 0 };
        for (list, error, limited) in all {
            lists.error += error;
            lists.count += list.len();
            lists.limited += limited;
            lists.model.push(list);
        }
        lists
    }
}

/// ABRDF atoms whose cosine is nearer to one are taken for one; those of common materials are below 0.95.
const TWINS: f64 = 1e-4;
/// An error that is more times the estimate than this is not taken for granted.
const NEAR: f64 = 1.5;
/// Nor is one of atoms whose energies lie further apart; those of common materials are within ten.
const STIFF: f64 = 1e3;
/// Most passes over the data for the ranges of coefficients.
const MOST_PASSES: usize = 8;
/// Widths of a value that are tried.
const VALUE_BITS: std::ops::RangeInclusive<u32> = 5..=9;

/// Encodes the components of a dataset, and its coarser levels of detail.
///
/// # Errors
/// If the data cannot be read, or the goal cannot be met.
pub fn encode(
    pca: &Pca<'_>,
    coarser: &[&Dataset],
    options: &Options,
    tell: impl FnMut(&str, usize, usize),
) -> Result<Encoded> {
    let fitted = fit(pca, options.shape, options.training, tell);
    encode_fit(pca, &fitted, coarser, options)
}

/// Fibres and largest coefficients of the ABRDF atoms, with nothing left of those that are parallel to
/// another one with larger coefficients.
///
/// Where one part of the data has nearly all the energy, training makes many atoms of it, which rounding may
/// turn in any order: which of them a texel is coded with, and how large its coefficient is then, would be
/// chance.
fn without_twins(light: &Rows, fitted: &Fit) -> (Vec<Vec<(u32, f64)>>, Vec<f64>) {
    let (mut fibres, mut largest) = (fitted.fibres.clone(), fitted.largest.clone());
    let products = gram(&Atoms::new(light, &fibres, &largest, 8).rebuild());
    let n = largest.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| largest[b].total_cmp(&largest[a]).then(a.cmp(&b)));
    let mut kept: Vec<usize> = Vec::with_capacity(n);
    for atom in order {
        let is_twin = |&&other: &&usize| {
            products[atom * n + other].abs()
                > (1.0 - TWINS) * (products[atom * n + atom] * products[other * n + other]).sqrt()
        };
        match kept.iter().find(is_twin) {
            Some(&twin) => {
                largest[twin] += std::mem::take(&mut largest[atom]);
                fibres.iter_mut().skip(atom).step_by(n).for_each(Vec::clear);
            }
            None => kept.push(atom),
        }
    }
    (fibres, largest)
}

/// Encodes a decomposition that is there.
///
/// # Errors
/// As [`encode`].
pub fn encode_fit(pca: &Pca<'_>, fitted: &Fit, coarser: &[&Dataset], options: &Options) -> Result<Encoded> {
    let data = pca.dataset;
    let description = data.description();
    let transfer = transfer_of(data, pca.domain);
    let forward = Forward::new(transfer);
    let pairs = description.pairs();
    // The mean in the channels: colours mix linearly, and so does what is subtracted.
    let mut means: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; pairs]);
    for (pair, rgb) in pca.mean.as_chunks::<3>().0.iter().enumerate() {
        let mixed = forward.mix(into_units(*rgb, pca.domain));
        (0..3).for_each(|c| means[c][pair] = mixed[c] as f64);
    }
    let (tables, decoded_means) = mean_tables(&means)?;
    let light = {
        let mut light = fitted.light.clone();
        for rgb in light.values.as_chunks_mut::<3>().0 {
            *rgb = forward.mix(into_units(*rgb, pca.domain));
        }
        light
    };
    let unit = match transfer {
        TransferModel::Log2 { .. } => LN_2,
        TransferModel::Linear { exponent } => 2f64.powi(exponent),
    };
    let values = (description.texels() * pairs * 3) as f64;
    let wanted = |rms: f64| (rms / unit).powi(2) * values;

    let levels: Vec<&Dataset> = std::iter::once(data).chain(coarser.iter().copied()).collect();
    let bits: Vec<u32> = options.value_bits.map_or(VALUE_BITS.collect(), |bits| vec![bits]);
    let (fibres, mut largest) = without_twins(&light, fitted);
    let mut best: Option<(f64, Encoded)> = None;
    let mut correlations: Option<(Atoms, Vec<f64>, Vec<Correlations>)> = None;
    for value_bits in bits {
        if correlations.is_none() {
            // Atoms are made for the range of their coefficients; coded anew these move a little, so it is
            // done twice, and where many are limited, as those of nearly parallel atoms are,
            // again with more room: what errs least is taken.
            let mut least = f64::INFINITY;
            for pass in 0..MOST_PASSES {
                let atoms = Atoms::new(&light, &fibres, &largest, value_bits.max(8));
                let rebuilt = atoms.rebuild();
                let products = gram(&rebuilt);
                let of_levels = levels
                    .iter()
                    .map(|level| correlate(level, &forward, &decoded_means, &rebuilt))
                    .collect::<Result<Vec<_>>>()?;
                let quantiser = Quantiser::new(&atoms, 15);
                let lists = of_levels[0].lists(
                    &products,
                    &quantiser,
                    Pursuit { most: options.shape.coefficients, least_gain: 0.0 },
                );
                let mut seen = vec![0.0f64; largest.len()];
                let coefficient =
                    |&(atom, stored): &(u32, u16)| (atom as usize, quantiser.coefficient(atom, stored).abs());
                lists
                    .model
                    .iter()
                    .flatten()
                    .map(coefficient)
                    .for_each(|(atom, c)| seen[atom] = seen[atom].max(c));
                // Limited ones say that there is more; a little room for what other numbers of coefficients
                // need.
                let (room, floor) = if pass == 0 { (1.25, 1e-6) } else { (4.0, 1.0) };
                largest = largest
                    .iter()
                    .zip(&seen)
                    .map(|(&was, &now)| if now >= was * 0.999 { was * room } else { now.max(was * floor) })
                    .collect();
                if lists.error < least * if pass == 1 { 1.01 } else { 1.0 } {
                    least = lists.error;
                    correlations = Some((atoms, products, of_levels));
                }
                if pass > 0 && !are_many(lists.limited, lists.count) {
                    break;
                }
            }
        }
        let Some((atoms, products, of_levels)) = &correlations else { continue };
        let quantiser = Quantiser::new(atoms, value_bits);
        let attempt = |least_gain: f64| -> (MaterialModel, Vec<u8>, Lists) {
            let pursuit = Pursuit { most: options.shape.coefficients, least_gain };
            let mut lists: Vec<Lists> =
                of_levels.iter().map(|level| level.lists(products, &quantiser, pursuit)).collect();
            let per_level: Vec<Vec<Vec<(u32, u16)>>> =
                lists.iter_mut().map(|lists| std::mem::take(&mut lists.model)).collect();
            let (shifts, shift) = quantiser.shifts(&per_level);
            let tensor: Box<dyn Texture> = Box::new(TensorModel {
                channels: [true; 3],
                light_atoms: atoms.light_atoms(),
                lights: atoms.lights(),
                entries: atoms.entries(),
                atoms: shifts,
                fibres: atoms.fibres(),
                lists: per_level
                    .into_iter()
                    .map(|lists| vec![ListsModel { value_bits, shift, lists }])
                    .collect(),
            });
            let mut model = described(description, transfer).with_texture(tensor);
            model.level_count = levels.len() as u32;
            model.channels.iter_mut().zip(&tables).for_each(|(c, table)| c.mean = Some(table.clone()));
            let bytes = write_material(&model);
            (model, bytes, lists.swap_remove(0))
        };
        // The least worth of a coefficient that still meets the goal: bisection over its logarithm.
        let meets = |bytes: &[u8], lists: &Lists| match options.goal {
            Goal::Size(size) => bytes.len() as u64 <= size,
            Goal::Rms(rms) => lists.error <= wanted(rms),
            Goal::All => true,
        };
        let energy = of_levels[0].energy.iter().sum::<f64>() / description.texels() as f64;
        let mut found = attempt(0.0);
        match options.goal {
            Goal::All => {}
            Goal::Size(_) if meets(&found.1, &found.2) => {}
            Goal::Rms(_) if !meets(&found.1, &found.2) => continue,
            _ => {
                // For a size a higher worth meets it, for an error a lower one does.
                let (mut low, mut high) =
                    ((energy * 1e-9 + f64::MIN_POSITIVE).ln(), (energy * 10.0 + f64::MIN_POSITIVE).ln());
                let mut met = None;
                for _ in 0..14 {
                    let middle = (low + high) / 2.0;
                    let tried = attempt(middle.exp());
                    let is_met = meets(&tried.1, &tried.2);
                    let up = matches!(options.goal, Goal::Rms(_)) == is_met;
                    if up {
                        low = middle
                    } else {
                        high = middle
                    }
                    if is_met {
                        met = Some(tried);
                    }
                }
                match met {
                    Some(met) => found = met,
                    None if matches!(options.goal, Goal::Rms(_)) => {}
                    None => continue,
                }
            }
        }
        let (model, bytes, lists) = found;
        let predicted_rms = (lists.error / values).sqrt() * unit;
        let worth = options.goal.worth(predicted_rms, bytes.len() as f64);
        let encoded = Encoded {
            model,
            bytes,
            coefficients: lists.count,
            predicted_rms,
            limited: lists.limited,
            trained: fitted.trained,
        };
        if best.as_ref().is_none_or(|(least, _)| worth < *least) {
            best = Some((worth, encoded));
        }
    }
    let goal = match options.goal {
        Goal::Size(size) => format!("{size} bytes"),
        Goal::Rms(rms) => format!("an error of {rms}"),
        Goal::All => "a file".to_owned(),
    };
    best.map(|(_, encoded)| encoded).ok_or_else(|| {
        ToolError::Usage(format!("{goal} cannot be reached with these sizes of dictionaries and lists"))
    })
}

/// Sizes of dictionaries that are tried: light atoms and ABRDF atoms.
pub const SIZES: [[usize; 2]; 4] = [[16, 32], [32, 64], [64, 128], [128, 256]];
/// Lists and fibres of the trial from which their lengths are chosen.
const TRIAL: [usize; 2] = [12, 20];

/// Bytes that a file of this shape will have, about: its lists full, seven bits a value.
fn estimated_bytes(data: &Dataset, levels: usize, shape: Shape) -> u64 {
    let description = data.description();
    let [lights, views] = [&description.lights, &description.views].map(Vec::len);
    let fixed = 600
        + 6 * (lights * views + lights)
        + 60 * (lights + if description.lights == description.views { 0 } else { views });
    let texels: usize = (0..levels as u32)
        .map(|level| description.size.iter().map(|&n| n.div_ceil(1 << level)).product::<usize>())
        .sum();
    let index = (shape.abrdf_atoms as f64 / shape.coefficients as f64).log2().max(0.0) + 2.0;
    let list = (shape.coefficients as f64 * (7.0 + index) + 9.0) / 8.0;
    (fixed + 4 * lights * shape.light_atoms + 2 * views * shape.abrdf_atoms * shape.entries) as u64
        + (texels as f64 * list) as u64
}

/// Errors of shorter fibres and lists of one trial decomposition.
struct Trial {
    light_atoms: usize,
    abrdf_atoms: usize,
    of_texels: Vec<f64>,
    of_fibres: Vec<f64>,
}

/// What the shape for a goal is chosen by: for some sizes of the dictionaries one decomposition with long
/// fibres and lists. The same for all goals.
pub struct Trials<'a, 'd> {
    pca: &'a Pca<'d>,
    trials: Vec<Trial>,
}

impl<'a, 'd> Trials<'a, 'd> {
    /// Makes the decompositions.
    pub fn new(pca: &'a Pca<'d>, training: Training, mut tell: impl FnMut(&str, usize, usize)) -> Self {
        let training = Training { iterations: training.iterations.min(6), rounds: 1, ..training };
        let trial = |[light_atoms, abrdf_atoms]: [usize; 2]| {
            let [entries, coefficients] = TRIAL;
            let fitted =
                fit(pca, Shape { light_atoms, abrdf_atoms, entries, coefficients }, training, &mut tell);
            Trial { light_atoms, abrdf_atoms, of_texels: fitted.of_texels, of_fibres: fitted.of_fibres }
        };
        Trials { pca, trials: SIZES.map(trial).into() }
    }

    /// The best shape of each size of the dictionaries for a goal, the best of all first, and the error that
    /// is estimated for it.
    ///
    /// By the estimate of Ruiters and Klein (section 4.2): errors of shorter fibres and lists are read from a
    /// decomposition as sums of those of both steps.
    fn ranked(&self, levels: usize, goal: Goal) -> Vec<(f64, Shape)> {
        let values = (self.pca.dataset.description().texels() * self.pca.mean.len()) as f64;
        let best_of = |trial: &Trial| {
            let &Trial { light_atoms, abrdf_atoms, ref of_texels, ref of_fibres } = trial;
            let mut best: Option<(f64, f64, Shape)> = None;
            for (entries, of_fibres) in of_fibres.iter().enumerate().skip(2) {
                for (coefficients, of_texels) in of_texels.iter().enumerate().skip(2) {
                    let shape = Shape { light_atoms, abrdf_atoms, entries, coefficients };
                    let error = ((of_texels + of_fibres) / values).sqrt();
                    let bytes = estimated_bytes(self.pca.dataset, levels, shape);
                    // What misses the goal is worse than all that meet it, by how far it misses.
                    let worth = match goal {
                        Goal::Size(size) if bytes > size => 1e30 * bytes as f64,
                        Goal::Rms(rms) if error > rms => 1e30 * error,
                        _ => goal.worth(error, bytes as f64),
                    };
                    if best.is_none_or(|(least, ..)| worth < least) {
                        best = Some((worth, error, shape));
                    }
                }
            }
            best
        };
        let mut all: Vec<(f64, f64, Shape)> = self.trials.iter().filter_map(best_of).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The estimate is rough: a little more room, of which the goal takes what it needs. Lists can be
        // shortened to a size, fibres cannot.
        let roomy = |(_, error, shape): (f64, f64, Shape)| {
            let longer = Shape { entries: shape.entries + 1, ..shape };
            let fits = |size| estimated_bytes(self.pca.dataset, levels, longer) <= size;
            let entries =
                if matches!(goal, Goal::Size(size) if !fits(size)) { shape.entries } else { longer.entries };
            (error, Shape { entries, coefficients: shape.coefficients + 3, ..shape })
        };
        if all.is_empty() {
            return vec![(
                f64::INFINITY,
                Shape { light_atoms: 64, abrdf_atoms: 128, entries: 8, coefficients: 10 },
            )];
        }
        all.into_iter().map(roomy).collect()
    }

    /// Encodes with the shape that is estimated to be best, and with those of other sizes of the dictionaries
    /// where the error comes out far from the estimate or the goal is not reached, as it may with data
    /// whose energy is in a few of their values. Gives the decomposition too.
    ///
    /// # Errors
    /// If the data cannot be read, or no shape reaches the goal.
    pub fn encode(
        &self,
        coarser: &[&Dataset],
        goal: Goal,
        value_bits: Option<u32>,
        training: Training,
        mut tell: impl FnMut(&str, usize, usize),
    ) -> Result<(Shape, Fit, Encoded)> {
        let mut best: Option<(Shape, Fit, Encoded)> = None;
        let mut failed = None;
        for (estimate, shape) in self.ranked(1 + coarser.len(), goal) {
            let fitted = fit(self.pca, shape, training, &mut tell);
            let encoded = match encode_fit(
                self.pca,
                &fitted,
                coarser,
                &Options { shape, goal, value_bits, training },
            ) {
                Ok(encoded) => encoded,
                Err(error @ ToolError::Usage(_)) => {
                    failed.get_or_insert(error);
                    continue;
                }
                Err(error) => return Err(error),
            };
            let is_near = matches!(goal, Goal::Rms(_))
                || encoded.predicted_rms <= NEAR * estimate && encoded.trained.condition <= STIFF;
            let worth = |encoded: &Encoded| goal.worth(encoded.predicted_rms, encoded.bytes.len() as f64);
            if best.as_ref().is_none_or(|(.., least)| worth(&encoded) < worth(least)) {
                best = Some((shape, fitted, encoded));
            }
            if is_near {
                break;
            }
        }
        best.ok_or_else(|| {
            failed.unwrap_or_else(|| ToolError::Usage("no shape of a sparse tensor was tried".into()))
        })
    }
}

/// Values of the components' domain in the units that channels are mixed of.
fn into_units(rgb: [f32; 3], domain: Domain) -> [f32; 3] {
    if domain == Domain::Log { rgb.map(|v| (v as f64 / LN_2) as f32) } else { rgb }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset::{Description, Sample};
    use crate::measure::baseline::pca::pca;
    use crate::measure::baseline::tests::small;
    use crate::measure::compare::{Source, compare};
    use selvedge::Limits;

    fn options(goal: Goal) -> Options {
        let shape = Shape { light_atoms: 5, abrdf_atoms: 7, entries: 3, coefficients: 4 };
        Options { shape, goal, value_bits: None, training: Training { iterations: 4, rounds: 2, seed: 1 } }
    }

    /// Decoded against the data, in the domain that was coded.
    fn decoded(data: &Dataset, bytes: &[u8], domain: Domain) -> f64 {
        let file = selvedge::open(bytes, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"));
        let metrics = compare(
            Source::Data(data),
            Source::File(&file, 0),
            data.description(),
            data.statistics().log_offset(),
            None,
            &|_, _| (),
        )
        .expect("compared");
        if domain == Domain::Log { metrics.log_rms } else { metrics.linear_rms }
    }

    #[test]
    fn what_is_predicted_is_decoded_and_goals_are_met() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [21, 12]);
        for domain in [Domain::Log, Domain::Linear] {
            let components = pca(&data, domain, 12).expect("made");
            let all = encode(&components, &[], &options(Goal::All), |_, _, _| ()).expect("encoded");
            let found = decoded(&data, &all.bytes, domain);
            // Below the prediction where what would be negative is decoded as zero.
            let lowest = if domain == Domain::Log { 0.97 } else { 0.85 };
            assert!(
                (lowest..1.03).contains(&(found / all.predicted_rms)),
                "{domain:?}: {found} {}",
                all.predicted_rms
            );
            assert!(
                found < 0.5 * components.predicted_rms(0),
                "{domain:?}: {found} {}",
                components.predicted_rms(0)
            );
            let size = all.bytes.len() as u64 - 100;
            let smaller =
                encode(&components, &[], &options(Goal::Size(size)), |_, _, _| ()).expect("encoded");
            assert!(smaller.bytes.len() as u64 <= size && smaller.predicted_rms >= all.predicted_rms * 0.99);
            let rms = all.predicted_rms * 1.2;
            let looser = encode(&components, &[], &options(Goal::Rms(rms)), |_, _, _| ()).expect("encoded");
            assert!(looser.predicted_rms <= rms && looser.bytes.len() <= all.bytes.len());
            assert!(encode(&components, &[], &options(Goal::Rms(rms * 1e-3)), |_, _, _| ()).is_err());
            assert!(encode(&components, &[], &options(Goal::Size(500)), |_, _, _| ()).is_err());
        }
    }

    /// Name, texels, directions of light and view, and the value of a texel's number.
    type Case = (&'static str, [usize; 2], usize, usize, fn(usize, usize) -> f32);

    /// Materials at the ends of what data can be: each encodes, opens, and is decoded to what was predicted.
    #[test]
    fn odd_data_are_encoded() {
        let folder = tempfile::tempdir().expect("a folder");
        let grid = crate::data::directions::grid(81).expect("known");
        let cases: [Case; 9] = [
            ("one texel", [1, 1], 9, 6, |_, i| 0.5 + (i % 7) as f32 * 0.1),
            ("one direction", [5, 4], 1, 1, |t, i| 0.5 + ((t * 3 + i) % 5) as f32 * 0.1),
            ("one number", [1, 1], 1, 1, |_, _| 0.25),
            ("black", [6, 5], 9, 6, |_, _| 0.0),
            ("constant", [6, 5], 9, 6, |_, _| 0.75),
            ("rank one", [6, 5], 9, 6, |t, i| (1.0 + t as f32 * 0.1) * (0.2 + (i % 11) as f32 * 0.05)),
            ("zeros", [6, 5], 9, 6, |t, i| if (t + i) % 3 == 0 { 0.0 } else { 0.4 }),
            ("a highlight a million times the rest", [6, 5], 9, 6, |t, i| {
                if t == 7 && i / 3 == 11 { 600.0 } else { 0.0006 + (i % 5) as f32 * 1e-5 }
            }),
            ("very small", [6, 5], 9, 6, |t, i| 1e-15 * (1.0 + ((t + i) % 4) as f32)),
        ];
        for (name, size, lights, views, value) in cases {
            let path = folder.path().join("odd.selvset");
            let description = Description {
                size,
                lights: grid[..lights].to_vec(),
                views: grid[..views].to_vec(),
                sample: Sample::Float,
                ..Description::default()
            };
            let data = Dataset::from_fn(&path, description, value).expect("written");
            for domain in [Domain::Log, Domain::Linear] {
                let components = pca(&data, domain, 8).expect("made");
                let encoded = encode(&components, &[], &options(Goal::All), |_, _, _| ())
                    .unwrap_or_else(|error| panic!("{name} {domain:?}: {error}"));
                let found = decoded(&data, &encoded.bytes, domain);
                // A unit of the last place of a channel, which is a millionth of its range, may be lost on
                // the way.
                let range = if domain == Domain::Log { 20.0 } else { data.statistics().largest as f64 };
                assert!(
                    found <= encoded.predicted_rms * 1.05 + range * 2e-4,
                    "{name} {domain:?}: {found} {}",
                    encoded.predicted_rms
                );
                println!("{name}, {domain:?}: {found:.3e}, predicted {:.3e}", encoded.predicted_rms);
            }
        }
    }

    #[test]
    fn bytes_do_not_depend_on_threads() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [9, 7]);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                encode(&pca(&data, Domain::Linear, 8).expect("made"), &[], &options(Goal::All), |_, _, _| ())
                    .expect("encoded")
                    .bytes
            })
        };
        assert!(with(1) == with(2) && with(1) == with(3));
    }
}
