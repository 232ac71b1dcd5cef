//! Pictures of the mesostructures for documentation: two by two tiles, seen obliquely.

use super::mesh::Mesh;
use super::mesostructure::Mesostructure;
use super::shade::Scene;
use crate::data::directions;
use crate::data::picture::Picture;
use glam::Vec3A;
use rayon::prelude::*;

/// Part of the picture's light that comes from all around, so that metal has something to reflect.
const AROUND: f32 = 0.4;
/// Rays along an axis of a pixel.
const RAYS: usize = 3;

const EXPOSURE: f32 = 1.3;

/// With highlights wide enough that the sky's single directions run into each other.
fn softened(mut mesh: Mesh) -> Mesh {
    mesh.vertices.iter_mut().for_each(|v| v.look.widths = v.look.widths.map(|width| width.max(0.22)));
    mesh
}

/// Two by two tiles seen from 35 degrees to the normal, `pixels` wide, under one light and a weak sky.
pub fn preview(kind: Mesostructure, seed: u64, pixels: usize) -> Picture {
    let vector = |polar, azimuth| directions::from_degrees(polar, azimuth).as_vec3a();
    let view = vector(35.0, 270.0);
    let sky: Vec<Vec3A> = directions::grid(81).expect("known").iter().map(|d| d.as_vec3a()).collect();
    let (sun, sky) = (vector(48.0, 150.0), &sky[1..]);
    let scene = Scene::new(kind.mesh(seed), vec![sun]);
    let around = Scene::new(softened(kind.mesh(seed)), sky.to_vec());
    // The grid is even in angle, so a direction weighs by its solid angle; the sky is brighter above the
    // light.
    let ring = |d: &Vec3A| sky.iter().filter(|other| (other.z - d.z).abs() < 1e-3).count() as f32;
    let areas: Vec<f32> = sky
        .iter()
        .map(|d| (1.0 - d.z * d.z).sqrt() / ring(d) * (1.0 + 0.9 * (d.x * sun.x + d.y * sun.y)))
        .collect();
    let total: f32 = sky.iter().zip(&areas).map(|(d, area)| d.z * area).sum();
    let (width, height) = (pixels, (pixels as f32 * view.z) as usize);
    let pixel = |i: usize| {
        let mut sum = Vec3A::ZERO;
        for ray in 0..RAYS * RAYS {
            let at = |k: usize, part: usize| k as f32 + (part as f32 + 0.5) / RAYS as f32;
            let (x, y) =
                (at(i % width, ray % RAYS) / width as f32, 1.0 - at(i / width, ray / RAYS) / height as f32);
            let (mut direct, mut of_sky) = ([0.0; 3], vec![0.0; sky.len() * 3]);
            scene.add_radiance(2.0 * x, 2.0 * y, view, 1.0, &mut direct);
            around.add_radiance(2.0 * x, 2.0 * y, view, AROUND / total, &mut of_sky);
            let of_sky = of_sky
                .as_chunks::<3>()
                .0
                .iter()
                .zip(&areas)
                .fold(Vec3A::ZERO, |sum, (&rgb, &area)| sum + Vec3A::from(rgb) * area);
            // Clipped ray by ray, as a display would, so that highlights have soft edges.
            sum += ((Vec3A::from(direct) * (1.0 - AROUND) + of_sky) * EXPOSURE).min(Vec3A::splat(2.0));
        }
        (sum / (RAYS * RAYS) as f32).to_array()
    };
    let pixels = (0..width * height).into_par_iter().map(pixel).collect();
    Picture { width, height, pixels }
}
