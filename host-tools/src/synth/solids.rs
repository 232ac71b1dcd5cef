//! Mesostructures of solid surfaces: checker, rings and hammered metal.

use super::mesh::{Look, Mesh, Tube};
use super::noise::{Noise, signed};
use crate::math::random::Random;
use glam::{Vec2, Vec3A, vec2, vec3a};
use std::f32::consts::TAU;

fn smooth_step(low: f32, high: f32, at: f32) -> f32 {
    let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Raised pink cells on a blue plane: a smoothed checker pattern of four by four cells.
pub fn checker(random: &mut Random) -> Mesh {
    let grain = Noise::new(random, 40, 40);
    // From 0 on the plane to 1 on the cells.
    let raised = |x: f32, y: f32| smooth_step(-0.12, 0.42, (TAU * 2.0 * x).sin() * (TAU * 2.0 * y).sin());
    let (plane, cell) =
        (Look::glossy([0.05, 0.1, 0.42], [0.03; 3], 0.5), Look::glossy([0.68, 0.24, 0.36], [0.06; 3], 0.16));
    let mut mesh = Mesh::default();
    mesh.add_height_field(
        224,
        |x, y| 0.065 * raised(x, y) + 0.0006 * grain.at(x, y),
        |x, y| {
            let look = plane.towards(cell, smooth_step(0.25, 0.6, raised(x, y)));
            Look { albedo: look.albedo * (1.0 + 0.06 * grain.at(y, x)), ..look }
        },
    );
    mesh
}

/// Concentric rings of gold on a glossy blue plane.
pub fn rings(random: &mut Random) -> Mesh {
    let grain = Noise::new(random, 64, 64);
    let mut mesh = Mesh::default();
    let blue = Look::glossy([0.03, 0.07, 0.36], [0.05; 3], 0.14);
    mesh.add_height_field(
        160,
        |x, y| 0.0003 * grain.at(x, y),
        |x, y| Look { albedo: blue.albedo * (1.0 + 0.08 * grain.at(y, x)), ..blue },
    );
    let gold = Look::glossy([0.14, 0.085, 0.02], [0.95, 0.66, 0.26], 0.24);
    for radius in [0.07f32, 0.17, 0.27, 0.37, 0.467] {
        let tone = 1.0 + 0.06 * signed(random);
        let along = (radius * 900.0) as usize;
        mesh.add_tube(&Tube {
            steps: [along, 28],
            shift: Vec2::ZERO,
            turns: 0.0,
            centre: &|u| vec3a(0.5 + radius * (TAU * u).cos(), 0.5 + radius * (TAU * u).sin(), 0.024),
            section: &|_, _| [0.03, 0.03],
            look: &|_, _| Look {
                albedo: gold.albedo * tone,
                specular: (gold.specular * tone).min(Vec3A::ONE),
                ..gold
            },
        });
    }
    mesh
}

/// Copper beaten with a round hammer: many shallow bowls with soft ridges between.
pub fn hammered(random: &mut Random) -> Mesh {
    const SIDE: i32 = 7;
    let blows: Vec<(Vec2, f32, f32)> = (0..SIDE * SIDE)
        .map(|i| {
            let place = vec2((i % SIDE) as f32, (i / SIDE) as f32)
                + 0.5
                + 0.42 * vec2(signed(random), signed(random));
            (place / SIDE as f32, 1.9 * (1.0 + 0.3 * signed(random)), 0.003 * signed(random))
        })
        .collect();
    let height = |x: f32, y: f32| {
        // A soft minimum over the bowls near by.
        let sharpness = 1500.0;
        let (column, row) = ((x * SIDE as f32).floor() as i32, (y * SIDE as f32).floor() as i32);
        let mut sum = 0.0;
        for j in row - 2..=row + 2 {
            for i in column - 2..=column + 2 {
                let (place, curve, depth) = blows[(j.rem_euclid(SIDE) * SIDE + i.rem_euclid(SIDE)) as usize];
                let away = vec2(x, y) - place;
                let away = away - away.round();
                sum += (-(curve * away.length_squared() + depth) * sharpness).exp();
            }
        }
        -sum.max(1e-30).ln() / sharpness
    };
    let grain = Noise::new(random, 48, 48);
    let mut mesh = Mesh::default();
    let copper = Look::glossy([0.05, 0.025, 0.015], [0.93, 0.58, 0.42], 0.045);
    mesh.add_height_field(288, height, |x, y| Look {
        specular: copper.specular * (0.92 + 0.08 * grain.at(x, y)),
        ..copper
    });
    mesh
}
