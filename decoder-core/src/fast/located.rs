//! Sets of directions with the lines of their triangles and hull made ready: chapter 5 for many queries.
//!
//! The signed areas of 5.4-1 are linear in the point, so each is two products and a sum, exact modulo 2^32:
//! the same bits as [`crate::kernel::direction::locate`].

use crate::kernel::direction::{
    Direction, Located, Taps, beyond_hull, clamp_direction, coarse_q14, cross, dot_product, grid_cell,
    grid_start, hull_start, point, ratio_q15, refine, triangles_start,
};
use crate::kernel::fixed::ONE_Q15;
use crate::kernel::material::Material;
use crate::kernel::words::{Words, high_i16, low_i16, word};

/// A line: `x * p.x + y * p.y + c` at a point `p`.
#[derive(Clone, Copy)]
struct Line {
    x: i32,
    y: i32,
    c: i32,
}

impl Line {
    /// The line of a function that is linear in the point.
    fn of(value: impl Fn(i32, i32) -> i32) -> Line {
        let c = value(0, 0);
        Line { x: value(1, 0).wrapping_sub(c), y: value(0, 1).wrapping_sub(c), c }
    }

    #[inline(always)]
    fn at(self, point: (i32, i32)) -> i32 {
        self.x.wrapping_mul(point.0).wrapping_add(self.y.wrapping_mul(point.1)).wrapping_add(self.c)
    }
}

/// A triangle made ready: the lines opposite to its directions, and its three words (5.3).
#[derive(Clone, Copy)]
struct Triangle {
    opposite_a: Line,
    opposite_b: Line,
    opposite_c: Line,
    first: u32,
    second: u32,
    reciprocal: u32,
}

/// Words of a [`Triangle`] in scratch.
const TRIANGLE_WORDS: usize = 12;

impl Triangle {
    fn to_words(self) -> [i32; TRIANGLE_WORDS] {
        let [a, b, c] = [self.opposite_a, self.opposite_b, self.opposite_c];
        let [first, second, reciprocal] = [self.first, self.second, self.reciprocal].map(|word| word as i32);
        [a.x, a.y, a.c, b.x, b.y, b.c, c.x, c.y, c.c, first, second, reciprocal]
    }

    #[inline(always)]
    fn from_words(words: &[i32; TRIANGLE_WORDS]) -> Triangle {
        let &[ax, ay, ac, bx, by, bc, cx, cy, cc, first, second, reciprocal] = words;
        Triangle {
            opposite_a: Line { x: ax, y: ay, c: ac },
            opposite_b: Line { x: bx, y: by, c: bc },
            opposite_c: Line { x: cx, y: cy, c: cc },
            first: first as u32,
            second: second as u32,
            reciprocal: reciprocal as u32,
        }
    }
}

/// A hull edge made ready: how far along it and outside of it a point is, its squared length, its two words,
/// and the direction that it ends at.
#[derive(Clone, Copy)]
struct Edge {
    along: Line,
    outside: Line,
    length: i32,
    first: u32,
    reciprocal: u32,
    end: u32,
}

/// Words of an [`Edge`] in scratch.
const EDGE_WORDS: usize = 10;

impl Edge {
    fn to_words(self) -> [i32; EDGE_WORDS] {
        let Edge { along, outside, length, .. } = self;
        let [first, reciprocal, end] = [self.first, self.reciprocal, self.end].map(|word| word as i32);
        [along.x, along.y, along.c, outside.x, outside.y, outside.c, length, first, reciprocal, end]
    }

    #[inline(always)]
    fn from_words(words: &[i32; EDGE_WORDS]) -> Edge {
        let &[along_x, along_y, along_c, outside_x, outside_y, outside_c, length, first, reciprocal, end] =
            words;
        Edge {
            along: Line { x: along_x, y: along_y, c: along_c },
            outside: Line { x: outside_x, y: outside_y, c: outside_c },
            length,
            first: first as u32,
            reciprocal: reciprocal as u32,
            end: end as u32,
        }
    }

