//! Checks that a set of directions is one that `locate` can trust (chapters 5.3 to 5.7).
//!
//! The proof that the cover is valid: the hull is a convex polygon turned through once; every triangle
//! has positive area; every side of a triangle is the side of one neighbour, reversed, or of the hull.
//! So the triangles' boundary is the hull, and each point of it lies in exactly one triangle or on
//! sides. The grid lists every triangle that meets a cell, so the first hit is always found.

use crate::error::Rule;
use crate::kernel::direction::{
    cross, dot_product, grid_cell, grid_start, hull_start, point, triangles_start,
};
use crate::kernel::words::{high_i16, low_i16, word};
use crate::walk::check::{Check, Section};

/// Most triangles that a cell lists (5.5-5).
pub const CELL_LIMIT: u32 = 256;

/// A point in Q14.
type Point = (i32, i32);

/// The set under check, by word numbers.
struct Set {
    start: u32,
    offset: u32,
    count: u32,
    triangle_count: u32,
    hull_count: u32,
    grid_size: u32,
    candidate_count: u32,
    triangles: u32,
    hull: u32,
    grid: u32,
}

/// Shift and reciprocal of a doubled area or a squared length, `1 <= whole <= 2^30` (5.4-4).
///
/// Rounded up, so that the whole over itself is one: a sample direction is met exactly.
pub fn reciprocal_of(whole: u32) -> (u32, u32) {
    let shift = 16u32.saturating_sub(whole.leading_zeros());
    (shift, (1u32 << 31).div_ceil((whole >> shift).max(1)))
}

/// The cosine of a point of the disc, Q15 (5.3-4): `(1 - r^2) / (1 + r^2)`, halves up.
pub fn cosine_of(x_q14: i32, y_q14: i32) -> u32 {
    let square = (x_q14 as i64)
        .wrapping_mul(x_q14 as i64)
        .wrapping_add((y_q14 as i64).wrapping_mul(y_q14 as i64)) as u64;
    let one = 1u64 << 28;
    let below = one.wrapping_add(square);
    ((one.saturating_sub(square)) << 16).wrapping_add(below).checked_div(below.wrapping_mul(2)).unwrap_or(0)
        as u32
}

/// First and last Q14 coordinate of cell `cell` of `grid_size` (5.5-1).
pub fn cell_range(cell: u32, grid_size: u32) -> (i32, i32) {
    let first = |cell: u32| ((cell << 15).div_ceil(grid_size.max(1)) as i32).wrapping_sub(16384);
    let last =
        if cell.wrapping_add(1) >= grid_size { 16384 } else { first(cell.wrapping_add(1)).wrapping_sub(1) };
    (first(cell), last)
}

/// Whether a triangle meets a cell, sides and corners included (5.5-3): no side has the whole cell outside.
pub fn meets_cell(triangle: [Point; 3], x: (i32, i32), y: (i32, i32)) -> bool {
    let [a, b, c] = triangle;
    let low = |f: fn(Point) -> i32| f(a).min(f(b)).min(f(c));
    let high = |f: fn(Point) -> i32| f(a).max(f(b)).max(f(c));
    if low(|p| p.0) > x.1 || high(|p| p.0) < x.0 || low(|p| p.1) > y.1 || high(|p| p.1) < y.0 {
        return false;
    }
    [(a, b), (b, c), (c, a)].iter().all(|&(p, q)| {
        // The corner furthest to the left of the side decides.
        let corner_x = if q.1 >= p.1 { x.0 } else { x.1 };
        let corner_y = if q.0 >= p.0 { y.1 } else { y.0 };
        cross(p.0, p.1, q.0, q.1, corner_x, corner_y) >= 0
    })
}

impl Set {
    fn point(&self, check: &Check<'_, '_>, index: u32) -> Point {
        let pair = point(check.words, self.start, index);
        (low_i16(pair), high_i16(pair))
    }

    fn corners(&self, check: &Check<'_, '_>, triangle: u32) -> [u32; 3] {
        let at = self.triangles.wrapping_add(triangle.wrapping_mul(3));
        let first = word(check.words, at);
        [first & 0xffff, first >> 16, word(check.words, at.wrapping_add(1)) & 0xffff]
    }

    fn triangle(&self, check: &Check<'_, '_>, triangle: u32) -> [Point; 3] {
        self.corners(check, triangle).map(|corner| self.point(check, corner))
    }

