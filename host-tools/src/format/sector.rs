//! A part of the hemisphere, and the sample directions that queries within it need.
//!
//! A query in the sector must have the taps that it had in the whole set. So all corners of every triangle
//! that the sector touches are kept, and both ends of every hull edge, and every hull corner, whose queries
//! beyond the hull are in the sector. That the kept ones are triangulated alike follows from the written
//! rule (5.8): an empty circle stays empty where directions leave; a face of more than three corners is a
//! fan from its lowest number, which every triangle of it has, so that the triangles that stay are still
//! of the fan, numbers keeping their order. Kept directions on one edge of the hull stay neighbours.
//!
//! One thing can change: the hull begins at its lowest number, and where two of its edges lie in one line
//! the first answers for queries above the point between them. So all is checked on the result; where it
//! does not hold the whole set is kept (three of forty thousand random sets).

use crate::error::{Result, ToolError};
use crate::format::triangulate::{Triangulation, triangulate};
use crate::format::units::ONE_Q14;
use selvedge::Direction;
use selvedge::kernel::direction::{cross, dot_product};

/// What the sector is widened by, Q14: more than the rounding of a query to its coarse point (5.4-6).
const MARGIN: f64 = 2.0;

/// Directions up to an angle from the normal, within a range of azimuths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sector {
    /// Largest angle from the normal in degrees, 0 to 90.
    pub polar_max: f64,
    /// Azimuths in degrees from the first, counter-clockwise from the x axis, to the second; 350 to 10 goes
    /// through 0. `None` for all.
    pub azimuth: Option<[f64; 2]>,
}

impl Sector {
    /// The sector of these angles.
    ///
    /// # Errors
    /// [`ToolError::Usage`] if the angle from the normal is not 0 to 90 or an azimuth is not finite.
    pub fn new(polar_max: f64, azimuth: Option<[f64; 2]>) -> Result<Sector> {
        let sector = Sector { polar_max, azimuth };
        sector.check().map(|()| sector)
    }

    /// Refuses angles that are none.
    pub(crate) fn check(&self) -> Result<()> {
        if !(0.0..=90.0).contains(&self.polar_max) {
            return Err(ToolError::Usage(format!(
                "the largest angle from the normal is 0 to 90 degrees, not {}",
                self.polar_max
            )));
        }
        if self.azimuth.is_some_and(|azimuth| azimuth.iter().any(|angle| !angle.is_finite())) {
            return Err(ToolError::Usage("azimuths are numbers of degrees".into()));
        }
        Ok(())
    }

    /// Radius in the disc, Q14.
    fn radius(&self) -> f64 {
        (self.polar_max.to_radians() / 2.0).tan() * ONE_Q14
    }

    /// First azimuth and how far the range goes, if it is not all around.
    fn range(&self) -> Option<[f64; 2]> {
        let [from, to] = self.azimuth?;
        let width = if to - from >= 360.0 { 360.0 } else { (to - from).rem_euclid(360.0) };
        (width < 360.0).then_some([from, width])
    }

    /// Whether a query's point lies in the sector: exactly these queries are promised their taps. The normal
    /// is in every sector. The cosine does not matter.
    pub fn contains(&self, direction: Direction) -> bool {
        let [x, y] = [direction.x_q18, direction.y_q18].map(|q18| q18 as f64 / 16.0);
        if x.hypot(y) > self.radius() {
            return false;
        }
        let azimuth = y.atan2(x).to_degrees();
        (x == 0.0 && y == 0.0)
            || self.range().is_none_or(|[from, width]| (azimuth - from).rem_euclid(360.0) <= width)
    }

