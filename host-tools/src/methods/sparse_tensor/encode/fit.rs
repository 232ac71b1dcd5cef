//! The decomposition of Ruiters and Klein (2009, section 4.1), in floats.
//!
//! The unfolded tensor is projected into the space of its leading components; K-SVD over texels gives ABRDF
//! atoms, and K-SVD over their views, each weighted by how much its atom is used, gives light atoms. Where
//! the paper stops, a few rounds follow: texels are coded again with the atoms as the second step left them,
//! ABRDF atoms solved again for these codes, and their fibres coded again.

use crate::math::ksvd::{
    Code, Found, Pursuit, Rows, code_all, code_with, first_atoms, gram, iterate, normalise,
};
use crate::math::linear::{product, product_bt, solve_symmetric};
use crate::math::pca::Pca;

/// How to decompose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Light atoms, `D1`.
    pub light_atoms: usize,
    /// ABRDF atoms, `D2`.
    pub abrdf_atoms: usize,
    /// Entries of a fibre, `k1`.
    pub entries: usize,
    /// Coefficients of a texel at most, `k2`.
    pub coefficients: usize,
}

/// How long to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// Iterations of each K-SVD.
    pub iterations: usize,
    /// Rounds over both after it.
    pub rounds: usize,
    /// Of the first atoms.
    pub seed: u64,
}

impl Training {
    /// As long as more of it was found to gain.
    pub const DEFAULT: Training = Training { iterations: 12, rounds: 4, seed: 1 };
}

impl Default for Training {
    fn default() -> Training {
        Training::DEFAULT
    }
}

/// What training found, for reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Trained {
    /// Atoms that were replaced, over all iterations.
    pub revived: usize,
    /// Atoms refused in pursuits, since they lay in the span of others.
    pub breakdowns: u64,
    /// Largest over smallest energy of the ABRDF atoms' uses: how unequal they are.
    pub condition: f64,
}

impl Trained {
    fn add(&mut self, found: Found) {
        self.revived += found.revived;
        self.breakdowns += found.breakdowns;
    }
}

/// The decomposition.
pub struct Fit {
    /// Light atoms, unit length: `[light][colour]`.
    pub light: Rows,
    /// `fibres[view * abrdf_atoms + atom]`: light atoms with their values.
    pub fibres: Vec<Vec<(u32, f64)>>,
    /// Largest magnitude of each ABRDF atom's coefficients.
    pub largest: Vec<f64>,
    /// Squared error of coding texels with 0, 1, 2, ... coefficients, in the data's domain; what the
    /// components lose is added.
    pub of_texels: Vec<f64>,
    /// Squared error of coding fibres with 0, 1, 2, ... entries, weighted by use.
    pub of_fibres: Vec<f64>,
    /// What training found.
    pub trained: Trained,
}

/// Squared errors of codes by the number of coefficients, up to `most`.
fn errors(codes: &[Code], most: usize) -> Vec<f64> {
    let at = |k: usize| codes.iter().map(|code| code.errors[k.min(code.errors.len() - 1)]).sum();
    (0..=most).map(at).collect()
}

/// ABRDF atoms in the space of the data: `[atom][view][light][colour]`.
fn lift(atoms: &Rows, of_pairs: &[f32], rank: usize) -> Rows {
    let columns = of_pairs.len() / rank;
    let mut lifted = Rows::zeros(atoms.count(), columns);
    product_bt(&mut lifted.values, &atoms.values, of_pairs, [atoms.count(), rank, columns], false);
    lifted
}

/// The same from light atoms and fibres.
pub fn rebuild(light: &Rows, fibres: &[Vec<(u32, f64)>], atoms: usize) -> Rows {
    let (views, row) = (fibres.len() / atoms, light.dim);
    let mut rebuilt = Rows::zeros(atoms, views * row);
    for (n, fibre) in fibres.iter().enumerate() {
        let (view, atom) = (n / atoms, n % atoms);
        let target = &mut rebuilt.values[(atom * views + view) * row..][..row];
        for &(index, value) in fibre {
            target
                .iter_mut()
                .zip(light.row(index as usize))
                .for_each(|(t, l)| *t += (value * *l as f64) as f32);
        }
    }
    rebuilt
}

/// Fibres of lifted atoms as samples, each times the weight of its atom: `[view * atoms +
/// atom][light][colour]`.
fn fibre_samples(lifted: &Rows, views: usize, weights: &[f64]) -> Rows {
    let (atoms, row) = (lifted.count(), lifted.dim / views);
    let mut samples = Rows::zeros(views * atoms, row);
    for view in 0..views {
        for (atom, weight) in weights.iter().enumerate() {
            let from = &lifted.row(atom)[view * row..][..row];
            samples
                .row_mut(view * atoms + atom)
                .iter_mut()
                .zip(from)
                .for_each(|(to, from)| *to = (weight * *from as f64) as f32);
        }
    }
    samples
}

/// Root of the energy of each atom's coefficients.
fn uses(codes: &[Code], atoms: usize) -> Vec<f64> {
    let mut energy = vec![0.0f64; atoms];
    codes
        .iter()
        .flat_map(|code| &code.terms)
        .for_each(|&(atom, value)| energy[atom as usize] += value * value);
    energy.iter().map(|e| e.sqrt()).collect()
}