    fn hull_vertex(&self, check: &Check<'_, '_>, edge: u32) -> u32 {
        let edge = if edge >= self.hull_count { edge.wrapping_sub(self.hull_count) } else { edge };
        word(check.words, self.hull.wrapping_add(edge.wrapping_mul(2))) & 0xffff
    }

    /// Byte offset of a word.
    fn byte(&self, index: u32) -> u32 {
        self.offset.wrapping_add(index.wrapping_sub(self.start).wrapping_mul(4))
    }

    /// Triangles that have the directed side `a` to `b`: candidates of the cell that holds `a`.
    fn sides(&self, check: &Check<'_, '_>, a: u32, b: u32) -> u32 {
        let (x, y) = self.point(check, a);
        let cell = grid_cell(y, self.grid_size)
            .wrapping_mul(self.grid_size)
            .wrapping_add(grid_cell(x, self.grid_size));
        let (from, to) = (
            word(check.words, self.grid.wrapping_add(cell)),
            word(check.words, self.grid.wrapping_add(cell).wrapping_add(1)),
        );
        let candidates = self.grid.wrapping_add(self.grid_size.wrapping_mul(self.grid_size)).wrapping_add(1);
        (from..to)
            .filter(|&at| {
                let [p, q, r] = self.corners(check, word(check.words, candidates.wrapping_add(at)));
                (p, q) == (a, b) || (q, r) == (a, b) || (r, p) == (a, b)
            })
            .count() as u32
    }
}

/// Largest number of candidates in a cell, for the stated cost (4.2).
pub(crate) fn largest_candidates(check: &Check<'_, '_>, section: Section) -> (u32, u32) {
    let start = check.section_start(section);
    let grid = grid_start(check.words, start);
    let size = word(check.words, start.wrapping_add(3));
    let largest = (0..size.wrapping_mul(size))
        .map(|cell| {
            word(check.words, grid.wrapping_add(cell).wrapping_add(1))
                .wrapping_sub(word(check.words, grid.wrapping_add(cell)))
        })
        .max();
    (largest.unwrap_or(0), word(check.words, start.wrapping_add(2)))
}

/// Walks 5.3 to 5.7. `false` if the set cannot be used.
pub(crate) fn check_directions(check: &mut Check<'_, '_>, section: Section, count: u32) -> bool {
    let start = check.section_start(section);
    let offset = section.offset;
    if !check.ensure(section.length >= 32, Rule::DirectionsLength, offset, section.length) {
        return false;
    }
    let field = |n: u32| word(check.words, start.wrapping_add(n));
    let (stated, triangle_count, hull_count, grid_size, candidate_count) =
        (field(0), field(1), field(2), field(3), field(4));
    let counts = [
        (0, stated, stated == count),
        (
            4,
            triangle_count,
            triangle_count <= 2048
                && if triangle_count > 0 {
                    hull_count >= 3
                        && triangle_count.wrapping_add(2).wrapping_add(hull_count.min(4096))
                            == count.wrapping_mul(2)
                } else {
                    true
                },
        ),
        (
            8,
            hull_count,
            if triangle_count > 0 {
                hull_count <= count
            } else {
                hull_count == count.wrapping_sub(1).wrapping_mul(2)
            },
        ),
        (12, grid_size, (1..=64).contains(&grid_size)),
        (16, candidate_count, candidate_count <= 1 << 20),
        (20, field(5), field(5) == 0),
        (24, field(6), field(6) == 0),
        (28, field(7), field(7) == 0),
    ];
    let mut sound = true;
    for (at, found, holds) in counts {
        sound &= check.ensure(holds, Rule::DirectionsCounts, offset.wrapping_add(at), found);
    }
    if !sound {
        return false;
    }
    let expected = count
        .wrapping_mul(8)
        .wrapping_add(32)
        .wrapping_add(triangle_count.wrapping_mul(12))
        .wrapping_add(hull_count.wrapping_mul(8))
        .wrapping_add(grid_size.wrapping_mul(grid_size).wrapping_add(1).wrapping_mul(4))
        .wrapping_add(candidate_count.wrapping_mul(4));
    if !check.ensure(section.length == expected, Rule::DirectionsLength, offset, section.length) {
        return false;
    }
    let triangles = triangles_start(check.words, start);
    let hull = hull_start(check.words, start);
    let grid = grid_start(check.words, start);
    let set = Set {
        start,
        offset,
        count,
        triangle_count,
        hull_count,
        grid_size,
        candidate_count,
        triangles,
        hull,
        grid,
    };
    check_points(check, &set)
        && check_triangles(check, &set)
        && check_grid(check, &set)
        && check_hull(check, &set)
        && check_cover(check, &set)
}

