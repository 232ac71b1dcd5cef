//! Directions and their triangulation (chapter 5). Twin: `shaders/wgsl/direction.wgsl`.
//!
//! A direction is a point of the unit disc under the stereographic projection `x/(1+z), y/(1+z)`, with
//! its cosine in Q15. Samples have 14 fraction bits, so that every orientation test is exact in 32 bits;
//! a query has four more, which refine the weights once its triangle is found. A set is located by a grid
//! of candidate triangles; beyond the hull the point moves to the nearest place on it.

use crate::kernel::fixed::{HALF_Q15, ONE_Q15, divide, round_shift};
use crate::kernel::words::{Words, high_i16, low_i16, word};

/// One in Q14: the radius of the disc.
pub const ONE_Q14: i32 = 16384;
/// One in Q18.
pub const ONE_Q18: i32 = 262_144;
/// One in Q30.
pub const ONE_Q30: i32 = 0x4000_0000;

/// A direction of the upper hemisphere, or below it with a zero cosine. The default is one without light: the
/// point of the normal, with a cosine of zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Direction {
    /// `x / (1 + z)`, in `-ONE_Q18 ..= ONE_Q18`.
    pub x_q18: i32,
    /// `y / (1 + z)`, in `-ONE_Q18 ..= ONE_Q18`.
    pub y_q18: i32,
    /// Cosine of the angle from the surface normal, in `0 ..= ONE_Q15`.
    pub z_q15: i32,
}

/// Three sample directions of a set and their weights, which sum to `ONE_Q15` exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Taps {
    /// First direction.
    pub a: u32,
    /// Second direction.
    pub b: u32,
    /// Third direction.
    pub c: u32,
    /// Weight of the first.
    pub weight_a_q15: i32,
    /// Weight of the second.
    pub weight_b_q15: i32,
    /// Weight of the third.
    pub weight_c_q15: i32,
    /// Cosine asked for over cosine sampled: `ONE_Q15` within the hull, less beyond it, zero below the
    /// horizon.
    pub cosine_q15: i32,
}

/// A direction that was located in a set: what a method is given for the light and for the view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Located {
    /// The direction that was asked for, every part within its range.
    pub direction: Direction,
    /// Its point in the disc, moved onto the hull where it lies beyond, along x.
    pub clamped_x_q18: i32,
    /// The same along y.
    pub clamped_y_q18: i32,
    /// The sample directions around it and their weights.
    pub taps: Taps,
}

/// `|value|` as Q30 with its sign, from binary32 bits; magnitudes of one and more, infinities and NaN give
/// one (5.2-1).
pub fn binary32_to_q30(bits: u32) -> i32 {
    let exponent = (bits >> 23) & 0xff;
    let mantissa = (bits & 0x7f_ffff) | 0x80_0000;
    // 5.2-1: a value below one has an exponent field of at most 126; it is mantissa * 2^(exponent - 150).
    let shift = 126u32.wrapping_sub(exponent);
    let mut magnitude = ONE_Q30;
    if exponent < 127 {
        magnitude = if shift < 31 { round_shift((mantissa << 6) as i32, shift) } else { 0 };
    }
    if (bits >> 31) != 0 {
        return magnitude.wrapping_neg();
    }
    magnitude
}

/// `round(|n| / d * 2^18)` with the sign of `n`, for `|n| <= d` (5.2-2).
pub fn project_q18(n: i32, d: u32) -> i32 {
    // 5.2-2: one more bit than needed, then halves up.
    let magnitude = (divide(n.unsigned_abs(), d, 19).wrapping_add(1) >> 1) as i32;
    if n < 0 {
        return magnitude.wrapping_neg();
    }
    magnitude
}

/// The direction of a unit vector given as three binary32 bit patterns (5.2-3).
pub fn direction_from_binary32(x_bits: u32, y_bits: u32, z_bits: u32) -> Direction {
    let x_q30 = binary32_to_q30(x_bits);
    let y_q30 = binary32_to_q30(y_bits);
    let z_q30 = binary32_to_q30(z_bits);
    // 5.2-3: below the horizon the point is that of the mirrored vector and the cosine is zero.
    let d = (ONE_Q30 as u32).wrapping_add(z_q30.unsigned_abs());
    Direction {
        x_q18: project_q18(x_q30, d),
        y_q18: project_q18(y_q30, d),
        z_q15: round_shift(z_q30.max(0), 15),
    }
}

