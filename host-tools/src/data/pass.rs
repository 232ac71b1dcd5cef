//! Passes over a dataset in batches of texels, for what never holds all of it.

use crate::data::dataset::Dataset;
use crate::error::Result;
use crate::work::{WAVE, ordered_in};
use std::cell::RefCell;

/// Texels of a batch.
pub const BATCH: usize = 64;

thread_local! {
    /// Bytes and values of a batch: mapping fresh memory for each would take longer than the work.
    static BUFFERS: RefCell<(Vec<u8>, Vec<f32>)> = const { RefCell::new((Vec::new(), Vec::new())) };
}

/// `fold(total, work(first texel, values))` over batches of [`BATCH`] texels, in the order of the texels. The
/// values of a batch are linear radiance, `[texel][view][light][colour]`.
///
/// # Errors
/// If the data cannot be read.
pub fn pass<T: Send, A>(
    dataset: &Dataset,
    work: impl Fn(usize, &[f32]) -> T + Sync,
    total: A,
    fold: impl FnMut(&mut A, T),
) -> Result<A> {
    pass_in(WAVE, dataset, work, total, fold)
}

/// As [`pass`], with at most `wave` batches at once.
///
/// # Errors
/// If the data cannot be read.
pub fn pass_in<T: Send, A>(
    wave: usize,
    dataset: &Dataset,
    work: impl Fn(usize, &[f32]) -> T + Sync,
    total: A,
    mut fold: impl FnMut(&mut A, T),
) -> Result<A> {
    let (texels, columns) = (dataset.description().texels(), dataset.description().texel_len());
    let part = |i: usize| -> Result<T> {
        let count = BATCH.min(texels - i * BATCH);
        BUFFERS.with_borrow_mut(|(bytes, values)| {
            values.resize(count * columns, 0.0);
            dataset.read(i * BATCH, count, bytes, values)?;
            Ok(work(i * BATCH, values))
        })
    };
    ordered_in(wave, texels.div_ceil(BATCH), part, total, |total, _, result| fold(total, result))
}