fn check_points(check: &mut Check<'_, '_>, set: &Set) -> bool {
    let mut sound = true;
    for i in 0..set.count {
        let (x, y) = set.point(check, i);
        let at = set.byte(set.start.wrapping_add(8).wrapping_add(i.wrapping_mul(2)));
        // Within the square first: beyond it the sum of squares could overflow.
        let inside = x.abs() <= 16384
            && y.abs() <= 16384
            && x.wrapping_mul(x).wrapping_add(y.wrapping_mul(y)) <= 1 << 28;
        let differs = (0..i).all(|other| set.point(check, other) != (x, y));
        sound &= check.ensure(
            inside && differs,
            Rule::DirectionPoint,
            at,
            word(check.words, set.start.wrapping_add(8).wrapping_add(i.wrapping_mul(2))),
        );
        let cosine = word(check.words, set.start.wrapping_add(9).wrapping_add(i.wrapping_mul(2)));
        sound &= check.ensure(
            !inside || cosine == cosine_of(x, y),
            Rule::DirectionCosine,
            at.wrapping_add(4),
            cosine,
        );
        if check.stopped {
            return false;
        }
    }
    sound
}

fn check_triangles(check: &mut Check<'_, '_>, set: &Set) -> bool {
    let mut sound = true;
    let mut before = None;
    for t in 0..set.triangle_count {
        let at = set.byte(set.triangles.wrapping_add(t.wrapping_mul(3)));
        let corners = set.corners(check, t);
        let [a, b, c] = corners;
        let named = a < b && a < c && b < set.count && c < set.count && b != c;
        let area = if named {
            let [p, q, r] = set.triangle(check, t);
            cross(p.0, p.1, q.0, q.1, r.0, r.1)
        } else {
            0
        };
        if !check.ensure(
            named && area > 0,
            Rule::TriangleShape,
            at,
            word(check.words, set.triangles.wrapping_add(t.wrapping_mul(3))),
        ) {
            sound = false;
            if check.stopped {
                return false;
            }
            continue;
        }
        let (shift, reciprocal) = reciprocal_of(area as u32);
        let (second, third) = (
            word(check.words, set.triangles.wrapping_add(t.wrapping_mul(3)).wrapping_add(1)),
            word(check.words, set.triangles.wrapping_add(t.wrapping_mul(3)).wrapping_add(2)),
        );
        sound &=
            check.ensure(second >> 16 == shift, Rule::TriangleReciprocal, at.wrapping_add(6), second >> 16);
        sound &= check.ensure(third == reciprocal, Rule::TriangleReciprocal, at.wrapping_add(8), third);
        sound &= check.ensure(
            before.is_none_or(|before| before < corners),
            Rule::TriangleOrder,
            at,
            word(check.words, set.triangles.wrapping_add(t.wrapping_mul(3))),
        );
        before = Some(corners);
        if check.stopped {
            return false;
        }
    }
    sound
}

