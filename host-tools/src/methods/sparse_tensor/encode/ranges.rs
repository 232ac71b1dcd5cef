//! Ranges of the ABRDF atoms' coefficients: atoms become integers for a range, and coding with these shows
//! which range is needed.

use super::fit::Fit;
use super::integers::{Atoms, Quantiser};
use super::lists::{Correlations, Lists};
use super::options::is_clipping_frequent;
use crate::error::Result;
use crate::math::ksvd::{Pursuit, Rows, gram};

/// ABRDF atoms whose cosine is nearer to one are merged; those of common materials are below 0.95.
const PARALLEL: f64 = 1e-4;
/// Passes over the data for the ranges of coefficients, at most.
const MOST_PASSES: usize = 8;
/// Bits of a value for which atoms are made at least.
const ATOM_BITS: u32 = 8;
/// Bits with which ranges are found: nearly unrounded.
const FULL_BITS: u32 = 15;
/// A coefficient from this part of a range on says that a larger range is needed.
const AT_RANGE: f64 = 0.999;
/// Growth of such a range, and smallest part of a range that is kept where coefficients are smaller: in the
/// first pass, whose ranges are those of other codes, and in the following ones, which only widen.
const FIRST_GROWTH: (f64, f64) = (1.25, 1e-6);
const NEXT_GROWTH: (f64, f64) = (4.0, 1.0);
/// The second pass is taken even if its error is so much larger: its ranges are those of its own codes.
const SECOND_PASS: f64 = 1.01;

/// Atoms of a file, and every level against them.
pub(super) struct Ranged {
    pub(super) atoms: Atoms,
    /// Inner products of the atoms.
    pub(super) gram: Vec<f64>,
    pub(super) levels: Vec<Correlations>,
}

/// Fibres of the ABRDF atoms, and the largest coefficient of each.
pub(super) struct Ranges<'a> {
    light: &'a Rows,
    fibres: Vec<Vec<(u32, f64)>>,
    largest: Vec<f64>,
}

impl<'a> Ranges<'a> {
    /// Those of a decomposition, with nothing left of atoms that are parallel to another one with larger
    /// coefficients.
    ///
    /// Where one part of the data has nearly all the energy, training makes many atoms of it, which rounding
    /// may turn in any order: which of them a texel is coded with, and how large its coefficient is then,
    /// would be chance.
    pub(super) fn without_parallels(light: &'a Rows, fitted: &Fit) -> Ranges<'a> {
        let (mut fibres, mut largest) = (fitted.fibres.clone(), fitted.largest.clone());
        let products = gram(&Atoms::new(light, &fibres, &largest, ATOM_BITS).rebuild());
        let n = largest.len();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| largest[b].total_cmp(&largest[a]).then(a.cmp(&b)));
        let mut kept: Vec<usize> = Vec::with_capacity(n);
        for atom in order {
            let is_parallel = |&&other: &&usize| {
                products[atom * n + other].abs()
                    > (1.0 - PARALLEL) * (products[atom * n + atom] * products[other * n + other]).sqrt()
            };
            match kept.iter().find(is_parallel) {
                Some(&other) => {
                    largest[other] += std::mem::take(&mut largest[atom]);
                    fibres.iter_mut().skip(atom).step_by(n).for_each(Vec::clear);
                }
                None => kept.push(atom),
            }
        }
        Ranges { light, fibres, largest }
    }

    /// Atoms whose ranges fit their coefficients, and every level against them. `None` if no pass gives an
    /// error that is a number.
    ///
    /// Atoms are made for the range of their coefficients; coded again these move a little, so it is done
    /// twice, and where clipping is frequent, as with nearly parallel atoms, again with larger ranges: the
    /// pass of the least error is taken.
    pub(super) fn fitted(
        &mut self,
        value_bits: u32,
        most: usize,
        correlate: impl Fn(&Rows) -> Result<Vec<Correlations>>,
    ) -> Result<Option<Ranged>> {
        let mut best = None;
        let mut least = f64::INFINITY;
        for pass in 0..MOST_PASSES {
            let atoms = Atoms::new(self.light, &self.fibres, &self.largest, value_bits.max(ATOM_BITS));
            let rebuilt = atoms.rebuild();
            let gram = gram(&rebuilt);
            let levels = correlate(&rebuilt)?;
            let quantiser = Quantiser::new(&atoms, FULL_BITS);
            let lists = levels[0].lists(&gram, &quantiser, Pursuit { most, least_gain: 0.0 });
            self.widen(&lists, &quantiser, if pass == 0 { FIRST_GROWTH } else { NEXT_GROWTH });
            if lists.error < least * if pass == 1 { SECOND_PASS } else { 1.0 } {
                least = lists.error;
                best = Some(Ranged { atoms, gram, levels });
            }
            if pass > 0 && !is_clipping_frequent(lists.clipped, lists.count) {
                break;
            }
        }
        Ok(best)
    }

    /// Ranges for the coefficients that were found. One at the end of its range says that there is more;
    /// others leave a little for what other numbers of coefficients need.
    fn widen(&mut self, lists: &Lists, quantiser: &Quantiser, (growth, floor): (f64, f64)) {
        let mut seen = vec![0.0f64; self.largest.len()];
        for &(atom, stored) in lists.model.iter().flatten() {
            let coefficient = quantiser.coefficient(atom, stored).abs();
            seen[atom as usize] = seen[atom as usize].max(coefficient);
        }
        for (range, now) in self.largest.iter_mut().zip(seen) {
            let was = *range;
            *range = if now >= was * AT_RANGE { was * growth } else { now.max(was * floor) };
        }
    }
}
