//! The triangulation of a set of directions, by the written rule (5.8) that makes it unique.
//!
//! The Delaunay subdivision of exact integer points is unique. Where more than three points lie on one
//! empty circle it has a larger face, which is split as a fan from its lowest direction.

use crate::format::units::ONE_Q14;
use selvedge::container::directions::{cell_range, meets_cell};
use spade::{DelaunayTriangulation, Point2, Triangulation as _};
use std::collections::BTreeMap;

/// A triangulated set, ready to be written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Triangulation {
    /// Counter-clockwise, lowest direction first, ascending.
    pub triangles: Vec<[u32; 3]>,
    /// The closed hull from its lowest direction; for collinear points along the line from the lowest x,
    /// then y, and back.
    pub hull: Vec<u32>,
    /// Cells along an axis.
    pub grid_size: u32,
    /// First candidate of each cell, and the count at the end.
    pub starts: Vec<u32>,
    /// Triangles that meet the cells.
    pub candidates: Vec<u32>,
}

impl Triangulation {
    /// Largest number of candidates in a cell.
    pub fn largest_cell(&self) -> u32 {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }
}

/// Exact in-circle determinant: zero if `d` is on the circle of the counter-clockwise `a`, `b`, `c`.
fn in_circle(a: [i32; 2], b: [i32; 2], c: [i32; 2], d: [i32; 2]) -> i128 {
    let row = |p: [i32; 2]| {
        let (x, y) = ((p[0] - d[0]) as i128, (p[1] - d[1]) as i128);
        (x, y, x * x + y * y)
    };
    let ((ax, ay, aw), (bx, by, bw), (cx, cy, cw)) = (row(a), row(b), row(c));
    ax * (by * cw - bw * cy) - ay * (bx * cw - bw * cx) + aw * (bx * cy - by * cx)
}

fn find(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    i
}

/// The unique triangulation of distinct points (5.8).
pub fn triangulate(points: &[[i32; 2]], grid_size: Option<u32>) -> Triangulation {
    let mut triangles = delaunay(points);
    triangles.sort_unstable();
    let hull = if triangles.is_empty() { line_hull(points) } else { convex_hull(&triangles) };
    let grid_size =
        grid_size.unwrap_or_else(|| ((triangles.len() as f64 * 2.0).sqrt().ceil() as u32).clamp(1, 64));
    with_grid(points, triangles, hull, grid_size)
}

/// Triangles and hull as they are, with the grid that lists where they meet its cells (5.5).
pub fn with_grid(
    points: &[[i32; 2]],
    triangles: Vec<[u32; 3]>,
    hull: Vec<u32>,
    grid_size: u32,
) -> Triangulation {
    let mut starts = vec![0];
    let mut candidates = Vec::new();
    for cell_y in 0..grid_size {
        for cell_x in 0..grid_size {
            let (x, y) = (cell_range(cell_x, grid_size), cell_range(cell_y, grid_size));
            candidates.extend(
                (0u32..)
                    .zip(&triangles)
                    .filter(|(_, t)| meets_cell(t.map(|i| points[i as usize].into()), x, y))
                    .map(|(i, _)| i),
            );
            starts.push(candidates.len() as u32);
        }
    }
    Triangulation { triangles, hull, grid_size, starts, candidates }
}

fn delaunay(points: &[[i32; 2]]) -> Vec<[u32; 3]> {
    let vertices = points.iter().map(|p| Point2::new(p[0] as f64, p[1] as f64)).collect();
    let triangulation = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(vertices)
        .expect("points are finite and small");
    let faces: Vec<[u32; 3]> =
        triangulation.inner_faces().map(|face| face.vertices().map(|v| v.fix().index() as u32)).collect();
    let mut side_of = BTreeMap::new();
    for (f, t) in faces.iter().enumerate() {
        for i in 0..3 {
            side_of.insert((t[i], t[(i + 1) % 3]), (f, t[(i + 2) % 3]));
        }
    }
    // Join the faces that share a circle.
    let at = |i: u32| points[i as usize];
    let mut parents: Vec<usize> = (0..faces.len()).collect();
    for (&(a, b), &(f, c)) in &side_of {
        if let Some(&(other, d)) = side_of.get(&(b, a))
            && in_circle(at(a), at(b), at(c), at(d)) == 0
        {
            let (p, q) = (find(&mut parents, f), find(&mut parents, other));
            parents[p] = q;
        }
    }
    let mut borders: BTreeMap<usize, BTreeMap<u32, u32>> = BTreeMap::new();
    for (&(a, b), &(f, _)) in &side_of {
        let group = find(&mut parents, f);
        let inner = side_of.get(&(b, a)).is_some_and(|&(other, _)| find(&mut parents, other) == group);
        if !inner {
            borders.entry(group).or_default().insert(a, b);
        }
    }
    let mut triangles = Vec::with_capacity(faces.len());
    for next in borders.values() {
        let lowest = *next.keys().next().expect("a face has sides");
        let mut b = next[&lowest];
        while next[&b] != lowest {
            triangles.push([lowest, b, next[&b]]);
            b = next[&b];
        }
    }
    triangles
}

