//! What a sample of the sparse tensor costs (4.2-4).
#![deny(clippy::arithmetic_side_effects)]

/// Operations of a layer of a sparse tensor at worst (4.2-4): four lists of `count` coefficients over `atoms`
/// ABRDF atoms, with `entries` in a fibre.
///
/// A coefficient takes two weights (3). An atom is evaluated once, whatever number of texels use it: for each
/// of three fibres an entry takes its weight (1), blends three channels of a light atom (9) and multiplies
/// them (3); then the weight goes into three channels (6).
pub const fn layer_operations(count: u32, atoms: u32, entries: u32) -> u64 {
    let met = (count as u64).wrapping_mul(4);
    let distinct = if met < atoms as u64 { met } else { atoms as u64 };
    met.wrapping_mul(3).wrapping_add(distinct.wrapping_mul((entries as u64).wrapping_mul(39).wrapping_add(6)))
}
