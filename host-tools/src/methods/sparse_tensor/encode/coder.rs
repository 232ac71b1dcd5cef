//! Coding of a decomposition for a target: the least gain of a coefficient that meets it.

use super::fit::{Fit, fit};
use super::integers::Quantiser;
use super::lists::{Correlations, Lists, correlate};
use super::options::{Encoded, Options, cost};
use super::ranges::{Ranged, Ranges};
use crate::data::dataset::Dataset;
use crate::data::transfer::Forward;
use crate::data::transfer::{Domain, transfer_of};
use crate::encode::goal::Target;
use crate::error::{Result, ToolError};
use crate::format::model::{MaterialModel, PairTableModel, TransferModel};
use crate::format::texture::Texture;
use crate::format::write::write_material;
use crate::math::ksvd::{Pursuit, Rows};
use crate::math::pca::Pca;
use crate::methods::means::{described, mean_tables};
use crate::methods::sparse_tensor::model::{ListsModel, TensorModel};
use std::f64::consts::LN_2;

/// Widths of a value that are tried.
const VALUE_BITS: std::ops::RangeInclusive<u32> = 5..=9;
/// Halvings of the interval of logarithms of the least gain.
const HALVINGS: usize = 14;
/// Ends of that interval, over the mean energy of a texel.
const GAINS: (f64, f64) = (1e-9, 10.0);

/// Everything about a dataset and its components that does not depend on the decomposition.
pub(super) struct Coder<'a> {
    data: &'a Dataset,
    /// Finest first.
    levels: Vec<&'a Dataset>,
    domain: Domain,
    transfer: TransferModel,
    forward: Forward,
    /// Means as the file holds them.
    tables: [PairTableModel; 3],
    /// Means that the decoder will add, in floats.
    means: [Vec<f32>; 3],
    /// Units of a channel in those of errors.
    unit: f64,
    /// Number of values of level 0.
    values: f64,
}

/// A file of one least gain.
struct Attempt {
    model: MaterialModel,
    bytes: Vec<u8>,
    lists: Lists,
}

