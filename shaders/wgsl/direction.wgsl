// Directions and their triangulation (chapter 5). Twin: decoder-core/src/kernel/direction.rs.
//
// A direction is a point of the unit disc under the stereographic projection x/(1+z), y/(1+z), with
// its cosine in Q15. Samples have 14 fraction bits, so that every orientation test is exact in 32 bits;
// a query has four more, which refine the weights once its triangle is found. A set is located by a grid
// of candidate triangles; beyond the hull the point moves to the nearest place on it.

// One in Q14: the radius of the disc.
const ONE_Q14: i32 = 16384;
// One in Q18.
const ONE_Q18: i32 = 262144;
// One in Q30.
const ONE_Q30: i32 = 0x40000000;

// A direction of the upper hemisphere, or below it with a zero cosine.
struct Direction {
    x_q18: i32,
    y_q18: i32,
    z_q15: i32,
}

// Three sample directions of a set and their weights, which sum to ONE_Q15 exactly.
struct Taps {
    a: u32,
    b: u32,
    c: u32,
    weight_a_q15: i32,
    weight_b_q15: i32,
    weight_c_q15: i32,
    cosine_q15: i32,
}

// A direction that was located in a set: what a method is given for the light and for the view.
struct Located {
    direction: Direction,
    clamped_x_q18: i32,
    clamped_y_q18: i32,
    taps: Taps,
}

// |value| as Q30 with its sign, from binary32 bits; magnitudes of one and more, infinities and NaN give one (5.2-1).
fn binary32_to_q30(bits: u32) -> i32 {
    let exponent = (bits >> 23u) & 0xffu;
    let mantissa = (bits & 0x7fffffu) | 0x800000u;
    // 5.2-1: a value below one has an exponent field of at most 126; it is mantissa * 2^(exponent - 150).
    let shift = 126u - exponent;
    var magnitude = ONE_Q30;
    if (exponent < 127u) {
        magnitude = 0;
        if (shift < 31u) {
            magnitude = round_shift(i32(mantissa << 6u), shift);
        }
    }
    if ((bits >> 31u) != 0u) {
        return -magnitude;
    }
    return magnitude;
}

// round(|n| / d * 2^18) with the sign of n, for |n| <= d (5.2-2).
fn project_q18(n: i32, d: u32) -> i32 {
    // 5.2-2: one more bit than needed, then halves up.
    let magnitude = i32((divide(u32(abs(n)), d, 19u) + 1u) >> 1u);
    if (n < 0) {
        return -magnitude;
    }
    return magnitude;
}

// The direction of a unit vector given as three binary32 bit patterns (5.2-3).
fn direction_from_binary32(x_bits: u32, y_bits: u32, z_bits: u32) -> Direction {
    let x_q30 = binary32_to_q30(x_bits);
    let y_q30 = binary32_to_q30(y_bits);
    let z_q30 = binary32_to_q30(z_bits);
    // 5.2-3: below the horizon the point is that of the mirrored vector and the cosine is zero.
    let d = u32(ONE_Q30) + u32(abs(z_q30));
    return Direction(project_q18(x_q30, d), project_q18(y_q30, d), round_shift(max(z_q30, 0), 15u));
}

// The direction with every part within its range (5.1-2).
fn clamp_direction(direction: Direction) -> Direction {
    // 5.1-2: what lies outside the ranges is moved to their ends.
    return Direction(
        max(min(direction.x_q18, ONE_Q18), -ONE_Q18),
        max(min(direction.y_q18, ONE_Q18), -ONE_Q18),
        max(min(direction.z_q15, ONE_Q15), 0),
    );
}

// One sample direction alone (5.1-3).
fn single_tap(index: u32) -> Taps {
    // 5.1-3: the other two weights are zero.
    return Taps(index, index, index, ONE_Q15, 0, 0, ONE_Q15);
}

// A sample direction as a query (5.1-4).
fn sample_direction(start: u32, index: u32) -> Direction {
    let pair = point(start, index);
    // 5.1-4: the same point with four zero bits, and its cosine.
    return Direction(low_i16(pair) << 4u, high_i16(pair) << 4u, point_z_q15(start, index));
}

// First word of the sample directions of the set at `start` (5.3).
fn points_start(start: u32) -> u32 {
    return start + 8u;
}

// First word of the triangles (5.3).
fn triangles_start(start: u32) -> u32 {
    return points_start(start) + word(start) * 2u;
}

// First word of the hull (5.3).
fn hull_start(start: u32) -> u32 {
    return triangles_start(start) + word(start + 1u) * 3u;
}

