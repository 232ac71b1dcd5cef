//! Rays against a surface that repeats without end.
//!
//! The tree holds one period and a margin of its neighbours. A ray goes in pieces no longer than the margin;
//! before each piece its start is moved back into the tile, so grazing rays may go as far as they need.

use super::mesh::Mesh;
use glam::{Vec3A, vec3a};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

/// How far around the tile its neighbours are held.
const MARGIN: f32 = 0.35;
/// Most pieces of a ray: beyond, a nearly level ray counts as free.
const PIECES: usize = 32;
/// Distance from its start at which a ray begins, so that it does not meet its own triangle.
const START: f32 = 2e-5;

/// A surface to trace rays against.
pub struct Tracer {
    bvh: CwBvh,
    /// In the order of the tree's leaves, with the mesh's triangle.
    triangles: Vec<(RtTriangle, u32)>,
    /// Slightly below and above all of it.
    heights: [f32; 2],
}

/// A place on the surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Triangle of the mesh.
    pub triangle: u32,
    /// Weights of its three corners.
    pub weights: [f32; 3],
}

impl Tracer {
    /// For a mesh.
    pub fn new(mesh: &Mesh) -> Tracer {
        let mut copies = Vec::new();
        let mut sources = Vec::new();
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle);
            let (low, high) =
                (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            // All shifts by which the triangle meets the square.
            let shifts =
                |low: f32, high: f32| (-MARGIN - high).ceil() as i32..=(1.0 + MARGIN - low).floor() as i32;
            for y in shifts(low.y, high.y) {
                for x in shifts(low.x, high.x) {
                    let [v0, v1, v2] = corners.map(|corner| corner + vec3a(x as f32, y as f32, 0.0));
                    copies.push(Triangle { v0, v1, v2 });
                    sources.push(triangle as u32);
                }
            }
        }
        let bvh =
            build_cwbvh_from_tris(&copies, BvhBuildParams::fast_build(), &mut std::time::Duration::default());
        let triangles = bvh
            .primitive_indices
            .iter()
            .map(|&i| (RtTriangle::from(&copies[i as usize]), sources[i as usize]))
            .collect();
        let [low, high] = mesh.heights();
        Tracer { bvh, triangles, heights: [low - 1e-3, high + 1e-3] }
    }

    /// Follows a ray piece by piece until `visit` ends it or it leaves the surface's heights.
    fn pieces(&self, mut origin: Vec3A, direction: Vec3A, mut visit: impl FnMut(Ray) -> bool) {
        // No component may be -0: the tree takes its sign from the comparison with 0 and the sign of its
        // inverse from the bit.
        let direction = direction + Vec3A::ZERO;
        let level = direction.x.hypot(direction.y);
        let length = if level > 1e-6 { MARGIN / level } else { f32::INFINITY };
        for piece in 0..PIECES {
            origin -= vec3a(origin.x.floor(), origin.y.floor(), 0.0);
            // A piece reaches slightly into the next, so nothing falls between.
            let (start, end) = (if piece == 0 { START } else { 0.0 }, length * 0.999);
            if visit(Ray::new(origin, direction, start, end)) {
                return;
            }
            origin += direction * (length * 0.998);
            if !(self.heights[0]..=self.heights[1]).contains(&origin.z) {
                return;
            }
        }
    }

    /// The first place that a ray meets.
    pub fn closest(&self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        let mut found = None;
        self.pieces(origin, direction, |ray| {
            let mut hit = RayHit::none();
            let met = self.bvh.ray_traverse(ray, &mut hit, |ray, i| self.triangles[i].0.intersect(ray));
            if met {
                let (triangle, source) = &self.triangles[hit.primitive_id as usize];
                let at = triangle.compute_barycentric(&ray).clamp(glam::Vec2::ZERO, glam::Vec2::ONE);
                found = Some(Hit { triangle: *source, weights: [(1.0 - at.x - at.y).max(0.0), at.x, at.y] });
            }
            met
        });
        found
    }

    /// Whether a ray meets anything.
    #[cfg(test)]
    pub fn blocked(&self, origin: Vec3A, direction: Vec3A) -> bool {
        let mut blocked = false;
        self.pieces(origin, direction, |ray| {
            blocked = !self.bvh.ray_traverse_miss(ray, |ray, i| self.triangles[i].0.intersect(ray));
            blocked
        });
        blocked
    }

    /// What is seen along `view` through a place of the plane `z = plane`, from above.
    pub fn seen(&self, x: f32, y: f32, plane: f32, view: Vec3A) -> Option<Hit> {
        let start = vec3a(x, y, plane) + view * ((self.heights[1] - plane) / view.z);
        // A ray may slip through the seam of two triangles; one beside it does not.
        let beside = [(0.0, 0.0), (1.3e-5, 0.7e-5), (-0.9e-5, 1.7e-5)];
        beside.into_iter().find_map(|(dx, dy)| self.closest(start + vec3a(dx, dy, 0.0), -view))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::mesh::Look;

    #[test]
    fn grazing_rays_meet_the_surface_where_they_should() {
        let mut mesh = Mesh::default();
        mesh.add_height_field(
            24,
            |x, y| 0.03 * (x * std::f32::consts::TAU).sin() * (y * std::f32::consts::TAU).cos(),
            |_, _| Look::default(),
        );
        let tracer = Tracer::new(&mesh);
        for i in 0..500 {
            let (sin, cos) = (i as f32).sin_cos();
            let view = vec3a(sin * 0.9659, cos * 0.9659, 0.2588).normalize();
            let (x, y) = ((i as f32 * 0.618).fract(), (i as f32 * 0.414).fract());
            let hit = tracer.seen(x, y, 0.0, view).expect("the surface has no hole");
            let corners = mesh.corners(hit.triangle as usize);
            let place =
                corners[0] * hit.weights[0] + corners[1] * hit.weights[1] + corners[2] * hit.weights[2];
            let along = (place - vec3a(x, y, 0.0)) - view * ((place.z) / view.z);
            assert!(
                (along.x - along.x.round()).abs() < 1e-4 && (along.y - along.y.round()).abs() < 1e-4,
                "{along}"
            );
        }
    }
    #[test]
    fn every_view_of_the_grids_sees_every_surface() {
        for kind in crate::synth::Mesostructure::all() {
            let tracer = Tracer::new(&kind.mesh(2));
            for direction in
                [81, 151].into_iter().flat_map(|count| crate::data::directions::grid(count).expect("known"))
            {
                // Among them the corners of cells, and rays along their edges.
                for i in 0..64 {
                    let (x, y) = ((i % 8) as f32 / 8.0, (i / 8) as f32 / 8.0);
                    assert!(
                        tracer.seen(x, y, 0.01, direction.as_vec3a()).is_some(),
                        "{kind:?}: nothing at {x}, {y} along {direction}"
                    );
                }
            }
        }
    }
}