/// Sides without a neighbour, in order, from the lowest direction.
fn convex_hull(triangles: &[[u32; 3]]) -> Vec<u32> {
    let sides: Vec<(u32, u32)> =
        triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect();
    let all: std::collections::BTreeSet<_> = sides.iter().copied().collect();
    let next: BTreeMap<u32, u32> = sides.into_iter().filter(|&(a, b)| !all.contains(&(b, a))).collect();
    let first = *next.keys().next().expect("a triangulation has a hull");
    let mut hull = vec![first];
    while next[hull.last().expect("not empty")] != first {
        hull.push(next[hull.last().expect("not empty")]);
    }
    hull
}

/// Along the line and back.
fn line_hull(points: &[[i32; 2]]) -> Vec<u32> {
    if points.len() < 2 {
        return Vec::new();
    }
    let mut along: Vec<u32> = (0..points.len() as u32).collect();
    along.sort_by_key(|&i| points[i as usize]);
    let back = along[1..along.len() - 1].iter().rev().copied().collect::<Vec<_>>();
    along.into_iter().chain(back).collect()
}

/// The Q14 point of the disc for a unit vector of the upper hemisphere: the nearest, or where that leaves the
/// disc the one towards its centre (5.1-1).
pub fn project(vector: glam::DVec3) -> [i32; 2] {
    let scale = ONE_Q14 / (1.0 + vector.z);
    let exact = [vector.x * scale, vector.y * scale];
    let nearest = exact.map(|c| c.round() as i32);
    let inside = nearest[0] * nearest[0] + nearest[1] * nearest[1] <= 1 << 28;
    if inside { nearest } else { exact.map(|c| c.trunc() as i32) }
}

/// The unit vector of a Q14 point of the disc.
pub fn unproject(point: [i32; 2]) -> glam::DVec3 {
    let [x, y] = point.map(|c| c as f64 / ONE_Q14);
    let square = x * x + y * y;
    glam::DVec3::new(2.0 * x, 2.0 * y, 1.0 - square) / (1.0 + square)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cross(a: [i32; 2], b: [i32; 2], p: [i32; 2]) -> i32 {
        selvedge::kernel::direction::cross(a[0], a[1], b[0], b[1], p[0], p[1])
    }

    fn is_collinear(points: &[[i32; 2]]) -> bool {
        points[2..].iter().all(|&p| cross(points[0], points[1], p) == 0)
    }

    #[test]
    fn a_square_is_a_fan_from_its_lowest_direction() {
        for order in [[0usize, 1, 2, 3], [2, 0, 3, 1], [3, 1, 0, 2], [1, 3, 2, 0]] {
            let square = [[-5000, -5000], [5000, -5000], [5000, 5000], [-5000, 5000]];
            let points = order.map(|i| square[i]);
            let t = triangulate(&points, None);
            assert_eq!(t.triangles.len(), 2);
            assert!(t.triangles.iter().all(|t| t[0] == 0), "{t:?}");
        }
    }

    #[test]
    fn every_triangle_has_an_empty_circle() {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as i32 % 23 * 400 - 4400
        };
        for _ in 0..50 {
            let mut points: Vec<[i32; 2]> = (0..40).map(|_| [next(), next()]).collect();
            points.sort_unstable();
            points.dedup();
            let t = triangulate(&points, None);
            for &[a, b, c] in &t.triangles {
                let [a, b, c] = [a, b, c].map(|i| points[i as usize]);
                assert!(cross(a, b, c) > 0);
                assert!(points.iter().all(|&d| in_circle(a, b, c, d) <= 0));
            }
            assert_eq!(t.triangles.len() + 2 + t.hull.len(), 2 * points.len());
        }
    }

    #[test]
    fn the_horizon_is_in_the_disc() {
        for tenth in 0..3600 {
            let (y, x) = (tenth as f64 / 10.0).to_radians().sin_cos();
            let [px, py] = project(glam::DVec3::new(x, y, 0.0));
            assert!(px * px + py * py <= 1 << 28, "{tenth}");
        }
    }

    #[test]
    fn points_on_a_line_go_there_and_back() {
        let points = [[0, 0], [300, 300], [100, 100], [200, 200]];
        let t = triangulate(&points, None);
        assert!(t.triangles.is_empty() && is_collinear(&points));
        assert_eq!(t.hull, [0, 2, 3, 1, 3, 2]);
    }
}
