//! Tables for pairs of directions, quantised: means (8.1) and scales (8.2).

use crate::error::{Result, ToolError};
use crate::format::model::PairTableModel;
use crate::format::units::{LARGEST_ENTRY, ONE_Q15, ONE_Q20};
use selvedge::container::pair_table::{BASE_BOUND, MEAN_SHIFT_LIMIT, SCALE_SHIFT_LIMIT};

/// Largest scale of a shift, so that its entry is not clipped.
const LARGEST_SCALE: f64 = 0.999;

/// Means in Q20 over the smallest range of 16 bits that holds them (8.1).
///
/// # Errors
/// [`ToolError::Usage`] if they are beyond the format.
pub fn quantise_means(means_q20: &[f64]) -> Result<PairTableModel> {
    let (low, high) =
        means_q20.iter().fold((f64::MAX, f64::MIN), |(low, high), &q| (low.min(q), high.max(q)));
    let base = ((low + high) / 2.0).round().clamp(-BASE_BOUND as f64, BASE_BOUND as f64);
    let fits = |shift: u32| (high - base).max(base - low) / 2f64.powi(shift as i32) < LARGEST_ENTRY + 0.5;
    let Some(shift) = (0..=MEAN_SHIFT_LIMIT).find(|&shift| fits(shift)) else {
        return Err(ToolError::Usage(format!(
            "means from {:e} to {:e} are beyond the format",
            low / ONE_Q20,
            high / ONE_Q20
        )));
    };
    let entry = |q: &f64| clip((q - base) / 2f64.powi(shift as i32));
    Ok(PairTableModel { base_q20: base as i32, shift, entries: means_q20.iter().map(entry).collect() })
}

/// Scales, 1 for a texture as it is, in the finest unit that holds them (8.2).
///
/// # Errors
/// [`ToolError::Usage`] if they are beyond the format.
pub fn quantise_scales(scales: &[f64]) -> Result<PairTableModel> {
    let largest = scales.iter().fold(0.0f64, |largest, s| largest.max(s.abs()));
    let fits = |shift: u32| largest / 2f64.powi(shift as i32) < LARGEST_SCALE;
    let Some(shift) = (0..=SCALE_SHIFT_LIMIT).find(|&shift| fits(shift)) else {
        return Err(ToolError::Usage(format!("a scale of {largest:e} is beyond the format")));
    };
    let unit = ONE_Q15 / 2f64.powi(shift as i32);
    Ok(PairTableModel { base_q20: 0, shift, entries: scales.iter().map(|s| clip(s * unit)).collect() })
}

/// The nearest entry.
fn clip(value: f64) -> i16 {
    value.round().clamp(-LARGEST_ENTRY, LARGEST_ENTRY) as i16
}
