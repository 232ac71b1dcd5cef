//! Blends of two materials in the space of their coefficients (SparseBTF 2023, section 3.5).
//!
//! The values of a channel become `(1 - alpha) a + alpha b`: for log files radiance moves geometrically.
//! Means blend entry by entry. Records blend block by block, level by level and layer by layer:
//!
//! - on equal dictionaries coefficients add (equation 7);
//! - on different ones the record with less energy is projected into the span of the other's dictionary
//!   (equations 8 and 9), and the largest coefficients stay; [`Report`] says what was lost;
//! - with [`Blend::exact`] both records stay as they are, side by side in layers of their own: the sample
//!   costs the sum of both, and nothing is lost but the rounding of quantisers.
//!
//! With an alpha of 0 or 1 the result is one of the two models as it is.

use crate::error::{Result, ToolError};
use crate::format::model::{
    AtomModel, ChannelModel, CoefficientsModel, DictionaryModel, EnsembleModel, MaterialModel, MetadataModel,
    PairTableModel, RecordModel, TransferModel,
};
use crate::format::trim::drop_unused;
use crate::methods::sparse_ensemble::basis::{Basis, Change, Sparse};
use crate::methods::sparse_ensemble::quantise::{FloatRecord, quantise, quantise_means, quantise_scales};
use rayon::prelude::*;
use selvedge::ensemble::dequantise;
use selvedge::ensemble_set::{DICTIONARY_LIMIT, SUM_LIMIT};
use std::collections::BTreeMap;

/// Most layers of a file (3.1-13).
const LAYER_LIMIT: u32 = 8;
/// Most coefficients of a record, by the width of its count (10.3-3).
const COUNT_LIMIT: usize = 32_767;

/// How to blend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Blend {
    /// No change of basis: the layers of both, one of `a` and one of `b` in turn.
    pub exact: bool,
    /// Most coefficients of a record after a change of basis or a sum; as many as both have if `None`.
    pub most: Option<u32>,
    /// Bits of a value; the larger number of both if `None`. Exact blends keep the bits that there are.
    pub value_bits: Option<u32>,
    /// Blend textures and scales apart where scales differ. This is how normalised materials are blended in
    /// the paper; values then move smoothly from one to the other, but not linearly.
    pub scales_apart: bool,
}

/// What a change of basis cost, over all blocks, layers and levels.
///
/// Energies are sums of squares of textures before scales, over all texels of blocks and all pairs of
/// sample directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Records that are a sum on one dictionary, or of one material alone.
    pub summed: u64,
    /// Records that took a change of basis.
    pub changed: u64,
    /// Energy of the blended textures as they should be; of an exact blend it is not formed.
    pub energy: f64,
    /// Energy outside of the span of the dictionaries that were kept.
    pub outside: f64,
    /// Energy of the whole difference: outside of the span, or beyond the number of coefficients.
    pub lost: f64,
}

/// `(1 - alpha) a + alpha b`.
///
/// # Errors
/// [`ToolError::Usage`] if alpha is not 0 to 1, or if the two do not agree in image size, block edge, levels,
/// directions, channel states, transfer and its offset or exponent, cosine flag and colour matrix; in scales,
/// unless they are to be blended apart; or if the result is beyond the format.
pub fn blend(
    a: &MaterialModel,
    b: &MaterialModel,
    alpha: f64,
    options: Blend,
) -> Result<(MaterialModel, Report)> {
    if !(0.0..=1.0).contains(&alpha) {
        return Err(ToolError::Usage(format!("alpha is 0 to 1, not {alpha}")));
    }
    agree(a, b, options)?;
    if alpha == 0.0 || alpha == 1.0 {
        return Ok((if alpha == 0.0 { a } else { b }.clone(), Report::default()));
    }
    let full = a.channels.iter().any(|channel| channel.ensemble.is_some());
    let layer_count =
        if options.exact && full { a.layer_count + b.layer_count } else { a.layer_count.max(b.layer_count) };
    if layer_count > LAYER_LIMIT {
        let (of_a, of_b) = (a.layer_count, b.layer_count);
        return Err(ToolError::Usage(format!(
            "an exact blend has the layers of both, {of_a} and {of_b}; a file has room for {LAYER_LIMIT}: trim them first"
        )));
    }
    let mut report = Report::default();
    let mut channels: [ChannelModel; 3] = Default::default();
    for (channel, (of_a, of_b)) in channels.iter_mut().zip(a.channels.iter().zip(&b.channels)) {
        if let (Some(of_a), Some(of_b)) = (&of_a.mean, &of_b.mean) {
            channel.mean = Some(blend_tables(of_a, of_b, alpha, quantise_means)?);
        }
        if let (Some(of_a), Some(of_b)) = (&of_a.scale, &of_b.scale) {
            // Q15 in units of 2^shift.
            channel.scale = Some(blend_tables(of_a, of_b, alpha, |q15| {
                quantise_scales(&q15.iter().map(|q| q / 32_768.0).collect::<Vec<_>>())
            })?);
        }
        if let (Some(of_a), Some(of_b)) = (&of_a.ensemble, &of_b.ensemble) {
            let ensemble = if options.exact {
                side_by_side(of_a, of_b, alpha)?
            } else {
                blend_ensembles(of_a, of_b, alpha, options, &mut report)?
            };
            channel.ensemble = Some(ensemble);
        }
    }
    let model = MaterialModel {
        layer_count,
        channels,
        metadata: blend_metadata(&a.metadata, &b.metadata),
        extras: a.extras.iter().filter(|extra| b.extras.contains(extra)).cloned().collect(),
        ..a.clone()
    };
    Ok((model, report))
}

