//! Mesostructures of yarns: tissue, cloth and knit.
//!
//! A yarn is a swept elliptic tube whose section has the ridges of its twisted plies. Its colour and width
//! vary from yarn to yarn and along the yarn, by periodic noise, so that no two crossings are equal and the
//! tile still repeats. The highlight follows the direction of the plies.

use super::mesh::{Look, Mesh, Tube};
use super::noise::{Noise, signed};
use crate::math::random::Random;
use glam::{Vec2, Vec3A, vec2, vec3a};
use std::f32::consts::{PI, TAU};

/// What yarns of one kind have in common.
struct Yarn {
    /// Half width and half height.
    half: [f32; 2],
    /// Plies, their turns along the tile and the depth between them, as part of the radius.
    plies: f32,
    turns: f32,
    depth: f32,
    colour: [f32; 3],
    /// Steps along and around.
    steps: [usize; 2],
    /// Cells of the noise along the yarn.
    grain: usize,
}

/// Adds a yarn along a centre line; its own tone, width and fibres come from `random`.
fn add_yarn(mesh: &mut Mesh, random: &mut Random, yarn: &Yarn, shift: Vec2, centre: &dyn Fn(f32) -> Vec3A) {
    let slubs = Noise::new(random, yarn.grain, 1);
    let tones = Noise::new(random, yarn.grain * 2, 3);
    let fibres = Noise::new(random, yarn.grain * 3, yarn.steps[1] / 2);
    let size = 1.0 + 0.05 * signed(random);
    let tone = 1.0 + 0.16 * signed(random);
    let hue = Vec3A::from_array(std::array::from_fn(|_| 1.0 + 0.06 * signed(random)));
    // An angle that turns with the plies.
    let twisted = |u: f32, angle: f32| angle - TAU * yarn.turns * u;
    let ridge = |u: f32, angle: f32| (twisted(u, angle) * yarn.plies / 2.0).cos().abs().sqrt();
    let section = |u: f32, angle: f32| {
        let fibre = 0.035 * fibres.at(u, twisted(u, angle) / TAU);
        let radius = size * (1.0 + 0.08 * slubs.at(u, 0.0) + fibre) - yarn.depth * (1.0 - ridge(u, angle));
        yarn.half.map(|half| half * radius)
    };
    let look = |u: f32, angle: f32| {
        let around = twisted(u, angle) / TAU;
        // Between the plies the yarn is darker than its form alone would make it: fibres lie loose there.
        let shade = (0.72 + 0.28 * ridge(u, angle))
            * (1.0 + 0.13 * tones.at(u, around) + 0.16 * fibres.at(u, around));
        let albedo = Vec3A::from(yarn.colour) * hue * (tone * shade);
        Look {
            albedo: albedo.clamp(Vec3A::ZERO, Vec3A::splat(0.85)),
            specular: Vec3A::splat(0.05) + albedo * 0.1,
            widths: [0.28, 0.6],
        }
    };
    mesh.add_tube(&Tube {
        steps: yarn.steps,
        shift,
        turns: yarn.turns,
        centre,
        section: &section,
        look: &look,
    });
}

/// Adds a level ground that closes the view through gaps.
fn add_ground(mesh: &mut Mesh, height: f32, steps: usize, look: Look) {
    mesh.add_height_field(steps, |_, _| height, |_, _| look);
}

/// Height of a yarn on its way over and under others: `over` is asked for each crossing, with crossings at
/// half numbers.
fn wave(at: f32, over: impl Fn(i32) -> bool) -> f32 {
    let before = (at - 0.5).floor();
    let t = at - 0.5 - before;
    let side = |k: f32| if over(k as i32) { 1.0 } else { -1.0 };
    let (a, b) = (side(before), side(before + 1.0));
    a + (b - a) * (0.5 - 0.5 * (PI * t).cos())
}

/// How two sets of yarns cross.
struct Weave<'a> {
    /// Yarns of each set.
    count: usize,
    /// Warp, along y, and weft, along x.
    yarns: [&'a Yarn; 2],
    /// How far a yarn rises over others and falls below them.
    lift: f32,
    /// How far it strays to its sides, in spacings.
    wander: f32,
}