    /// Convex pieces as half-planes, widened by the margin; the disc is left to [`touches`].
    fn pieces(&self) -> Vec<Vec<HalfPlane>> {
        let Some([from, width]) = self.range() else { return vec![Vec::new()] };
        let count = (width / 90.0).ceil().max(1.0) as usize;
        let ray = |degrees: f64| {
            let (y, x) = degrees.to_radians().sin_cos();
            [x, y]
        };
        (0..count)
            .map(|i| {
                let [first, last] = [i, i + 1].map(|i| from + width * i as f64 / count as f64);
                let ([ax, ay], [bx, by]) = (ray(first), ray(last));
                // Left of the first ray, right of the last, and not on their other sides.
                vec![
                    HalfPlane::new([-ay, ax], [0.0; 2]),
                    HalfPlane::new([by, -bx], [0.0; 2]),
                    HalfPlane::new(ray((first + last) / 2.0), [0.0; 2]),
                ]
            })
            .collect()
    }
}

/// Points `p` with `normal . p >= least`.
#[derive(Clone, Copy, Debug)]
struct HalfPlane {
    normal: [f64; 2],
    least: f64,
}

impl HalfPlane {
    /// The points on the side of `through` that the normal shows to, and those within the margin.
    fn new(normal: [f64; 2], through: [f64; 2]) -> HalfPlane {
        let length = normal[0].hypot(normal[1]).max(f64::MIN_POSITIVE);
        let normal = normal.map(|n| n / length);
        HalfPlane { normal, least: normal[0] * through[0] + normal[1] * through[1] - MARGIN }
    }

    fn excess(&self, p: [f64; 2]) -> f64 {
        self.normal[0] * p[0] + self.normal[1] * p[1] - self.least
    }
}

/// What is left of a convex polygon.
fn clip(polygon: &[[f64; 2]], plane: HalfPlane) -> Vec<[f64; 2]> {
    let mut left = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (from, to) = (plane.excess(p), plane.excess(q));
        if from >= 0.0 {
            left.push(p);
        }
        if (from >= 0.0) != (to >= 0.0) {
            let t = from / (from - to);
            left.push([p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t]);
        }
    }
    left
}

/// Whether a convex region and a piece of a sector of this radius have a point in common.
fn touches(region: &[HalfPlane], piece: &[HalfPlane], radius: f64) -> bool {
    let far = 4.0 * ONE_Q14;
    let square = vec![[-far, -far], [far, -far], [far, far], [-far, far]];
    let common = region.iter().chain(piece).fold(square, |polygon, &plane| clip(&polygon, plane));
    let sides = || common.iter().zip(common.iter().cycle().skip(1));
    // The centre is inside if it is left of all sides; else the nearest side counts.
    let centre_inside = !common.is_empty() && sides().all(|(p, q)| p[0] * q[1] - p[1] * q[0] >= 0.0);
    let distance = |p: &[f64; 2], q: &[f64; 2]| {
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let t = (-(p[0] * dx + p[1] * dy) / (dx * dx + dy * dy).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p[0] + t * dx).hypot(p[1] + t * dy)
    };
    centre_inside || sides().any(|(p, q)| distance(p, q) <= radius + MARGIN)
}

/// What the queries of a sector meet in a triangulated set.
struct Needed {
    triangles: Vec<[u32; 3]>,
    /// Places of edges in the hull.
    edges: Vec<usize>,
    corners: Vec<u32>,
}

fn needed(points: &[[i32; 2]], t: &Triangulation, sector: &Sector) -> Needed {
    let (pieces, radius) = (sector.pieces(), sector.radius());
    let at = |i: u32| points[i as usize].map(|c| c as f64);
    let is_touched = |region: &[HalfPlane]| pieces.iter().any(|piece| touches(region, piece, radius));
    let triangle_is = |corners: &[u32; 3]| {
        let side = |i: usize| {
            let (p, q) = (at(corners[i]), at(corners[(i + 1) % 3]));
            HalfPlane::new([p[1] - q[1], q[0] - p[0]], p)
        };
        is_touched(&[side(0), side(1), side(2)])
    };
    let hull_at = |i: usize| at(t.hull[i % t.hull.len()]);
    let edge_is = |i: usize| {
        let (a, b) = (hull_at(i), hull_at(i + 1));
        let along = [b[0] - a[0], b[1] - a[1]];
        is_touched(&[
            HalfPlane::new(along, a),
            HalfPlane::new(along.map(|c| -c), b),
            HalfPlane::new([along[1], -along[0]], a),
        ])
    };
    let corner_is = |i: usize| {
        let (o, a, b) = (hull_at(i + t.hull.len() - 1), hull_at(i), hull_at(i + 1));
        is_touched(&[
            HalfPlane::new([a[0] - b[0], a[1] - b[1]], a),
            HalfPlane::new([a[0] - o[0], a[1] - o[1]], a),
        ])
    };
    let places = 0..t.hull.len();
    Needed {
        triangles: t.triangles.iter().filter(|corners| triangle_is(corners)).copied().collect(),
        edges: places.clone().filter(|&i| edge_is(i)).collect(),
        corners: if t.hull.is_empty() {
            vec![0]
        } else {
            places.filter(|&i| corner_is(i)).map(|i| t.hull[i]).collect()
        },
    }
}

