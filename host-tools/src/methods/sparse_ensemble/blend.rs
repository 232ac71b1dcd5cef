//! Blends of sparse ensembles in the space of their coefficients (SparseBTF 2023, section 3.5).
//!
//! Records blend block by block, level by level and layer by layer:
//!
//! - on equal dictionaries coefficients add (equation 7);
//! - on different ones the record with less energy is projected into the span of the other's dictionary
//!   (equations 8 and 9), and the largest coefficients stay; [`BlendReport`] says what was lost;
//! - with [`Blend::exact`] both records stay as they are, side by side in layers of their own: the sample
//!   costs the sum of both, and nothing is lost but the rounding of quantisers.

use crate::error::{Result, ToolError};
use crate::format::texture::{Blend, BlendReport};
use crate::methods::sparse_ensemble::basis::{Basis, Change, Sparse};
use crate::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, RecordModel,
};
use crate::methods::sparse_ensemble::quantise::{FloatRecord, quantise};
use crate::methods::sparse_ensemble::trim::drop_unused;
use rayon::prelude::*;
use selvedge::method::sparse_ensemble::check::{DICTIONARY_LIMIT, SUM_LIMIT};
use selvedge::method::sparse_ensemble::dequantise;
use std::collections::BTreeMap;

/// Most coefficients of a record, by the width of its count (10.3-3).
const COUNT_LIMIT: usize = 32_767;

/// Largest magnitude of a weighted range, with room for the rounding of its base.
const LARGEST: f64 = 32_766.0;

/// `(1 - alpha) a + alpha b` of the channels that both have.
///
/// # Errors
/// [`ToolError::Usage`] if the result is beyond the format.
pub fn blend(
    a: &EnsembleTexture,
    b: &EnsembleTexture,
    alpha: f64,
    options: Blend,
) -> Result<(EnsembleTexture, BlendReport)> {
    let mut report = BlendReport::default();
    let mut texture = EnsembleTexture::default();
    for (channel, pair) in texture.channels.iter_mut().zip(a.channels.iter().zip(&b.channels)) {
        if let (Some(of_a), Some(of_b)) = pair {
            *channel = Some(if options.exact {
                side_by_side(of_a, of_b, alpha)?
            } else {
                blend_ensembles(of_a, of_b, alpha, options, &mut report)?
            });
        }
    }
    Ok((texture, report))
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
    report: &mut BlendReport,
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
    let pairs_of_level = |level: usize| -> Vec<Vec<Pair>> {
        let (of_a, of_b) = (&a.coefficients[level], &b.coefficients[level]);
        let blocks = of_a.iter().chain(of_b).map(|layer| layer.records.len()).max().unwrap_or(0);
        let of_layer = |layer: usize| {
            let of_a = float_layer(a, level, layer, 1.0 - alpha, blocks);
            let of_b = float_layer(b, level, layer, alpha, blocks);
            of_a.into_par_iter()
                .zip(of_b)
                .map(|(of_a, of_b)| pair_of(&bases, of_a, (number_of_b[of_b.0], of_b.1)))
                .collect()
        };
        (0..of_a.len().max(of_b.len())).map(of_layer).collect()
    };
    let pairs: Vec<Vec<Vec<Pair>>> = (0..a.coefficients.len()).map(pairs_of_level).collect();
    let changes = changes_of(&bases, pairs.iter().flatten().flatten());
    let mut records = Vec::with_capacity(pairs.len());
    for level in pairs {
        let mut of_level = Vec::with_capacity(level.len());
        for layer in level {
            let blended: Vec<(FloatRecord, BlendReport)> =
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

/// The changes of basis that pairs take.
fn changes_of<'a>(
    bases: &[Basis],
    pairs: impl Iterator<Item = &'a Pair>,
) -> BTreeMap<(usize, usize), Change> {
    let mut changes: Vec<(usize, usize)> =
        pairs.filter(|pair| needs_change(pair)).map(|pair| (pair.target.0, pair.other.0)).collect();
    changes.sort_unstable();
    changes.dedup();
    let change = |(target, other): (usize, usize)| Change::new(&bases[target], &bases[other]);
    changes.into_par_iter().map(|key| (key, change(key))).collect()
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
) -> (FloatRecord, BlendReport) {
    let Pair { target: (k, own), other: (p, other) } = pair;
    let basis = &bases[k];
    let most = options.most.map_or(own.len() + other.len(), |most| most as usize).min(COUNT_LIMIT);
    if p == k || other.is_empty() {
        let whole = basis.sum(&own, &other, usize::MAX);
        let kept = basis.sum(&whole, &Sparse::new(), most);
        let lost = if kept.len() < whole.len() { basis.energy(&difference(&whole, &kept)) } else { 0.0 };
        let report = BlendReport { summed: 1, energy: basis.energy(&whole), lost, ..BlendReport::default() };
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
    ((k, sum), BlendReport { changed: 1, energy, outside, lost, ..BlendReport::default() })
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
    // Rounding takes a record that is full to the brim over it: values are quantised again.
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
    let fits = |shift: u32| base.abs().max(end.abs()) * 2f64.powi((shift - atom.shift) as i32) < LARGEST;
    let shift = (atom.shift..=15).rev().find(|&shift| fits(shift)).unwrap_or(atom.shift);
    let gain = 2f64.powi((shift - atom.shift) as i32);
    let new_base = (base * gain).round() as i16;
    let room = (i16::MAX as i32 - new_base as i32).min(u16::MAX as i32) as f64;
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
