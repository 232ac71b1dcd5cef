//! Which candidates a file keeps: those whose gain exceeds the cost of their bits, and the atoms and columns
//! that repay theirs.
//!
//! A coefficient is kept if its square is above that of a threshold: for orthonormal dictionaries its square
//! is the error that leaving it out makes. The threshold sets the price of a bit. At that price an atom has
//! to pay for its two words, and a column of a factor for its rows; what does not pay goes, until all that is
//! left does.

use super::candidates::Candidates;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use selvedge::method::sparse_ensemble::check::ATOM_LIMIT;

/// Bits of an atom's two words (10.2).
const ATOM_BITS: f64 = 64.0;

/// What a selection costs and leaves, beside the lists themselves.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// `kept[level][block]`: indices into the candidates, ascending.
    pub kept: Vec<Vec<Vec<u32>>>,
    /// Energy of what is not kept, over all levels.
    pub lost: f64,
    /// Energy of level 0 that is not kept.
    pub lost_at_0: f64,
    /// Coefficients.
    pub count: usize,
}

/// Candidates of one channel at all levels, with their atoms numbered.
pub struct Channel<'a> {
    levels: Vec<&'a Candidates>,
    /// Number of the atom of each candidate.
    atoms: Vec<Vec<u32>>,
    /// Dictionary and place of each atom.
    keys: Vec<(u16, u32)>,
    columns: [usize; 2],
    rows: [usize; 2],
    dictionaries: usize,
}

impl<'a> Channel<'a> {
    /// Numbers the atoms.
    pub fn new(levels: Vec<&'a Candidates>, ensemble: &Ensemble) -> Channel<'a> {
        let size = ensemble.light.columns * ensemble.view.columns * ensemble.edge() * ensemble.edge();
        let bit_of = |candidates: &Candidates, block: usize, i: usize| {
            candidates.dictionaries[block] as usize * size + candidates.places[i] as usize
        };
        let all = |candidates: &'a Candidates| {
            (0..candidates.dictionaries.len()).flat_map(move |b| {
                (candidates.starts[b]..candidates.starts[b + 1]).map(move |i| bit_of(candidates, b, i))
            })
        };
        // A bit for every atom that there could be; the number of one is that of the bits before it.
        let mut bits = vec![0u64; (size * ensemble.turns.len()).div_ceil(64)];
        levels
            .iter()
            .flat_map(|candidates| all(candidates))
            .for_each(|bit| bits[bit / 64] |= 1 << (bit % 64));
        let mut before = Vec::with_capacity(bits.len());
        let mut keys: Vec<(u16, u32)> = Vec::new();
        for (i, &word) in bits.iter().enumerate() {
            before.push(keys.len() as u32);
            keys.extend(
                (0..64)
                    .filter(|n| word >> n & 1 == 1)
                    .map(|n| i * 64 + n)
                    .map(|bit| ((bit / size) as u16, (bit % size) as u32)),
            );
        }
        let number = |bit: usize| before[bit / 64] + (bits[bit / 64] & ((1 << (bit % 64)) - 1)).count_ones();
        let atoms = levels.iter().map(|candidates| all(candidates).map(number).collect()).collect();
        Channel {
            levels,
            atoms,
            columns: [ensemble.light.columns, ensemble.view.columns],
            rows: [ensemble.light.rows, ensemble.view.rows],
            dictionaries: ensemble.turns.len(),
            keys,
        }
    }

    /// Chooses at a threshold; `bits` is what a coefficient costs, `most` the largest record that is allowed.
    pub fn select(&self, threshold: f32, bits: f64, most: usize) -> Selection {
        let alive = self.paying(threshold, bits);
        self.keep(|value, atom| value.abs() >= threshold && alive[atom], most)
    }

    /// The energy of level 0 that [`Channel::select`] loses without a cap on records, without its lists.
    pub fn lost_at_0(&self, threshold: f32, bits: f64) -> f64 {
        let alive = self.paying(threshold, bits);
        let (Some(candidates), Some(atoms)) = (self.levels.first(), self.atoms.first()) else { return 0.0 };
        let kept = candidates
            .values
            .iter()
            .zip(atoms)
            .filter(|(value, atom)| value.abs() >= threshold && alive[**atom as usize]);
        (candidates.energy - kept.map(|(&value, _)| (value as f64).powi(2)).sum::<f64>()).max(0.0)
    }

    /// Whether a dictionary has as many atoms at a threshold as it can hold, so that a lower one may gain
    /// little.
    pub fn is_full(&self, threshold: f32, bits: f64) -> bool {
        let alive = self.paying(threshold, bits);
        (0..self.dictionaries).any(|k| {
            self.keys.iter().zip(&alive).filter(|(key, alive)| **alive && key.0 as usize == k).count()
                >= ATOM_LIMIT as usize
        })
    }

