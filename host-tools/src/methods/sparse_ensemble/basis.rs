//! Sparse records in the span of another dictionary (SparseBTF 2023, equations 8 and 9).
//!
//! The authors' dictionaries are whole orthonormal bases, and the change from one to another is a product
//! of two of them for each mode. Stored columns are some of a basis, each scaled to its own maximum. So the
//! change for a mode is the least-squares solution over the columns that are there; what lies outside of
//! their span is lost, and measured.

use crate::format::units::ONE_Q15;
use crate::methods::sparse_ensemble::model::{AtomModel, DictionaryModel, FactorModel};

/// Coefficients on atoms, of which only the columns count.
pub type Sparse = Vec<(AtomModel, f64)>;

/// A dense matrix, row by row.
#[derive(Clone, Debug, Default)]
struct Matrix {
    columns: usize,
    entries: Vec<f64>,
}

impl Matrix {
    fn at(&self, row: usize, column: usize) -> f64 {
        self.entries[row * self.columns + column]
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.entries[row * self.columns..][..self.columns]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// All inner products of two lists of vectors.
fn products(a: &[Vec<f64>], b: &[Vec<f64>]) -> Matrix {
    Matrix { columns: b.len(), entries: a.iter().flat_map(|a| b.iter().map(move |b| dot(a, b))).collect() }
}

/// Columns of the four factors, and their inner products, by mode: light, view, x, y.
#[derive(Debug)]
pub struct Basis {
    columns: [Vec<Vec<f64>>; 4],
    gram: [Matrix; 4],
}

/// An atom's columns by mode.
fn modes(atom: &AtomModel) -> [usize; 4] {
    [atom.light, atom.view, atom.x, atom.y].map(|column| column as usize)
}

fn columns_of(factor: &FactorModel) -> Vec<Vec<f64>> {
    let count = factor.columns as usize;
    (0..count)
        .map(|column| {
            factor.entries.iter().skip(column).step_by(count).map(|&entry| entry as f64 / ONE_Q15).collect()
        })
        .collect()
}

/// `M b` as a tensor `[y][x][view][light]`, for a product of matrices by mode with `from` columns and `to`
/// rows.
fn apply(matrices: &[Matrix; 4], record: &Sparse, from: [usize; 4], to: [usize; 4]) -> Vec<f64> {
    let mut sizes = from;
    let mut tensor = vec![0.0; sizes.iter().product()];
    for (atom, value) in record {
        let [l, v, x, y] = modes(atom);
        tensor[((y * sizes[2] + x) * sizes[1] + v) * sizes[0] + l] += value;
    }
    for (mode, matrix) in matrices.iter().enumerate() {
        let inner: usize = sizes[..mode].iter().product();
        let outer: usize = sizes[mode + 1..].iter().product();
        let mut next = vec![0.0; inner * to[mode] * outer];
        for block in 0..outer {
            let (source, target) = (
                &tensor[block * sizes[mode] * inner..],
                &mut next[block * to[mode] * inner..][..to[mode] * inner],
            );
            for column in 0..sizes[mode] {
                let source = &source[column * inner..][..inner];
                if source.iter().all(|&s| s == 0.0) {
                    continue;
                }
                for (row, target) in target.chunks_mut(inner).enumerate() {
                    let factor = matrix.at(row, column);
                    target.iter_mut().zip(source).for_each(|(t, s)| *t += factor * s);
                }
            }
        }
        tensor = next;
        sizes[mode] = to[mode];
    }
    tensor
}

/// `a^T M b` for a product of matrices by mode.
fn form(matrices: &[Matrix; 4], a: &Sparse, b: &Sparse) -> f64 {
    let [light, view, x, y] = matrices;
    // Coefficient by coefficient for short records; long ones as tensors, a mode at a time.
    let from = matrices.each_ref().map(|m| m.columns);
    let to = matrices.each_ref().map(|m| m.entries.len() / m.columns.max(1));
    let dense = from.iter().product::<usize>() * to[0]
        + to[0] * from[1] * from[2] * from[3] * (to[1] + to[2] + to[3]);
    if a.len() * b.len() > dense {
        let applied = apply(matrices, b, from, to);
        return a
            .iter()
            .map(|(p, c)| {
                c * applied[((p.y as usize * to[2] + p.x as usize) * to[1] + p.view as usize) * to[0]
                    + p.light as usize]
            })
            .sum();
    }
    let of = |p: &AtomModel| {
        let [pl, pv, px, py] = modes(p);
        let (rl, rv, rx, ry) = (light.row(pl), view.row(pv), x.row(px), y.row(py));
        b.iter()
            .map(|(q, c)| {
                c * rx[q.x as usize] * ry[q.y as usize] * rl[q.light as usize] * rv[q.view as usize]
            })
            .sum::<f64>()
    };
    a.iter().map(|(p, c)| c * of(p)).sum()
}

impl Basis {
    /// Of a dictionary.
    pub fn new(dictionary: &DictionaryModel) -> Basis {
        let columns = [&dictionary.light, &dictionary.view, &dictionary.x, &dictionary.y].map(columns_of);
        let gram = std::array::from_fn(|mode| products(&columns[mode], &columns[mode]));
        Basis { columns, gram }
    }

    /// Sum of the squares of what a record stands for, over all texels of the block and pairs of directions.
    pub fn energy(&self, record: &Sparse) -> f64 {
        form(&self.gram, record, record).max(0.0)
    }

    /// The norm of an atom's product of columns.
    fn norm(&self, atom: &AtomModel) -> f64 {
        modes(atom).iter().zip(&self.gram).map(|(&column, gram)| gram.at(column, column).sqrt()).product()
    }

    /// The sum of two records, and all but its `cap` largest coefficients left out.
    pub fn sum(&self, a: &Sparse, b: &Sparse, cap: usize) -> Sparse {
        let mut all: Sparse = a.iter().chain(b).copied().collect();
        all.sort_by_key(|(atom, _)| atom.word() >> 4);
        all.dedup_by(|next, first| {
            let same = next.0.word() >> 4 == first.0.word() >> 4;
            first.1 += if same { next.1 } else { 0.0 };
            same
        });
        self.largest(all, cap)
    }

    fn largest(&self, mut record: Sparse, cap: usize) -> Sparse {
        if record.len() > cap {
            record.sort_by(|a, b| (b.1.abs() * self.norm(&b.0)).total_cmp(&(a.1.abs() * self.norm(&a.0))));
            record.truncate(cap);
            record.sort_by_key(|(atom, _)| atom.word() >> 4);
        }
        record
    }
}

/// Indices of columns that do not depend on those before, their orthonormal basis, and the triangular matrix
/// that leads back: column `kept[j]` is the sum over `i <= j` of `triangle[j][i] * orthonormal[i]`.
struct Orthonormal {
    kept: Vec<usize>,
    orthonormal: Vec<Vec<f64>>,
    triangle: Vec<Vec<f64>>,
}

impl Orthonormal {
    fn new(columns: &[Vec<f64>]) -> Orthonormal {
        let mut result = Orthonormal { kept: Vec::new(), orthonormal: Vec::new(), triangle: Vec::new() };
        for (number, column) in columns.iter().enumerate() {
            let length = dot(column, column).sqrt();
            let mut rest = column.clone();
            let mut parts = vec![0.0; result.orthonormal.len()];
            // Twice is enough for orthogonality to rounding.
            for _ in 0..2 {
                for (part, q) in parts.iter_mut().zip(&result.orthonormal) {
                    let along = dot(&rest, q);
                    *part += along;
                    rest.iter_mut().zip(q).for_each(|(rest, q)| *rest -= along * q);
                }
            }
            let left = dot(&rest, &rest).sqrt();
            // What is shorter is the rounding of entries to 16 bits; its coefficients would be large and mean
            // nothing.
            if left > length * 1e-3 {
                parts.push(left);
                result.orthonormal.push(rest.iter().map(|rest| rest / left).collect());
                result.triangle.push(parts);
                result.kept.push(number);
            }
        }
        result
    }

    /// Coefficients on all columns for coordinates in the orthonormal basis.
    fn solve(&self, mut coordinates: Vec<f64>, columns: usize) -> Vec<f64> {
        let mut solution = vec![0.0; columns];
        for j in (0..self.kept.len()).rev() {
            let x = coordinates[j] / self.triangle[j][j];
            coordinates.iter_mut().zip(&self.triangle[j]).for_each(|(c, t)| *c -= x * t);
            solution[self.kept[j]] = x;
        }
        solution
    }
}

/// From the span of one dictionary into that of another.
#[derive(Debug)]
pub struct Change {
    /// Inner products of target columns and others.
    cross: [Matrix; 4],
    /// Inner products of the others' projections.
    inside: [Matrix; 4],
    /// `weights[mode][target column, other column]`, each row times the norm of the target column.
    weights: [Matrix; 4],
    /// Norms of the target's columns.
    norms: [Vec<f64>; 4],
}

impl Change {
    /// Of coefficients on `other` to coefficients on `target`.
    pub fn new(target: &Basis, other: &Basis) -> Change {
        let norms: [Vec<f64>; 4] = std::array::from_fn(|mode| {
            (0..target.columns[mode].len()).map(|i| target.gram[mode].at(i, i).sqrt()).collect()
        });
        let mut inside: [Matrix; 4] = Default::default();
        let mut weights: [Matrix; 4] = Default::default();
        for mode in 0..4 {
            let (to, from) = (&target.columns[mode], &other.columns[mode]);
            let basis = Orthonormal::new(to);
            let coordinates: Vec<Vec<f64>> = from
                .iter()
                .map(|column| basis.orthonormal.iter().map(|q| dot(q, column)).collect())
                .collect();
            inside[mode] = products(&coordinates, &coordinates);
            let solved: Vec<Vec<f64>> =
                coordinates.into_iter().map(|coordinates| basis.solve(coordinates, to.len())).collect();
            let entries = (0..to.len())
                .flat_map(|row| solved.iter().map(move |column| (row, column[row])))
                .map(|(row, x)| x * norms[mode][row]);
            weights[mode] = Matrix { columns: from.len(), entries: entries.collect() };
        }
        Change {
            cross: std::array::from_fn(|mode| products(&target.columns[mode], &other.columns[mode])),
            inside,
            weights,
            norms,
        }
    }

    /// Energy of what the target's span can hold of a record.
    pub fn energy_inside(&self, other: &Sparse) -> f64 {
        form(&self.inside, other, other).max(0.0)
    }

    /// Inner product of what a record of the target and one of the other stand for.
    pub fn product(&self, target: &Sparse, other: &Sparse) -> f64 {
        form(&self.cross, target, other)
    }

    /// A record of the target plus the projection of one of the other: its largest coefficients, up to `cap`.
    pub fn sum(&self, target: &Basis, own: &Sparse, other: &Sparse, cap: usize) -> Sparse {
        let mut own_sum: Sparse = own
            .iter()
            .map(|&(atom, value)| {
                let norm: f64 =
                    modes(&atom).iter().zip(&self.norms).map(|(&column, norms)| norms[column]).product();
                // Where the column is zero nothing can be added.
                let added =
                    if norm > 0.0 { form(&self.weights, &vec![(atom, 1.0)], other) / norm } else { 0.0 };
                (atom, value + added)
            })
            .collect();
        own_sum.sort_by_key(|(atom, _)| atom.word() >> 4);
        let is_own = |atom: &AtomModel| {
            own_sum.binary_search_by_key(&(atom.word() >> 4), |(own, _)| own.word() >> 4).is_ok()
        };
        let more: Sparse = self
            .largest_projected(other, cap + own.len())
            .into_iter()
            .filter(|(atom, _)| !is_own(atom))
            .collect();
        target.sum(&own_sum, &more, cap)
    }

    /// The largest coefficients of the projection of a record, by what they contribute.
    ///
    /// The projection is dense. It is formed mode by mode, x and y first, and a row of lights only if its
    /// norm leaves room for a coefficient that is large enough.
    fn largest_projected(&self, other: &Sparse, count: usize) -> Sparse {
        let [by_light, by_view, by_x, by_y] = &self.weights;
        let [light_norms, view_norms, x_norms, y_norms] = &self.norms;
        let mut pairs: Vec<(u32, u32)> = other.iter().map(|(atom, _)| (atom.light, atom.view)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut lights: Vec<u32> = pairs.iter().map(|pair| pair.0).collect();
        lights.dedup();
        let place_of_light: Vec<usize> =
            pairs.iter().map(|pair| lights.partition_point(|&light| light < pair.0)).collect();
        let place_of_pair: Vec<usize> = other
            .iter()
            .map(|(atom, _)| pairs.partition_point(|&pair| pair < (atom.light, atom.view)))
            .collect();
        let reach = (0..light_norms.len())
            .map(|row| dot(by_light.row(row), by_light.row(row)).sqrt())
            .fold(0.0, f64::max);

        let mut best = Largest { count, least: 0.0, list: Vec::new() };
        let mut of_pair = vec![0.0; pairs.len()];
        let mut of_light = vec![0.0; lights.len()];
        for (y, x) in (0..y_norms.len()).flat_map(|y| (0..x_norms.len()).map(move |x| (y, x))) {
            of_pair.fill(0.0);
            for ((atom, value), &pair) in other.iter().zip(&place_of_pair) {
                of_pair[pair] += value * by_x.at(x, atom.x as usize) * by_y.at(y, atom.y as usize);
            }
            for (view, view_norm) in view_norms.iter().enumerate() {
                of_light.fill(0.0);
                let weights = by_view.row(view);
                for ((pair, value), &place) in pairs.iter().zip(&of_pair).zip(&place_of_light) {
                    of_light[place] += value * weights[pair.1 as usize];
                }
                if dot(&of_light, &of_light).sqrt() * reach <= best.least {
                    continue;
                }
                for (light, &light_norm) in light_norms.iter().enumerate() {
                    let weights = by_light.row(light);
                    let magnitude: f64 = lights
                        .iter()
                        .zip(&of_light)
                        .map(|(&light, value)| value * weights[light as usize])
                        .sum();
                    let norm = light_norm * view_norm * x_norms[x] * y_norms[y];
                    if magnitude.abs() > best.least && norm > 0.0 {
                        let atom = AtomModel {
                            light: light as u32,
                            view: view as u32,
                            x: x as u32,
                            y: y as u32,
                            ..AtomModel::default()
                        };
                        best.push(magnitude.abs(), (atom, magnitude / norm));
                    }
                }
            }
        }
        best.cut();
        best.list.into_iter().map(|(_, coefficient)| coefficient).collect()
    }
}

/// The `count` largest of what is pushed.
struct Largest {
    count: usize,
    /// Nothing that is not larger can be among them.
    least: f64,
    list: Vec<(f64, (AtomModel, f64))>,
}

impl Largest {
    fn push(&mut self, magnitude: f64, coefficient: (AtomModel, f64)) {
        self.list.push((magnitude, coefficient));
        if self.list.len() >= 2 * self.count + 64 {
            self.cut();
        }
    }

    fn cut(&mut self) {
        if self.list.len() > self.count && self.count > 0 {
            self.list.select_nth_unstable_by(self.count - 1, |a, b| b.0.total_cmp(&a.0));
            self.least = self.list[self.count - 1].0;
        }
        self.list.truncate(self.count);
    }
}
