//! Parallel work whose results are added up in a fixed order, so that no number depends on how many threads
//! there are.

use rayon::prelude::*;

/// Items worked on at once between two ordered additions.
pub const WAVE: usize = 16;

/// `fold(total, work(i))` for `i` ascending, the work in parallel: the same bits for any number of threads.
///
/// # Errors
/// The first of `work`, by its number within a wave.
pub fn ordered<T: Send, E: Send, A>(
    count: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
    total: A,
    fold: impl FnMut(&mut A, usize, T),
) -> Result<A, E> {
    ordered_in(WAVE, count, work, total, fold)
}

/// As [`ordered`], with at most `wave` results in memory: the same bits for any number of them.
///
/// # Errors
/// As [`ordered`].
pub fn ordered_in<T: Send, E: Send, A>(
    wave: usize,
    count: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
    mut total: A,
    mut fold: impl FnMut(&mut A, usize, T),
) -> Result<A, E> {
    for first in (0..count).step_by(wave) {
        let results: Vec<T> =
            (first..(first + wave).min(count)).into_par_iter().map(&work).collect::<Result<_, E>>()?;
        results.into_iter().enumerate().for_each(|(i, result)| fold(&mut total, first + i, result));
    }
    Ok(total)
}
