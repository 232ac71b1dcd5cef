//! Diffuse interreflection: two bounces by a fixed set of gathering rays at every vertex.
//!
//! The rays are traced once; then every light's bounces are sums over them. The result belongs to the
//! vertices and is interpolated, so it is the same from every view.

use super::mesh::Mesh;
use super::shadow::ShadowTable;
use super::trace::Tracer;
use glam::Vec3A;
use rayon::prelude::*;

/// Gathering rays of a vertex.
const RAYS: usize = 48;
/// A gathering ray that meets nothing, or the inside of a surface.
const NOTHING: u32 = u32::MAX;

/// Which vertex each gathering ray of each vertex sees.
pub struct Transport {
    seen: Vec<[u32; RAYS]>,
}

/// Directions with a density of the cosine around z: a spiral over a disk, raised to the hemisphere.
fn gathering() -> [Vec3A; RAYS] {
    std::array::from_fn(|i| {
        let radius = ((i as f32 + 0.5) / RAYS as f32).sqrt();
        let (sin, cos) = (i as f32 * 2.399_963_2).sin_cos();
        Vec3A::new(radius * cos, radius * sin, (1.0 - radius * radius).sqrt())
    })
}

impl Transport {
    /// Traces the gathering rays.
    pub fn new(mesh: &Mesh, tracer: &Tracer) -> Transport {
        let directions = gathering();
        let seen = mesh
            .vertices
            .par_iter()
            .map(|vertex| {
                let across = vertex.normal.cross(vertex.tangent);
                let start = vertex.position + vertex.normal * 2e-4;
                directions.map(|d| {
                    let direction = vertex.tangent * d.x + across * d.y + vertex.normal * d.z;
                    let Some(hit) = tracer.closest(start, direction) else { return NOTHING };
                    if mesh.face_normal(hit.triangle as usize).dot(direction) >= 0.0 {
                        return NOTHING;
                    }
                    let nearest =
                        (1..3).fold(0, |best, i| if hit.weights[i] > hit.weights[best] { i } else { best });
                    mesh.triangles[hit.triangle as usize][nearest]
                })
            })
            .collect();
        Transport { seen }
    }

    /// Radiance that each vertex sends out after one and two bounces of a light, without the light's own.
    pub fn bounces(&self, mesh: &Mesh, light: Vec3A, table: &ShadowTable) -> Vec<[f32; 3]> {
        let mut first: Vec<Vec3A> = mesh
            .vertices
            .iter()
            .map(|v| {
                let cosine = v.normal.dot(light);
                if cosine > 0.0 {
                    v.look.albedo * (cosine * table.lit(v.position, v.normal))
                } else {
                    Vec3A::ZERO
                }
            })
            .collect();
        let once = self.gather(mesh, &first);
        // Both bounces at once: what is gathered of the light and of its first bounce.
        first.iter_mut().zip(&once).for_each(|(a, b)| *a += *b);
        self.gather(mesh, &first).iter().map(Vec3A::to_array).collect()
    }

    fn gather(&self, mesh: &Mesh, sent: &[Vec3A]) -> Vec<Vec3A> {
        let vertices = mesh.vertices.iter().zip(&self.seen);
        let gathered = vertices.map(|(vertex, seen)| {
            let sum =
                seen.iter().filter(|&&i| i != NOTHING).fold(Vec3A::ZERO, |sum, &i| sum + sent[i as usize]);
            vertex.look.albedo * sum / RAYS as f32
        });
        gathered.collect()
    }
}
