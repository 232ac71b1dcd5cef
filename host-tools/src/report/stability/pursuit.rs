//! Sparse coding: nearly parallel atoms, samples of zeros, dead atoms.

use super::case::{Case, Outcome, case};
use crate::math::ksvd::{Code, Pursuit, Rows, code_all, dot, gram, iterate, normalise, pursue};
use crate::math::random::Random;

/// Angles between the atoms of a pair, radians.
const ANGLES: [f64; 4] = [1e-1, 1e-3, 1e-5, 0.0];

/// Unit atoms of which pairs are nearly parallel, by this angle; and samples.
fn near_parallel(angle: f64) -> (Rows, Rows) {
    let (dim, pairs) = (24, 16);
    let mut random = Random::new(11);
    let mut atoms = Rows::zeros(2 * pairs, dim);
    for i in 0..pairs {
        let draw: Vec<f32> = (0..dim).map(|_| random.range(-1000, 1000) as f32 / 1000.0).collect();
        let aside: Vec<f32> = (0..dim).map(|_| random.range(-1000, 1000) as f32 / 1000.0).collect();
        let length = (dot(&draw, &draw) / dot(&aside, &aside)).sqrt() * angle;
        atoms.row_mut(2 * i).copy_from_slice(&draw);
        let turned: Vec<f32> =
            draw.iter().zip(&aside).map(|(a, b)| (*a as f64 + length * *b as f64) as f32).collect();
        atoms.row_mut(2 * i + 1).copy_from_slice(&turned);
        normalise(atoms.row_mut(2 * i));
        normalise(atoms.row_mut(2 * i + 1));
    }
    let mut samples = Rows::zeros(200, dim);
    samples.values.iter_mut().for_each(|v| *v = random.range(-1000, 1000) as f32 / 1000.0);
    (atoms, samples)
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for angle in ANGLES {
        cases.push(case(
            "pursuit",
            format!("atoms in pairs, {angle:.0e} apart"),
            "1 / angle",
            "parts of: stated error of a code against that of its sum, \
             2 sqrt(n) 2^-24 of the sample times all coefficients (correlations are binary32)",
            move |_| Ok(parallel_pairs(angle)),
        ));
    }
    cases.push(case("pursuit", "a sample of zeros", "atoms", "no term, no error", |_| {
        let (atoms, _) = near_parallel(0.1);
        let code =
            pursue(&vec![0.0; atoms.count()], 0.0, &gram(&atoms), Pursuit { most: 8, least_gain: 0.0 });
        Ok(Outcome {
            condition: atoms.count() as f64,
            bound: 0.0,
            measured: code.terms.len() as f64 + code.errors.iter().sum::<f64>(),
        })
    }));
    cases.push(case(
        "pursuit",
        "dead atoms are replaced",
        "atoms that no sample uses",
        "every atom is a unit vector after an iteration, 2^-20",
        |_| Ok(dead_atoms()),
    ));
    cases
}

/// Codes of samples over nearly parallel atoms: their stated errors against those of their sums, as parts of
/// what is allowed.
fn parallel_pairs(angle: f64) -> Outcome {
    let (atoms, samples) = near_parallel(angle);
    let codes = code_all(&samples, &atoms, Pursuit { most: 16, least_gain: 0.0 });
    let mut measured = 0.0f64;
    let mut breakdowns = 0;
    for (i, code) in codes.iter().enumerate() {
        let mut rest: Vec<f64> = samples.row(i).iter().map(|&v| v as f64).collect();
        for &(atom, value) in &code.terms {
            rest.iter_mut().zip(atoms.row(atom as usize)).for_each(|(r, a)| *r -= value * *a as f64);
        }
        let energy = dot(samples.row(i), samples.row(i));
        let error: f64 = rest.iter().map(|r| r * r).sum();
        let magnitudes: f64 = code.terms.iter().map(|term| term.1.abs()).sum();
        // The code minimises its error, so that an error of the correlations comes in once for each
        // coefficient, twice by the square.
        let allowed =
            2.0 * 2f64.powi(-24) * (samples.dim as f64).sqrt() * energy.sqrt() * magnitudes + 1e-12 * energy;
        measured = measured.max((error - code.errors.last().copied().unwrap_or(energy)).abs() / allowed);
        breakdowns += code.breakdowns;
    }
    // Of two equal atoms the second has to be refused, and the two are never taken together.
    if (angle == 0.0 && codes.iter().any(has_a_pair)) || (angle > 1e-2 && breakdowns > 0) {
        measured = f64::INFINITY;
    }
    Outcome { condition: 1.0 / f64::max(angle, 1e-9), bound: 1.0, measured }
}

/// Whether a code has both atoms of a pair.
fn has_a_pair(code: &Code) -> bool {
    code.terms.iter().any(|a| code.terms.iter().any(|b| a.0 + 1 == b.0 && a.0 % 2 == 0))
}

/// A dictionary of which all atoms but one are dead, after an iteration: how far atoms are from unit vectors.
fn dead_atoms() -> Outcome {
    let (_, samples) = near_parallel(0.1);
    let mut atoms = Rows::zeros(40, samples.dim);
    // Forty copies of one atom: all but one are dead.
    (0..40).for_each(|i| atoms.row_mut(i)[0] = 1.0);
    let found = iterate(&samples, &mut atoms, Pursuit { most: 3, least_gain: 0.0 });
    let defect = (0..40).map(|i| (dot(atoms.row(i), atoms.row(i)) - 1.0).abs()).fold(0.0, f64::max);
    let measured = if found.revived >= 30 { defect } else { f64::INFINITY };
    Outcome { condition: 39.0, bound: 2f64.powi(-20), measured }
}