// First word of the grid (5.3).
fn grid_start(start: u32) -> u32 {
    return hull_start(start) + word(start + 2u) * 2u;
}

// The point of sample direction `index`: x in the low half, y in the high, Q14 (5.3-3).
fn point(start: u32, index: u32) -> u32 {
    return word(points_start(start) + index * 2u);
}

// Cosine of sample direction `index`, Q15 (5.3-4).
fn point_z_q15(start: u32, index: u32) -> i32 {
    return i32(word(points_start(start) + index * 2u + 1u));
}

// Twice the signed area of the triangle a, b, p: positive if p is left of a to b (5.4-1).
fn cross(ax: i32, ay: i32, bx: i32, by: i32, px: i32, py: i32) -> i32 {
    // 5.4-1: exact.
    let first = (bx - ax) * (py - ay);
    let second = (by - ay) * (px - ax);
    return first - second;
}

// part / whole in Q15 by the stored reciprocal of the whole, halves up, at most `limit` (5.4-2).
fn ratio_q15(part: i32, shift: u32, reciprocal: u32, limit: i32) -> i32 {
    // 5.4-2: part >> shift has 16 bits or fewer and the product is below 2^31 + 2^16.
    let ratio = ((u32(part) >> shift) * reciprocal + u32(HALF_Q15) * 2u) >> 16u;
    return min(i32(ratio), limit);
}

// The nearest point with 14 fraction bits (5.4-6).
fn coarse_q14(q18: i32) -> i32 {
    // 5.4-6: halves up; at most 2^14.
    return (q18 + 8) >> 4u;
}

// An area or a product along an edge, moved by what a query has beyond 14 fraction bits, and kept from zero to the whole (5.4-7).
fn refine(part: i32, whole: i32, step_x: i32, step_y: i32, rest_x: i32, rest_y: i32) -> i32 {
    // 5.4-7: the sum of products is within 2^19.
    let moved = part + ((step_x * rest_x + step_y * rest_y) >> 4u);
    return max(min(moved, whole), 0);
}

// The cell of the grid along one axis (5.5-1).
fn grid_cell(q14: i32, grid_size: u32) -> u32 {
    // 5.5-1: the last cell is closed.
    let cell = (u32(q14 + ONE_Q14) * grid_size) >> 15u;
    return min(cell, grid_size - 1u);
}

// A sample direction as one that was located: itself, with one tap (8.5).
fn locate_sample(start: u32, index: u32) -> Located {
    let direction = sample_direction(start, index);
    // 5.7-9: its point is on the hull or inside.
    return Located(direction, direction.x_q18, direction.y_q18, single_tap(index));
}

// A direction located in the set at `start` (5.6).
fn locate(start: u32, asked: Direction) -> Located {
    let direction = clamp_direction(asked);
    let px = coarse_q14(direction.x_q18);
    let py = coarse_q14(direction.y_q18);
    let triangles = triangles_start(start);
    let grid = grid_start(start);
    let grid_size = word(start + 3u);
    let cell = grid_cell(py, grid_size) * grid_size + grid_cell(px, grid_size);
    let candidates = grid + grid_size * grid_size + 1u;
    let last = word(grid + cell + 1u);
    var candidate = word(grid + cell);
    // 5.6-1: the first candidate that has the point inside or on its border.
    while (candidate < last) {
        let triangle = triangles + word(candidates + candidate) * 3u;
        let first = word(triangle);
        let second = word(triangle + 1u);
        let a = first & 0xffffu;
        let b = first >> 16u;
        let c = second & 0xffffu;
        let point_a = point(start, a);
        let point_b = point(start, b);
        let point_c = point(start, c);
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
        if ((area_a | area_b | area_c) >= 0) {
            // 5.6-2: two weights by reciprocal, from areas at the query's full precision; the last is what is left.
            let rest_x = direction.x_q18 - (px << 4u);
            let rest_y = direction.y_q18 - (py << 4u);
            let whole = area_a + area_b + area_c;
            let fine_a = refine(area_a, whole, by - cy, cx - bx, rest_x, rest_y);
            let fine_b = refine(area_b, whole, cy - ay, ax - cx, rest_x, rest_y);
            let shift = second >> 16u;
            let reciprocal = word(triangle + 2u);
            let weight_a = ratio_q15(fine_a, shift, reciprocal, ONE_Q15);
            let weight_b = ratio_q15(fine_b, shift, reciprocal, ONE_Q15 - weight_a);
            let weight_c = ONE_Q15 - weight_a - weight_b;
            // 5.6-3: at and below the horizon no light arrives. select(if false, if true, condition)
            let cosine = select(0, ONE_Q15, direction.z_q15 > 0);
            let taps = Taps(a, b, c, weight_a, weight_b, weight_c, cosine);
            // 5.7-9: inside the hull the point is the direction's own.
            return Located(direction, direction.x_q18, direction.y_q18, taps);
        }
        candidate += 1u;
    }
    return locate_on_hull(start, direction);
}

