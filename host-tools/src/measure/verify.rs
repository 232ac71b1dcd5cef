//! What an encoder made, opened and decoded against its data.

use crate::data::dataset::Dataset;
use crate::error::{Result, ToolError};
use crate::measure::compare::{Comparison, Metrics};
use crate::measure::radiance::AtLevel;
use selvedge::{Limits, Selvedge};

/// Opens what an encoder made: that it breaks a rule is the encoder's fault.
///
/// # Errors
/// [`ToolError::Mismatch`] if it does.
pub fn open_made<'a>(bytes: &'a [u8], dictionary: Option<&'a [u8]>) -> Result<Selvedge<'a>> {
    let opened = selvedge::open_with(bytes, dictionary, &Limits::NONE);
    opened.map_err(|finding| {
        ToolError::Mismatch(format!("the encoder wrote a file that breaks a rule: {finding}"))
    })
}

/// Decodes what an encoder made of some data, at every texel and every N-th light: errors, and the operations
/// that it states.
///
/// # Errors
/// If it breaks a rule, or data cannot be read.
pub fn verify(
    data: &Dataset,
    bytes: &[u8],
    dictionary: Option<&[u8]>,
    every: usize,
    progress: &dyn Fn(usize, usize),
) -> Result<(Metrics, u32)> {
    let file = open_made(bytes, dictionary)?;
    let (offset, peak) = (data.statistics().log_offset(), Some(data.statistics().largest as f64));
    let comparison = Comparison { description: data.description(), log_offset: offset, peak, every };
    let metrics = comparison.run(data, &AtLevel::finest(&file), progress)?;
    Ok((metrics, file.header().operations))
}
