//! A lit surface: everything that lies between a mesh and the radiance that leaves it.
//!
//! A distant light has irradiance pi on a plane that faces it, so a white diffuse plane sends out the cosine
//! of the light's angle. Radiance is the light's own, by a Lambert and an anisotropic GGX layer (Smith's
//! shadowing, Schlick's Fresnel term) behind the shadow tables, and two bounces of diffuse light.

use super::mesh::{Look, Mesh};
use super::radiosity::Transport;
use super::shadow::ShadowTable;
use super::trace::{Hit, Tracer};
use glam::Vec3A;
use rayon::prelude::*;

/// A surface with its lights.
pub struct Scene {
    mesh: Mesh,
    tracer: Tracer,
    lights: Vec<Vec3A>,
    tables: Vec<ShadowTable>,
    /// Bounced radiance, `[vertex][light]`.
    bounced: Vec<[f32; 3]>,
    plane: f32,
}

/// A seen place with its frame.
struct Place {
    position: Vec3A,
    face_normal: Vec3A,
    /// Tangent, across, normal.
    frame: [Vec3A; 3],
    look: Look,
    /// The view in the frame.
    view: Vec3A,
}

fn to_frame(frame: &[Vec3A; 3], direction: Vec3A) -> Vec3A {
    Vec3A::new(frame[0].dot(direction), frame[1].dot(direction), frame[2].dot(direction))
}

/// The specular layer times pi and the light's cosine; directions in the frame, both above its horizon.
fn specular(look: &Look, light: Vec3A, view: Vec3A) -> Vec3A {
    let [along, across] = look.widths;
    let half = (light + view).normalize();
    let (x, y) = (half.x / along, half.y / across);
    let spread = x * x + y * y + half.z * half.z;
    // pi cancels against the irradiance.
    let density = 1.0 / (along * across * spread * spread);
    let length = |d: Vec3A| Vec3A::new(d.x * along, d.y * across, d.z).length();
    let visible = 0.5 / (light.z * length(view) + view.z * length(light));
    let rest = 1.0 - half.dot(view).clamp(0.0, 1.0);
    // What reflects nothing at the normal reflects nothing at the edge.
    let edge = (look.specular.max_element() * 50.0).min(1.0);
    let fresnel = look.specular + (Vec3A::splat(edge) - look.specular) * (rest * rest * rest * rest * rest);
    fresnel * (density * visible * light.z)
}

impl Scene {
    /// Traces, tabulates and bounces; `lights` are unit vectors above the horizon.
    pub fn new(mesh: Mesh, lights: Vec<Vec3A>) -> Scene {
        let tracer = Tracer::new(&mesh);
        let transport = Transport::new(&mesh, &tracer);
        let (tables, by_light): (Vec<_>, Vec<_>) = lights
            .par_iter()
            .map(|&light| {
                let table = ShadowTable::new(&mesh, light);
                let bounced = transport.bounces(&mesh, light, &table);
                (table, bounced)
            })
            .unzip();
        let bounced = (0..mesh.vertices.len())
            .flat_map(|vertex| by_light.iter().map(move |of_light| of_light[vertex]))
            .collect();
        let [low, high] = mesh.heights();
        Scene { mesh, tracer, lights, tables, bounced, plane: (low + high) / 2.0 }
    }

    /// How many lights there are.
    pub fn lights(&self) -> usize {
        self.lights.len()
    }

    /// Adds the radiance from a place of the plane towards `view`, times `weight`, for every light:
    /// `[light][colour]`.
    pub fn add_radiance(&self, x: f32, y: f32, view: Vec3A, weight: f32, sums: &mut [f32]) {
        let Some(hit) = self.tracer.seen(x, y, self.plane, view) else { return };
        let place = self.place(&hit, view);
        let corners = self.mesh.triangles[hit.triangle as usize].map(|i| i as usize * self.lights.len());
        for (l, (&light, rgb)) in self.lights.iter().zip(sums.as_chunks_mut::<3>().0).enumerate() {
            let bounced = corners.map(|first| self.bounced[first + l]);
            let mut radiance = Vec3A::ZERO;
            let local = to_frame(&place.frame, light);
            if local.z > 0.0 {
                let lit = self.tables[l].lit(place.position, place.face_normal);
                if lit > 0.0 {
                    radiance = (place.look.albedo * local.z + specular(&place.look, local, place.view)) * lit;
                }
            }
            for c in 0..3 {
                let indirect = bounced[0][c] * hit.weights[0]
                    + bounced[1][c] * hit.weights[1]
                    + bounced[2][c] * hit.weights[2];
                rgb[c] += (radiance[c] + indirect) * weight;
            }
        }
    }

    fn place(&self, hit: &Hit, view: Vec3A) -> Place {
        let corners = self.mesh.triangles[hit.triangle as usize].map(|i| &self.mesh.vertices[i as usize]);
        let [a, b, c] = hit.weights;
        let mix = |of: fn(&super::mesh::Vertex) -> Vec3A| {
            of(corners[0]) * a + of(corners[1]) * b + of(corners[2]) * c
        };
        let normal = mix(|v| v.normal).normalize();
        let tangent = mix(|v| v.tangent);
        let tangent = (tangent - normal * tangent.dot(normal))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        let frame = [tangent, normal.cross(tangent), normal];
        let mut local = to_frame(&frame, view);
        // A facet may be seen whose smooth normal points away: as if at the edge.
        local.z = local.z.max(0.05);
        Place {
            position: mix(|v| v.position),
            face_normal: self.mesh.face_normal(hit.triangle as usize),
            frame,
            look: Look {
                albedo: mix(|v| v.look.albedo),
                specular: mix(|v| v.look.specular),
                widths: std::array::from_fn(|i| {
                    corners[0].look.widths[i] * a
                        + corners[1].look.widths[i] * b
                        + corners[2].look.widths[i] * c
                }),
            },
            view: local.normalize(),
        }
    }
}