/// The direction with every part within its range (5.1-2).
pub fn clamp_direction(direction: Direction) -> Direction {
    // 5.1-2: what lies outside the ranges is moved to their ends.
    Direction {
        x_q18: direction.x_q18.min(ONE_Q18).max(-ONE_Q18),
        y_q18: direction.y_q18.min(ONE_Q18).max(-ONE_Q18),
        z_q15: direction.z_q15.min(ONE_Q15).max(0),
    }
}

/// One sample direction alone (5.1-3).
pub fn single_tap(index: u32) -> Taps {
    // 5.1-3: the other two weights are zero.
    Taps {
        a: index,
        b: index,
        c: index,
        weight_a_q15: ONE_Q15,
        weight_b_q15: 0,
        weight_c_q15: 0,
        cosine_q15: ONE_Q15,
    }
}

/// A sample direction as a query (5.1-4).
pub fn sample_direction(words: Words<'_>, start: u32, index: u32) -> Direction {
    let pair = point(words, start, index);
    // 5.1-4: the same point with four zero bits, and its cosine.
    Direction {
        x_q18: low_i16(pair) << 4,
        y_q18: high_i16(pair) << 4,
        z_q15: point_z_q15(words, start, index),
    }
}

/// First word of the sample directions of the set at `start` (5.3).
pub fn points_start(start: u32) -> u32 {
    start.wrapping_add(8)
}

/// First word of the triangles (5.3).
pub fn triangles_start(words: Words<'_>, start: u32) -> u32 {
    points_start(start).wrapping_add(word(words, start).wrapping_mul(2))
}

/// First word of the hull (5.3).
pub fn hull_start(words: Words<'_>, start: u32) -> u32 {
    triangles_start(words, start).wrapping_add(word(words, start.wrapping_add(1)).wrapping_mul(3))
}

/// First word of the grid (5.3).
pub fn grid_start(words: Words<'_>, start: u32) -> u32 {
    hull_start(words, start).wrapping_add(word(words, start.wrapping_add(2)).wrapping_mul(2))
}

/// The point of sample direction `index`: x in the low half, y in the high, Q14 (5.3-3).
pub fn point(words: Words<'_>, start: u32, index: u32) -> u32 {
    word(words, points_start(start).wrapping_add(index.wrapping_mul(2)))
}

/// Cosine of sample direction `index`, Q15 (5.3-4).
pub fn point_z_q15(words: Words<'_>, start: u32, index: u32) -> i32 {
    word(words, points_start(start).wrapping_add(index.wrapping_mul(2)).wrapping_add(1)) as i32
}

/// Twice the signed area of the triangle `a`, `b`, `p`: positive if `p` is left of `a` to `b` (5.4-1).
///
/// Each difference is at most 2^15 and each product at most 2^30, so nothing overflows.
pub fn cross(ax: i32, ay: i32, bx: i32, by: i32, px: i32, py: i32) -> i32 {
    // 5.4-1: exact.
    let first = bx.wrapping_sub(ax).wrapping_mul(py.wrapping_sub(ay));
    let second = by.wrapping_sub(ay).wrapping_mul(px.wrapping_sub(ax));
    first.wrapping_sub(second)
}

/// `part / whole` in Q15 by the stored reciprocal of the whole, halves up, at most `limit` (5.4-2).
pub fn ratio_q15(part: i32, shift: u32, reciprocal: u32, limit: i32) -> i32 {
    // 5.4-2: part >> shift has 16 bits or fewer and the product is below 2^31 + 2^16.
    let ratio = ((part as u32) >> shift).wrapping_mul(reciprocal).wrapping_add(HALF_Q15 as u32 * 2) >> 16;
    (ratio as i32).min(limit)
}