fn check_grid(check: &mut Check<'_, '_>, set: &Set) -> bool {
    let cells = set.grid_size.wrapping_mul(set.grid_size);
    let mut sound = true;
    let mut before = 0;
    for cell in 0..=cells {
        let from = word(check.words, set.grid.wrapping_add(cell));
        let holds = match cell {
            0 => from == 0,
            _ if cell == cells => from == set.candidate_count && from >= before,
            _ => from >= before && from <= set.candidate_count,
        };
        if !check.ensure(holds, Rule::GridStarts, set.byte(set.grid.wrapping_add(cell)), from) {
            return false;
        }
        if !check.ensure(
            from.wrapping_sub(before) <= CELL_LIMIT,
            Rule::GridCell,
            set.byte(set.grid.wrapping_add(cell)),
            from.wrapping_sub(before),
        ) {
            return false;
        }
        before = from;
    }
    let candidates = set.grid.wrapping_add(cells).wrapping_add(1);
    for cell_y in 0..set.grid_size {
        for cell_x in 0..set.grid_size {
            let cell = cell_y.wrapping_mul(set.grid_size).wrapping_add(cell_x);
            let (x, y) = (cell_range(cell_x, set.grid_size), cell_range(cell_y, set.grid_size));
            let mut previous = None;
            for at in word(check.words, set.grid.wrapping_add(cell))
                ..word(check.words, set.grid.wrapping_add(cell).wrapping_add(1))
            {
                let triangle = word(check.words, candidates.wrapping_add(at));
                let holds = triangle < set.triangle_count
                    && previous.is_none_or(|p| p < triangle)
                    && meets_cell(set.triangle(check, triangle), x, y);
                sound &=
                    check.ensure(holds, Rule::GridCandidate, set.byte(candidates.wrapping_add(at)), triangle);
                previous = Some(triangle);
                if check.stopped {
                    return false;
                }
            }
        }
    }
    if !sound {
        return false;
    }
    // Every listed one meets its cell and none is listed twice, so equal counts mean equal sets.
    let mut meetings = 0u32;
    for t in 0..set.triangle_count {
        let triangle = set.triangle(check, t);
        let span = |f: fn(Point) -> i32| {
            let [a, b, c] = triangle.map(f).map(|q14| grid_cell(q14, set.grid_size));
            a.min(b).min(c)..=a.max(b).max(c)
        };
        for cell_y in span(|p| p.1) {
            for cell_x in span(|p| p.0) {
                meetings = meetings.wrapping_add(meets_cell(
                    triangle,
                    cell_range(cell_x, set.grid_size),
                    cell_range(cell_y, set.grid_size),
                ) as u32);
            }
        }
    }
    check.ensure(
        meetings == set.candidate_count,
        Rule::GridComplete,
        set.offset.wrapping_add(16),
        set.candidate_count,
    )
}

fn check_hull(check: &mut Check<'_, '_>, set: &Set) -> bool {
    for edge in 0..set.hull_count {
        let at = set.hull.wrapping_add(edge.wrapping_mul(2));
        let first = word(check.words, at);
        let (a, b) = (first & 0xffff, set.hull_vertex(check, edge.wrapping_add(1)));
        if !check.ensure(a < set.count && b < set.count && a != b, Rule::HullEdge, set.byte(at), first) {
            return false;
        }
        let (p, q) = (set.point(check, a), set.point(check, b));
        let (shift, reciprocal) = reciprocal_of(dot_product(p.0, p.1, q.0, q.1, q.0, q.1) as u32);
        let holds = first >> 16 == shift && word(check.words, at.wrapping_add(1)) == reciprocal;
        if !check.ensure(holds, Rule::HullEdge, set.byte(at), first) {
            return false;
        }
    }
    // Once around is four quadrants of the edges' direction; a left turn never skips two.
    let mut quadrants = 0u32;
    let mut before: Option<u32> = None;
    for edge in 0..=set.hull_count {
        if set.hull_count == 0 {
            break;
        }
        let [p, q, r] = [edge, edge.wrapping_add(1), edge.wrapping_add(2)]
            .map(|n| set.point(check, set.hull_vertex(check, n.checked_rem(set.hull_count).unwrap_or(0))));
        let turn = cross(p.0, p.1, q.0, q.1, r.0, r.1);
        let back = dot_product(q.0, q.1, p.0, p.1, r.0, r.1) > 0;
        let flat = set.triangle_count == 0;
        // A flat set goes along a line and back: straight on but for its two ends, where it returns.
        let end = flat
            && edge
                .wrapping_add(1)
                .checked_rem(set.hull_count)
                .unwrap_or(0)
                .checked_rem((set.hull_count / 2).max(1))
                .unwrap_or(0)
                == 0;
        let turns = if flat { turn == 0 && back == end } else { turn > 0 || turn == 0 && !back };
        if !check.ensure(
            turns,
            Rule::HullConvex,
            set.byte(set.hull.wrapping_add(edge.checked_rem(set.hull_count).unwrap_or(0).wrapping_mul(2))),
            edge.checked_rem(set.hull_count).unwrap_or(0),
        ) {
            return false;
        }
        let (dx, dy) = (q.0.wrapping_sub(p.0), q.1.wrapping_sub(p.1));
        let quadrant: u32 = if dx > 0 && dy >= 0 {
            0
        } else if dx <= 0 && dy > 0 {
            1
        } else if dx < 0 && dy <= 0 {
            2
        } else {
            3
        };
        quadrants = quadrants
            .wrapping_add(before.map_or(0, |before| quadrant.wrapping_add(4).wrapping_sub(before) % 4));
        before = Some(quadrant);
    }
    let once = set.triangle_count == 0 || quadrants == 4;
    check.ensure(once, Rule::HullConvex, set.byte(set.hull), quadrants)
}

