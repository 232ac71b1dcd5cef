//! Triangle meshes that tile: periodic height fields and tubes swept along periodic paths.
//!
//! A mesh is one period of a surface that repeats with period 1 in x and y. It may reach out of the unit
//! square; whoever needs a neighbour shifts it by whole numbers. Everything that shading needs stands at the
//! vertices and is interpolated, so nothing is finer than the mesh and no direction meets another pattern.

use glam::{Vec2, Vec3A, vec3a};
use std::f32::consts::TAU;

/// What a surface is like at a point: a diffuse layer below a specular one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// Diffuse albedo.
    pub albedo: Vec3A,
    /// Specular reflectance at normal incidence.
    pub specular: Vec3A,
    /// GGX widths along the tangent and across it.
    pub widths: [f32; 2],
}

impl Look {
    /// With one width for all directions.
    pub fn glossy(albedo: [f32; 3], specular: [f32; 3], width: f32) -> Look {
        Look { albedo: albedo.into(), specular: specular.into(), widths: [width; 2] }
    }

    /// Part `t` of the way to another.
    pub fn towards(self, other: Look, t: f32) -> Look {
        let widths = std::array::from_fn(|i| self.widths[i] + (other.widths[i] - self.widths[i]) * t);
        Look {
            albedo: self.albedo.lerp(other.albedo, t),
            specular: self.specular.lerp(other.specular, t),
            widths,
        }
    }
}

/// A vertex.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vertex {
    /// Place; a tile is the unit square.
    pub position: Vec3A,
    /// Unit shading normal.
    pub normal: Vec3A,
    /// Unit direction of the fibres, across the normal.
    pub tangent: Vec3A,
    /// The surface here.
    pub look: Look,
}

/// One period of a surface.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A tube to be swept; `u` runs from 0 to 1 along it, the angle around it from 0 (its side) over a quarter
/// turn (its top).
pub struct Tube<'a> {
    /// Steps along and around.
    pub steps: [usize; 2],
    /// By how many tiles the end lies from the start.
    pub shift: Vec2,
    /// Turns of the plies along the tube.
    pub turns: f32,
    /// The centre line, for any `u`.
    pub centre: &'a dyn Fn(f32) -> Vec3A,
    /// Half width and half height at a place and angle.
    pub section: &'a dyn Fn(f32, f32) -> [f32; 2],
    /// The surface at a place and angle.
    pub look: &'a dyn Fn(f32, f32) -> Look,
}

impl Mesh {
    /// Adds a height field with `steps` cells along both axes, from a height and a look of a place in the
    /// tile.
    pub fn add_height_field(
        &mut self,
        steps: usize,
        height: impl Fn(f32, f32) -> f32,
        look: impl Fn(f32, f32) -> Look,
    ) {
        let step = 1.0 / steps as f32;
        let first = self.vertices.len() as u32;
        for j in 0..=steps {
            for i in 0..=steps {
                // The last row and column repeat the first, to the bit.
                let (x, y) = ((i % steps) as f32 * step, (j % steps) as f32 * step);
                let slope_x = (height(x + 0.5 * step, y) - height(x - 0.5 * step, y)) / step;
                let slope_y = (height(x, y + 0.5 * step) - height(x, y - 0.5 * step)) / step;
                self.vertices.push(Vertex {
                    position: vec3a(i as f32 * step, j as f32 * step, height(x, y)),
                    normal: vec3a(-slope_x, -slope_y, 1.0).normalize(),
                    tangent: vec3a(1.0, 0.0, slope_x).normalize(),
                    look: look(x, y),
                });
            }
        }
        self.add_quads(first, [steps, steps], steps + 1);
    }

    /// Adds a tube.
    pub fn add_tube(&mut self, tube: &Tube) {
        let [along, around] = tube.steps;
        let points: Vec<Vec3A> = (0..along * around)
            .map(|k| {
                let (u, angle) =
                    ((k / around) as f32 / along as f32, (k % around) as f32 / around as f32 * TAU);
                let forward = ((tube.centre)(u + 1e-3) - (tube.centre)(u - 1e-3)).normalize();
                let side = forward.cross(Vec3A::Z).normalize();
                let [width, height] = (tube.section)(u, angle);
                (tube.centre)(u) + side * (angle.cos() * width) + side.cross(forward) * (angle.sin() * height)
            })
            .collect();
        let shift = vec3a(tube.shift.x, tube.shift.y, 0.0);
        // Any step along and around, with the ends joined.
        let point = |j: isize, i: isize| {
            let (n, m) = (along as isize, around as isize);
            points[(j.rem_euclid(n) * m + i.rem_euclid(m)) as usize] + shift * j.div_euclid(n) as f32
        };
        let first = self.vertices.len() as u32;
        for j in 0..=along as isize {
            for i in 0..=around as isize {
                let by_u = (point(j + 1, i) - point(j - 1, i)) * (along as f32 / 2.0);
                let by_angle = (point(j, i + 1) - point(j, i - 1)) * (around as f32 / (2.0 * TAU));
                let normal = by_u.cross(by_angle).normalize();
                let fibre = by_u + by_angle * (TAU * tube.turns);
                let (u, angle) = (
                    (j as usize % along) as f32 / along as f32,
                    (i as usize % around) as f32 / around as f32 * TAU,
                );
                self.vertices.push(Vertex {
                    position: point(j, i),
                    normal,
                    tangent: (fibre - normal * fibre.dot(normal)).normalize(),
                    look: (tube.look)(u, angle),
                });
            }
        }
        self.add_quads(first, [around, along], around + 1);
        // Along runs as the rows here, so the quads' orientation is turned.
        let count = self.triangles.len() - 2 * along * around;
        self.triangles[count..].iter_mut().for_each(|t| t.swap(1, 2));
    }

    /// Two triangles for each cell of a grid of vertices with `pitch` vertices in a row.
    fn add_quads(&mut self, first: u32, cells: [usize; 2], pitch: usize) {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let at = first + (j * pitch + i) as u32;
                let up = at + pitch as u32;
                self.triangles.extend([[at, at + 1, up + 1], [at, up + 1, up]]);
            }
        }
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3A; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize].position)
    }

    /// Unit normal of a triangle, to the outside; zero for one without area.
    pub fn face_normal(&self, triangle: usize) -> Vec3A {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Least and largest height.
    pub fn heights(&self) -> [f32; 2] {
        let z = |f: fn(f32, f32) -> f32, start| self.vertices.iter().fold(start, |a, v| f(a, v.position.z));
        [z(f32::min, f32::MAX), z(f32::max, f32::MIN)]
    }
}