impl<'a> Coder<'a> {
    pub(super) fn new(pca: &Pca<'a>, coarser: &[&'a Dataset]) -> Result<Coder<'a>> {
        let data = pca.dataset;
        let transfer = transfer_of(data, pca.domain);
        let forward = Forward::new(transfer);
        let pairs = data.description().pairs();
        // The mean in the channels: colours mix linearly, and so does what is subtracted.
        let mut means: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; pairs]);
        for (pair, rgb) in pca.mean.as_chunks::<3>().0.iter().enumerate() {
            let mixed = forward.mix(into_units(*rgb, pca.domain));
            (0..3).for_each(|c| means[c][pair] = mixed[c] as f64);
        }
        let (tables, means) = mean_tables(&means)?;
        let unit = match transfer {
            TransferModel::Log2 { .. } => LN_2,
            TransferModel::Linear { exponent } => 2f64.powi(exponent),
        };
        let values = (data.description().texels() * pairs * 3) as f64;
        let levels = std::iter::once(data).chain(coarser.iter().copied()).collect();
        Ok(Coder { data, levels, domain: pca.domain, transfer, forward, tables, means, unit, values })
    }

    /// Light atoms in the channels.
    fn mixed(&self, light: &Rows) -> Rows {
        let mut light = light.clone();
        for rgb in light.values.as_chunks_mut::<3>().0 {
            *rgb = self.forward.mix(into_units(*rgb, self.domain));
        }
        light
    }

    /// Every level against atoms.
    fn correlate(&self, atoms: &Rows) -> Result<Vec<Correlations>> {
        self.levels.iter().map(|level| correlate(level, &self.forward, &self.means, atoms)).collect()
    }

    /// The best file for the target, over the widths of a value. `None` if no width meets it.
    pub(super) fn encode(&self, fitted: &Fit, options: &Options) -> Result<Option<Encoded>> {
        let light = self.mixed(&fitted.light);
        let mut ranges = Ranges::without_parallels(&light, fitted);
        let bits: Vec<u32> = options.value_bits.map_or(VALUE_BITS.collect(), |bits| vec![bits]);
        let mut best: Option<(f64, Encoded)> = None;
        let mut ranged = None;
        for value_bits in bits {
            if ranged.is_none() {
                ranged =
                    ranges.fitted(value_bits, options.shape.coefficients, |atoms| self.correlate(atoms))?;
            }
            let Some(ranged) = &ranged else { continue };
            let Some(Attempt { model, bytes, lists }) = self.search(ranged, value_bits, options) else {
                continue;
            };
            let predicted_rms = (lists.error / self.values).sqrt() * self.unit;
            let cost = cost(options.target, predicted_rms, bytes.len() as f64);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                let encoded = Encoded {
                    model,
                    bytes,
                    coefficients: lists.count,
                    predicted_rms,
                    clipped: lists.clipped,
                    trained: fitted.trained,
                };
                best = Some((cost, encoded));
            }
        }
        Ok(best.map(|(_, encoded)| encoded))
    }

    /// The largest least gain for an error, the smallest for a size: bisection over its logarithm.
    fn search(&self, ranged: &Ranged, value_bits: u32, options: &Options) -> Option<Attempt> {
        let quantiser = Quantiser::new(&ranged.atoms, value_bits);
        let attempt = |least_gain: f64| {
            self.attempt(
                ranged,
                &quantiser,
                value_bits,
                Pursuit { most: options.shape.coefficients, least_gain },
            )
        };
        let meets = |attempt: &Attempt| match options.target {
            Target::Bytes(bytes) => attempt.bytes.len() as u64 <= bytes,
            Target::Rms(rms) => attempt.lists.error <= (rms / self.unit).powi(2) * self.values,
            Target::AsGiven => true,
        };
        let is_error = matches!(options.target, Target::Rms(_));
        let whole = attempt(0.0);
        match (options.target, meets(&whole)) {
            (Target::AsGiven, _) | (Target::Bytes(_), true) => return Some(whole),
            (Target::Rms(_), false) => return None,
            _ => {}
        }
        let energy = ranged.levels[0].energy.iter().sum::<f64>() / self.data.description().texels() as f64;
        let end = |part: f64| (energy * part + f64::MIN_POSITIVE).ln();
        let (mut low, mut high) = (end(GAINS.0), end(GAINS.1));
        let mut met = None;
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            let tried = attempt(middle.exp());
            let is_met = meets(&tried);
            // For a size a higher gain meets it, for an error a lower one does.
            if is_error == is_met {
                low = middle
            } else {
                high = middle
            }
            if is_met {
                met = Some(tried);
            }
        }
        met.or(is_error.then_some(whole))
    }

    /// The file of a least gain.
    fn attempt(&self, ranged: &Ranged, quantiser: &Quantiser, value_bits: u32, pursuit: Pursuit) -> Attempt {
        let mut lists: Vec<Lists> =
            ranged.levels.iter().map(|level| level.lists(&ranged.gram, quantiser, pursuit)).collect();
        let per_level: Vec<Vec<Vec<(u32, u16)>>> =
            lists.iter_mut().map(|lists| std::mem::take(&mut lists.model)).collect();
        let (shifts, shift) = quantiser.shifts(&per_level);
        let tensor: Box<dyn Texture> = Box::new(TensorModel {
            channels: [true; 3],
            light_atoms: ranged.atoms.light_atoms(),
            lights: ranged.atoms.lights(),
            entries: ranged.atoms.entries(),
            atoms: shifts,
            fibres: ranged.atoms.fibres(),
            lists: per_level.into_iter().map(|lists| vec![ListsModel { value_bits, shift, lists }]).collect(),
        });
        let mut model = described(self.data.description(), self.transfer).with_texture(tensor);
        model.level_count = self.levels.len() as u32;
        for (channel, table) in model.channels.iter_mut().zip(&self.tables) {
            channel.mean = Some(table.clone());
        }
        let bytes = write_material(&model);
        Attempt { model, bytes, lists: lists.swap_remove(0) }
    }
}

/// Encodes the components of a dataset, and its coarser levels of detail.
///
/// # Errors
/// If the data cannot be read or are beyond the format; [`ToolError::Unreachable`] if the target is out of
/// reach of the shape.
pub fn encode(
    pca: &Pca<'_>,
    coarser: &[&Dataset],
    options: &Options,
    report: impl FnMut(&str, usize, usize),
) -> Result<Encoded> {
    let fitted = fit(pca, options.shape, options.training, report);
    encode_fit(pca, &fitted, coarser, options)
}

/// Encodes a decomposition that is there.
///
/// # Errors
/// As [`encode`].
pub fn encode_fit(pca: &Pca<'_>, fitted: &Fit, coarser: &[&Dataset], options: &Options) -> Result<Encoded> {
    let goal = match options.target {
        Target::Bytes(bytes) => format!("a size of {bytes} bytes"),
        Target::Rms(rms) => format!("an RMS error of {rms}"),
        Target::AsGiven => "a file".to_owned(),
    };
    Coder::new(pca, coarser)?.encode(fitted, options)?.ok_or_else(|| ToolError::Unreachable {
        goal,
        least: "these sizes of dictionaries and lists are too small for an error, or too large for a size"
            .into(),
    })
}

/// Values of the components' domain in the units that channels are mixed of.
fn into_units(rgb: [f32; 3], domain: Domain) -> [f32; 3] {
    if domain == Domain::Log { rgb.map(|v| (v as f64 / LN_2) as f32) } else { rgb }
}
