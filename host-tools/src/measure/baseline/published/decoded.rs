//! The published layout decoded from what it stores: images and filtered samples.

use crate::math::linear::Basis;
use crate::measure::baseline::decoder::{At, Blend, Decoder, EXPONENTIAL, Pairs, add_row};
use crate::methods::sparse_ensemble::sparsebtf::{LOG_OFFSET, YUV_TO_RGB};

/// Texels along the side of a block.
pub const EDGE: usize = 10;

/// A row of a matrix times a column.
pub(super) fn row_times(m: &[f32; 3], v: [f32; 3]) -> f32 {
    m[0] * v[0] + m[1] * v[1] + m[2] * v[2]
}

/// A coefficient and its place.
#[derive(Clone, Copy)]
pub(super) struct Term {
    pub(super) value: f32,
    pub(super) light: u16,
    pub(super) view: u16,
    pub(super) x: u8,
    pub(super) y: u8,
    pub(super) dictionary: u16,
}

/// The layout decoded from what it stores.
pub struct Decoded {
    /// Terms of all blocks, three channels each, largest first.
    pub(super) terms: Vec<Term>,
    /// Where the terms of a block's channel end.
    pub(super) ends: Vec<usize>,
    /// Of each channel's dictionaries: bases of lights and views, of x, of y.
    pub(super) bases: [Vec<([Basis; 2], Basis, Basis)>; 3],
    pub(super) means: Vec<f32>,
    pub(super) deviations: Vec<f32>,
    pub(super) size: [usize; 2],
    pub(super) lights: usize,
    pub(super) bytes: u64,
}

impl Decoded {
    fn terms(&self, block: usize, channel: usize) -> &[Term] {
        let i = block * 3 + channel;
        &self.terms[if i == 0 { 0 } else { self.ends[i - 1] }..self.ends[i]]
    }

    /// The angular factor of a term between directions: the columns of each pair times its standard
    /// deviation, as the published shader has it.
    #[inline(always)]
    fn angular(&self, channel: usize, term: &Term, light: Blend, view: Blend) -> f32 {
        let [of_lights, of_views] = &self.bases[channel][term.dictionary as usize].0;
        let mut sum = 0.0;
        for (v, weight_v) in view.parts() {
            let mut inner = 0.0;
            for (l, weight_l) in light.parts() {
                inner +=
                    weight_l * of_lights.at(l, term.light as usize) * self.deviations[v * self.lights + l];
            }
            sum += weight_v * of_views.at(v, term.view as usize) * inner;
        }
        term.value * sum
    }

    fn mean(&self, light: Blend, view: Blend) -> f32 {
        Pairs::of(light, view, self.lights).iter().map(|&(pair, weight)| weight * self.means[pair]).sum()
    }

    fn back(yuv: [f32; 3]) -> [f32; 3] {
        YUV_TO_RGB.map(|row| (row_times(&row.map(|m| m as f32), yuv).exp() - LOG_OFFSET).max(0.0))
    }
}

impl Decoder for Decoded {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]) {
        let [width, height] = self.size;
        let across = width.div_ceil(EDGE);
        for (&light, out) in lights.iter().zip(out.chunks_mut(width * height)) {
            let mean = self.mean(light, view);
            for block in 0..self.ends.len() / 3 {
                let (left, top) = (block % across * EDGE, block / across * EDGE);
                let mut planes = [[mean; EDGE * EDGE]; 3];
                for (c, plane) in planes.iter_mut().enumerate() {
                    let terms = self.terms(block, c);
                    let Some(first) = terms.first() else { continue };
                    let (_, x_basis, y_basis) = &self.bases[c][first.dictionary as usize];
                    let (mut core, mut rows) = ([0.0f32; EDGE * EDGE], [0.0f32; EDGE * EDGE]);
                    terms.iter().for_each(|term| {
                        core[term.y as usize * EDGE + term.x as usize] += self.angular(c, term, light, view)
                    });
                    for (y, row) in rows.chunks_mut(EDGE).enumerate() {
                        (0..EDGE).for_each(|k| add_row(row, y_basis.at(y, k), &core[k * EDGE..][..EDGE]));
                    }
                    for (row, out) in rows.chunks(EDGE).zip(plane.chunks_mut(EDGE)) {
                        out.iter_mut().enumerate().for_each(|(x, out)| {
                            *out += (0..EDGE).map(|k| x_basis.at(x, k) * row[k]).sum::<f32>()
                        });
                    }
                }
                for y in top..height.min(top + EDGE) {
                    for x in left..width.min(left + EDGE) {
                        let i = (y - top) * EDGE + x - left;
                        out[y * width + x] = Decoded::back(planes.each_ref().map(|plane| plane[i]));
                    }
                }
            }
        }
    }

    fn filtered(&self, at: &At) -> [f32; 3] {
        let across = self.size[0].div_ceil(EDGE);
        let mut yuv = [self.mean(at.light, at.view); 3];
        // Blocks between which the sample is, each with the blended rows of its texels.
        for (block_y, part_y) in parts_of(at.y) {
            for (block_x, part_x) in parts_of(at.x) {
                for (c, value) in yuv.iter_mut().enumerate() {
                    for term in self.terms(block_y * across + block_x, c) {
                        let (_, x_basis, y_basis) = &self.bases[c][term.dictionary as usize];
                        let of = |basis: &Basis, part: [(usize, f32); 2], column: u8| -> f32 {
                            part.iter().map(|&(row, weight)| weight * basis.at(row, column as usize)).sum()
                        };
                        *value += self.angular(c, term, at.light, at.view)
                            * of(x_basis, part_x, term.x)
                            * of(y_basis, part_y, term.y);
                    }
                }
            }
        }
        Decoded::back(yuv)
    }

    fn operations(&self, at: &At) -> u64 {
        let across = self.size[0].div_ceil(EDGE);
        let (views, lights) = (at.view.parts().count() as u64, at.light.parts().count() as u64);
        let mut terms = 0;
        for (block_y, _) in parts_of(at.y) {
            for (block_x, _) in parts_of(at.x) {
                terms += (0..3).map(|c| self.terms(block_y * across + block_x, c).len() as u64).sum::<u64>();
            }
        }
        // A term: two products for each pair of directions and one for a view, its value, two rows of two
        // texels, and both.
        terms * (views * (2 * lights + 2) + 1 + 4 + 2) + 2 * views * lights + 9 + 3 * EXPONENTIAL
    }

    fn two_nearest(&self) -> bool {
        true
    }
}

/// The blocks that two texels of an axis are of, and their rows and weights within.
fn parts_of(axis: [(usize, f32); 2]) -> impl Iterator<Item = (usize, [(usize, f32); 2])> {
    let [(a, weight_a), (b, weight_b)] = axis;
    let same = a / EDGE == b / EDGE;
    let first = (a / EDGE, [(a % EDGE, weight_a), (b % EDGE, if same { weight_b } else { 0.0 })]);
    let second = (!same && weight_b != 0.0).then_some((b / EDGE, [(b % EDGE, weight_b), (b % EDGE, 0.0)]));
    std::iter::once(first).chain(second)
}
