//! The linear algebra of training: moments, eigenvectors, orthogonal factors, components.

use super::case::{Case, Outcome, case};
use super::files::dataset;
use crate::data::directions;
use crate::data::transfer::Domain;
use crate::error::{Result, ToolError};
use crate::math::linear::{eigenbasis, nearest_orthogonal, orthonormal, product_at};
use crate::math::random::Random;
use crate::measure::baseline::pca;
use std::path::Path;

/// A random matrix with singular values that fall from one to `1 / condition`, `rows x columns`, row-major.
fn conditioned(rows: usize, columns: usize, condition: f64, seed: u64) -> Vec<f32> {
    let mut random = Random::new(seed);
    let mut draw =
        |n: usize| -> Vec<f64> { (0..n).map(|_| random.range(-1_000_000, 1_000_000) as f64 / 1e6).collect() };
    let (u, v) =
        (orthonormal(&draw(rows * columns), columns), orthonormal(&draw(columns * columns), columns));
    let s = |k: usize| condition.powf(-(k as f64) / (columns as f64 - 1.0));
    (0..rows * columns)
        .map(|i| (0..columns).map(|k| u[(i / columns, k)] * s(k) * v[(i % columns, k)]).sum::<f64>() as f32)
        .collect()
}

/// Conditions of the moments.
const CONDITIONS: [f64; 3] = [1e2, 1e6, 1e12];

/// Name, rank and scale of the materials that components are taken of.
const RANKS: [(&str, usize, f64); 4] = [
    ("rank three", 3, 1.0),
    ("rank one", 1, 1.0),
    ("rank three, values of 1e-12", 3, 1e-12),
    ("rank three, values of 1e12", 3, 1e12),
];

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for condition in CONDITIONS {
        cases.push(case(
            "training",
            format!("moments in binary32 against binary64, condition {condition:.0e}"),
            "condition number",
            "4 sqrt(n) 2^-24 of the largest entry, n products each rounded",
            move |_| Ok(single_moments(condition)),
        ));
        cases.push(case(
            "training",
            format!("eigenvectors of moments, condition {condition:.0e}"),
            "condition number of the moments",
            "orthonormal as rows of binary32 can be: sqrt(n) 2^-23",
            move |_| Ok(eigenvectors(condition)),
        ));
    }
    cases.push(case(
        "training",
        "orthogonal factor of a singular matrix (Procrustes)",
        "condition number",
        "orthonormal: sqrt(n) 2^-23",
        |_| procrustes(),
    ));
    for (name, rank, scale) in RANKS {
        cases.push(case(
            "training",
            format!("components of a material of {name}"),
            "components beyond the rank",
            "nothing is left after its rank: 2^-20 of the root mean square, \
             and the 16 bits of the mean and factors, 2^-15 of the largest mean",
            move |folder| components(folder, rank, scale),
        ));
    }
    cases
}

/// Moments in binary32: their largest error, as a part of the largest moment.
fn single_moments(condition: f64) -> Outcome {
    let (rows, columns) = (4096, 24);
    let matrix = conditioned(rows, columns, condition, 1);
    let mut single = vec![0.0f32; columns * columns];
    product_at(&mut single, &matrix, &matrix, [columns, rows, columns], false);
    let exact = |i: usize, j: usize| {
        (0..rows).map(|r| matrix[r * columns + i] as f64 * matrix[r * columns + j] as f64).sum::<f64>()
    };
    let largest = (0..columns).map(|i| exact(i, i)).fold(0.0, f64::max);
    let measured = (0..columns * columns)
        .map(|i| (single[i] as f64 - exact(i / columns, i % columns)).abs())
        .fold(0.0, f64::max)
        / largest;
    Outcome { condition, bound: 4.0 * (rows as f64).sqrt() * 2f64.powi(-24), measured }
}

/// Eigenvectors of moments: how far they are from orthonormal.
fn eigenvectors(condition: f64) -> Outcome {
    let (rows, columns) = (512, 32);
    let matrix = conditioned(rows, columns, condition.sqrt(), 2);
    let moment = |i: usize, j: usize| -> f64 {
        (0..rows).map(|r| matrix[r * columns + i] as f64 * matrix[r * columns + j] as f64).sum()
    };
    let moments: Vec<f64> = (0..columns * columns).map(|i| moment(i / columns, i % columns)).collect();
    let (basis, _) = eigenbasis(&moments, columns);
    Outcome { condition, bound: (columns as f64).sqrt() * 2f64.powi(-23), measured: basis.defect() }
}

/// The nearest orthogonal matrix to a singular one: how far it is from orthonormal.
fn procrustes() -> Result<Outcome> {
    let n = 16;
    let matrix: Vec<f64> = conditioned(n, n, 1e30, 3).into_iter().map(f64::from).collect();
    let basis =
        nearest_orthogonal(&matrix, n).ok_or_else(|| ToolError::Mismatch("no decomposition".into()))?;
    Ok(Outcome { condition: 1e30, bound: (n as f64).sqrt() * 2f64.powi(-23), measured: basis.defect() })
}

/// What the components of a material of low rank leave after its rank.
fn components(folder: &Path, rank: usize, scale: f64) -> Result<Outcome> {
    let set = directions::grid(81).expect("known");
    let value = move |t: usize, l: usize, v: usize, c: usize| {
        let of_texel = |k: usize| 1.0 + ((t * (k + 2)) as f64 * 0.37).sin();
        let of_pair = |k: usize| 1.0 + ((l * 3 + v * 7 + c + k) as f64 * (k as f64 + 0.61)).sin();
        let sum: f64 = (0..rank).map(|k| of_texel(k) * of_pair(k)).sum();
        (sum * scale) as f32
    };
    let data = dataset(folder, [12, 9], &set[..9], &set[..7], value)?;
    // The mean takes one, which is no component.
    let mut whole = pca::components(&data, Domain::Linear, 8)?;
    let row = whole.measure(rank, 16)?;
    let of_mean = whole.mean.iter().map(|m| (*m as f64).powi(2)).sum::<f64>() * 108.0;
    let rms = ((whole.energy + of_mean) / (108.0 * whole.mean.len() as f64)).sqrt();
    let largest_mean = whole.mean.iter().fold(0.0f32, |a, b| a.max(b.abs())) as f64;
    let bound = rms * 2f64.powi(-20) + largest_mean * 2f64.powi(-15);
    Ok(Outcome { condition: 8.0 - rank as f64, bound, measured: row.linear_rms })
}
