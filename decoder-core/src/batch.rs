//! Batches of filtered samples: the same bits as one at a time, with work shared by the material's method.

use crate::kernel::colour::Rgb;
use crate::method;
use crate::query::FilteredQuery;
use crate::selvedge::{BufferTooSmall, Selvedge};

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
