//! Coefficients become integers: one table of atoms for all levels and layers, and their records (10.4,
//! 10.5).
//!
//! An atom has one range of integers for all records that use it, and each record a shift that says what
//! one integer is worth. Within a level and layer all records have the same shift. The shifts are either
//! one for all, or as fine as each level and layer allows; of the two the one is taken that is expected
//! to lose less, since a fine shift for a quiet layer widens the range that a loud one has to share.

use crate::error::{Result, ToolError};
use crate::format::units::LARGEST_ENTRY;
use crate::methods::sparse_ensemble::layout::{VIEW_BIT, atom_columns};
use crate::methods::sparse_ensemble::model::{AtomModel, CoefficientsModel, RecordModel};
use selvedge::method::sparse_ensemble::check::{ATOM_LIMIT, SUM_LIMIT};
use selvedge::method::sparse_ensemble::dequantise;

/// A record before quantisation: its dictionary, and atoms (columns only) with coefficients.
///
/// A coefficient is in units of the channel (Q20 over 2^20) for columns whose entries are in Q15. An atom
/// occurs once; the order is free.
pub type FloatRecord = (usize, Vec<(AtomModel, f64)>);

/// Atoms of each dictionary, and `coefficients[level][layer]`.
pub type Quantised = (Vec<Vec<AtomModel>>, Vec<Vec<CoefficientsModel>>);

/// Finest and coarsest shift of a record that are used (10.4-3).
const SHIFTS: std::ops::RangeInclusive<u32> = 0..=26;
/// Largest magnitude of a coefficient, with room for the rounding of base and step (10.5-7).
const LARGEST: f64 = 32_000.0;

/// Bits of one level and layer.
struct Group<'a> {
    records: &'a [FloatRecord],
    /// Flat number of the atom of each coefficient, record by record.
    atoms: Vec<u32>,
    value_bits: u32,
    /// The finest shift that its sums and coefficients allow.
    finest: u32,
}

/// Units of a coefficient for one unit of the channel: the product of columns is Q15 and the result Q20.
fn unit(shift: u32) -> f64 {
    2f64.powi(shift as i32 + 5)
}

/// Quantises `records[level][layer][block]` to `value_bits[level][layer]` bits a value.
///
/// Every atom that a record names is in the table, at the place that 10.5-6 gives it, and no other.
///
/// # Errors
/// [`ToolError::Usage`] if `value_bits` has another shape than `records` or a number that is not 1 to 16, if
/// a record names a dictionary that is not there or an atom twice, if a dictionary would have more than
/// 65,536 atoms, or if coefficients are too large for the format: 1,000 for one, or 2,046 for the sum of a
/// record's magnitudes.
pub fn quantise(
    records: &[Vec<Vec<FloatRecord>>],
    dictionaries: usize,
    value_bits: &[Vec<u32>],
) -> Result<Quantised> {
    if !records.iter().map(Vec::len).eq(value_bits.iter().map(Vec::len)) {
        return Err(ToolError::Usage("every level and layer has a number of bits of a value".into()));
    }
    let keys = atom_keys(records, dictionaries)?;
    // Atoms are numbered through all dictionaries; `starts` has the first of each.
    let starts: Vec<usize> = std::iter::once(0)
        .chain(keys.iter().scan(0, |sum, keys| {
            *sum += keys.len();
            Some(*sum)
        }))
        .collect();
    let mut groups = Vec::new();
    for (level, bits) in records.iter().zip(value_bits) {
        for (records, &value_bits) in level.iter().zip(bits) {
            if !(1..=16).contains(&value_bits) {
                return Err(ToolError::Usage(format!("values have 1 to 16 bits, not {value_bits}")));
            }
            groups.push(Group::new(records, &keys, &starts, value_bits)?);
        }
    }
    let total = starts[dictionaries];
    let common = groups.iter().map(|group| group.finest).min().unwrap_or(*SHIFTS.start());
    let alone: Vec<u32> = groups.iter().map(|group| group.finest).collect();
    let of_keys: Vec<u32> = keys.iter().flatten().copied().collect();
    let mut best: Option<(f64, Vec<AtomModel>, Vec<Vec<RecordModel>>)> = None;
    let same = alone.iter().all(|&shift| shift == common);
    for mut shifts in [vec![common; groups.len()], alone].into_iter().take(if same { 1 } else { 2 }) {
        let fitted = loop {
            match fit(&groups, &of_keys, total, &shifts)
                .and_then(|atoms| Ok((quantise_groups(&groups, &atoms, &starts, &shifts)?, atoms)))
            {
                Ok(fitted) => break Some(fitted),
                Err(group) if shifts[group] > *SHIFTS.start() => {
                    // With one shift for all they go down together.
                    let limit = shifts[group] - 1;
                    let all = shifts.iter().all(|&shift| shift == limit + 1);
                    shifts
                        .iter_mut()
                        .enumerate()
                        .filter(|(i, _)| all || *i == group)
                        .for_each(|(_, shift)| *shift = limit);
                }
                Err(_) => break None,
            }
        };
        if let Some((records, atoms)) = fitted {
            let loss = expected_loss(&groups, &atoms, &shifts);
            if best.as_ref().is_none_or(|best| loss < best.0) {
                best = Some((loss, atoms, records));
            }
        }
    }
    let Some((_, atoms, records_of)) = best else {
        return Err(ToolError::Usage("coefficients sum beyond the format".into()));
    };
    let atoms = starts.windows(2).map(|of_k| atoms[of_k[0]..of_k[1]].to_vec()).collect();
    let mut filled = records_of
        .into_iter()
        .zip(&groups)
        .map(|(records, group)| CoefficientsModel { value_bits: group.value_bits, records });
    Ok((atoms, records.iter().map(|level| filled.by_ref().take(level.len()).collect()).collect()))
}

