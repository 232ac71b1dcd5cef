//! Ensembles of orthonormal 4-D dictionaries in floats (SparseBTF 2023, equation 1): what training makes and
//! encoding projects on.
//!
//! The dictionaries of a channel share one basis of lights and one of views; each turns the first columns of
//! both in its own way and keeps the others. So the costly product with all directions is made once a block
//! (equation 3 in a subspace), and a dictionary adds small products only.

use crate::math::linear::{Basis, multiply, product, product_at};
use crate::methods::sparse_ensemble::model::DictionaryModel;
use faer::{MatMut, MatRef};

/// How one dictionary differs from the shared bases, and its bases over texels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turn {
    /// Turns the first columns of the light basis; `None` leaves them.
    pub light: Option<Basis>,
    /// Turns the first columns of the view basis.
    pub view: Option<Basis>,
    /// Basis along x.
    pub x: Basis,
    /// Basis along y.
    pub y: Basis,
}

/// The ensemble of one channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ensemble {
    /// Rows are light directions.
    pub light: Basis,
    /// Rows are view directions.
    pub view: Basis,
    /// The dictionaries.
    pub turns: Vec<Turn>,
    /// The integer columns of a dictionary file that the ensemble was read from.
    pub tables: Option<Vec<DictionaryModel>>,
}

/// Scratch of projections.
#[derive(Default)]
pub struct Scratch {
    a: Vec<f32>,
    b: Vec<f32>,
}

impl Ensemble {
    /// Texels along the side of a block.
    pub fn edge(&self) -> usize {
        self.turns[0].x.rows
    }

    /// The same angular bases with cosines over blocks of another edge; the ensemble itself if it has that
    /// edge.
    pub fn with_edge(&self, edge: usize) -> Ensemble {
        if edge == self.edge() {
            return self.clone();
        }
        let turns = self
            .turns
            .iter()
            .map(|turn| Turn { x: Basis::cosine(edge), y: Basis::cosine(edge), ..turn.clone() })
            .collect();
        Ensemble { turns, ..self.clone() }
    }

    /// Numbers of a core and of a tensor of coefficients: `[y][x][view column][light column]`.
    pub fn core_len(&self) -> usize {
        self.edge() * self.edge() * self.light.columns * self.view.columns
    }

    /// Bases of lights and views of one dictionary.
    pub fn angular(&self, dictionary: usize) -> [Basis; 2] {
        let turned = |basis: &Basis, turn: &Option<Basis>| {
            turn.as_ref().map_or_else(|| basis.clone(), |turn| basis.turned(turn))
        };
        let turn = &self.turns[dictionary];
        [turned(&self.light, &turn.light), turned(&self.view, &turn.view)]
    }

    /// A block `[texel][view][light]` in the shared bases: `[texel][view column][light column]`.
    pub fn to_core(&self, block: &[f32], scratch: &mut Scratch, core: &mut Vec<f32>) {
        let (lights, views) = (self.light.rows, self.view.rows);
        let (cl, cv) = (self.light.columns, self.view.columns);
        let texels = block.len() / (lights * views);
        scratch.a.resize(texels * views * cl, 0.0);
        core.resize(texels * cv * cl, 0.0);
        product(&mut scratch.a, block, &self.light.entries, [texels * views, lights, cl], false);
        for (out, from) in core.chunks_mut(cv * cl).zip(scratch.a.chunks(views * cl)) {
            product_at(out, &self.view.entries, from, [cv, views, cl], false);
        }
    }

    /// Coefficients of a core in one dictionary: `[y][x][view column][light column]`.
    pub fn to_coefficients(
        &self,
        dictionary: usize,
        core: &[f32],
        scratch: &mut Scratch,
        out: &mut Vec<f32>,
    ) {
        let (cl, cv, edge) = (self.light.columns, self.view.columns, self.edge());
        let turn = &self.turns[dictionary];
        let per_texel = cl * cv;
        out.resize(core.len(), 0.0);
        scratch.a.resize(core.len(), 0.0);
        scratch.b.resize(core.len(), 0.0);
        let mut current: &[f32] = core;
        if let Some(light) = &turn.light {
            let r = light.rows;
            scratch.b.copy_from_slice(current);
            let rows = core.len() / cl;
            multiply(
                // Row by row; the library's own function for that swaps the strides.
                MatMut::from_column_major_slice_with_stride_mut(&mut scratch.b, r, rows, cl).transpose_mut(),
                MatRef::from_row_major_slice_with_stride(current, rows, r, cl),
                MatRef::from_row_major_slice(&light.entries, r, r),
                false,
            );
            current = &scratch.b;
        }
        if let Some(view) = &turn.view {
            let r = view.rows;
            for (out, from) in scratch.a.chunks_mut(per_texel).zip(current.chunks(per_texel)) {
                product_at(&mut out[..r * cl], &view.entries, &from[..r * cl], [r, r, cl], false);
                out[r * cl..].copy_from_slice(&from[r * cl..]);
            }
        } else {
            scratch.a.copy_from_slice(current);
        }
        if edge == 1 {
            out.copy_from_slice(&scratch.a);
            return;
        }
        for (out, from) in scratch.b.chunks_mut(edge * per_texel).zip(scratch.a.chunks(edge * per_texel)) {
            product_at(out, &turn.x.entries, from, [edge, edge, per_texel], false);
        }
        product_at(out, &turn.y.entries, &scratch.b, [edge, edge, edge * per_texel], false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::linear::nearest_orthogonal;
    use crate::math::random::Random;

    #[test]
    fn coefficients_are_equation_3() {
        let mut random = Random::new(1);
        let mut any =
            |n: usize| -> Vec<f64> { (0..n).map(|_| random.range(-1000, 1000) as f64 / 1000.0).collect() };
        let (lights, views, edge, r) = (7, 5, 3, 4);
        let mut basis = |n: usize| nearest_orthogonal(&any(n * n), n).expect("finite");
        let turn = Turn { light: Some(basis(r)), view: Some(basis(r)), x: basis(edge), y: basis(edge) };
        let plain = Turn { light: None, view: None, x: basis(edge), y: basis(edge) };
        let ensemble = Ensemble {
            light: basis(lights).first(6),
            view: basis(views),
            turns: vec![turn, plain],
            tables: None,
        };
        let block: Vec<f32> = any(edge * edge * lights * views).iter().map(|&v| v as f32).collect();
        let (mut scratch, mut core, mut out) = (Scratch::default(), Vec::new(), Vec::new());
        ensemble.to_core(&block, &mut scratch, &mut core);
        for k in 0..2 {
            ensemble.to_coefficients(k, &core, &mut scratch, &mut out);
            let [light, view] = ensemble.angular(k);
            for (i, &got) in out.iter().enumerate() {
                let (l, v, x, y) = (i % 6, i / 6 % views, i / 6 / views % edge, i / 6 / views / edge);
                let term = |n: usize| {
                    let (a, b, p, q) = (
                        n % lights,
                        n / lights % views,
                        n / lights / views % edge,
                        n / lights / views / edge,
                    );
                    block[n]
                        * light.at(a, l)
                        * view.at(b, v)
                        * ensemble.turns[k].x.at(p, x)
                        * ensemble.turns[k].y.at(q, y)
                };
                let wanted = (0..block.len()).map(term).sum::<f32>();
                assert!((got - wanted).abs() < 1e-4, "{k} {i}: {got} {wanted}");
            }
        }
    }
}
