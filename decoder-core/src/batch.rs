//! Batches of filtered samples: the same bits as one at a time, with work shared by the material's method.

use crate::kernel::colour::Rgb;
use crate::kernel::direction::Direction;
use crate::method;
use crate::selvedge::{BufferTooSmall, Selvedge, position_from_f32};

/// A filtered sample to be made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilteredQuery {
    /// u0.32 fraction of the image along x.
    pub u_q32: u32,
    /// u0.32 fraction of the image along y.
    pub v_q32: u32,
    /// Light direction.
    pub light: Direction,
    /// View direction.
    pub view: Direction,
}

impl FilteredQuery {
    /// From a position of any magnitude, which wraps, and unit vectors in the material's tangent frame.
    pub fn from_f32(position: [f32; 2], light: [f32; 3], view: [f32; 3]) -> FilteredQuery {
        let [u_q32, v_q32] = position.map(position_from_f32);
        FilteredQuery {
            u_q32,
            v_q32,
            light: Direction::from_unit_vector(light),
            view: Direction::from_unit_vector(view),
        }
    }
}

impl Selvedge<'_> {
    /// Words of scratch that [`Selvedge::sample_batch`] needs for `count` queries.
    pub fn batch_scratch_len(&self, count: usize) -> usize {
        method::fast::batch_scratch_len(self, count)
    }

    /// Radiance of many filtered samples: `out[i]` equals [`Selvedge::filtered`] of `queries[i]`, bit for
    /// bit.
    ///
    /// The more queries at once, the more of them share a block; tens of thousands are a good batch, and
    /// fewer than 2^28 a legal one.
    ///
    /// # Errors
    /// If `out` is shorter than `queries`, or `scratch` than [`Selvedge::batch_scratch_len`].
    pub fn sample_batch(
        &self,
        queries: &[FilteredQuery],
        scratch: &mut [i32],
        out: &mut [Rgb],
    ) -> Result<(), BufferTooSmall> {
        if out.len() < queries.len() {
            return Err(BufferTooSmall { needed: queries.len(), lent: out.len() });
        }
        let (needed, lent) = (self.batch_scratch_len(queries.len()), scratch.len());
        method::fast::batch(self, queries, scratch, out).ok_or(BufferTooSmall { needed, lent })
    }
}