    /// How far a point is along the edge, left of its end, and outside of it.
    #[inline(always)]
    fn sides(&self, p: (i32, i32)) -> (i32, i32, i32) {
        let along = self.along.at(p);
        (along, self.length.wrapping_sub(along), self.outside.at(p))
    }
}

/// The sets of light and view of a material, ready.
pub(crate) struct ReadySets<'a, 's> {
    /// Light directions.
    pub light: ReadySet<'a, 's>,
    /// View directions.
    pub view: ReadySet<'a, 's>,
}

impl<'a, 's> ReadySets<'a, 's> {
    /// Words of scratch that both sets need.
    pub fn scratch_len(words: Words<'a>, material: &Material) -> usize {
        scratch_len(words, material.light_start).wrapping_add(scratch_len(words, material.view_start))
    }

    /// Makes both sets ready in scratch of that length.
    pub fn new(words: Words<'a>, material: &Material, scratch: &'s mut [i32]) -> Self {
        let length = scratch_len(words, material.light_start).min(scratch.len());
        let (light, view) = scratch.split_at_mut(length);
        ReadySets {
            light: ReadySet::new(words, material.light_start, light),
            view: ReadySet::new(words, material.view_start, view),
        }
    }
}

/// Words of scratch of the set at `start`.
fn scratch_len(words: Words<'_>, start: u32) -> usize {
    let count = |at: u32| word(words, start.wrapping_add(at)) as usize;
    count(1) * TRIANGLE_WORDS + count(2) * EDGE_WORDS
}

/// A set of directions made ready.
pub(crate) struct ReadySet<'a, 's> {
    words: Words<'a>,
    start: u32,
    grid: u32,
    grid_size: u32,
    triangles: &'s [[i32; TRIANGLE_WORDS]],
    edges: &'s [[i32; EDGE_WORDS]],
}

impl<'a, 's> ReadySet<'a, 's> {
    fn new(words: Words<'a>, start: u32, scratch: &'s mut [i32]) -> Self {
        let triangle_count = word(words, start.wrapping_add(1)) as usize;
        let (triangles, edges) = scratch.split_at_mut((triangle_count * TRIANGLE_WORDS).min(scratch.len()));
        let (triangles, edges) = (triangles.as_chunks_mut().0, edges.as_chunks_mut().0);
        let at = |index: u32| {
            let pair = point(words, start, index);
            (low_i16(pair), high_i16(pair))
        };
        for (number, ready) in (0u32..).zip(triangles.iter_mut()) {
            let triangle = triangles_start(words, start).wrapping_add(number.wrapping_mul(3));
            let [first, second, reciprocal] = [0, 1, 2].map(|n| word(words, triangle.wrapping_add(n)));
            let (a, b, c) = (at(first & 0xffff), at(first >> 16), at(second & 0xffff));
            let side = |p: (i32, i32), q: (i32, i32)| Line::of(|x, y| cross(p.0, p.1, q.0, q.1, x, y));
            let (opposite_a, opposite_b, opposite_c) = (side(b, c), side(c, a), side(a, b));
            *ready = Triangle { opposite_a, opposite_b, opposite_c, first, second, reciprocal }.to_words();
        }
        let count = word(words, start.wrapping_add(2));
        let hull = hull_start(words, start);
        for (number, ready) in (0u32..).zip(edges.iter_mut()) {
            let next = if number.wrapping_add(1) < count { number.wrapping_add(1) } else { 0 };
            let [first, reciprocal] =
                [0, 1].map(|n| word(words, hull.wrapping_add(number.wrapping_mul(2)).wrapping_add(n)));
            let end = word(words, hull.wrapping_add(next.wrapping_mul(2))) & 0xffff;
            let (a, b) = (at(first & 0xffff), at(end));
            *ready = Edge {
                along: Line::of(|x, y| dot_product(a.0, a.1, b.0, b.1, x, y)),
                outside: Line::of(|x, y| cross(b.0, b.1, a.0, a.1, x, y)),
                length: dot_product(a.0, a.1, b.0, b.1, b.0, b.1),
                first,
                reciprocal,
                end,
            }
            .to_words();
        }
        let (grid, grid_size) = (grid_start(words, start), word(words, start.wrapping_add(3)));
        ReadySet { words, start, grid, grid_size, triangles, edges }
    }

