//! K-SVD (Aharon et al. 2006): a dictionary whose sparse combinations come near given samples.
//!
//! Coding is batch orthogonal matching pursuit and the update of an atom one step of the power method instead
//! of a whole decomposition (both Rubinstein et al. 2008). Everything adds up in a fixed order, so that no
//! bit depends on the number of threads.

use crate::math::linear::product_bt;
use crate::math::random::Random;
use crate::work::ordered;

/// Samples coded at once.
const BATCH: usize = 128;
/// A pivot below this part of an atom's energy means that the atom lies in the span of those already chosen:
/// it is left out, and counted.
const BREAKDOWN: f64 = 1e-7;

/// Rows of numbers, each `dim` long.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Numbers of a row.
    pub dim: usize,
    /// All rows.
    pub values: Vec<f32>,
}

impl Rows {
    /// Rows of zeros.
    pub fn zeros(count: usize, dim: usize) -> Rows {
        Rows { dim, values: vec![0.0; count * dim] }
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.values.len() / self.dim.max(1)
    }

    /// One row.
    pub fn row(&self, i: usize) -> &[f32] {
        &self.values[i * self.dim..][..self.dim]
    }

    /// One row, to be changed.
    pub fn row_mut(&mut self, i: usize) -> &mut [f32] {
        &mut self.values[i * self.dim..][..self.dim]
    }
}

/// A dot product in binary64.
pub fn dot(a: &[f32], b: &[f32]) -> f64 {
    // Eight sums, so that it is vector code with a fixed order.
    let mut sums = [0.0f64; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for i in 0..8 {
            sums[i] += a[i] as f64 * b[i] as f64;
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| *a as f64 * *b as f64).sum::<f64>()
}

/// All products of atoms with each other.
pub fn gram(atoms: &Rows) -> Vec<f64> {
    let n = atoms.count();
    let mut gram = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let product = dot(atoms.row(i), atoms.row(j));
            gram[i * n + j] = product;
            gram[j * n + i] = product;
        }
    }
    gram
}

/// How a sample is coded.
#[derive(Clone, Copy, Debug)]
pub struct Pursuit {
    /// Most coefficients.
    pub most: usize,
    /// A coefficient has to take away at least this much of the squared error.
    pub least_gain: f64,
}

/// A sample's code.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Code {
    /// Atoms in the order in which they were chosen, with their coefficients.
    pub terms: Vec<(u32, f64)>,
    /// Squared error with the first 0, 1, 2, ... of them.
    pub errors: Vec<f64>,
    /// Atoms that lay in the span of others.
    pub breakdowns: u32,
}

/// Orthogonal matching pursuit by correlations: `alpha` are the sample's products with all atoms, `energy` is
/// that of the sample, `gram` those of the atoms with each other.
pub fn pursue(alpha: &[f32], energy: f64, gram: &[f64], pursuit: Pursuit) -> Code {
    let n = alpha.len();
    let first: Vec<f64> = alpha.iter().map(|&a| a as f64).collect();
    let mut now = first.clone();
    let mut banned = vec![false; n];
    let mut code = Code { errors: vec![energy], ..Code::default() };
    let mut chosen: Vec<usize> = Vec::new();
    // Cholesky factor of the chosen atoms' products, row by row.
    let mut factor: Vec<Vec<f64>> = Vec::new();
    let mut solved: Vec<f64> = Vec::new();
    let mut values: Vec<f64> = Vec::new();
    let mut error = energy;
    while chosen.len() < pursuit.most {
        let gain = |i: usize| {
            if banned[i] || gram[i * n + i] <= 0.0 { 0.0 } else { now[i] * now[i] / gram[i * n + i] }
        };
        let mut best = (0, 0.0);
        for i in 0..n {
            let gain = gain(i);
            if gain > best.1 {
                best = (i, gain);
            }
        }
        let (next, expected) = best;
        if expected <= pursuit.least_gain || expected <= energy * 1e-14 {
            break;
        }
        banned[next] = true;
        let mut row: Vec<f64> = Vec::with_capacity(chosen.len() + 1);
        for (i, &other) in chosen.iter().enumerate() {
            let known: f64 = row.iter().zip(&factor[i]).map(|(a, b): (&f64, &f64)| a * b).sum();
            row.push((gram[next * n + other] - known) / factor[i][i]);
        }
        let pivot = gram[next * n + next] - row.iter().map(|r| r * r).sum::<f64>();
        if pivot <= gram[next * n + next] * BREAKDOWN {
            code.breakdowns += 1;
            continue;
        }
        let known: f64 = row.iter().zip(&solved).map(|(a, b)| a * b).sum();
        row.push(pivot.sqrt());
        solved.push((first[next] - known) / pivot.sqrt());
        factor.push(row);
        chosen.push(next);
        error -= solved.last().map_or(0.0, |s| s * s);
        code.errors.push(error.max(0.0));
        // Back substitution: the coefficients of all that are chosen.
        values = vec![0.0; chosen.len()];
        for i in (0..chosen.len()).rev() {
            let known: f64 = (i + 1..chosen.len()).map(|j| factor[j][i] * values[j]).sum();
            values[i] = (solved[i] - known) / factor[i][i];
        }
        now.copy_from_slice(&first);
        for (&atom, &value) in chosen.iter().zip(&values) {
            now.iter_mut().zip(&gram[atom * n..][..n]).for_each(|(now, g)| *now -= value * g);
        }
    }
    code.terms = chosen.iter().zip(&values).map(|(&atom, &value)| (atom as u32, value)).collect();
    code
}