/// The words without shift of all atoms that occur, ascending, for each dictionary.
fn atom_keys(records: &[Vec<Vec<FloatRecord>>], dictionaries: usize) -> Result<Vec<Vec<u32>>> {
    let mut keys: Vec<Vec<u32>> = vec![Vec::new(); dictionaries];
    for (number, list) in records.iter().flatten().flatten() {
        match keys.get_mut(*number) {
            Some(keys) => keys.extend(list.iter().map(|(atom, _)| atom.word() >> VIEW_BIT)),
            None if list.is_empty() => {}
            None => {
                return Err(ToolError::Usage(format!(
                    "a record names dictionary {number} of {dictionaries}"
                )));
            }
        }
    }
    for keys in &mut keys {
        keys.sort_unstable();
        keys.dedup();
        if keys.len() > ATOM_LIMIT as usize {
            return Err(ToolError::Usage(format!(
                "a dictionary would have {} atoms; the format has room for {ATOM_LIMIT}",
                keys.len()
            )));
        }
    }
    Ok(keys)
}

impl<'a> Group<'a> {
    fn new(
        records: &'a [FloatRecord],
        keys: &[Vec<u32>],
        starts: &[usize],
        value_bits: u32,
    ) -> Result<Group<'a>> {
        let mut atoms = Vec::with_capacity(records.iter().map(|record| record.1.len()).sum());
        let (mut largest, mut largest_sum) = (0.0f64, 0.0f64);
        for (number, list) in records {
            let first = atoms.len();
            let mut sum = 0.0;
            for (atom, value) in list {
                let place = keys[*number].partition_point(|&key| key < atom.word() >> VIEW_BIT);
                atoms.push((starts[*number] + place) as u32);
                largest = largest.max(value.abs());
                sum += value.abs();
            }
            if !atoms[first..].is_sorted_by(|a, b| a < b) {
                let mut sorted = atoms[first..].to_vec();
                sorted.sort_unstable();
                if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                    return Err(ToolError::Usage(format!(
                        "a record has the atom {} of dictionary {number} twice",
                        pair[0] as usize - starts[*number]
                    )));
                }
            }
            // A sum that is not a number would be lost in a maximum.
            largest_sum = if sum.is_nan() || sum > largest_sum { sum } else { largest_sum };
            if largest_sum.is_nan() {
                break;
            }
        }
        let fits = |shift: u32| largest_sum * unit(shift) < 65_000.0 && largest * unit(shift) < LARGEST;
        let finest = SHIFTS
            .rev()
            .find(|&shift| fits(shift))
            .or((largest_sum < 2047.0 && largest < 1000.0).then_some(*SHIFTS.start()));
        match finest {
            Some(finest) => Ok(Group { records, atoms, value_bits, finest }),
            None => Err(ToolError::Usage(format!(
                "coefficients of up to {largest} that sum to {largest_sum} are beyond the format"
            ))),
        }
    }

    /// Each coefficient's atom and value.
    fn coefficients(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.atoms
            .iter()
            .map(|&atom| atom as usize)
            .zip(self.records.iter().flat_map(|record| &record.1).map(|(_, value)| *value))
    }
}

/// The atom whose word without shift is `key`.
fn atom_of(key: u32) -> AtomModel {
    let [light, view, x, y] = atom_columns(key << VIEW_BIT);
    AtomModel { light, view, x, y, ..AtomModel::default() }
}

