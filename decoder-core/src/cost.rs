//! The stated price of a sample (chapter 4): operations, which are 32-bit multiplications of values.

/// Operations of a record of `count` coefficients at worst (4.2-2).
///
/// A coefficient dequantises (1), blends a light and a view column (6), multiplies both (1) and itself
/// (1); each change of the spatial atom blends (2) and multiplies (2), x and y apart.
pub const fn record_operations(count: u32, edge: u32) -> u64 {
    let n = count as u64;
    let atoms = (edge as u64) * (edge as u64);
    let changes_x = if n < atoms { n } else { atoms };
    let changes_y = if n < edge as u64 { n } else { edge as u64 };
    9 * n + 4 * changes_x + 4 * changes_y + 8
}

/// Operations of a layer of a sparse tensor at worst (4.2-4): four lists of `count` coefficients over `atoms`
/// ABRDF atoms, with `entries` in a fibre.
///
/// A coefficient takes two weights (3). An atom is evaluated once, whatever number of texels use it: for each
/// of three fibres an entry takes its weight (1), blends three channels of a light atom (9) and multiplies
/// them (3); then the weight goes into three channels (6).
pub const fn layer_operations(count: u32, atoms: u32, entries: u32) -> u64 {
    let met = 4 * count as u64;
    let distinct = if met < atoms as u64 { met } else { atoms as u64 };
    3 * met + distinct * (39 * entries as u64 + 6)
}

/// Operations to locate a direction at worst (4.2-3): the grid (2), every candidate (6), every edge of the
/// hull (6), the begin of the hull, what refines, a ratio and two cosines (7).
const fn locate_operations(candidates: u32, hull_count: u32) -> u64 {
    2 + 6 * candidates as u64 + 6 * hull_count as u64 + 7
}

/// What the cost of a sample depends on beside the records (4.2-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// Largest number of candidates in a cell of the light's and of the view's grid.
    pub candidates: [u32; 2],
    /// Hull edges of the light's and of the view's set.
    pub hull_counts: [u32; 2],
    /// Channels that are there.
    pub means: u32,
    /// Channels with scales.
    pub scales: u32,
}

/// Operations of a filtered sample at worst (4.2-1), limited to 32 bits.
///
/// `textures` is the largest sum, over the levels, of four times [`record_operations`] of every layer and
/// channel, or of [`layer_operations`] of every layer.
pub fn filtered_operations(shape: Shape, textures: u64) -> u32 {
    let ([light_candidates, view_candidates], [light_hull, view_hull]) =
        (shape.candidates, shape.hull_counts);
    let (light, view) =
        (locate_operations(light_candidates, light_hull), locate_operations(view_candidates, view_hull));
    let axes = 18;
    let colour = 102;
    let sum = axes + light + view + 15 * shape.means as u64 + 17 * shape.scales as u64 + textures + colour;
    sum.min(u32::MAX as u64) as u32
}