/// Refuses two materials that have no common space.
fn agree(a: &MaterialModel, b: &MaterialModel, options: Blend) -> Result<()> {
    let kind = |model: &MaterialModel| matches!(model.transfer, TransferModel::Linear { .. });
    let states = |model: &MaterialModel| [0, 1, 2].map(|c| model.state(c));
    let scales = |model: &MaterialModel| model.channels.each_ref().map(|channel| channel.scale.is_some());
    let same_scales = a.channels.iter().zip(&b.channels).all(|(a, b)| a.scale == b.scale);
    let rules = [
        (a.tensor.is_none() && b.tensor.is_none(), "methods: both must be sparse ensembles"),
        (a.size == b.size, "image sizes: both must have the same width and height"),
        (a.edge == b.edge, "block edges: encode both with the same"),
        (a.level_count == b.level_count, "numbers of levels: trim the one that has more"),
        (a.lights == b.lights, "light directions: both must have the same, in the same order"),
        (a.views() == b.views(), "view directions: both must have the same, in the same order"),
        (states(a) == states(b), "channel states: trim a texture or a channel that only one has"),
        (kind(a) == kind(b), "transfers: both must be log2 or linear"),
        (a.transfer == b.transfer, "log offsets or exponents: encode both with the same"),
        (
            a.cosine_included == b.cosine_included,
            "cosine flags: both must have the light's cosine in, or both not",
        ),
        (a.matrix_q13 == b.matrix_q13, "colour matrices: encode both with the same channels"),
        (scales(a) == scales(b), "scales: only one of them has a table; encode both with or without"),
        (
            same_scales || options.scales_apart,
            "scales: values do not blend linearly; blend textures and scales apart, or encode both without scales",
        ),
    ];
    match rules.iter().find(|(holds, _)| !holds) {
        Some((_, what)) => Err(ToolError::Usage(format!("the two materials differ in their {what}"))),
        None => Ok(()),
    }
}

fn blend_tables(
    a: &PairTableModel,
    b: &PairTableModel,
    alpha: f64,
    quantise: impl Fn(&[f64]) -> Result<PairTableModel>,
) -> Result<PairTableModel> {
    if a == b {
        return Ok(a.clone());
    }
    let value = |table: &PairTableModel, entry: i16| {
        entry as f64 * 2f64.powi(table.shift as i32) + table.base_q20 as f64
    };
    let blended: Vec<f64> = a
        .entries
        .iter()
        .zip(&b.entries)
        .map(|(&p, &q)| (1.0 - alpha) * value(a, p) + alpha * value(b, q))
        .collect();
    quantise(&blended)
}

/// Texts of both where they differ; numbers where they agree.
fn blend_metadata(a: &MetadataModel, b: &MetadataModel) -> MetadataModel {
    let either = |a: u32, b: u32| if a == b { a } else { 0 };
    MetadataModel {
        texel_nm: std::array::from_fn(|i| either(a.texel_nm[i], b.texel_nm[i])),
        frame: either(a.frame, b.frame),
        image_origin: either(a.image_origin, b.image_origin),
        primaries: either(a.primaries, b.primaries),
        texts: std::array::from_fn(|i| {
            if a.texts[i] == b.texts[i] {
                a.texts[i].clone()
            } else {
                format!("{}; {}", a.texts[i], b.texts[i])
            }
        }),
    }
}

