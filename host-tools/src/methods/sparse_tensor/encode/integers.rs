//! Light atoms, fibres and coefficients become the integers of chapter 12.
//!
//! Scales chain up so that every number uses its range: a light atom's largest entry is 511 and its scale
//! goes into the fibres; an ABRDF atom's coefficients fill 16 bits and their scale goes into its fibres too;
//! what remains is a power of two, which the two shifts of the atom and that of the section take.

use crate::math::ksvd::Rows;
use crate::methods::sparse_tensor::model::AtomShifts;
use selvedge::method::sparse_tensor::check::{FIBRE_SUM_LIMIT, LIST_SUM_LIMIT};
use selvedge::method::sparse_tensor::{bit_length, list_coefficient};

/// Largest entry of a light atom.
const ENTRY: f64 = 511.0;
/// Largest value of a fibre's entry, Q15.
const VALUE_LIMIT: i32 = 32_767;
/// Smallest unit of a coefficient: that of an atom which no texel uses.
const LEAST_UNIT: f64 = 1e-30;
/// Most of a shift.
const SHIFT_LIMIT: i32 = 31;

/// Light atoms and fibres as a file has them.
pub struct Atoms {
    light_atoms: usize,
    atoms: usize,
    entries: usize,
    /// `[light][atom][channel]`.
    lights: Vec<[i16; 3]>,
    /// `[view][atom][entry]`: value in Q15 and index.
    fibres: Vec<(i32, u32)>,
    /// Unit of a coefficient in Q15, of each ABRDF atom.
    coefficient_unit: Vec<f64>,
    /// Unit of the product of a fibre's value and a light atom's entry, of each ABRDF atom.
    value_unit: Vec<f64>,
    angular_shift: Vec<u32>,
    /// Sum of an ABRDF atom's gain shift and the section's.
    rest_shift: Vec<i32>,
}

impl Atoms {
    /// From floats: light atoms `[light][channel]`, fibres by view and atom, and the largest coefficient of
    /// each ABRDF atom, which `value_bits` have to reach.
    pub fn new(light: &Rows, fibres: &[Vec<(u32, f64)>], largest: &[f64], value_bits: u32) -> Atoms {
        let (light_atoms, atoms) = (light.count(), largest.len());
        let views = fibres.len() / atoms;
        let entries = fibres.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let scales: Vec<f64> = (0..light_atoms)
            .map(|i| {
                light.row(i).iter().fold(0.0f64, |m, &x| m.max(x.abs() as f64)).max(f64::MIN_POSITIVE.sqrt())
                    / ENTRY
            })
            .collect();
        let quantised = |l: usize, i: usize| {
            std::array::from_fn(|c| (light.row(i)[l * 3 + c] as f64 / scales[i]).round() as i16)
        };
        let lights: Vec<[i16; 3]> = (0..light.dim / 3)
            .flat_map(|l| (0..light_atoms).map(move |i| (l, i)))
            .map(|(l, i)| quantised(l, i))
            .collect();
        let mut result = Atoms {
            light_atoms,
            atoms,
            entries,
            lights,
            fibres: vec![(0, 0); views * atoms * entries],
            coefficient_unit: vec![0.0; atoms],
            value_unit: vec![0.0; atoms],
            angular_shift: vec![0; atoms],
            rest_shift: vec![SHIFT_LIMIT; atoms],
        };
        let top = (1 << 15) - (1 << (15 - value_bits.min(15)));
        for (atom, largest) in largest.iter().enumerate() {
            let of_atom: Vec<Vec<(u32, f64)>> = (0..views)
                .map(|view| {
                    fibres[view * atoms + atom]
                        .iter()
                        .map(|&(index, value)| (index, value * scales[index as usize]))
                        .collect()
                })
                .collect();
            result.coefficient_unit[atom] = (largest / top as f64).max(LEAST_UNIT);
            result.set_atom(atom, &of_atom);
        }
        result
    }

    /// Quantises the fibres of an ABRDF atom whose coefficients have their unit.
    fn set_atom(&mut self, atom: usize, of_atom: &[Vec<(u32, f64)>]) {
        let magnitudes = of_atom.iter().map(|fibre| fibre.iter().map(|(_, v)| v.abs()));
        let most = magnitudes.clone().flatten().fold(0.0f64, f64::max);
        let sum = magnitudes.map(|fibre| fibre.sum::<f64>()).fold(0.0, f64::max);
        if most <= 0.0 {
            self.value_unit[atom] = 1.0;
            return;
        }
        let step = 1i32 << bit_length(self.light_atoms as u32 - 1);
        let unit = self.coefficient_unit[atom];
        // Rounding to the nearest multiple of the step must stay within the format.
        let needed = (most / (VALUE_LIMIT - step) as f64)
            .max(sum / (FIBRE_SUM_LIMIT as i32 - self.entries as i32 * step) as f64);
        // Largest q with 2^(-q - 17) / unit >= needed.
        let q = (-(needed * unit).log2() - 17.0).floor() as i32;
        let value_unit = 2f64.powi(-q - 17) / unit;
        let mut peak = 0.0f64;
        for (view, fibre) in of_atom.iter().enumerate() {
            let first = (view * self.atoms + atom) * self.entries;
            let slots = &mut self.fibres[first..][..self.entries];
            for (slot, &(index, value)) in slots.iter_mut().zip(fibre) {
                *slot = ((value / value_unit / step as f64).round() as i32 * step, index);
            }
            slots.sort_by_key(|&(value, index)| (value == 0, index));
            slots.iter_mut().filter(|slot| slot.0 == 0).for_each(|slot| slot.1 = 0);
            for lights in self.lights.chunks(self.light_atoms) {
                let sum = |c: usize| -> i64 {
                    slots.iter().map(|&(v, i)| v as i64 * lights[i as usize][c] as i64).sum()
                };
                for sum in [0, 1, 2].map(sum) {
                    peak = peak.max(sum.unsigned_abs() as f64);
                }
            }
        }
        // 12.5-2 and 12.5-3: eight times the sum, shifted to 16 bits.
        let shift = (peak * 8.0 / 32_766.0).max(1.0).log2().ceil() as i32;
        self.value_unit[atom] = value_unit;
        self.angular_shift[atom] = shift.clamp(0, SHIFT_LIMIT) as u32;
        self.rest_shift[atom] = q - shift;
    }