    /// [`crate::kernel::direction::locate`], the same bits.
    #[inline(always)]
    pub fn locate(&self, asked: Direction) -> Located {
        let direction = clamp_direction(asked);
        let size = self.grid_size;
        let p = (coarse_q14(direction.x_q18), coarse_q14(direction.y_q18));
        let cell = grid_cell(p.1, size).wrapping_mul(size).wrapping_add(grid_cell(p.0, size));
        let candidates = self.grid.wrapping_add(size.wrapping_mul(size)).wrapping_add(1);
        let first = word(self.words, self.grid.wrapping_add(cell));
        let last = word(self.words, self.grid.wrapping_add(cell).wrapping_add(1));
        for candidate in first..last {
            let number = word(self.words, candidates.wrapping_add(candidate));
            let Some(words) = self.triangles.get(number as usize) else { break };
            let triangle = Triangle::from_words(words);
            let area_a = triangle.opposite_a.at(p);
            let area_b = triangle.opposite_b.at(p);
            let area_c = triangle.opposite_c.at(p);
            if (area_a | area_b | area_c) >= 0 {
                let whole = area_a.wrapping_add(area_b).wrapping_add(area_c);
                let rest = (direction.x_q18.wrapping_sub(p.0 << 4), direction.y_q18.wrapping_sub(p.1 << 4));
                let ratio = |area: i32, line: Line, most: i32| {
                    let fine = refine(area, whole, line.x, line.y, rest.0, rest.1);
                    ratio_q15(fine, triangle.second >> 16, triangle.reciprocal, most)
                };
                let weight_a_q15 = ratio(area_a, triangle.opposite_a, ONE_Q15);
                let left = ONE_Q15.wrapping_sub(weight_a_q15);
                let weight_b_q15 = ratio(area_b, triangle.opposite_b, left);
                let taps = Taps {
                    a: triangle.first & 0xffff,
                    b: triangle.first >> 16,
                    c: triangle.second & 0xffff,
                    weight_a_q15,
                    weight_b_q15,
                    weight_c_q15: left.wrapping_sub(weight_b_q15),
                    cosine_q15: if direction.z_q15 > 0 { ONE_Q15 } else { 0 },
                };
                let (clamped_x_q18, clamped_y_q18) = (direction.x_q18, direction.y_q18);
                return Located { direction, clamped_x_q18, clamped_y_q18, taps };
            }
        }
        self.locate_on_hull(direction)
    }

    /// [`crate::kernel::direction::locate_on_hull`], the same bits.
    fn locate_on_hull(&self, direction: Direction) -> Located {
        let p = (coarse_q14(direction.x_q18), coarse_q14(direction.y_q18));
        let Some(last) = self.edges.last() else {
            return beyond_hull(self.words, self.start, direction, 0, 0, 0);
        };
        let mut past_previous = Edge::from_words(last).sides(p).1 < 0;
        let mut corner = 0;
        for words in self.edges {
            let edge = Edge::from_words(words);
            let (along, left, outside) = edge.sides(p);
            let a = edge.first & 0xffff;
            if (along | left | outside) >= 0 {
                let rest = (direction.x_q18.wrapping_sub(p.0 << 4), direction.y_q18.wrapping_sub(p.1 << 4));
                let fine = refine(along, edge.length, edge.along.x, edge.along.y, rest.0, rest.1);
                let weight_b = ratio_q15(fine, edge.first >> 16, edge.reciprocal, ONE_Q15);
                return beyond_hull(self.words, self.start, direction, a, edge.end, weight_b);
            }
            if past_previous & (along < 0) {
                corner = a;
            }
            past_previous = left < 0;
        }
        beyond_hull(self.words, self.start, direction, corner, corner, 0)
    }
}