/// What a record stands for, times a weight: a coefficient is worth `2^-(shift + 5)` of the channel's unit.
fn float_record(ensemble: &EnsembleModel, record: &RecordModel, value_bits: u32, weight: f64) -> FloatRecord {
    let atoms = &ensemble.atoms[record.dictionary as usize];
    let value = |atom: &AtomModel, value: u16| {
        let coefficient = dequantise(atom.quantiser(), value as u32, value_bits);
        coefficient as f64 * weight * 2f64.powi(-((record.shift + 5 + atom.shift) as i32))
    };
    let list = record
        .coefficients
        .iter()
        .map(|&(position, v)| (atoms[position as usize], value(&atoms[position as usize], v)));
    (record.dictionary as usize, list.collect())
}

/// Float records of a layer, or empty ones for a layer that is not there.
fn float_layer(
    ensemble: &EnsembleModel,
    level: usize,
    layer: usize,
    weight: f64,
    blocks: usize,
) -> Vec<FloatRecord> {
    match ensemble.coefficients[level].get(layer) {
        Some(c) => {
            c.records.iter().map(|record| float_record(ensemble, record, c.value_bits, weight)).collect()
        }
        None => vec![(0, Vec::new()); blocks],
    }
}

/// Two records of a block, on dictionaries of the blend, and which of them gives the dictionary.
struct Pair {
    target: FloatRecord,
    other: FloatRecord,
}

/// Equations 7 to 9 for one channel.
fn blend_ensembles(
    a: &EnsembleModel,
    b: &EnsembleModel,
    alpha: f64,
    options: Blend,
    report: &mut Report,
) -> Result<EnsembleModel> {
    // Dictionaries of both, those of b that a has as well but once.
    let mut dictionaries: Vec<&DictionaryModel> = a.dictionaries.iter().collect();
    let number_of_b: Vec<usize> = b
        .dictionaries
        .iter()
        .map(|dictionary| {
            a.dictionaries.iter().position(|of_a| of_a == dictionary).unwrap_or_else(|| {
                dictionaries.push(dictionary);
                dictionaries.len() - 1
            })
        })
        .collect();
    let bases: Vec<Basis> = dictionaries.par_iter().map(|dictionary| Basis::new(dictionary)).collect();
    let pairs: Vec<Vec<Vec<Pair>>> = (0..a.coefficients.len())
        .map(|level| {
            let blocks = a.coefficients[level]
                .iter()
                .chain(&b.coefficients[level])
                .map(|layer| layer.records.len())
                .max()
                .unwrap_or(0);
            let layers = a.coefficients[level].len().max(b.coefficients[level].len());
            let of_layer = |layer: usize| {
                let of_a = float_layer(a, level, layer, 1.0 - alpha, blocks);
                let of_b = float_layer(b, level, layer, alpha, blocks);
                of_a.into_par_iter()
                    .zip(of_b)
                    .map(|(of_a, of_b)| pair_of(&bases, of_a, (number_of_b[of_b.0], of_b.1)))
                    .collect()
            };
            (0..layers).map(of_layer).collect()
        })
        .collect();
    let mut changes: Vec<(usize, usize)> = pairs
        .iter()
        .flatten()
        .flatten()
        .filter(|pair| needs_change(pair))
        .map(|pair| (pair.target.0, pair.other.0))
        .collect();
    changes.sort_unstable();
    changes.dedup();
    let changes: BTreeMap<(usize, usize), Change> = changes
        .into_par_iter()
        .map(|(target, other)| ((target, other), Change::new(&bases[target], &bases[other])))
        .collect();
    let mut records = Vec::with_capacity(pairs.len());
    for level in pairs {
        let mut of_level = Vec::with_capacity(level.len());
        for layer in level {
            let blended: Vec<(FloatRecord, Report)> =
                layer.into_par_iter().map(|pair| blend_pair(&bases, &changes, pair, options)).collect();
            for (_, part) in &blended {
                report.summed += part.summed;
                report.changed += part.changed;
                report.energy += part.energy;
                report.outside += part.outside;
                report.lost += part.lost;
            }
            of_level.push(blended.into_iter().map(|(record, _)| record).collect::<Vec<_>>());
        }
        records.push(of_level);
    }
    let bits = |level: usize, layer: usize| {
        let there =
            [a, b].map(|ensemble| ensemble.coefficients[level].get(layer).map_or(0, |c| c.value_bits));
        options.value_bits.unwrap_or(there[0].max(there[1]))
    };
    let bits: Vec<Vec<u32>> = records
        .iter()
        .enumerate()
        .map(|(level, layers)| (0..layers.len()).map(|layer| bits(level, layer)).collect())
        .collect();
    let (atoms, coefficients) = quantise(&records, dictionaries.len(), &bits)?;
    let dictionaries = dictionaries.into_iter().cloned().collect();
    within_limit(EnsembleModel { dictionaries, atoms, coefficients })
}

