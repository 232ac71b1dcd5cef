//! Tables of what a distant light reaches: a periodic depth map for each light.
//!
//! Points are projected along the light onto the plane `z = 0`, where the surface stays periodic. A cell
//! keeps the largest height above its centre; a point is lit where no more than its own plane is there. The
//! four nearest cells are compared each with the receiver's plane at that cell, and blended.
//!
//! Against shadow rays from places that face the light, seen along every view of the 81 (the test
//! `exactness_of_every_kind`, 1024 cells): the table is on the ray's side of one half for 99.9 % of the
//! places of checker, rings and hammered, 99.7 % of cloth and knit, and 99.6 % of tissue. Its mean difference
//! from the ray is 0.001 to 0.006 of the light. The rest lies within a cell of a shadow's edge.

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
        let high = free(above + left, own + per_cell.y) * (1.0 - u)
            + free(above + right, own + per_cell.x + per_cell.y) * u;
        low * (1.0 - v) + high * v
    }
}

/// Raises the cells whose centres a projected triangle covers; `x`, `y` in cells, `z` as stored.
///
/// Triangles that face away lie below others of the closed surface, so they are left out.
fn fill(heights: &mut [u16], [a, b, c]: [Vec3A; 3]) {
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if area < 1e-9 {
        return;
    }
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let inverse = 1.0 / area;
    // Weights of b and c grow evenly along a row.
    let (by_b, by_c) = ((c.y - a.y) * inverse, (a.y - b.y) * inverse);
    let by_z = (b.z - a.z) * by_b + (c.z - a.z) * by_c;
    for j in low.y.ceil() as i32..=high.y.floor() as i32 {
        let row = wrap(j) * CELLS;
        let y = j as f32 - a.y;
        // The weights at x = a.x, and from there the span where all three are positive.
        let (at_b, at_c) = (-y * (c.x - a.x) * inverse, y * (b.x - a.x) * inverse);
        let (mut from, mut to) = (low.x, high.x);
        for (at, by) in [(at_b, by_b), (at_c, by_c), (1.0 - at_b - at_c, -by_b - by_c)] {
            // Slightly more than the triangle: both triangles of an edge take its cells.
            let (at, edge) = (at + 1e-5, a.x - (at + 1e-5) / by);
            if by > 0.0 {
                from = from.max(edge);
            } else if by < 0.0 {
                to = to.min(edge);
            } else if at < 0.0 {
                to = f32::MIN;
            }
        }
        let at_z = a.z + (b.z - a.z) * at_b + (c.z - a.z) * at_c - a.x * by_z;
        for i in from.ceil() as i32..=to.floor() as i32 {
            let z = (at_z + by_z * i as f32).clamp(low.z, high.z) as u16;
            let cell = &mut heights[row + wrap(i)];
            *cell = (*cell).max(z);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::directions;
    use crate::synth::Mesostructure;
    use crate::synth::trace::Tracer;

    /// Parts of places, seen from everywhere and facing a light, where table and ray agree, and the mean
    /// difference.
    fn exactness(kind: Mesostructure) -> [f64; 2] {
        let mesh = kind.mesh(1);
        let tracer = Tracer::new(&mesh);
        let grid: Vec<Vec3A> = directions::grid(81).expect("known").iter().map(|d| d.as_vec3a()).collect();
        let (mut count, mut agreed, mut difference) = (0, 0, 0.0);
        for (l, &light) in grid.iter().enumerate().step_by(7) {
            let table = ShadowTable::new(&mesh, light);
            for i in 0..2000 {
                let (x, y, view) = (
                    (i as f32 * 0.618_034).fract(),
                    (i as f32 * 0.754_878).fract(),
                    grid[(i * 5 + l) % grid.len()],
                );
                let Some(hit) = tracer.seen(x, y, 0.0, view) else { continue };
                let normal = mesh.face_normal(hit.triangle as usize);
                if normal.dot(light) <= 0.02 {
                    continue;
                }
                let corners = mesh.corners(hit.triangle as usize);
                let place =
                    corners[0] * hit.weights[0] + corners[1] * hit.weights[1] + corners[2] * hit.weights[2];
                let lit = table.lit(place, normal);
                let by_ray = if tracer.blocked(place + normal * 1e-5, light) { 0.0 } else { 1.0 };
                count += 1;
                agreed += usize::from((lit - by_ray).abs() <= 0.5);
                difference += f64::from((lit - by_ray).abs());
            }
        }
        [agreed as f64 / count as f64, difference / count as f64]
    }

    #[test]
    fn tables_agree_with_rays() {
        for kind in [Mesostructure::Checker, Mesostructure::Cloth] {
            let [agreed, difference] = exactness(kind);
            println!("{kind:?}: {agreed:.4} agree, mean difference {difference:.4}");
            assert!(
                agreed > 0.985 && difference < 0.02,
                "{kind:?}: {agreed} agree, mean difference {difference}"
            );
        }
    }

    #[test]
    #[ignore = "measures what the documentation says"]
    fn exactness_of_every_kind() {
        for kind in Mesostructure::all() {
            let [agreed, difference] = exactness(kind);
            println!("{kind:?}: {agreed:.4} agree, mean difference {difference:.4}");
        }
    }
}
