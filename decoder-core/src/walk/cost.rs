//! The stated price of a sample (chapter 4): operations, which are 32-bit multiplications of values.

/// Operations to locate a direction at worst (4.2-3): the grid (2), every candidate (6), every edge of the
/// hull (6), the begin of the hull, what refines, a ratio and two cosines (7).
const fn locate_operations(candidates: u32, hull_count: u32) -> u64 {
    (candidates as u64)
        .wrapping_mul(6)
        .wrapping_add(2)
        .wrapping_add((hull_count as u64).wrapping_mul(6))
        .wrapping_add(7)
}

/// What the common part of a sample's cost depends on (4.2-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// Largest number of candidates in a cell of the light's and of the view's grid.
    pub candidates: [u32; 2],
    /// Hull edges of the light's and of the view's set.
    pub hull_counts: [u32; 2],
    /// Channels with means.
    pub means: u32,
    /// Channels with scales.
    pub scales: u32,
}

/// Operations of the axes of a position (4.2-1).
const AXES: u64 = 18;
/// Operations of a table of means (4.2-1).
const MEAN: u64 = 15;
/// Operations of a table of scales (4.2-1).
const SCALE: u64 = 17;
/// Operations of matrix, transfer and presentation (4.2-1).
const COLOUR: u64 = 102;

/// Operations of a filtered sample at worst (4.2-1), saturated to 32 bits.
///
/// `textures` is the method's own part, as its chapter says: the largest of its levels.
pub fn filtered_operations(shape: Shape, textures: u64) -> u32 {
    let ([light_candidates, view_candidates], [light_hull, view_hull]) =
        (shape.candidates, shape.hull_counts);
    let light = locate_operations(light_candidates, light_hull);
    let view = locate_operations(view_candidates, view_hull);
    let tables = MEAN.wrapping_mul(shape.means as u64).wrapping_add(SCALE.wrapping_mul(shape.scales as u64));
    AXES.wrapping_add(light)
        .wrapping_add(view)
        .wrapping_add(tables)
        .wrapping_add(textures)
        .wrapping_add(COLOUR)
        .min(u32::MAX as u64) as u32
}
