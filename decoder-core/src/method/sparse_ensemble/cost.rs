//! What a sample of the sparse ensemble costs (4.2-2).
#![deny(clippy::arithmetic_side_effects)]

/// Operations of a record of `count` coefficients at worst (4.2-2).
///
/// A coefficient dequantises (1), blends a light and a view column (6), multiplies both (1) and itself
/// (1); each change of the spatial atom blends (2) and multiplies (2), x and y apart.
pub const fn record_operations(count: u32, edge: u32) -> u64 {
    let n = count as u64;
    let atoms = (edge as u64).wrapping_mul(edge as u64);
    let changes_x = if n < atoms { n } else { atoms };
    let changes_y = if n < edge as u64 { n } else { edge as u64 };
    n.wrapping_mul(9)
        .wrapping_add(changes_x.wrapping_mul(4))
        .wrapping_add(changes_y.wrapping_mul(4))
        .wrapping_add(8)
}