/// Drops what nothing uses and refuses more dictionaries than a file has room for.
fn within_limit(mut ensemble: EnsembleModel) -> Result<EnsembleModel> {
    drop_unused(&mut ensemble);
    if ensemble.dictionaries.len() > DICTIONARY_LIMIT as usize {
        return Err(ToolError::Usage(format!(
            "the blend would have {} dictionaries; a file has room for {DICTIONARY_LIMIT}",
            ensemble.dictionaries.len()
        )));
    }
    Ok(ensemble)
}

/// The record with more energy gives the dictionary, that of the first material where they are equal.
fn pair_of(bases: &[Basis], a: FloatRecord, b: FloatRecord) -> Pair {
    let alike = a.0 == b.0 || b.1.is_empty();
    if !a.1.is_empty() && (alike || bases[a.0].energy(&a.1) >= bases[b.0].energy(&b.1)) {
        Pair { target: a, other: b }
    } else {
        Pair { target: b, other: a }
    }
}

fn needs_change(pair: &Pair) -> bool {
    pair.target.0 != pair.other.0 && !pair.other.1.is_empty()
}

fn blend_pair(
    bases: &[Basis],
    changes: &BTreeMap<(usize, usize), Change>,
    pair: Pair,
    options: Blend,
) -> (FloatRecord, Report) {
    let Pair { target: (k, own), other: (p, other) } = pair;
    let basis = &bases[k];
    let most = options.most.map_or(own.len() + other.len(), |most| most as usize).min(COUNT_LIMIT);
    if p == k || other.is_empty() {
        let whole = basis.sum(&own, &other, usize::MAX);
        let kept = basis.sum(&whole, &Sparse::new(), most);
        let lost = if kept.len() < whole.len() { basis.energy(&difference(&whole, &kept)) } else { 0.0 };
        let report = Report { summed: 1, energy: basis.energy(&whole), lost, ..Report::default() };
        return ((k, kept), report);
    }
    let change = &changes[&(k, p)];
    let sum = change.sum(basis, &own, &other, most);
    let other_energy = bases[p].energy(&other);
    // |own + other - sum|^2 with own and sum on one dictionary.
    let rest = difference(&own, &sum);
    let lost = (basis.energy(&rest) + 2.0 * change.product(&rest, &other) + other_energy).max(0.0);
    let energy = (basis.energy(&own) + 2.0 * change.product(&own, &other) + other_energy).max(0.0);
    let outside = (other_energy - change.energy_inside(&other)).max(0.0);
    ((k, sum), Report { changed: 1, energy, outside, lost, ..Report::default() })
}

/// One record less another of the same dictionary.
fn difference(a: &Sparse, b: &Sparse) -> Sparse {
    a.iter().copied().chain(b.iter().map(|&(atom, value)| (atom, -value))).collect()
}