/// Adds warp and weft; `over` is whether warp `i` lies above weft `j`.
fn weave(mesh: &mut Mesh, random: &mut Random, cloth: &Weave<'_>, over: impl Fn(i32, i32) -> bool) {
    let &Weave { count, yarns, lift, wander } = cloth;
    let spacing = 1.0 / count as f32;
    for (kind, yarn) in yarns.into_iter().enumerate() {
        for i in 0..count {
            let (sway, sag) = (Noise::new(random, count, 1), Noise::new(random, count / 2, 1));
            let rise = |u: f32| {
                let above = |k: i32| if kind == 0 { over(i as i32, k) } else { !over(k, i as i32) };
                lift * (wave(u * count as f32, above) + 0.06 * sag.at(u, 0.0))
            };
            let across = |u: f32| (i as f32 + 0.5 + wander * sway.at(u, 0.0)) * spacing;
            if kind == 0 {
                add_yarn(mesh, random, yarn, vec2(0.0, 1.0), &|u| vec3a(across(u), u, rise(u)));
            } else {
                add_yarn(mesh, random, yarn, vec2(1.0, 0.0), &|u| vec3a(u, across(u), rise(u)));
            }
        }
    }
}

/// Loosely intertwined round fibres over a dark plane.
pub fn tissue(random: &mut Random) -> Mesh {
    const COUNT: usize = 8;
    const RADIUS: f32 = 0.018;
    let fibre = |colour| Yarn {
        half: [RADIUS; 2],
        plies: 3.0,
        turns: 5.0,
        depth: 0.12,
        colour,
        steps: [COUNT * 24, 20],
        grain: 24,
    };
    let mut mesh = Mesh::default();
    add_ground(&mut mesh, -2.1 * RADIUS, 96, Look::glossy([0.05, 0.03, 0.025], [0.02; 3], 0.5));
    let yarns = [&fibre([0.72, 0.6, 0.38]), &fibre([0.62, 0.5, 0.3])];
    let crossing = Weave { count: COUNT, yarns, lift: RADIUS * 0.95, wander: 0.22 };
    weave(&mut mesh, random, &crossing, |i, j| (i + j).rem_euclid(2) == 0);
    mesh
}

/// A dense twill, two over two, of red warp and sand-coloured weft.
pub fn cloth(random: &mut Random) -> Mesh {
    const COUNT: usize = 12;
    const HALF: [f32; 2] = [0.5 / COUNT as f32, 0.0165];
    let yarn = |colour, turns| Yarn {
        half: HALF,
        plies: 3.0,
        turns,
        depth: 0.2,
        colour,
        steps: [COUNT * 18, 22],
        grain: 36,
    };
    let mut mesh = Mesh::default();
    add_ground(&mut mesh, -2.1 * HALF[1], 48, Look::glossy([0.03; 3], [0.0; 3], 0.5));
    let yarns = [&yarn([0.42, 0.06, 0.05], 6.0), &yarn([0.66, 0.52, 0.3], 5.0)];
    let crossing = Weave { count: COUNT, yarns, lift: HALF[1], wander: 0.06 };
    weave(&mut mesh, random, &crossing, |i, j| (i - j).rem_euclid(4) < 2);
    mesh
}

/// Stockinette: rows of loops, each drawn through the row below.
pub fn knit(random: &mut Random) -> Mesh {
    const WALES: usize = 8;
    const ROWS: usize = 10;
    let width = 1.0 / WALES as f32;
    let yarn = Yarn {
        half: [width * 0.135, width * 0.125],
        plies: 3.0,
        turns: 25.0,
        depth: 0.24,
        colour: [0.16, 0.3, 0.42],
        steps: [WALES * 52, 18],
        grain: 80,
    };
    let mut mesh = Mesh::default();
    add_ground(&mut mesh, -0.31 * width, 64, Look::glossy([0.05, 0.06, 0.07], [0.0; 3], 0.5));
    for row in 0..ROWS {
        let (sway, rise) = (Noise::new(random, WALES, 1), Noise::new(random, WALES * 2, 1));
        // Top and bottom of a loop lie behind, the legs in front.
        let centre = |u: f32| {
            let t = TAU * WALES as f32 * u;
            let x = width / TAU * (t + 1.4 * (2.0 * t).sin());
            let y = (row as f32 + 0.5 + 0.05 * sway.at(u, 0.0)) / ROWS as f32 + 0.7 * width * t.cos();
            vec3a(x, y, width * (-0.16 * (2.0 * t).cos() + 0.015 * rise.at(u, 0.0)))
        };
        add_yarn(&mut mesh, random, &yarn, vec2(1.0, 0.0), &centre);
    }
    mesh
}