    /// ABRDF atoms as the decoder has them at sample directions, but for its last roundings:
    /// `[atom][view][light][channel]`.
    pub fn rebuild(&self) -> Rows {
        let (views, lights) =
            (self.fibres.len() / self.atoms / self.entries, self.lights.len() / self.light_atoms);
        let mut rows = Rows::zeros(self.atoms, views * lights * 3);
        for view in 0..views {
            for atom in 0..self.atoms {
                let fibre = &self.fibres[(view * self.atoms + atom) * self.entries..][..self.entries];
                let row = &mut rows.row_mut(atom)[view * lights * 3..][..lights * 3];
                for (light, out) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                    for (c, out) in out.iter_mut().enumerate() {
                        let sum: i64 = fibre
                            .iter()
                            .map(|&(v, i)| {
                                v as i64 * self.lights[light * self.light_atoms + i as usize][c] as i64
                            })
                            .sum();
                        *out = (sum as f64 * self.value_unit[atom]) as f32;
                    }
                }
            }
        }
        rows
    }

    /// Light atoms.
    pub fn light_atoms(&self) -> u32 {
        self.light_atoms as u32
    }

    /// Entries of a fibre.
    pub fn entries(&self) -> u32 {
        self.entries as u32
    }

    /// Light atoms as a model has them.
    pub fn lights(&self) -> Vec<[i16; 3]> {
        self.lights.clone()
    }

    /// Fibres as a model has them.
    pub fn fibres(&self) -> Vec<u16> {
        self.fibres.iter().map(|&(value, index)| value as u16 | index as u16).collect()
    }
}

/// Coefficients of a number of bits.
pub struct Quantiser<'a> {
    atoms: &'a Atoms,
    value_bits: u32,
}

impl Quantiser<'_> {
    /// For the atoms.
    pub fn new(atoms: &Atoms, value_bits: u32) -> Quantiser<'_> {
        Quantiser { atoms, value_bits }
    }

    /// ABRDF atoms.
    pub fn atoms(&self) -> usize {
        self.atoms.atoms
    }

    /// What is stored for a coefficient, and whether it was beyond its range.
    pub fn value(&self, atom: u32, coefficient: f64) -> (u16, bool) {
        let q15 = coefficient / self.atoms.coefficient_unit[atom as usize];
        let wanted = ((q15 + 32_768.0) / 2f64.powi(16 - self.value_bits as i32)).floor();
        let most = ((1u32 << self.value_bits) - 1) as f64;
        (wanted.clamp(0.0, most) as u16, !(0.0..=most).contains(&wanted))
    }

    /// The coefficient that a stored value stands for.
    pub fn coefficient(&self, atom: u32, stored: u16) -> f64 {
        list_coefficient(stored as u32, self.value_bits) as f64 * self.atoms.coefficient_unit[atom as usize]
    }

    /// Shifts of the ABRDF atoms, and of the sections, for lists that are there: gains as small as the bound
    /// of 12.5-8 allows.
    pub fn shifts(&self, levels: &[Vec<Vec<(u32, u16)>>]) -> (Vec<AtomShifts>, u32) {
        let least = self.atoms.rest_shift.iter().copied().min().unwrap_or(0).clamp(0, SHIFT_LIMIT);
        let gain =
            |atom: usize, shift: i32| (self.atoms.rest_shift[atom] - shift).clamp(0, SHIFT_LIMIT) as u32;
        let fits = |shift: i32| {
            levels.iter().flatten().all(|list| {
                let part = |&(atom, stored): &(u32, u16)| {
                    list_coefficient(stored as u32, self.value_bits)
                        .unsigned_abs()
                        .div_ceil(1 << gain(atom as usize, shift))
                };
                list.iter().map(part).sum::<u32>() <= LIST_SUM_LIMIT
            })
        };
        let shift = (0..=least).rev().find(|&shift| fits(shift)).unwrap_or(0);
        let atoms = (0..self.atoms.atoms)
            .map(|atom| AtomShifts { angular: self.atoms.angular_shift[atom], gain: gain(atom, shift) })
            .collect();
        (atoms, shift as u32)
    }
}