/// Atoms whose ranges hold all values at these shifts, or the group whose shift is too fine.
fn fit(
    groups: &[Group<'_>],
    keys: &[u32],
    total: usize,
    shifts: &[u32],
) -> std::result::Result<Vec<AtomModel>, usize> {
    let mut low = vec![f64::MAX; total];
    let mut high = vec![f64::MIN; total];
    // What the highest of `2^bits` values falls short of base plus step, so coarse values need a larger step.
    let mut widths: Vec<u32> = groups.iter().map(|group| group.value_bits).collect();
    widths.sort_unstable();
    widths.dedup();
    let mut highs = vec![vec![f64::MIN; total]; widths.len()];
    let mut widest = vec![0u32; total];
    for ((g, group), &shift) in groups.iter().enumerate().zip(shifts) {
        let unit = unit(shift);
        let of_width = &mut highs[widths.partition_point(|&width| width < group.value_bits)];
        for (atom, value) in group.coefficients() {
            let value = value * unit;
            if value.abs() > low[atom].abs().max(high[atom].abs()) || low[atom] == f64::MAX {
                widest[atom] = g as u32;
            }
            low[atom] = low[atom].min(value);
            high[atom] = high[atom].max(value);
            of_width[atom] = of_width[atom].max(value);
        }
    }
    let quantiser = |atom: usize, fine: u32| {
        let gain = 2f64.powi(fine as i32);
        let base = (low[atom] * gain).round();
        let step = widths.iter().zip(&highs).fold(0.0f64, |step, (&bits, highs)| {
            let levels = (1u32 << bits) as f64;
            step.max(((highs[atom] * gain - base).max(0.0) * levels / (levels - 1.0)).ceil())
        });
        (base, step)
    };
    (0..total)
        .map(|atom| {
            // The finest shift that leaves room for rounding base and step.
            let largest = low[atom].abs().max(high[atom].abs());
            let fits = |fine: u32| {
                let (base, step) = quantiser(atom, fine);
                largest * 2f64.powi(fine as i32) < LARGEST && step <= 65_535.0 && base + step <= LARGEST_ENTRY
            };
            let fine = (0..=15u32).rev().find(|&fine| fits(fine)).ok_or(widest[atom] as usize)?;
            let (base, step) = quantiser(atom, fine);
            Ok(AtomModel { shift: fine, base: base as i16, step: step as u16, ..atom_of(keys[atom]) })
        })
        .collect()
}

/// The records of every group, or the group that has one whose sum is too large (10.7-7).
fn quantise_groups(
    groups: &[Group<'_>],
    atoms: &[AtomModel],
    starts: &[usize],
    shifts: &[u32],
) -> std::result::Result<Vec<Vec<RecordModel>>, usize> {
    groups
        .iter()
        .zip(shifts)
        .enumerate()
        .map(|(g, (group, &shift))| quantise_group(group, atoms, starts, shift).ok_or(g))
        .collect()
}

fn quantise_group(
    group: &Group<'_>,
    atoms: &[AtomModel],
    starts: &[usize],
    shift: u32,
) -> Option<Vec<RecordModel>> {
    let unit = unit(shift);
    let levels = (1u32 << group.value_bits) as f64;
    let mut numbers = group.atoms.iter();
    let mut records = Vec::with_capacity(group.records.len());
    for (dictionary, list) in group.records {
        if list.is_empty() {
            records.push(RecordModel { dictionary: 0, shift: *SHIFTS.start(), coefficients: Vec::new() });
            continue;
        }
        let mut sum = 0;
        let mut coefficients: Vec<(u32, u16)> = list
            .iter()
            .zip(numbers.by_ref())
            .map(|((_, value), &number)| {
                let atom = atoms[number as usize];
                let target = value * unit * 2f64.powi(atom.shift as i32);
                let guess = if atom.step == 0 {
                    0.0
                } else {
                    (target - atom.base as f64) * levels / atom.step as f64
                };
                let quantised = guess.round().clamp(0.0, levels - 1.0) as u16;
                let coefficient = dequantise(atom.quantiser(), quantised as u32, group.value_bits);
                sum += coefficient.unsigned_abs().div_ceil(1 << atom.shift);
                (number - starts[*dictionary] as u32, quantised)
            })
            .collect();
        if sum > SUM_LIMIT {
            return None;
        }
        if !coefficients.is_sorted() {
            coefficients.sort_unstable();
        }
        records.push(RecordModel { dictionary: *dictionary as u32, shift, coefficients });
    }
    Some(records)
}

/// Sum of the squared steps of all coefficients, in units of the channel.
fn expected_loss(groups: &[Group<'_>], atoms: &[AtomModel], shifts: &[u32]) -> f64 {
    let step_of = |atom: &AtomModel| atom.step as f64 / 2f64.powi(atom.shift as i32);
    groups
        .iter()
        .zip(shifts)
        .map(|(group, &shift)| {
            let unit = unit(shift) * (1u32 << group.value_bits) as f64;
            group.atoms.iter().map(|&atom| (step_of(&atoms[atom as usize]) / unit).powi(2)).sum::<f64>()
        })
        .sum()
}
