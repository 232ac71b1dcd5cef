//! Dense matrices of training and encoding, row by row in plain slices, on top of `faer`.
//!
//! Everything runs on one thread: callers work in parallel on independent items and add up in a fixed
//! order, so that no number depends on how many threads there are.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve as _;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};
use half::slice::HalfFloatSliceExt as _;

/// `out = a * b` (or `out += a * b`) of matrices with any strides.
pub fn multiply(out: MatMut<'_, f32>, a: MatRef<'_, f32>, b: MatRef<'_, f32>, add: bool) {
    matmul(out, if add { Accum::Add } else { Accum::Replace }, a, b, 1.0, Par::Seq);
    clean_registers();
}

/// Clears the upper halves of the vector registers, to be called after `faer` has worked, which is why
/// nothing but this module lets it work.
///
/// Its microkernels for x86 return without `vzeroupper` (seen with faer 0.24), and from then on every scalar
/// instruction of the thread waits for registers that it does not read: the import of a `.btf` took four
/// times as long. A conversion from binary16 is compiled to leave them clean, and is the only instruction
/// sequence of that kind that can be had here without `unsafe`. It costs eight conversions.
fn clean_registers() {
    let mut numbers = [0.0; 8];
    [half::f16::ONE; 8].convert_to_f32_slice(&mut numbers);
    std::hint::black_box(numbers);
}

/// `out = a * b` (or `out += a * b`): `a` is `m x k`, `b` is `k x n`, row-major.
pub fn product(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3], add: bool) {
    let (a, b) = (MatRef::from_row_major_slice(a, m, k), MatRef::from_row_major_slice(b, k, n));
    multiply(MatMut::from_row_major_slice_mut(out, m, n), a, b, add);
}

/// `out = transpose(a) * b`: `a` is `k x m`, `b` is `k x n`, row-major.
pub fn product_at(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3], add: bool) {
    let (a, b) = (MatRef::from_row_major_slice(a, k, m).transpose(), MatRef::from_row_major_slice(b, k, n));
    multiply(MatMut::from_row_major_slice_mut(out, m, n), a, b, add);
}

/// `out = a * transpose(b)`: `a` is `m x k`, `b` is `n x k`, row-major.
pub fn product_bt(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3], add: bool) {
    let (a, b) = (MatRef::from_row_major_slice(a, m, k), MatRef::from_row_major_slice(b, n, k).transpose());
    multiply(MatMut::from_row_major_slice_mut(out, m, n), a, b, add);
}

/// A square or tall matrix of orthonormal columns, `rows x columns`, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Basis {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Entries.
    pub entries: Vec<f32>,
}

impl Basis {
    /// The identity.
    pub fn identity(n: usize) -> Basis {
        Basis {
            rows: n,
            columns: n,
            entries: (0..n * n).map(|i| if i / n == i % n { 1.0 } else { 0.0 }).collect(),
        }
    }

    /// From a function of row and column.
    pub fn from_fn(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f32) -> Basis {
        Basis {
            rows,
            columns,
            entries: (0..rows * columns).map(|i| entry(i / columns, i % columns)).collect(),
        }
    }

    /// One entry.
    pub fn at(&self, row: usize, column: usize) -> f32 {
        self.entries[row * self.columns + column]
    }

    /// The first columns alone.
    pub fn first(&self, columns: usize) -> Basis {
        Basis::from_fn(self.rows, columns, |r, c| self.at(r, c))
    }

    /// The cosine transform (DCT-II), orthonormal.
    pub fn cosine(n: usize) -> Basis {
        let entry = |row: usize, column: usize| {
            let norm = if column == 0 { (1.0 / n as f64).sqrt() } else { (2.0 / n as f64).sqrt() };
            (norm * (std::f64::consts::PI * (row as f64 + 0.5) * column as f64 / n as f64).cos()) as f32
        };
        Basis::from_fn(n, n, entry)
    }

    /// This basis turned: `self * turn` in its first `turn.rows` columns, the others as they are.
    pub fn turned(&self, turn: &Basis) -> Basis {
        let r = turn.rows;
        let entry = |row: usize, column: usize| {
            if column >= r {
                return self.at(row, column);
            }
            (0..r).map(|i| self.at(row, i) as f64 * turn.at(i, column) as f64).sum::<f64>() as f32
        };
        Basis::from_fn(self.rows, self.columns, entry)
    }

    /// Largest deviation of `transpose(self) * self` from the identity.
    pub fn defect(&self) -> f64 {
        let dot = |a: usize, b: usize| {
            (0..self.rows).map(|r| self.at(r, a) as f64 * self.at(r, b) as f64).sum::<f64>()
        };
        let pairs = (0..self.columns).flat_map(|a| (0..=a).map(move |b| (a, b)));
        pairs.map(|(a, b)| (dot(a, b) - if a == b { 1.0 } else { 0.0 }).abs()).fold(0.0, f64::max)
    }
}

