//! Tables of what a distant light reaches: a periodic depth map for each light.
//!
//! Points are projected along the light onto the plane `z = 0`, where the surface stays periodic. A cell
//! keeps the largest height above its centre; a point is lit where no more than its own plane is there. The
//! four nearest cells are compared each with the receiver's plane at that cell, and blended.

use super::mesh::Mesh;
use glam::{Vec2, Vec3A, vec2};

/// Cells along an axis.
const CELLS: usize = 1024;
/// Steepest plane of a receiver, against cells that its edge covers by part only.
const STEEPEST: f32 = 6.0;

/// The depth map of a light.
pub struct ShadowTable {
    /// Largest heights, `[y][x]`, from 0 to 65535 of the range.
    heights: Vec<u16>,
    low: f32,
    scale: f32,
    light: Vec3A,
    shear: Vec2,
}

fn wrap(cell: i32) -> usize {
    // A power of two.
    (cell & (CELLS as i32 - 1)) as usize
}

impl ShadowTable {
    /// For a mesh and a light above the horizon.
    pub fn new(mesh: &Mesh, light: Vec3A) -> ShadowTable {
        let [low, high] = mesh.heights();
        let scale = 65_535.0 / (high - low).max(1e-6);
        let shear = vec2(light.x, light.y) / light.z;
        let mut heights = vec![0u16; CELLS * CELLS];
        let flat: Vec<Vec3A> = mesh
            .vertices
            .iter()
            .map(|v| {
                let at = (vec2(v.position.x, v.position.y) - shear * v.position.z) * CELLS as f32 - 0.5;
                Vec3A::new(at.x, at.y, (v.position.z - low) * scale)
            })
            .collect();
        for triangle in &mesh.triangles {
            fill(&mut heights, triangle.map(|i| flat[i as usize]));
        }
        ShadowTable { heights, low, scale, light, shear }
    }

    /// The lit part, 0 to 1, of a place with a triangle's normal.
    pub fn lit(&self, place: Vec3A, face_normal: Vec3A) -> f32 {
        // The receiver's plane: height over a projected place.
        let facing = face_normal.dot(self.light);
        let facing = if facing.abs() < 1e-3 { 1e-3 } else { facing };
        let slope = vec2(face_normal.x, face_normal.y) * (-self.light.z / facing);
        let slope = slope.clamp_length_max(STEEPEST);
        let at = (vec2(place.x, place.y) - self.shear * place.z) * CELLS as f32 - 0.5;
        let (x, y) = (at.x.floor(), at.y.floor());
        let (u, v) = (at.x - x, at.y - y);
        let per_cell = slope * (self.scale / CELLS as f32);
        // A curved surface leaves its plane by a small part of a cell.
        let bias = (0.35 + 0.35 * slope.length()) * self.scale / CELLS as f32;
        let own = (place.z - self.low) * self.scale + bias - per_cell.x * u - per_cell.y * v;
        let (left, right) = (wrap(x as i32), wrap(x as i32 + 1));
        let (below, above) = (wrap(y as i32) * CELLS, wrap(y as i32 + 1) * CELLS);
        let free = |cell: usize, plane: f32| if f32::from(self.heights[cell]) <= plane { 1.0 } else { 0.0 };
        let low = free(below + left, own) * (1.0 - u) + free(below + right, own + per_cell.x) * u;
        let high = free(above + left, own + per_cell.y) * (1.0 - u) + free(above + right, own + per_cell.x + per_cell.y) * u;
        low * (1.0 - v) + high * v
    }
}

/// Raises the cells whose centres a projected triangle covers; `x`, `y` in cells, `z` as stored.
fn fill(heights: &mut [u16], [a, b, c]: [Vec3A; 3]) {
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if area.abs() < 1e-9 {
        return;
    }
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let inverse = 1.0 / area;
    for j in low.y.ceil() as i32..=high.y.floor() as i32 {
        let row = wrap(j) * CELLS;
        for i in low.x.ceil() as i32..=high.x.floor() as i32 {
            let (x, y) = (i as f32, j as f32);
            let v = ((x - a.x) * (c.y - a.y) - (y - a.y) * (c.x - a.x)) * inverse;
            let w = ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) * inverse;
            // Both triangles of an edge take its cells.
            if v >= -1e-5 && w >= -1e-5 && v + w <= 1.0 + 1e-5 {
                let z = (a.z + (b.z - a.z) * v + (c.z - a.z) * w).clamp(0.0, 65_535.0) as u16;
                let cell = &mut heights[row + wrap(i)];
                *cell = (*cell).max(z);
            }
        }
    }
}