/// The atoms that with given codes come nearest to the samples: one solution of the normal equations for all
/// of them. Nothing if the equations are singular in the numbers that they are solved in.
fn solve_atoms(samples: &Rows, codes: &[Code], atoms: usize) -> Option<Rows> {
    let dim = samples.dim;
    let mut normal = vec![0.0f64; atoms * atoms];
    let mut right = vec![0.0f64; atoms * dim];
    for (i, code) in codes.iter().enumerate() {
        for &(a, va) in &code.terms {
            right[a as usize * dim..][..dim]
                .iter_mut()
                .zip(samples.row(i))
                .for_each(|(r, s)| *r += va * *s as f64);
            code.terms.iter().for_each(|&(b, vb)| normal[a as usize * atoms + b as usize] += va * vb);
        }
    }
    // A millionth of the mean use: what is hardly used stays near zero instead of growing without bound.
    let ridge =
        (0..atoms).map(|a| normal[a * atoms + a]).sum::<f64>() / atoms as f64 * 1e-6 + f64::MIN_POSITIVE;
    let matrix = |a: usize, b: usize| normal[a * atoms + b] + if a == b { ridge } else { 0.0 };
    let solved = solve_symmetric(matrix, &right, atoms)?;
    Some(Rows { dim, values: (0..atoms * dim).map(|i| solved[(i / dim, i % dim)] as f32).collect() })
}

/// Decomposes the components of a dataset.
pub fn fit(
    pca: &Pca<'_>,
    shape: Shape,
    training: Training,
    mut report: impl FnMut(&str, usize, usize),
) -> Fit {
    let rank = pca.rank();
    let views = pca.dataset.description().views.len();
    let samples = Rows { dim: rank, values: pca.of_texels.clone() };
    let lost = (pca.energy - pca.energies[..rank].iter().sum::<f64>()).max(0.0);
    let pursuit = Pursuit { most: shape.coefficients, least_gain: 0.0 };
    let mut trained = Trained::default();

    let mut atoms = first_atoms(&samples, shape.abrdf_atoms, training.seed);
    for i in 0..training.iterations {
        report("ABRDF atoms", i, training.iterations);
        trained.add(iterate(&samples, &mut atoms, pursuit));
    }
    let mut codes = code_all(&samples, &atoms, pursuit);
    let mut light = Rows::default();
    let mut fibre_codes = Vec::new();
    let mut weights = Vec::new();
    let fibre_pursuit = Pursuit { most: shape.entries, least_gain: 0.0 };
    for round in 0..=training.rounds {
        let lifted = lift(&atoms, &pca.of_pairs, rank);
        weights = uses(&codes, shape.abrdf_atoms);
        let fibres = fibre_samples(&lifted, views, &weights);
        // The second K-SVD, and one more step of it in every round.
        let (stage, begun, iterations, of) = if round == 0 {
            light = first_atoms(&fibres, shape.light_atoms, training.seed + 1);
            ("light atoms", 0, training.iterations, training.iterations)
        } else {
            ("rounds", round, 1, training.rounds + 1)
        };
        for i in 0..iterations {
            report(stage, begun + i, of);
            trained.add(iterate(&fibres, &mut light, fibre_pursuit));
        }
        fibre_codes = code_all(&fibres, &light, fibre_pursuit);
        if round < training.rounds {
            let unweighted = unweigh(&fibre_codes, &weights);
            let rebuilt = rebuild(&light, &unweighted, shape.abrdf_atoms);
            let inside = project(&rebuilt, &pca.of_pairs, rank);
            codes = code_with(&samples, &inside, &gram(&rebuilt), pursuit);
            match solve_atoms(&samples, &codes, shape.abrdf_atoms) {
                Some(better) => atoms = better,
                // They stay as they are.
                None => trained.breakdowns += 1,
            }
            // Unit length, as K-SVD has them; the codes take what they had.
            let lengths: Vec<f64> = (0..shape.abrdf_atoms).map(|a| normalise(atoms.row_mut(a))).collect();
            codes
                .iter_mut()
                .flat_map(|code| &mut code.terms)
                .for_each(|(atom, value)| *value *= lengths[*atom as usize]);
        }
    }
    trained.breakdowns += codes.iter().chain(&fibre_codes).map(|code| code.breakdowns as u64).sum::<u64>();
    let fibres = unweigh(&fibre_codes, &weights);
    let mut largest = vec![0.0f64; shape.abrdf_atoms];
    codes
        .iter()
        .flat_map(|code| &code.terms)
        .for_each(|&(atom, value)| largest[atom as usize] = largest[atom as usize].max(value.abs()));
    let used: Vec<f64> = weights.iter().copied().filter(|&w| w > 0.0).collect();
    trained.condition = used.iter().fold(0.0f64, |m, &w| m.max(w))
        / used.iter().fold(f64::MAX, |m, &w| m.min(w)).max(f64::MIN_POSITIVE);
    let of_texels = errors(&codes, shape.coefficients).iter().map(|e| e + lost).collect();
    Fit { of_texels, of_fibres: errors(&fibre_codes, shape.entries), light, fibres, largest, trained }
}

/// Fibres without the weights of their atoms.
fn unweigh(codes: &[Code], weights: &[f64]) -> Vec<Vec<(u32, f64)>> {
    let atoms = weights.len();
    let of = |(n, code): (usize, &Code)| {
        let weight = weights[n % atoms];
        if weight > 0.0 {
            code.terms.iter().map(|&(index, value)| (index, value / weight)).collect()
        } else {
            Vec::new()
        }
    };
    codes.iter().enumerate().map(of).collect()
}

/// Atoms of the data's space in that of its components.
fn project(rebuilt: &Rows, of_pairs: &[f32], rank: usize) -> Rows {
    let mut inside = Rows::zeros(rebuilt.count(), rank);
    product(&mut inside.values, &rebuilt.values, of_pairs, [rebuilt.count(), rebuilt.dim, rank], false);
    inside
}