/// Codes all samples.
pub fn code_all(samples: &Rows, atoms: &Rows, pursuit: Pursuit) -> Vec<Code> {
    code_with(samples, atoms, &gram(atoms), pursuit)
}

/// Codes all samples with products of the atoms that are given: where samples and atoms stand in a subspace,
/// those of the atoms in the whole space.
pub fn code_with(samples: &Rows, atoms: &Rows, gram: &[f64], pursuit: Pursuit) -> Vec<Code> {
    let n = atoms.count();
    let work = |batch: usize| -> Result<Vec<Code>, std::convert::Infallible> {
        let (first, count) = (batch * BATCH, BATCH.min(samples.count() - batch * BATCH));
        let mut alpha = vec![0.0; count * n];
        product_bt(
            &mut alpha,
            &samples.values[first * samples.dim..][..count * samples.dim],
            &atoms.values,
            [count, samples.dim, n],
            false,
        );
        let of = |i: usize| {
            pursue(&alpha[i * n..][..n], dot(samples.row(first + i), samples.row(first + i)), gram, pursuit)
        };
        Ok((0..count).map(of).collect())
    };
    let Ok(codes) =
        ordered(samples.count().div_ceil(BATCH), work, Vec::new(), |all: &mut Vec<Code>, _, codes| {
            all.extend(codes)
        });
    codes
}

/// What training found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Atoms that no sample used and that were replaced by a badly coded sample.
    pub revived: usize,
    /// Atoms refused in a pursuit, since they lay in the span of others.
    pub breakdowns: u64,
    /// Squared error before the last update.
    pub error: f64,
}

/// `count` samples, scaled to one, drawn without repetition; unit vectors where there are too few that are
/// not zero.
pub fn first_atoms(samples: &Rows, count: usize, seed: u64) -> Rows {
    let mut random = Random::new(seed);
    let mut order: Vec<usize> = (0..samples.count()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, random.range(0, i as i64) as usize);
    }
    let mut atoms = Rows::zeros(count, samples.dim);
    let mut drawn = order.into_iter().filter(|&i| dot(samples.row(i), samples.row(i)) > 0.0);
    for i in 0..count {
        match drawn.next() {
            Some(sample) => atoms.row_mut(i).copy_from_slice(samples.row(sample)),
            None => atoms.row_mut(i)[i % samples.dim] = 1.0,
        }
        normalise(atoms.row_mut(i));
    }
    atoms
}

/// Scales a row to a length of one; gives the length it had.
pub fn normalise(row: &mut [f32]) -> f64 {
    let length = dot(row, row).sqrt();
    if length > 0.0 {
        row.iter_mut().for_each(|x| *x = (*x as f64 / length) as f32);
    }
    length
}

