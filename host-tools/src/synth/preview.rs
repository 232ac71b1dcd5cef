//! Pictures of the mesostructures for documentation: two by two tiles, seen obliquely.

use super::Mesostructure;
use super::shade::Scene;
use crate::directions;
use crate::picture::Picture;
use glam::{Vec3A, vec3a};
use rayon::prelude::*;

/// Part of the picture's light that comes from all around, so that metal has something to reflect.
const AROUND: f32 = 0.35;
/// Rays along an axis of a pixel.
const RAYS: usize = 3;

/// Two by two tiles seen from 35 degrees to the normal, `pixels` wide, under one light and a weak sky.
pub fn preview(kind: Mesostructure, seed: u64, pixels: usize) -> Picture {
    let vector = |polar, azimuth| directions::from_degrees(polar, azimuth).as_vec3a();
    let view = vector(35.0, 270.0);
    let sky: Vec<Vec3A> = directions::grid(81).expect("known").iter().map(|d| d.as_vec3a()).collect();
    let mut lights = vec![vector(48.0, 150.0)];
    lights.extend(&sky[1..]);
    let scene = Scene::new(kind.mesh(seed), lights);
    // The grid is even in angle; a sky of one radiance weighs by solid angle.
    let areas: Vec<f32> =
        sky[1..].iter().map(|d| (1.0 - d.z * d.z).sqrt() / [6.0, 12.0, 18.0, 20.0, 24.0][((d.z.acos() / 0.2618).round() as usize).clamp(1, 5) - 1]).collect();
    let total: f32 = sky[1..].iter().zip(&areas).map(|(d, a)| d.z * a).sum();
    let (width, height) = (pixels, (pixels as f32 * view.z) as usize);
    let pixel = |i: usize| {
        let mut sum = Vec3A::ZERO;
        for ray in 0..RAYS * RAYS {
            let at = |k: usize, part: usize| k as f32 + (part as f32 + 0.5) / RAYS as f32;
            let (x, y) = (at(i % width, ray % RAYS) / width as f32, 1.0 - at(i / width, ray / RAYS) / height as f32);
            let mut radiance = vec![0.0; scene.lights() * 3];
            scene.add_radiance(2.0 * x, 2.0 * y, view, 1.0, &mut radiance);
            let rgb = |l: usize| vec3a(radiance[3 * l], radiance[3 * l + 1], radiance[3 * l + 2]);
            let around = (1..scene.lights()).fold(Vec3A::ZERO, |sum, l| sum + rgb(l) * (areas[l - 1] / total));
            // Clipped ray by ray, as a display would, so that highlights have soft edges.
            sum += (rgb(0) * (1.0 - AROUND) + around * AROUND).min(Vec3A::splat(1.5)) * 1.4;
        }
        (sum / (RAYS * RAYS) as f32).to_array()
    };
    let pixels = (0..width * height).into_par_iter().map(pixel).collect();
    Picture { width, height, pixels }
}