/// The nearest point with 14 fraction bits (5.4-6).
pub fn coarse_q14(q18: i32) -> i32 {
    // 5.4-6: halves up; at most 2^14.
    q18.wrapping_add(8) >> 4
}

/// An area or a product along an edge, moved by what a query has beyond 14 fraction bits, and kept from zero
/// to the whole (5.4-7).
///
/// `step_x` and `step_y` are what one unit of Q14 adds, at most 2^15; the rests are -8 to 7 sixteenths.
pub fn refine(part: i32, whole: i32, step_x: i32, step_y: i32, rest_x: i32, rest_y: i32) -> i32 {
    // 5.4-7: the sum of products is within 2^19.
    let moved = part.wrapping_add(step_x.wrapping_mul(rest_x).wrapping_add(step_y.wrapping_mul(rest_y)) >> 4);
    moved.min(whole).max(0)
}

/// The cell of the grid along one axis (5.5-1).
pub fn grid_cell(q14: i32, grid_size: u32) -> u32 {
    // 5.5-1: the last cell is closed.
    let cell = (q14.wrapping_add(ONE_Q14) as u32).wrapping_mul(grid_size) >> 15;
    cell.min(grid_size.wrapping_sub(1))
}

/// A sample direction as one that was located: itself, with one tap (8.5).
pub fn locate_sample(words: Words<'_>, start: u32, index: u32) -> Located {
    let direction = sample_direction(words, start, index);
    // 5.7-9: its point is on the hull or inside.
    Located {
        direction,
        clamped_x_q18: direction.x_q18,
        clamped_y_q18: direction.y_q18,
        taps: single_tap(index),
    }
}

/// A direction located in the set at `start` (5.6).
pub fn locate(words: Words<'_>, start: u32, asked: Direction) -> Located {
    let direction = clamp_direction(asked);
    let px = coarse_q14(direction.x_q18);
    let py = coarse_q14(direction.y_q18);
    let triangles = triangles_start(words, start);
    let grid = grid_start(words, start);
    let grid_size = word(words, start.wrapping_add(3));
    let cell = grid_cell(py, grid_size).wrapping_mul(grid_size).wrapping_add(grid_cell(px, grid_size));
    let candidates = grid.wrapping_add(grid_size.wrapping_mul(grid_size)).wrapping_add(1);
    let last = word(words, grid.wrapping_add(cell).wrapping_add(1));
    let mut candidate = word(words, grid.wrapping_add(cell));
    // 5.6-1: the first candidate that has the point inside or on its border.
    while candidate < last {
        let triangle =
            triangles.wrapping_add(word(words, candidates.wrapping_add(candidate)).wrapping_mul(3));
        let first = word(words, triangle);
        let second = word(words, triangle.wrapping_add(1));
        let a = first & 0xffff;
        let b = first >> 16;
        let c = second & 0xffff;
        let point_a = point(words, start, a);
        let point_b = point(words, start, b);
        let point_c = point(words, start, c);
        let ax = low_i16(point_a);
        let ay = high_i16(point_a);
        let bx = low_i16(point_b);
        let by = high_i16(point_b);
        let cx = low_i16(point_c);
        let cy = high_i16(point_c);
        let area_a = cross(bx, by, cx, cy, px, py);
        let area_b = cross(cx, cy, ax, ay, px, py);
        let area_c = cross(ax, ay, bx, by, px, py);
        // One test for three signs: the sign bit of the union is set if any is negative.
        if (area_a | area_b | area_c) >= 0 {
            // 5.6-2: two weights by reciprocal, from areas at the query's full precision; the last is what is
            // left.
            let rest_x = direction.x_q18.wrapping_sub(px << 4);
            let rest_y = direction.y_q18.wrapping_sub(py << 4);
            let whole = area_a.wrapping_add(area_b).wrapping_add(area_c);
            let fine_a = refine(area_a, whole, by.wrapping_sub(cy), cx.wrapping_sub(bx), rest_x, rest_y);
            let fine_b = refine(area_b, whole, cy.wrapping_sub(ay), ax.wrapping_sub(cx), rest_x, rest_y);
            let shift = second >> 16;
            let reciprocal = word(words, triangle.wrapping_add(2));
            let weight_a = ratio_q15(fine_a, shift, reciprocal, ONE_Q15);
            let weight_b = ratio_q15(fine_b, shift, reciprocal, ONE_Q15.wrapping_sub(weight_a));
            let weight_c = ONE_Q15.wrapping_sub(weight_a).wrapping_sub(weight_b);
            // 5.6-3: at and below the horizon no light arrives.
            let cosine = if direction.z_q15 > 0 { ONE_Q15 } else { 0 };
            let taps = Taps {
                a,
                b,
                c,
                weight_a_q15: weight_a,
                weight_b_q15: weight_b,
                weight_c_q15: weight_c,
                cosine_q15: cosine,
            };
            // 5.7-9: inside the hull the point is the direction's own.
            return Located {
                direction,
                clamped_x_q18: direction.x_q18,
                clamped_y_q18: direction.y_q18,
                taps,
            };
        }
        candidate = candidate.wrapping_add(1);
    }
    locate_on_hull(words, start, direction)
}