/// Codes the samples, then turns each atom towards what its samples miss.
pub fn iterate(samples: &Rows, atoms: &mut Rows, pursuit: Pursuit) -> Found {
    let codes = code_all(samples, atoms, pursuit);
    let mut found =
        Found { breakdowns: codes.iter().map(|code| code.breakdowns as u64).sum(), ..Found::default() };
    let dim = samples.dim;
    // What is left of each sample.
    let mut rest = samples.values.clone();
    let mut users: Vec<Vec<(u32, f64)>> = vec![Vec::new(); atoms.count()];
    let mut errors = Vec::with_capacity(codes.len());
    for (i, code) in codes.iter().enumerate() {
        for &(atom, value) in &code.terms {
            users[atom as usize].push((i as u32, value));
            let atom = atoms.row(atom as usize);
            rest[i * dim..][..dim]
                .iter_mut()
                .zip(atom)
                .for_each(|(rest, a)| *rest -= (value * *a as f64) as f32);
        }
        errors.push(code.errors.last().copied().unwrap_or(0.0));
    }
    found.error = errors.iter().sum();
    for (j, users) in users.iter().enumerate() {
        if users.is_empty() {
            // The worst coded sample that no other dead atom has taken.
            let worst = errors
                .iter()
                .enumerate()
                .fold((0, 0.0), |worst, (i, &e)| if e > worst.1 { (i, e) } else { worst });
            if worst.1 > 0.0 {
                errors[worst.0] = 0.0;
                atoms.row_mut(j).copy_from_slice(&rest[worst.0 * dim..][..dim]);
                normalise(atoms.row_mut(j));
                found.revived += 1;
            }
            continue;
        }
        let old = atoms.row(j).to_vec();
        let mut sum = vec![0.0f64; dim];
        for &(i, value) in users {
            let row = &rest[i as usize * dim..][..dim];
            sum.iter_mut()
                .zip(row.iter().zip(&old))
                .for_each(|(sum, (r, a))| *sum += value * (*r as f64 + value * *a as f64));
        }
        let length = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
        if length <= 0.0 {
            continue;
        }
        atoms.row_mut(j).iter_mut().zip(&sum).for_each(|(a, s)| *a = (s / length) as f32);
        let new = atoms.row(j);
        for &(i, value) in users {
            let row = &mut rest[i as usize * dim..][..dim];
            row.iter_mut().zip(&old).for_each(|(r, a)| *r += (value * *a as f64) as f32);
            let fresh = dot(row, new);
            row.iter_mut().zip(new).for_each(|(r, a)| *r -= (fresh * *a as f64) as f32);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_rows(count: usize, dim: usize, seed: u64) -> Rows {
        let mut random = Random::new(seed);
        Rows { dim, values: (0..count * dim).map(|_| random.range(-1000, 1000) as f32 / 1000.0).collect() }
    }

    #[test]
    fn pursuit_solves_least_squares_over_what_it_chose() {
        let (atoms, samples) = (random_rows(12, 20, 1), random_rows(30, 20, 2));
        for (i, code) in code_all(&samples, &atoms, Pursuit { most: 5, least_gain: 0.0 }).iter().enumerate() {
            assert_eq!((code.terms.len(), code.errors.len()), (5, 6));
            assert!(code.errors.windows(2).all(|pair| pair[1] <= pair[0]));
            let mut rest: Vec<f32> = samples.row(i).to_vec();
            code.terms.iter().for_each(|&(atom, value)| {
                rest.iter_mut()
                    .zip(atoms.row(atom as usize))
                    .for_each(|(r, a)| *r -= (value * *a as f64) as f32)
            });
            // What is left is square to every chosen atom, and as large as was said.
            assert!(code.terms.iter().all(|&(atom, _)| dot(&rest, atoms.row(atom as usize)).abs() < 1e-5));
            assert!((dot(&rest, &rest) - code.errors[5]).abs() < 1e-5 * code.errors[0]);
        }
    }

    #[test]
    fn nearly_parallel_atoms_are_refused_and_counted() {
        // The second atom is the first and a ten-thousandth of a direction that the sample has: fitting that
        // direction by their difference would take coefficients of thousands.
        let mut atoms = random_rows(4, 8, 3);
        let copy: Vec<f32> =
            atoms.row(0).iter().enumerate().map(|(i, x)| x + if i % 2 == 0 { 1e-4 } else { -1e-4 }).collect();
        atoms.row_mut(1).copy_from_slice(&copy);
        let samples = Rows {
            dim: 8,
            values: (0..8)
                .map(|i| atoms.row(0)[i] + 0.1 * atoms.row(2)[i] + if i % 2 == 0 { 0.3 } else { -0.3 })
                .collect(),
        };
        let code = &code_all(&samples, &atoms, Pursuit { most: 4, least_gain: 0.0 })[0];
        assert!(code.terms.iter().all(|(_, value)| value.abs() < 10.0), "{code:?}");
        assert!(code.terms.len() == 3 && code.breakdowns == 1, "{code:?}");
    }

    #[test]
    fn training_finds_a_planted_dictionary_and_revives_dead_atoms() {
        let (dim, count) = (16, 400);
        let planted = {
            let mut rows = random_rows(10, dim, 4);
            (0..10).for_each(|i| _ = normalise(rows.row_mut(i)));
            rows
        };
        let mut random = Random::new(5);
        let mut samples = Rows::zeros(count, dim);
        for i in 0..count {
            for _ in 0..2 {
                let (atom, value) = (random.range(0, 9) as usize, random.range(-100, 100) as f32 / 50.0);
                samples.row_mut(i).iter_mut().zip(planted.row(atom)).for_each(|(s, a)| *s += value * a);
            }
        }
        let energy: f64 = (0..count).map(|i| dot(samples.row(i), samples.row(i))).sum();
        let mut atoms = first_atoms(&samples, 12, 6);
        atoms.row_mut(11).fill(0.0);
        let pursuit = Pursuit { most: 2, least_gain: 0.0 };
        let first = iterate(&samples, &mut atoms, pursuit);
        assert!(first.revived >= 1);
        let last = (0..40).map(|_| iterate(&samples, &mut atoms, pursuit)).last().expect("some");
        assert!(
            last.error < 0.02 * energy && last.error < first.error / 5.0,
            "{} {} {energy}",
            last.error,
            first.error
        );
    }
}