fn check_cover(check: &mut Check<'_, '_>, set: &Set) -> bool {
    let mut open_sides = 0u32;
    for t in 0..set.triangle_count {
        let [a, b, c] = set.corners(check, t);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let neighbours = set.sides(check, q, p);
            open_sides = open_sides.wrapping_add((neighbours == 0) as u32);
            let holds = set.sides(check, p, q) == 1 && neighbours <= 1;
            if !check.ensure(holds, Rule::Cover, set.byte(set.triangles.wrapping_add(t.wrapping_mul(3))), t) {
                return false;
            }
        }
    }
    if set.triangle_count == 0 {
        // Going along the line and back names every direction.
        let all = (0..set.count).all(|i| {
            set.hull_count == 0 || (0..set.hull_count).any(|edge| set.hull_vertex(check, edge) == i)
        });
        return check.ensure(all, Rule::Cover, set.byte(set.hull), 0);
    }
    for edge in 0..set.hull_count {
        let (a, b) = (set.hull_vertex(check, edge), set.hull_vertex(check, edge.wrapping_add(1)));
        let holds = set.sides(check, a, b) == 1 && set.sides(check, b, a) == 0;
        if !check.ensure(holds, Rule::Cover, set.byte(set.hull.wrapping_add(edge.wrapping_mul(2))), a) {
            return false;
        }
    }
    // Sides without a neighbour are the hull's; by Euler's formula the counts then use every direction.
    check.ensure(open_sides == set.hull_count, Rule::Cover, set.byte(set.hull), open_sides)
}

#[cfg(test)]
#[allow(clippy::arithmetic_side_effects, reason = "a test may end by overflow")]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_the_square_once() {
        for size in 1..=64 {
            let mut next = -16384;
            for cell in 0..size {
                let (first, last) = cell_range(cell, size);
                assert_eq!(first, next, "cell {cell} of {size}");
                assert!((first..=last).all(|q14| grid_cell(q14, size) == cell), "cell {cell} of {size}");
                next = last + 1;
            }
            assert_eq!(next, 16385);
        }
    }

    /// Whether a point is in a triangle that turns left, sides included.
    fn holds([a, b, c]: [Point; 3], p: Point) -> bool {
        [(a, b), (b, c), (c, a)].iter().all(|&(a, b)| cross(a.0, a.1, b.0, b.1, p.0, p.1) >= 0)
    }

    /// Whether two segments have a point in common.
    fn meet((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
        let side = |a: Point, b: Point, p: Point| cross(a.0, a.1, b.0, b.1, p.0, p.1).signum();
        let between = |a: Point, b: Point, p: Point| {
            (a.0.min(b.0)..=a.0.max(b.0)).contains(&p.0)
                && (a.1.min(b.1)..=a.1.max(b.1)).contains(&p.1)
                && side(a, b, p) == 0
        };
        (side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0)
            || between(a, b, c)
            || between(a, b, d)
            || between(c, d, a)
            || between(c, d, b)
    }

    #[test]
    fn triangles_meet_cells_as_their_points_do() {
        let mut state = 7u32;
        let mut next = |limit: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 16) % limit) as i32
        };
        let mut met = [0u32; 2];
        for _ in 0..40_000 {
            let mut triangle = [(); 3].map(|()| (next(13), next(13)));
            let [a, b, c] = triangle;
            match cross(a.0, a.1, b.0, b.1, c.0, c.1) {
                0 => continue,
                1.. => {}
                _ => triangle = [a, c, b],
            }
            let ((x, y), (width, height)) = ((next(13), next(13)), (next(6), next(6)));
            let corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)];
            let sides = |points: &[Point]| -> [(Point, Point); 4] {
                core::array::from_fn(|i| (points[i % points.len()], points[(i + 1) % points.len()]))
            };
            let expected =
                triangle.iter().any(|p| (x..=x + width).contains(&p.0) && (y..=y + height).contains(&p.1))
                    || corners.iter().any(|&p| holds(triangle, p))
                    || sides(&triangle)[..3]
                        .iter()
                        .any(|&side| sides(&corners).iter().any(|&other| meet(side, other)));
            assert_eq!(
                meets_cell(triangle, (x, x + width), (y, y + height)),
                expected,
                "{triangle:?}, {corners:?}"
            );
            met[usize::from(expected)] += 1;
        }
        assert!(met.iter().all(|&count| count > 5_000), "{met:?}");
    }
}