// A direction whose point no triangle holds, located at the nearest place on the hull (5.7).
fn locate_on_hull(start: u32, direction: Direction) -> Located {
    let px = coarse_q14(direction.x_q18);
    let py = coarse_q14(direction.y_q18);
    let hull = hull_start(start);
    let hull_count = word(start + 2u);
    // 5.7-4: a set of one direction has no hull.
    if (hull_count == 0u) {
        return beyond_hull(start, direction, 0u, 0u, 0);
    }
    // 5.7-1: the last edge is looked at first, so that the first knows what precedes it.
    let last = point(start, word(hull + (hull_count - 1u) * 2u) & 0xffffu);
    var first = word(hull);
    var a = first & 0xffffu;
    var point_a = point(start, a);
    var past_previous = dot_product(low_i16(point_a), high_i16(point_a), low_i16(last), high_i16(last), px, py) < 0;
    var corner = a;
    var edge = 0u;
    while (edge < hull_count) {
        // select(if false, if true, condition)
        let next = select(0u, edge + 1u, edge + 1u < hull_count);
        let second = word(hull + next * 2u);
        let b = second & 0xffffu;
        let point_b = point(start, b);
        let ax = low_i16(point_a);
        let ay = high_i16(point_a);
        let bx = low_i16(point_b);
        let by = high_i16(point_b);
        let along = dot_product(ax, ay, bx, by, px, py);
        let left = dot_product(bx, by, ax, ay, px, py);
        let outside = cross(bx, by, ax, ay, px, py);
        // 5.7-2: the foot of the perpendicular lies on this edge and the point is not inside of it.
        if ((along | left | outside) >= 0) {
            let reciprocal = word(hull + edge * 2u + 1u);
            let rest_x = direction.x_q18 - (px << 4u);
            let rest_y = direction.y_q18 - (py << 4u);
            let fine = refine(along, along + left, bx - ax, by - ay, rest_x, rest_y);
            let weight_b = ratio_q15(fine, first >> 16u, reciprocal, ONE_Q15);
            return beyond_hull(start, direction, a, b, weight_b);
        }
        // 5.7-3: between two edges: past the end of the one, before the begin of the other.
        if (past_previous && along < 0) {
            corner = a;
        }
        past_previous = left < 0;
        first = second;
        a = b;
        point_a = point_b;
        edge += 1u;
    }
    return beyond_hull(start, direction, corner, corner, 0);
}

// Dot product of a to b with a to p (5.7-1).
fn dot_product(ax: i32, ay: i32, bx: i32, by: i32, px: i32, py: i32) -> i32 {
    // 5.7-1: exact.
    let first = (bx - ax) * (px - ax);
    let second = (by - ay) * (py - ay);
    return first + second;
}

// A coordinate between two directions of the hull, Q18 (5.7-9).
fn between_q18(a_q14: i32, b_q14: i32, weight_b_q15: i32) -> i32 {
    // 5.7-9: from Q29 to Q18, halves up.
    return (a_q14 << 4u) + (((b_q14 - a_q14) * weight_b_q15 + 1024) >> 11u);
}

// Located between two directions of the hull, with the cosine beyond it (5.7-5).
fn beyond_hull(start: u32, direction: Direction, a: u32, b: u32, weight_b: i32) -> Located {
    let weight_a = ONE_Q15 - weight_b;
    let za = point_z_q15(start, a) * weight_a;
    let zb = point_z_q15(start, b) * weight_b;
    // 5.7-5: z over the clamped z, and one where the clamped z is not larger; zero at the horizon (5.6-3).
    let sampled = (za + zb + HALF_Q15) >> 15u;
    // select(if false, if true, condition)
    var cosine = select(0, ONE_Q15, direction.z_q15 > 0);
    if (direction.z_q15 < sampled) {
        cosine = i32(divide(u32(direction.z_q15), u32(sampled), 15u));
    }
    let taps = Taps(a, b, a, weight_a, weight_b, 0, cosine);
    let point_a = point(start, a);
    let point_b = point(start, b);
    // 5.7-9: the point on the hull.
    return Located(
        direction,
        between_q18(low_i16(point_a), low_i16(point_b), weight_b),
        between_q18(high_i16(point_a), high_i16(point_b), weight_b),
        taps,
    );
}