/// A direction whose point no triangle holds, located at the nearest place on the hull (5.7).
pub fn locate_on_hull(words: Words<'_>, start: u32, direction: Direction) -> Located {
    let px = coarse_q14(direction.x_q18);
    let py = coarse_q14(direction.y_q18);
    let hull = hull_start(words, start);
    let hull_count = word(words, start.wrapping_add(2));
    // 5.7-4: a set of one direction has no hull.
    if hull_count == 0 {
        return beyond_hull(words, start, direction, 0, 0, 0);
    }
    // 5.7-1: the last edge is looked at first, so that the first knows what precedes it.
    let last = point(
        words,
        start,
        word(words, hull.wrapping_add(hull_count.wrapping_sub(1).wrapping_mul(2))) & 0xffff,
    );
    let mut first = word(words, hull);
    let mut a = first & 0xffff;
    let mut point_a = point(words, start, a);
    let mut past_previous =
        dot_product(low_i16(point_a), high_i16(point_a), low_i16(last), high_i16(last), px, py) < 0;
    let mut corner = a;
    let mut edge = 0u32;
    while edge < hull_count {
        let next = if edge.wrapping_add(1) < hull_count { edge.wrapping_add(1) } else { 0 };
        let second = word(words, hull.wrapping_add(next.wrapping_mul(2)));
        let b = second & 0xffff;
        let point_b = point(words, start, b);
        let ax = low_i16(point_a);
        let ay = high_i16(point_a);
        let bx = low_i16(point_b);
        let by = high_i16(point_b);
        let along = dot_product(ax, ay, bx, by, px, py);
        let left = dot_product(bx, by, ax, ay, px, py);
        let outside = cross(bx, by, ax, ay, px, py);
        // 5.7-2: the foot of the perpendicular lies on this edge and the point is not inside of it.
        if (along | left | outside) >= 0 {
            let reciprocal = word(words, hull.wrapping_add(edge.wrapping_mul(2)).wrapping_add(1));
            let rest_x = direction.x_q18.wrapping_sub(px << 4);
            let rest_y = direction.y_q18.wrapping_sub(py << 4);
            let fine = refine(
                along,
                along.wrapping_add(left),
                bx.wrapping_sub(ax),
                by.wrapping_sub(ay),
                rest_x,
                rest_y,
            );
            let weight_b = ratio_q15(fine, first >> 16, reciprocal, ONE_Q15);
            return beyond_hull(words, start, direction, a, b, weight_b);
        }
        // 5.7-3: between two edges: past the end of the one, before the begin of the other.
        if past_previous && along < 0 {
            corner = a;
        }
        past_previous = left < 0;
        first = second;
        a = b;
        point_a = point_b;
        edge = edge.wrapping_add(1);
    }
    beyond_hull(words, start, direction, corner, corner, 0)
}