/// Eigenvectors of a symmetric matrix by descending eigenvalue, each with its largest entry positive, and the
/// eigenvalues.
///
/// The matrix is `n x n`; what rounding makes negative becomes zero.
pub fn eigenbasis(matrix: &[f64], n: usize) -> (Basis, Vec<f64>) {
    let symmetric = faer::Mat::from_fn(n, n, |i, j| (matrix[i * n + j] + matrix[j * n + i]) / 2.0);
    let eigen = symmetric.self_adjoint_eigen(Side::Lower);
    clean_registers();
    let Ok(eigen) = eigen else {
        // Only for numbers that are not finite, which datasets refuse.
        return (Basis::identity(n), vec![0.0; n]);
    };
    let values: Vec<f64> = (0..n).map(|i| eigen.S().column_vector()[n - 1 - i].max(0.0)).collect();
    let sign = |column: usize| {
        let largest = (0..n).fold(0.0f64, |largest, row| {
            let entry = eigen.U()[(row, n - 1 - column)];
            // The first of nearly equal ones decides, so that symmetric columns do not flicker.
            if entry.abs() > largest.abs() * 1.000_001 { entry } else { largest }
        });
        if largest < 0.0 { -1.0 } else { 1.0 }
    };
    let signs: Vec<f64> = (0..n).map(sign).collect();
    (Basis::from_fn(n, n, |r, c| (eigen.U()[(r, n - 1 - c)] * signs[c]) as f32), values)
}

/// The orthogonal matrix nearest to an `n x n` matrix: the polar factor, which solves the Procrustes problem
/// `max trace(transpose(U) * matrix)`.
pub fn nearest_orthogonal(matrix: &[f64], n: usize) -> Option<Basis> {
    let m = faer::Mat::from_fn(n, n, |i, j| matrix[i * n + j]);
    let svd = m.svd().ok()?;
    let u = svd.U() * svd.V().transpose();
    clean_registers();
    u.as_ref()
        .col_iter()
        .all(|c| c.iter().all(|x| x.is_finite()))
        .then(|| Basis::from_fn(n, n, |r, c| u[(r, c)] as f32))
}

/// Orthonormal columns with the span of a tall matrix of so many columns, row-major.
pub fn orthonormal(matrix: &[f64], columns: usize) -> Mat<f64> {
    let q =
        Mat::from_fn(matrix.len() / columns, columns, |r, c| matrix[r * columns + c]).qr().compute_thin_Q();
    clean_registers();
    q
}

/// The solution of an `n x n` symmetric system for right sides of `n` rows, row-major; nothing if the matrix
/// is not positive definite.
pub fn solve_symmetric(matrix: impl Fn(usize, usize) -> f64, right: &[f64], n: usize) -> Option<Mat<f64>> {
    let columns = right.len() / n;
    let right = Mat::from_fn(n, columns, |r, c| right[r * columns + c]);
    let factor = Mat::from_fn(n, n, matrix).llt(Side::Lower).ok();
    let solution = factor.map(|factor| factor.solve(&right));
    clean_registers();
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn random(n: usize, seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed);
        (0..n).map(|_| random.range(-1000, 1000) as f64 / 1000.0).collect()
    }

    #[test]
    fn products_agree_with_their_definition() {
        let (m, k, n) = (5, 7, 3);
        let (a, b): (Vec<f32>, Vec<f32>) = (
            random(m * k, 1).iter().map(|&x| x as f32).collect(),
            random(k * n, 2).iter().map(|&x| x as f32).collect(),
        );
        let at: Vec<f32> = (0..k * m).map(|i| a[i % m * k + i / m]).collect();
        let bt: Vec<f32> = (0..n * k).map(|i| b[i % k * n + i / k]).collect();
        let (mut plain, mut by_at, mut by_bt) = (vec![0.0; m * n], vec![1.0; m * n], vec![0.0; m * n]);
        product(&mut plain, &a, &b, [m, k, n], false);
        product_at(&mut by_at, &at, &b, [m, k, n], true);
        product_bt(&mut by_bt, &a, &bt, [m, k, n], false);
        for i in 0..m * n {
            let wanted: f32 = (0..k).map(|j| a[i / n * k + j] * b[j * n + i % n]).sum();
            assert!(
                (plain[i] - wanted).abs() < 1e-5
                    && (by_at[i] - 1.0 - wanted).abs() < 1e-5
                    && (by_bt[i] - wanted).abs() < 1e-5
            );
        }
    }

    #[test]
    fn bases_are_orthonormal_and_best() {
        let n = 9;
        let (basis, values) = eigenbasis(&random(n * n, 3), n);
        assert!(basis.defect() < 1e-6 && values.windows(2).all(|pair| pair[0] >= pair[1]));
        let matrix = random(n * n, 4);
        let nearest = nearest_orthogonal(&matrix, n).expect("finite");
        assert!(nearest.defect() < 1e-6 && Basis::cosine(10).defect() < 1e-6);
        let trace = |u: &Basis| (0..n * n).map(|i| u.entries[i] as f64 * matrix[i]).sum::<f64>();
        for seed in 5..15 {
            let other = nearest_orthogonal(&random(n * n, seed), n).expect("finite");
            assert!(trace(&nearest) >= trace(&other));
        }
        // A singular matrix has a nearest one too.
        assert!(nearest_orthogonal(&vec![0.0; n * n], n).expect("finite").defect() < 1e-6);
    }
}