/// Numbers, ascending, of the directions of a set that are kept for the queries of a sector.
pub fn kept_directions(points: &[[i32; 2]], sector: &Sector) -> Vec<u32> {
    let whole = triangulate(points, Some(1));
    let needed = needed(points, &whole, sector);
    let mut is_kept = vec![false; points.len()];
    for &corners in &needed.triangles {
        corners.iter().for_each(|&corner| is_kept[corner as usize] = true);
    }
    for &edge in &needed.edges {
        is_kept[whole.hull[edge] as usize] = true;
        is_kept[whole.hull[(edge + 1) % whole.hull.len()] as usize] = true;
    }
    needed.corners.iter().for_each(|&corner| is_kept[corner as usize] = true);
    let kept: Vec<u32> = (0u32..).zip(&is_kept).filter(|(_, kept)| **kept).map(|(i, _)| i).collect();
    if keeps_all(points, &whole, &needed, &kept) { kept } else { (0..points.len() as u32).collect() }
}

/// Whether the kept directions alone answer the needed queries as the whole set does.
fn keeps_all(points: &[[i32; 2]], whole: &Triangulation, needed: &Needed, kept: &[u32]) -> bool {
    let fewer: Vec<[i32; 2]> = kept.iter().map(|&i| points[i as usize]).collect();
    let t = triangulate(&fewer, Some(1));
    let old = |i: u32| kept[i as usize];
    let triangles: Vec<[u32; 3]> = t.triangles.iter().map(|corners| corners.map(old)).collect();
    let hull: Vec<u32> = t.hull.iter().map(|&i| old(i)).collect();
    let ends = |hull: &[u32], i: usize| [hull[i % hull.len()], hull[(i + 1) % hull.len()]];
    let place_of = |edge: usize| (0..hull.len()).position(|i| ends(&hull, i) == ends(&whole.hull, edge));
    let places: Vec<Option<usize>> = needed.edges.iter().map(|&edge| place_of(edge)).collect();
    // Two edges in one line meet in a point whose perpendicular is of both: the first one answers, in both
    // sets.
    let same_order = (0..places.len()).all(|i| {
        let next = (0..places.len()).find(|&j| needed.edges[j] == (needed.edges[i] + 1) % whole.hull.len());
        next.is_none_or(|j| {
            !is_straight(points, whole, needed.edges[i])
                || (needed.edges[i] < needed.edges[j]) == (places[i] < places[j])
        })
    });
    needed.triangles.iter().all(|corners| triangles.binary_search(corners).is_ok())
        && places.iter().all(Option::is_some)
        && needed.corners.iter().all(|corner| hull.contains(corner) || kept == [*corner])
        && same_order
}

/// Whether the hull goes straight on behind edge `i`.
fn is_straight(points: &[[i32; 2]], t: &Triangulation, i: usize) -> bool {
    let [a, b, c] = [i, i + 1, i + 2].map(|n| points[t.hull[n % t.hull.len()] as usize]);
    cross(a[0], a[1], b[0], b[1], c[0], c[1]) == 0 && dot_product(b[0], b[1], a[0], a[1], c[0], c[1]) < 0
}