/// Dot product of `a` to `b` with `a` to `p` (5.7-1).
///
/// At most |b-a| |p-a| <= 2^15 * 39,555 < 2^31, and each product at most 2^30.
pub fn dot_product(ax: i32, ay: i32, bx: i32, by: i32, px: i32, py: i32) -> i32 {
    // 5.7-1: exact.
    let first = bx.wrapping_sub(ax).wrapping_mul(px.wrapping_sub(ax));
    let second = by.wrapping_sub(ay).wrapping_mul(py.wrapping_sub(ay));
    first.wrapping_add(second)
}

/// A coordinate between two directions of the hull, Q18 (5.7-9).
///
/// Coordinates are within 2^14, so the product is within 2^30.
pub fn between_q18(a_q14: i32, b_q14: i32, weight_b_q15: i32) -> i32 {
    // 5.7-9: from Q29 to Q18, halves up.
    (a_q14 << 4).wrapping_add(b_q14.wrapping_sub(a_q14).wrapping_mul(weight_b_q15).wrapping_add(1024) >> 11)
}

/// Located between two directions of the hull, with the cosine beyond it (5.7-5).
pub fn beyond_hull(
    words: Words<'_>,
    start: u32,
    direction: Direction,
    a: u32,
    b: u32,
    weight_b: i32,
) -> Located {
    let weight_a = ONE_Q15.wrapping_sub(weight_b);
    let za = point_z_q15(words, start, a).wrapping_mul(weight_a);
    let zb = point_z_q15(words, start, b).wrapping_mul(weight_b);
    // 5.7-5: z over the clamped z, and one where the clamped z is not larger; zero at the horizon (5.6-3).
    let sampled = za.wrapping_add(zb).wrapping_add(HALF_Q15) >> 15;
    let mut cosine = if direction.z_q15 > 0 { ONE_Q15 } else { 0 };
    if direction.z_q15 < sampled {
        cosine = divide(direction.z_q15 as u32, sampled as u32, 15) as i32;
    }
    let taps = Taps {
        a,
        b,
        c: a,
        weight_a_q15: weight_a,
        weight_b_q15: weight_b,
        weight_c_q15: 0,
        cosine_q15: cosine,
    };
    let point_a = point(words, start, a);
    let point_b = point(words, start, b);
    // 5.7-9: the point on the hull.
    Located {
        direction,
        clamped_x_q18: between_q18(low_i16(point_a), low_i16(point_b), weight_b),
        clamped_y_q18: between_q18(high_i16(point_a), high_i16(point_b), weight_b),
        taps,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn binary32_becomes_q30() {
        let mut state = 1u32;
        for i in 0..200_000u32 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value =
                if i % 2 == 0 { f32::from_bits(state) } else { (state as i32) as f32 / 2_147_483_648.0 };
            let got = binary32_to_q30(value.to_bits());
            let exact = if value.is_nan() {
                if value.is_sign_negative() { -1.0 } else { 1.0 }
            } else {
                (value as f64).clamp(-1.0, 1.0)
            };
            let want = (exact.abs() * ONE_Q30 as f64 + 0.5).floor().copysign(exact);
            assert_eq!(got as f64, want, "{value}");
        }
    }

    #[test]
    fn vectors_are_projected() {
        for (vector, want) in [
            ([0.0f32, 0.0, 1.0], (0, 0, ONE_Q15)),
            ([1.0, 0.0, 0.0], (ONE_Q18, 0, 0)),
            ([0.0, -1.0, 0.0], (0, -ONE_Q18, 0)),
            ([0.6, 0.0, 0.8], (87_381, 0, 26214)),
            ([0.6, 0.0, -0.8], (87_381, 0, 0)),
            ([0.0, 0.0, -1.0], (0, 0, 0)),
            ([f32::NAN, f32::INFINITY, f32::NEG_INFINITY], (ONE_Q18 / 2, ONE_Q18 / 2, 0)),
        ] {
            let [x, y, z] = vector.map(f32::to_bits);
            let got = direction_from_binary32(x, y, z);
            assert_eq!((got.x_q18, got.y_q18, got.z_q15), want, "{vector:?}");
        }
    }
}