    /// The atoms that pay for themselves at a threshold.
    fn paying(&self, threshold: f32, bits: f64) -> Vec<bool> {
        let square = (threshold as f64).powi(2);
        let price = square / bits;
        let mut gains = vec![0.0f64; self.keys.len()];
        for (candidates, atoms) in self.levels.iter().zip(&self.atoms) {
            for (&value, &atom) in candidates.values.iter().zip(atoms) {
                if value.abs() >= threshold {
                    gains[atom as usize] += (value as f64).powi(2) - square;
                }
            }
        }
        let mut alive: Vec<bool> = gains.iter().map(|&gain| gain > price * ATOM_BITS).collect();
        let columns_of = |key: (u16, u32)| {
            let (light, view) =
                (key.1 as usize % self.columns[0], key.1 as usize / self.columns[0] % self.columns[1]);
            (key.0 as usize * self.columns[0] + light, key.0 as usize * self.columns[1] + view)
        };
        // Dropping a column takes atoms with it, which may leave another column too little.
        loop {
            let mut of_lights = vec![0.0; self.dictionaries * self.columns[0]];
            let mut of_views = vec![0.0; self.dictionaries * self.columns[1]];
            for ((key, gain), _) in self.keys.iter().zip(&gains).zip(&alive).filter(|(_, alive)| **alive) {
                let (light, view) = columns_of(*key);
                of_lights[light] += gain - price * ATOM_BITS;
                of_views[view] += gain - price * ATOM_BITS;
            }
            let pays = |gain: f64, rows: usize| gain > price * 16.0 * rows as f64;
            let mut changed = false;
            for (key, alive) in self.keys.iter().zip(&mut alive).filter(|(_, alive)| **alive) {
                let (light, view) = columns_of(*key);
                if !pays(of_lights[light], self.rows[0]) || !pays(of_views[view], self.rows[1]) {
                    *alive = false;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        self.limit_atoms(&gains, &mut alive);
        alive
    }

    /// Every candidate, within the largest record that is allowed.
    pub fn all(&self, most: usize) -> Selection {
        let mut gains = vec![0.0f64; self.keys.len()];
        for (candidates, atoms) in self.levels.iter().zip(&self.atoms) {
            candidates
                .values
                .iter()
                .zip(atoms)
                .for_each(|(&value, &atom)| gains[atom as usize] += (value as f64).powi(2));
        }
        let mut alive = vec![true; self.keys.len()];
        self.limit_atoms(&gains, &mut alive);
        self.keep(|_, atom| alive[atom], most)
    }

    /// Keeps the best atoms of each dictionary, as many as it can hold.
    fn limit_atoms(&self, gains: &[f64], alive: &mut [bool]) {
        for k in 0..self.dictionaries {
            let mut of_k: Vec<usize> =
                (0..alive.len()).filter(|&i| alive[i] && self.keys[i].0 as usize == k).collect();
            if of_k.len() > ATOM_LIMIT as usize {
                of_k.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(a.cmp(&b)));
                of_k[ATOM_LIMIT as usize..].iter().for_each(|&i| alive[i] = false);
            }
        }
    }

    fn keep(&self, keep: impl Fn(f32, usize) -> bool, most: usize) -> Selection {
        let mut selection = Selection::default();
        for (level, (candidates, atoms)) in self.levels.iter().zip(&self.atoms).enumerate() {
            let mut blocks = Vec::with_capacity(candidates.dictionaries.len());
            let mut kept_energy = 0.0;
            for range in candidates.starts.windows(2) {
                let mut list: Vec<u32> = (range[0]..range[1])
                    .filter(|&i| keep(candidates.values[i], atoms[i] as usize))
                    .map(|i| i as u32)
                    .collect();
                if list.len() > most {
                    list.sort_by(|&a, &b| {
                        candidates.values[b as usize]
                            .abs()
                            .total_cmp(&candidates.values[a as usize].abs())
                            .then(a.cmp(&b))
                    });
                    list.truncate(most);
                    list.sort_unstable();
                }
                kept_energy +=
                    list.iter().map(|&i| (candidates.values[i as usize] as f64).powi(2)).sum::<f64>();
                selection.count += list.len();
                blocks.push(list);
            }
            let lost = (candidates.energy - kept_energy).max(0.0);
            selection.lost += lost;
            if level == 0 {
                selection.lost_at_0 = lost;
            }
            selection.kept.push(blocks);
        }
        selection
    }

    /// Largest record of a selection.
    pub fn largest_record(selection: &Selection) -> usize {
        selection.kept.iter().flatten().map(Vec::len).max().unwrap_or(0)
    }
}