/// Both ensembles with their weights, and their layers in turn.
fn side_by_side(a: &EnsembleModel, b: &EnsembleModel, alpha: f64) -> Result<EnsembleModel> {
    let (mut a, mut b) = (a.clone(), b.clone());
    for (ensemble, weight) in [(&mut a, 1.0 - alpha), (&mut b, alpha)] {
        drop_unused(ensemble);
        *ensemble = weigh(ensemble, weight)?;
    }
    let first_of_b = a.dictionaries.len() as u32;
    for record in b
        .coefficients
        .iter_mut()
        .flatten()
        .flat_map(|layer| &mut layer.records)
        .filter(|record| !record.coefficients.is_empty())
    {
        record.dictionary += first_of_b;
    }
    let in_turn = |(a, b): (Vec<CoefficientsModel>, Vec<CoefficientsModel>)| {
        let (mut a, mut b) = (a.into_iter(), b.into_iter());
        let mut layers = Vec::new();
        while a.len() + b.len() > 0 {
            layers.extend(a.next());
            layers.extend(b.next());
        }
        layers
    };
    within_limit(EnsembleModel {
        dictionaries: a.dictionaries.into_iter().chain(b.dictionaries).collect(),
        atoms: a.atoms.into_iter().chain(b.atoms).collect(),
        coefficients: a.coefficients.into_iter().zip(b.coefficients).map(in_turn).collect(),
    })
}

/// A weight of at most one times an ensemble: powers of two in the shifts of records, the rest in the
/// quantisers.
fn weigh(ensemble: &EnsembleModel, weight: f64) -> Result<EnsembleModel> {
    let records = || {
        ensemble
            .coefficients
            .iter()
            .flatten()
            .flat_map(|layer| &layer.records)
            .filter(|record| !record.coefficients.is_empty())
    };
    let room = 31 - records().map(|record| record.shift).max().unwrap_or(31);
    let halvings = (-weight.log2()).floor().clamp(0.0, room as f64) as u32;
    for halvings in (0..=halvings).rev() {
        let mut weighted = ensemble.clone();
        weighted
            .atoms
            .iter_mut()
            .flatten()
            .for_each(|atom| *atom = weighted_atom(*atom, weight * 2f64.powi(halvings as i32)));
        for record in weighted
            .coefficients
            .iter_mut()
            .flatten()
            .flat_map(|layer| &mut layer.records)
            .filter(|record| !record.coefficients.is_empty())
        {
            record.shift += halvings;
        }
        if sums_fit(&weighted) {
            return Ok(weighted);
        }
    }
    // Rounding takes a record that is full to the brim over it: values are quantised anew.
    let of_layer = |layer: &CoefficientsModel| {
        layer.records.iter().map(|record| float_record(ensemble, record, layer.value_bits, weight)).collect()
    };
    let records: Vec<Vec<Vec<FloatRecord>>> =
        ensemble.coefficients.iter().map(|level| level.iter().map(of_layer).collect()).collect();
    let bits: Vec<Vec<u32>> = ensemble
        .coefficients
        .iter()
        .map(|level| level.iter().map(|layer| layer.value_bits).collect())
        .collect();
    let (atoms, coefficients) = quantise(&records, ensemble.dictionaries.len(), &bits)?;
    Ok(EnsembleModel { dictionaries: ensemble.dictionaries.clone(), atoms, coefficients })
}

/// The atom whose coefficients are a weight of at most one times the atom's, as fine as they fit.
fn weighted_atom(atom: AtomModel, weight: f64) -> AtomModel {
    let (base, end) = (atom.base as f64 * weight, (atom.base as f64 + atom.step as f64) * weight);
    let fits = |shift: u32| base.abs().max(end.abs()) * 2f64.powi((shift - atom.shift) as i32) < 32_766.0;
    let shift = (atom.shift..=15).rev().find(|&shift| fits(shift)).unwrap_or(atom.shift);
    let gain = 2f64.powi((shift - atom.shift) as i32);
    let new_base = (base * gain).round() as i16;
    let room = (32_767 - new_base as i32).min(65_535) as f64;
    AtomModel {
        shift,
        base: new_base,
        step: (atom.step as f64 * weight * gain).round().min(room) as u16,
        ..atom
    }
}

/// Rule 10.7-7.
fn sums_fit(ensemble: &EnsembleModel) -> bool {
    let part = |atom: AtomModel, value: u16, bits: u32| {
        dequantise(atom.quantiser(), value as u32, bits).unsigned_abs().div_ceil(1 << atom.shift)
    };
    ensemble.coefficients.iter().flatten().all(|layer| {
        layer.records.iter().all(|record| {
            let atoms = &ensemble.atoms[record.dictionary as usize];
            let parts = record
                .coefficients
                .iter()
                .map(|&(position, value)| part(atoms[position as usize], value, layer.value_bits));
            parts.sum::<u32>() <= SUM_LIMIT
        })
    })
}
