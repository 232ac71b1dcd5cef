//! Numerical stability on stiff and extreme cases: a table of cases, each with a bound that is stated before
//! anything is measured.
//!
//! A case says what makes it hard (its condition: a condition number, a dynamic range, or how extreme it is),
//! where its bound comes from, and measures. Nothing is left out silently: a case that cannot be made is a
//! failure. `selvedge report --stability` puts the table on a page.

use crate::check::extreme::extreme;
use crate::data::dataset::{Dataset, Description, Sample};
use crate::data::directions;
use crate::data::transfer::Domain;
use crate::encode::goal::Target;
use crate::error::{Result, ToolError};
use crate::format::triangulate::{project, triangulate};
use crate::format::write::write_material;
use crate::math::ksvd::{Pursuit, Rows, code_all, dot, gram, iterate, normalise, pursue};
use crate::math::linear::{eigenbasis, nearest_orthogonal, orthonormal, product_at};
use crate::math::random::Random;
use crate::measure::baseline::pca::components as pca;
use crate::measure::compare::{Source, compare, query};
use crate::methods::METHODS;
use crate::methods::sparse_ensemble::encode::{self, prepare};
use crate::methods::sparse_tensor;
use crate::methods::sparse_tensor::encode::fit;
use glam::DVec3;
use selvedge::kernel::colour::{transfer_linear, transfer_log2};
use selvedge::kernel::fixed::{exp2_q31, multiply_q13, multiply_q15, round_shift};
use selvedge::kernel::material::part;
use selvedge::kernel::position::axis_at_position;
use selvedge::kernel::words::word;
use selvedge::method::sparse_tensor::{
    FIBRES_PART, LIGHT_ATOMS_PART, LIST_END, angular_q15, blend_light, corner_weight, lists_start,
    next_coefficient, open_list,
};
use selvedge::{Direction, Limits, Selvedge, Taps};
use serde::Serialize;
use std::path::Path;

/// What a case found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Condition number, dynamic range, or how extreme the case is.
    pub condition: f64,
    /// Largest error that is allowed.
    pub bound: f64,
    /// Error that was measured.
    pub measured: f64,
}

impl Outcome {
    /// Whether the bound holds; what is no number does not.
    pub fn holds(&self) -> bool {
        self.measured <= self.bound
    }
}

/// A case and its outcome.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// Group of cases.
    pub group: &'static str,
    /// The case.
    pub name: String,
    /// What its condition is.
    pub condition_is: &'static str,
    /// Where the bound comes from, and its unit.
    pub source: &'static str,
    /// What was found, or why nothing could be.
    pub outcome: std::result::Result<Outcome, String>,
}

impl Verdict {
    /// Whether the case was measured and keeps its bound.
    pub fn holds(&self) -> bool {
        self.outcome.as_ref().is_ok_and(Outcome::holds)
    }
}

type Run = Box<dyn Fn(&Path) -> Result<Outcome>>;

struct Case {
    group: &'static str,
    name: String,
    condition_is: &'static str,
    source: &'static str,
    run: Run,
}

fn case(
    group: &'static str,
    name: impl Into<String>,
    condition_is: &'static str,
    source: &'static str,
    run: impl Fn(&Path) -> Result<Outcome> + 'static,
) -> Case {
    Case { group, name: name.into(), condition_is, source, run: Box::new(run) }
}

/// Runs all cases; `folder` holds their data while they run.
pub fn run(folder: &Path, mut tell: impl FnMut(usize, usize)) -> Vec<Verdict> {
    let cases = all();
    let count = cases.len();
    let verdict = |(i, Case { group, name, condition_is, source, run }): (usize, Case)| {
        tell(i, count);
        Verdict { group, name, condition_is, source, outcome: run(folder).map_err(|error| error.to_string()) }
    };
    cases.into_iter().enumerate().map(verdict).collect()
}

fn all() -> Vec<Case> {
    let mut cases = arithmetic();
    cases.extend(weights());
    cases.extend(directions_at_ends());
    cases.extend(largest_legal());
    cases.extend(linear_algebra());
    cases.extend(pursuit());
    cases.extend(materials());
    cases.push(no_numbers());
    cases
}

const DRAWS: usize = 400_000;

/// Draws that are as often at the ends as inside.
fn extreme_draw(random: &mut Random, bound: i64) -> i64 {
    match random.range(0, 3) {
        0 => random.pick(&[-bound, bound, 0, 1, -1, bound - 1]),
        1 => random.range(-40, 40).clamp(-bound, bound),
        _ => random.range(-bound, bound),
    }
}

/// Largest distance of a rounded integer product from the real one, in units of the last place.
fn product_case(
    name: &'static str,
    p_bound: i64,
    u_bound: i64,
    fraction: u32,
    product: fn(i32, i32) -> i32,
) -> Case {
    case("arithmetic", name, "largest factor", "2.2: one rounding to nearest, half a unit", move |_| {
        let mut random = Random::new(1);
        let mut measured = 0.0f64;
        for _ in 0..DRAWS {
            let (p, u) = (extreme_draw(&mut random, p_bound), extreme_draw(&mut random, u_bound));
            let exact = (p * u) as f64 / (1i64 << fraction) as f64;
            measured = measured.max((product(p as i32, u as i32) as f64 - exact).abs());
        }
        Ok(Outcome { condition: p_bound as f64, bound: 0.5, measured })
    })
}

fn arithmetic() -> Vec<Case> {
    vec![
        product_case("products of 31 bits by 16", (1 << 31) - 1, 32_767, 15, multiply_q15),
        product_case("products of the colour matrix", 1 << 27, 32_767, 13, multiply_q13),
        case("arithmetic", "rounding shifts", "largest number", "2.2-3: half a unit", |_| {
            let mut random = Random::new(2);
            let mut measured = 0.0f64;
            for _ in 0..DRAWS {
                let (p, shift) = (extreme_draw(&mut random, (1 << 31) - 1), random.range(0, 31) as u32);
                measured = measured
                    .max((round_shift(p as i32, shift) as f64 - p as f64 / 2f64.powi(shift as i32)).abs());
            }
            Ok(Outcome { condition: 2f64.powi(31), bound: 0.5, measured })
        }),
        case(
            "arithmetic",
            "exponential, every fraction",
            "fractions tried",
            "2.3: within 2^-28, relative",
            |_| {
                let error = |x: u32| {
                    (exp2_q31(x) as f64 / 2f64.powi(31) / (x as f64 / 1_048_576.0).exp2() - 1.0).abs()
                };
                let measured = (0..1u32 << 20).map(error).fold(0.0, f64::max);
                Ok(Outcome { condition: 1_048_576.0, bound: 2f64.powi(-28), measured })
            },
        ),
        case(
            "arithmetic",
            "logarithm undone, powers of two from 2^-10 to 2^30",
            "largest over smallest result",
            "7.2: of the power of two: 2^-28 of the exponential, 2^-30 of the offset that is cut, half a unit of binary32",
            |_| {
                // Offset 2^-10 as mantissa and exponent.
                let (mantissa, exponent) = (0x8000_0000u32, -10);
                let mut random = Random::new(3);
                let mut measured = 0.0f64;
                for _ in 0..DRAWS {
                    let x = random.range(-10 << 20, 30 << 20) as i32;
                    let power = (x as f64 / 1_048_576.0).exp2();
                    let exact = (power - 2f64.powi(-10)).max(0.0);
                    let found = f32::from_bits(transfer_log2(x, mantissa, exponent, 32_768)) as f64;
                    measured = measured.max((found - exact).abs() / power);
                }
                Ok(Outcome {
                    condition: 2f64.powi(40),
                    bound: 2f64.powi(-28) + 2f64.powi(-30) + 2f64.powi(-24),
                    measured,
                })
            },
        ),
        case(
            "arithmetic",
            "linear values at both ends of binary32",
            "largest over smallest exponent",
            "7.3: half a unit of binary32, relative",
            |_| {
                let mut random = Random::new(4);
                let mut measured = 0.0f64;
                for _ in 0..DRAWS {
                    let (x, exponent) = (random.range(1, 1 << 27) as i32, random.range(-90, 90) as i32);
                    let exact = x as f64 * 2f64.powi(exponent - 20);
                    let found = f32::from_bits(transfer_linear(x, exponent, 32_768)) as f64;
                    measured = measured.max((found / exact - 1.0).abs());
                }
                Ok(Outcome { condition: 2f64.powi(180), bound: 2f64.powi(-24), measured })
            },
        ),
    ]
}

/// A small legal file with these lights and views, of smooth random numbers.
fn small_file(
    folder: &Path,
    lights: &[DVec3],
    views: &[DVec3],
    size: [usize; 2],
    tensor: bool,
) -> Result<Vec<u8>> {
    let wave = |t: usize, l: DVec3, v: DVec3, c: usize| {
        ((t % 5) as f64 * 0.3 + 2.0 * l.x + l.y * v.x * 3.0 + v.y + c as f64 * 0.2).sin() * 0.4
            + 0.6 * l.z.max(0.05)
    };
    let data =
        dataset(folder, size, lights, views, |t, l, v, c| wave(t, lights[l], views[v], c).max(0.0) as f32)?;
    encoded(&data, if tensor { Method::Tensor } else { Method::Ensemble }, Domain::Log)
        .map(|(bytes, _)| bytes)
}

fn opened(bytes: &[u8]) -> Result<Selvedge<'_>> {
    selvedge::open(bytes, &Limits::NONE).map_err(|finding| ToolError::Mismatch(finding.to_string()))
}

fn upward(random: &mut Random) -> DVec3 {
    let (z, azimuth) = (random.range(0, 1_000_000) as f64 / 1e6, random.range(0, 6_283_185) as f64 / 1e6);
    DVec3::new((1.0 - z * z).sqrt() * azimuth.cos(), (1.0 - z * z).sqrt() * azimuth.sin(), z)
}

fn direction(v: DVec3) -> Direction {
    Direction::from_unit_vector([v.x, v.y, v.z].map(|c| c as f32))
}

/// How far weights are from what they have to be: their sum from one, and the least from zero.
fn weight_defect(taps: Taps) -> f64 {
    let w = [taps.weight_a_q15, taps.weight_b_q15, taps.weight_c_q15];
    (w.iter().sum::<i32>() - 32_768).abs().max(-w.into_iter().min().unwrap_or(0)) as f64
}

/// Sets of directions that triangulations find hard.
fn hard_sets() -> Vec<(&'static str, Vec<DVec3>)> {
    let grid = |n| directions::grid(n).expect("known");
    let ring = |count: usize, polar: f64| {
        (0..count)
            .map(|i| directions::from_degrees(polar, i as f64 * 360.0 / count as f64))
            .collect::<Vec<_>>()
    };
    let mut near = grid(81);
    // The least distance that two points of 14 bits can have, and a little more.
    for i in [20, 40, 60] {
        near.push((near[i] + DVec3::new(9e-5, 0.0, 0.0)).normalize());
    }
    let spread = (0..400).map(|i| directions::from_degrees(i as f64 * 0.2, i as f64 * 137.507_764)).collect();
    let line = (0..9).map(|i| directions::from_degrees(i as f64 * 9.0, 0.0)).collect();
    vec![
        ("81 directions in rings", grid(81)),
        ("151 directions in rings", grid(151)),
        ("100 co-circular directions", ring(100, 60.0)),
        ("nearly equal directions", near),
        ("directions at the horizon", [ring(64, 90.0), vec![DVec3::Z]].concat()),
        ("400 directions of a spiral", spread),
        ("collinear directions", line),
        ("one direction", vec![DVec3::Z]),
        ("two directions", vec![DVec3::Z, directions::from_degrees(50.0, 10.0)]),
    ]
}

fn weights() -> Vec<Case> {
    let mut cases = vec![case(
        "weights",
        "bilinear weights, every size up to 64 and the largest",
        "largest size",
        "6.3: none negative, their sum 2^15 exactly",
        |_| {
            let mut random = Random::new(5);
            let mut measured = 0.0f64;
            for size in (1..=64).chain([16_383, 16_384]) {
                for i in 0..2000 {
                    let position = match i {
                        0 => 0,
                        1 => u32::MAX,
                        // Near the centre of a texel and between two.
                        _ if i % 2 == 0 => {
                            ((random.range(0, 2 * size as i64) << 31) / size as i64 + random.range(-3, 3))
                                as u32
                        }
                        _ => random.word(),
                    };
                    for edge in [1u32, 3, 16] {
                        let axis = axis_at_position(edge, (1u32 << 18).div_ceil(edge), size, position);
                        let spans =
                            if axis.count == 2 { vec![axis.first, axis.second] } else { vec![axis.first] };
                        let sum: i32 = spans.iter().map(|s| s.weight_a_q15 + s.weight_b_q15).sum();
                        let least =
                            spans.iter().map(|s| s.weight_a_q15.min(s.weight_b_q15)).min().unwrap_or(0);
                        measured = measured.max((sum - 32_768).abs().max(-least) as f64);
                    }
                }
            }
            Ok(Outcome { condition: 16_384.0, bound: 0.0, measured })
        },
    )];
    for (name, set) in hard_sets() {
        let condition = nearest_pair(&set);
        cases.push(case(
            "weights",
            format!("barycentric weights: {name}"),
            "1 / least distance of two directions",
            "5.6, 5.7: none negative, their sum 2^15 exactly",
            move |folder| {
                let bytes = small_file(folder, &set, &set[..set.len().min(3)], [2, 2], false)?;
                let file = opened(&bytes)?;
                let mut random = Random::new(6);
                let mut measured = 0.0f64;
                for i in 0..40_000 {
                    let asked = match i % 4 {
                        0 => query(set[i % set.len()]),
                        1 => Direction {
                            x_q18: random.range(-300_000, 300_000) as i32,
                            y_q18: random.range(-300_000, 300_000) as i32,
                            z_q15: random.range(-9, 32_768) as i32,
                        },
                        _ => direction(upward(&mut random)),
                    };
                    measured = measured.max(weight_defect(file.locate_light(asked).taps));
                }
                Ok(Outcome { condition, bound: 0.0, measured })
            },
        ));
    }
    cases
}

fn nearest_pair(set: &[DVec3]) -> f64 {
    let mut least = f64::MAX;
    for (i, a) in set.iter().enumerate() {
        set[..i].iter().for_each(|b| least = least.min(a.distance(*b)));
    }
    if set.len() < 2 { 0.0 } else { 1.0 / least }
}

fn directions_at_ends() -> Vec<Case> {
    let mut cases = vec![
        case(
            "directions",
            "triangles of sets that are hard, in wide integers",
            "triangles",
            "5.8: no point is inside the circle of a triangle, exactly; co-circular ones lie on it",
            |_| {
                let (mut inside, mut count) = (0, 0);
                for (_, set) in hard_sets() {
                    let points: Vec<[i32; 2]> = set.iter().map(|&d| project(d)).collect();
                    for t in triangulate(&points, None).triangles {
                        let corners = t.map(|i| points[i as usize]);
                        inside += points.iter().filter(|&&p| is_inside(corners, p)).count();
                        count += 1;
                    }
                }
                Ok(Outcome { condition: count as f64, bound: 0.0, measured: inside as f64 })
            },
        ),
        case(
            "directions",
            "light and view below the horizon",
            "degrees below",
            "5.7: weights stay whole, just below is where the horizon is, colours are finite and not negative",
            |folder| {
                let set = directions::grid(81).expect("known");
                let bytes = small_file(folder, &set, &set, [4, 4], false)?;
                let file = opened(&bytes)?;
                let mut measured = 0.0f64;
                for i in 0..720 {
                    let azimuth = i as f64 * 0.5;
                    let at = |polar: f64| direction(directions::from_degrees(polar, azimuth));
                    for below in [90.1, 95.0, 120.0, 179.0] {
                        let (a, b) = (file.locate_view(at(90.0)).taps, file.locate_view(at(below)).taps);
                        // The place on the hull's edge that is nearest to the point on the disc's border.
                        measured = measured.max(weight_defect(b));
                        if below < 91.0 {
                            measured = measured.max(f64::from(u8::from(
                                (a.a, a.b) != (b.a, b.b)
                                    && (a.a, a.b) != (b.b, b.a)
                                    && a.weight_a_q15.max(a.weight_b_q15) < 32_000,
                            )));
                        }
                        let rgb = file.filtered(0, 0, at(below), at(30.0)).to_f32();
                        measured =
                            measured.max(f64::from(u8::from(rgb.iter().any(|c| !c.is_finite() || *c < 0.0))));
                    }
                }
                Ok(Outcome { condition: 89.0, bound: 0.0, measured })
            },
        ),
    ];
    for (method, tensor) in [("ensemble", false), ("tensor", true)] {
        for what in ["light", "view", "position"] {
            cases.push(case(
                "continuity",
                format!("{method}: {what} in the smallest steps"),
                "steps taken",
                "a step changes a weight by 2^15 over the least height of a triangle and one rounding each; times the range of values, and eight roundings; of Q20",
                move |folder| continuity(folder, tensor, what),
            ));
        }
    }
    cases
}

/// The largest change of a channel value in one step of a light, view or position, against what the weights
/// allow.
fn continuity(folder: &Path, tensor: bool, what: &str) -> Result<Outcome> {
    let set = directions::grid(81).expect("known");
    let bytes = small_file(folder, &set, &set, [6, 6], tensor)?;
    let file = opened(&bytes)?;
    // The least height of a triangle of the set, in steps of Q18; positions: texels are 2^32 / 6 apart, a
    // step is 2^10.
    let points: Vec<[i32; 2]> = set.iter().map(|&d| project(d)).collect();
    let least = triangulate(&points, None)
        .triangles
        .iter()
        .map(|t| height(t.map(|i| points[i as usize])))
        .fold(f64::MAX, f64::min)
        * 16.0;
    let step_of_weight = if what == "position" { 1024.0 * 6.0 / 2f64.powi(17) } else { 32_768.0 / least };
    let values = |u: u32, v: u32, light: Direction, view: Direction| {
        let found = file.filtered_values(u, v, &file.locate_light(light), &file.locate_view(view));
        [found.c0, found.c1, found.c2].map(f64::from)
    };
    let mut random = Random::new(7);
    let (mut measured, mut range, mut steps) = (0.0f64, [f64::MAX, f64::MIN], 0.0);
    for _ in 0..60 {
        // Walks begin a little before a texel's centre, where the texels change that a sample is between.
        let centre = |random: &mut Random| (((2 * random.range(0, 5) + 1) << 31) / 6 - 1500 * 1024) as u32;
        let (mut u, mut v) = if what == "position" {
            (centre(&mut random), centre(&mut random))
        } else {
            (random.word(), random.word())
        };
        let (mut light, mut view) = (direction(upward(&mut random)), direction(upward(&mut random)));
        let along = [random.range(-1, 1) as i32, 1];
        let mut before: Option<[f64; 3]> = None;
        for _ in 0..3000 {
            match what {
                "light" => (light.x_q18, light.y_q18) = (light.x_q18 + along[0], light.y_q18 + along[1]),
                "view" => (view.x_q18, view.y_q18) = (view.x_q18 + along[0], view.y_q18 + along[1]),
                _ if along[0] > 0 => u = u.wrapping_add(1024),
                _ => v = v.wrapping_add(1024),
            }
            let now = values(u, v, light, view);
            now.iter().for_each(|v| range = [range[0].min(*v), range[1].max(*v)]);
            if let Some(before) = before {
                (0..3).for_each(|c| measured = measured.max((now[c] - before[c]).abs()));
            }
            before = Some(now);
            steps += 1.0;
        }
    }
    // Three weights change by at most a diagonal step and a rounding each, and meet at most the range of
    // values.
    let bound = (range[1] - range[0]) * 3.0 * (1.5 * step_of_weight + 1.0) / 32_768.0 + 8.0;
    Ok(Outcome { condition: steps, bound, measured })
}

/// Whether a point is strictly inside the circle through three others.
fn is_inside(corners: [[i32; 2]; 3], p: [i32; 2]) -> bool {
    let rows = corners.map(|c| {
        let (x, y) = ((c[0] - p[0]) as i128, (c[1] - p[1]) as i128);
        [x, y, x * x + y * y]
    });
    let [a, b, c] = rows;
    let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0]);
    let [u, v, w] = corners.map(|c| c.map(i128::from));
    let turn = (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]);
    determinant * turn.signum() > 0
}

/// The least height of a triangle.
fn height(t: [[i32; 2]; 3]) -> f64 {
    let side = |a: [i32; 2], b: [i32; 2]| ((a[0] - b[0]) as f64).hypot((a[1] - b[1]) as f64);
    let [a, b, c] = t;
    let area =
        ((b[0] - a[0]) as f64 * (c[1] - a[1]) as f64 - (b[1] - a[1]) as f64 * (c[0] - a[0]) as f64).abs();
    area / side(a, b).max(side(b, c)).max(side(c, a))
}

fn largest_legal() -> Vec<Case> {
    let mut cases = vec![
        case(
            "largest legal",
            "sparse tensor: sums over fibres of extreme files",
            "files",
            "12.5-2: magnitudes of all products of an atom sum to 2^30 + 2^20 at most",
            |_| {
                let mut measured = 0.0f64;
                for seed in 0..40 {
                    let bytes = write_material(&extreme(&sparse_tensor::METHOD, seed));
                    let file = opened(&bytes)?;
                    measured = measured.max(largest_fibre_sum(&file));
                }
                Ok(Outcome { condition: 40.0, bound: 2f64.powi(30) + 2f64.powi(20), measured })
            },
        ),
        case(
            "largest legal",
            "sparse tensor: sums of a texel of extreme files, in wide integers",
            "samples",
            "12.5-8: weights and products of all ABRDF atoms of a sample sum below 2^31 before they are limited",
            |_| {
                let mut random = Random::new(8);
                let (mut measured, mut samples) = (0.0f64, 0.0);
                for seed in 0..40 {
                    let bytes = write_material(&extreme(&sparse_tensor::METHOD, seed));
                    let file = opened(&bytes)?;
                    for _ in 0..if file.material().full_count > 0 { 200 } else { 0 } {
                        let (light, view) = (
                            file.locate_light(direction(upward(&mut random))).taps,
                            file.locate_view(direction(upward(&mut random))).taps,
                        );
                        measured = measured.max(largest_layer_sum(
                            &file,
                            [random.word(), random.word()],
                            light,
                            view,
                        ));
                        samples += 1.0;
                    }
                }
                Ok(Outcome { condition: samples, bound: 2f64.powi(31) - 1.0, measured })
            },
        ),
    ];
    for &method in METHODS {
        cases.push(case(
            "largest legal",
            format!("{}: values of extreme files", method.title),
            "samples",
            "11.1: no colour that is not a finite number, or negative",
            move |_| {
                let mut random = Random::new(9);
                let (mut measured, mut samples) = (0.0f64, 0.0);
                for seed in 0..40 {
                    let bytes = write_material(&extreme(method, seed));
                    let file = opened(&bytes)?;
                    for _ in 0..300 {
                        let (light, view) = (direction(upward(&mut random)), direction(upward(&mut random)));
                        let (u, v) = (random.word(), random.word());
                        let rgb = file.filtered(u, v, light, view).to_f32();
                        measured +=
                            rgb.iter().filter(|c| !c.is_finite() || c.is_sign_negative()).count() as f64;
                        samples += 1.0;
                    }
                }
                Ok(Outcome { condition: samples, bound: 0.0, measured })
            },
        ));
    }
    cases
}

/// The largest sum of a layer before it is limited: magnitudes of the weights of an atom, and of the products
/// of all atoms, added in wide integers.
fn largest_layer_sum(file: &Selvedge<'_>, position: [u32; 2], light: Taps, view: Taps) -> f64 {
    let (words, m) = (file.words(), file.material());
    let atoms = word(words, part(m, FIBRES_PART));
    let ends = |size: u32, at: u32| {
        let axis = axis_at_position(m.edge, m.edge_reciprocal_q18, size, at);
        let whole = [(axis.first.block, 32_768)].to_vec();
        if axis.count == 2 {
            vec![(axis.first.block, axis.first.weight_a_q15), (axis.second.block, axis.second.weight_a_q15)]
        } else {
            whole
        }
    };
    let (x, y) = (ends(m.width, position[0]), ends(m.height, position[1]));
    let mut largest = 0i64;
    for layer in 0..m.layer_limit {
        let start = lists_start(words, m, 0, layer);
        let mut weights = std::collections::BTreeMap::<u32, (i64, i64)>::new();
        for &(row, weight_y) in &y {
            for &(column, weight_x) in &x {
                let mut list = open_list(words, start, atoms, row * m.width + column);
                while list.index != LIST_END {
                    let weight = corner_weight(list.coefficient, weight_x, weight_y) as i64;
                    let sum = weights.entry(list.index).or_default();
                    *sum = (sum.0 + weight, sum.1 + weight.abs());
                    list = next_coefficient(words, list);
                }
            }
        }
        let mut sums = [0i64; 3];
        for (atom, (weight, magnitude)) in weights {
            largest = largest.max(magnitude);
            let shifts = word(words, part(m, FIBRES_PART) + 2 + atom);
            let found = angular_q15(words, m, atom, shifts & 31, light, view);
            for (sum, angular) in sums.iter_mut().zip([found.c0, found.c1, found.c2]) {
                *sum +=
                    round_shift(multiply_q15(weight as i32, angular), shifts >> 5 & 31).unsigned_abs() as i64;
            }
        }
        largest = sums.into_iter().fold(largest, i64::max);
    }
    largest as f64
}

/// The largest sum of magnitudes of all products of an ABRDF atom, in wide integers, over all pairs of
/// directions.
fn largest_fibre_sum(file: &Selvedge<'_>) -> f64 {
    let (words, m) = (file.words(), file.material());
    if m.full_count == 0 {
        return 0.0;
    }
    let (atoms, shape) = (word(words, part(m, FIBRES_PART)), word(words, part(m, FIBRES_PART) + 1));
    let (entries, index_bits) = (shape & 0xff, shape >> 8 & 15);
    let (table, light_atoms) = (part(m, FIBRES_PART) + 2 + atoms, word(words, part(m, LIGHT_ATOMS_PART)));
    // One light at full weight: the largest that a blend can be.
    let tap = |a| Taps {
        a,
        b: a,
        c: a,
        weight_a_q15: 32_768,
        weight_b_q15: 0,
        weight_c_q15: 0,
        cosine_q15: 32_768,
    };
    let mut largest = 0i64;
    for view in 0..m.view_count {
        for atom in 0..atoms {
            for light in 0..m.light_count {
                let mut sums = [0i64; 3];
                for n in 0..entries {
                    let at = (view * atoms + atom) * entries + n;
                    let entry = word(words, table + (at >> 1)) >> ((at & 1) << 4) & 0xffff;
                    let index = entry & ((1 << index_bits) - 1);
                    let value = (((entry - index) << 16) as i32 >> 16) as i64;
                    let h = (value * 32_768 + 0x10000) >> 17;
                    let l = word(words, part(m, LIGHT_ATOMS_PART) + 2 + light * light_atoms + index);
                    (0..3).for_each(|c| {
                        sums[c as usize] += (h * blend_light(l, l, l, tap(light), c) as i64).abs()
                    });
                }
                // Three views share the weight, but each may be rounded up.
                largest = largest.max(sums.into_iter().max().unwrap_or(0));
            }
        }
    }
    largest as f64
}

/// A random matrix with singular values that fall from one to `1 / condition`, `rows x columns`, row-major.
fn conditioned(rows: usize, columns: usize, condition: f64, seed: u64) -> Vec<f32> {
    let mut random = Random::new(seed);
    let mut draw =
        |n: usize| -> Vec<f64> { (0..n).map(|_| random.range(-1_000_000, 1_000_000) as f64 / 1e6).collect() };
    let (u, v) =
        (orthonormal(&draw(rows * columns), columns), orthonormal(&draw(columns * columns), columns));
    let s = |k: usize| condition.powf(-(k as f64) / (columns as f64 - 1.0));
    (0..rows * columns)
        .map(|i| (0..columns).map(|k| u[(i / columns, k)] * s(k) * v[(i % columns, k)]).sum::<f64>() as f32)
        .collect()
}

fn linear_algebra() -> Vec<Case> {
    let mut cases = Vec::new();
    for condition in [1e2, 1e6, 1e12] {
        cases.push(case(
            "training",
            format!("moments in binary32 against binary64, condition {condition:.0e}"),
            "condition number",
            "4 sqrt(n) 2^-24 of the largest entry, n products each rounded",
            move |_| {
                let (rows, columns) = (4096, 24);
                let matrix = conditioned(rows, columns, condition, 1);
                let mut single = vec![0.0f32; columns * columns];
                product_at(&mut single, &matrix, &matrix, [columns, rows, columns], false);
                let exact = |i: usize, j: usize| {
                    (0..rows)
                        .map(|r| matrix[r * columns + i] as f64 * matrix[r * columns + j] as f64)
                        .sum::<f64>()
                };
                let largest = (0..columns).map(|i| exact(i, i)).fold(0.0, f64::max);
                let measured = (0..columns * columns)
                    .map(|i| (single[i] as f64 - exact(i / columns, i % columns)).abs())
                    .fold(0.0, f64::max)
                    / largest;
                Ok(Outcome { condition, bound: 4.0 * (rows as f64).sqrt() * 2f64.powi(-24), measured })
            },
        ));
        cases.push(case(
            "training",
            format!("eigenvectors of moments, condition {condition:.0e}"),
            "condition number of the moments",
            "orthonormal as rows of binary32 can be: sqrt(n) 2^-23",
            move |_| {
                let (rows, columns) = (512, 32);
                let matrix = conditioned(rows, columns, condition.sqrt(), 2);
                let moments: Vec<f64> = (0..columns * columns)
                    .map(|i| {
                        (0..rows)
                            .map(|r| {
                                matrix[r * columns + i / columns] as f64
                                    * matrix[r * columns + i % columns] as f64
                            })
                            .sum()
                    })
                    .collect();
                let (basis, _) = eigenbasis(&moments, columns);
                Ok(Outcome {
                    condition,
                    bound: (columns as f64).sqrt() * 2f64.powi(-23),
                    measured: basis.defect(),
                })
            },
        ));
    }
    cases.push(case(
        "training",
        "orthogonal factor of a singular matrix (Procrustes)",
        "condition number",
        "orthonormal: sqrt(n) 2^-23",
        |_| {
            let n = 16;
            let matrix: Vec<f64> = conditioned(n, n, 1e30, 3).into_iter().map(f64::from).collect();
            let basis = nearest_orthogonal(&matrix, n)
                .ok_or_else(|| ToolError::Mismatch("no decomposition".into()))?;
            Ok(Outcome {
                condition: 1e30,
                bound: (n as f64).sqrt() * 2f64.powi(-23),
                measured: basis.defect(),
            })
        },
    ));
    for (name, rank, scale) in [
        ("rank three", 3, 1.0),
        ("rank one", 1, 1.0),
        ("rank three, values of 1e-12", 3, 1e-12),
        ("rank three, values of 1e12", 3, 1e12),
    ] {
        cases.push(case(
            "training",
            format!("components of a material of {name}"),
            "components beyond the rank",
            "nothing is left after its rank: 2^-20 of the root mean square, and the 16 bits of the mean and factors, 2^-15 of the largest mean",
            move |folder| {
                let set = directions::grid(81).expect("known");
                let value = move |t: usize, l: usize, v: usize, c: usize| {
                    let sum: f64 = (0..rank)
                        .map(|k| (1.0 + ((t * (k + 2)) as f64 * 0.37).sin()) * (1.0 + ((l * 3 + v * 7 + c + k) as f64 * (k as f64 + 0.61)).sin()))
                        .sum();
                    (sum * scale) as f32
                };
                let data = dataset(folder, [12, 9], &set[..9], &set[..7], value)?;
                // The mean takes one, which is no component.
                let mut whole = pca(&data, Domain::Linear, 8)?;
                let row = whole.measure(rank, 16)?;
                let rms = ((whole.energy + whole.mean.iter().map(|m| (*m as f64).powi(2)).sum::<f64>() * 108.0) / (108.0 * whole.mean.len() as f64)).sqrt();
                let bound = rms * 2f64.powi(-20) + whole.mean.iter().fold(0.0f32, |a, b| a.max(b.abs())) as f64 * 2f64.powi(-15);
                Ok(Outcome { condition: 8.0 - rank as f64, bound, measured: row.linear_rms })
            },
        ));
    }
    cases
}

/// Unit atoms of which pairs are nearly parallel, by this angle; and samples.
fn near_parallel(angle: f64) -> (Rows, Rows) {
    let (dim, pairs) = (24, 16);
    let mut random = Random::new(11);
    let mut atoms = Rows::zeros(2 * pairs, dim);
    for i in 0..pairs {
        let draw: Vec<f32> = (0..dim).map(|_| random.range(-1000, 1000) as f32 / 1000.0).collect();
        let aside: Vec<f32> = (0..dim).map(|_| random.range(-1000, 1000) as f32 / 1000.0).collect();
        let length = (dot(&draw, &draw) / dot(&aside, &aside)).sqrt() * angle;
        atoms.row_mut(2 * i).copy_from_slice(&draw);
        let turned: Vec<f32> =
            draw.iter().zip(&aside).map(|(a, b)| (*a as f64 + length * *b as f64) as f32).collect();
        atoms.row_mut(2 * i + 1).copy_from_slice(&turned);
        normalise(atoms.row_mut(2 * i));
        normalise(atoms.row_mut(2 * i + 1));
    }
    let mut samples = Rows::zeros(200, dim);
    samples.values.iter_mut().for_each(|v| *v = random.range(-1000, 1000) as f32 / 1000.0);
    (atoms, samples)
}

fn pursuit() -> Vec<Case> {
    let mut cases = Vec::new();
    for angle in [1e-1, 1e-3, 1e-5, 0.0] {
        cases.push(case(
            "pursuit",
            format!("atoms in pairs, {angle:.0e} apart"),
            "1 / angle",
            "parts of: stated error of a code against that of its sum, 2 sqrt(n) 2^-24 of the sample times all coefficients (correlations are binary32)",
            move |_| {
                let (atoms, samples) = near_parallel(angle);
                let codes = code_all(&samples, &atoms, Pursuit { most: 16, least_gain: 0.0 });
                let mut measured = 0.0f64;
                let mut breakdowns = 0;
                for (i, code) in codes.iter().enumerate() {
                    let mut rest: Vec<f64> = samples.row(i).iter().map(|&v| v as f64).collect();
                    for &(atom, value) in &code.terms {
                        rest.iter_mut().zip(atoms.row(atom as usize)).for_each(|(r, a)| *r -= value * *a as f64);
                    }
                    let energy = dot(samples.row(i), samples.row(i));
                    let error: f64 = rest.iter().map(|r| r * r).sum();
                    let magnitudes: f64 = code.terms.iter().map(|term| term.1.abs()).sum();
                    // The code minimises its error, so that an error of the correlations comes in once for each coefficient, twice by the square.
                    let allowed = 2.0 * 2f64.powi(-24) * (samples.dim as f64).sqrt() * energy.sqrt() * magnitudes + 1e-12 * energy;
                    measured = measured.max((error - code.errors.last().copied().unwrap_or(energy)).abs() / allowed);
                    breakdowns += code.breakdowns;
                }
                // Equal atoms have to be refused where both are wanted, and never be taken together.
                let together = codes.iter().any(|code| angle == 0.0 && code.terms.iter().any(|a| code.terms.iter().any(|b| a.0 + 1 == b.0 && a.0 % 2 == 0)));
                if together || (angle > 1e-2 && breakdowns > 0) {
                    measured = f64::INFINITY;
                }
                Ok(Outcome { condition: 1.0 / f64::max(angle, 1e-9), bound: 1.0, measured })
            },
        ));
    }
    cases.push(case("pursuit", "a sample of zeros", "atoms", "no term, no error", |_| {
        let (atoms, _) = near_parallel(0.1);
        let code =
            pursue(&vec![0.0; atoms.count()], 0.0, &gram(&atoms), Pursuit { most: 8, least_gain: 0.0 });
        Ok(Outcome {
            condition: atoms.count() as f64,
            bound: 0.0,
            measured: code.terms.len() as f64 + code.errors.iter().sum::<f64>(),
        })
    }));
    cases.push(case(
        "pursuit",
        "dead atoms are replaced",
        "atoms that no sample uses",
        "every atom is a unit vector after an iteration, 2^-20",
        |_| {
            let (_, samples) = near_parallel(0.1);
            let mut atoms = Rows::zeros(40, samples.dim);
            // Forty copies of one atom: all but one are dead.
            (0..40).for_each(|i| atoms.row_mut(i)[0] = 1.0);
            let found = iterate(&samples, &mut atoms, Pursuit { most: 3, least_gain: 0.0 });
            let defect = (0..40).map(|i| (dot(atoms.row(i), atoms.row(i)) - 1.0).abs()).fold(0.0, f64::max);
            let measured = if found.revived >= 30 { defect } else { f64::INFINITY };
            Ok(Outcome { condition: 39.0, bound: 2f64.powi(-20), measured })
        },
    ));
    cases
}

#[derive(Clone, Copy, PartialEq)]
enum Method {
    Ensemble,
    Tensor,
}

/// A dataset of a function of texel, light, view and colour.
fn dataset(
    folder: &Path,
    size: [usize; 2],
    lights: &[DVec3],
    views: &[DVec3],
    value: impl Fn(usize, usize, usize, usize) -> f32,
) -> Result<Dataset> {
    let path = folder.join("case.selvset");
    let description = Description {
        size,
        lights: lights.to_vec(),
        views: views.to_vec(),
        sample: Sample::Float,
        ..Description::default()
    };
    Dataset::from_fn(&path, description, |texel, i| {
        value(texel, i / 3 % lights.len(), i / 3 / lights.len(), i % 3)
    })
}

/// A file of a dataset, as exact as its encoder makes it, and the error that the encoder states.
fn encoded(data: &Dataset, method: Method, domain: Domain) -> Result<(Vec<u8>, f64)> {
    if method == Method::Tensor {
        let components = pca(data, domain, 24)?;
        let shape = fit::Shape { light_atoms: 12, abrdf_atoms: 24, entries: 6, coefficients: 8 };
        let options = sparse_tensor::encode::Options {
            shape,
            target: Target::AsGiven,
            value_bits: Some(12),
            training: fit::Training { iterations: 6, rounds: 2, seed: 1 },
        };
        let made = sparse_tensor::encode::encode(&components, &[], &options, |_, _, _| ())?;
        return Ok((made.bytes, made.predicted_rms));
    }
    let prepared = prepare(vec![data], sparse_tensor::encode::transfer_of(data, domain), &|_, _| ())?;
    let options = encode::Options {
        edge: 4,
        criterion: encode::Criterion::Coefficients([60, 30, 30]),
        ..encode::Options::default()
    };
    let made = encode::encode(&prepared, &prepared.own_ensembles(4), &options, &|_, _| ())?;
    // What is stated is of whole blocks, of which the image may be a part that has all of the error.
    let [width, height] = data.description().size;
    let blocks = width.next_multiple_of(4) * height.next_multiple_of(4);
    Ok((made.bytes, made.predicted_rms * (blocks as f64 / (width * height) as f64).sqrt()))
}

/// What is no radiance is refused before anything is computed from it.
fn no_numbers() -> Case {
    const BAD: [f32; 4] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-30];
    case(
        "materials",
        "values that are no radiances: no number, infinities, a negative one",
        "values that are tried",
        "none is taken: the first check of every value that is written to a dataset",
        |folder| {
            let set = directions::grid(81).expect("known");
            let taken = |&bad: &f32| {
                dataset(folder, [3, 2], &set[..4], &set[..5], |t, l, _, c| {
                    if t == 4 && l == 1 && c == 2 { bad } else { 0.5 }
                })
                .is_ok()
            };
            Ok(Outcome {
                condition: BAD.len() as f64,
                bound: 0.0,
                measured: BAD.iter().filter(|bad| taken(bad)).count() as f64,
            })
        },
    )
}

/// What a value of a material is, by texel, light, view and colour.
type Value = fn(usize, usize, usize, usize) -> f32;

fn smooth(t: usize, l: usize, v: usize, c: usize) -> f32 {
    0.2 + 0.1 * ((t as f32 * 0.9 + l as f32 * 0.4).sin() + (v as f32 * 0.5 + c as f32).cos()) * 0.9
}

/// Name, texels, lights, views and values.
const MATERIALS: [(&str, [usize; 2], usize, usize, Value); 15] =
    [
        ("a highlight 1e3 times the rest", [12, 9], 9, 7, |t, l, v, c| {
            if l == v && t % 3 == 0 { 200.0 } else { smooth(t, l, v, c) }
        }),
        ("a highlight 1e4 times the rest", [12, 9], 9, 7, |t, l, v, c| {
            if l == v && t % 3 == 0 { 2000.0 } else { smooth(t, l, v, c) }
        }),
        ("a highlight 1e6 times the rest", [12, 9], 9, 7, |t, l, v, c| {
            if l == v && t % 3 == 0 { 600.0 } else { smooth(t, l, v, c) * 0.003 }
        }),
        ("one texel with a highlight 1e6 times the rest", [12, 9], 9, 7, |t, l, v, c| {
            if t == 40 && l == 3 && v == 2 { 600.0 } else { smooth(t, l, v, c) * 0.003 }
        }),
        ("zeros in a third of all", [12, 9], 9, 7, |t, l, v, c| {
            if (t + l + v) % 3 == 0 { 0.0 } else { smooth(t, l, v, c) }
        }),
        ("all black", [12, 9], 9, 7, |_, _, _, _| 0.0),
        ("constant", [12, 9], 9, 7, |_, _, _, _| 0.75),
        ("rank one", [12, 9], 9, 7, |t, l, v, c| {
            (1.0 + t as f32 * 0.1) * (0.2 + ((l + 2 * v + c) % 11) as f32 * 0.05)
        }),
        ("one image without variance", [12, 9], 9, 7, |t, l, v, c| {
            if l == 3 && v == 2 { 0.4 } else { smooth(t, l, v, c) }
        }),
        ("one texel", [1, 1], 9, 7, smooth),
        ("one light and one view", [12, 9], 1, 1, smooth),
        ("one number", [1, 1], 1, 1, |_, _, _, _| 0.25),
        ("a size that blocks do not divide", [13, 7], 9, 7, smooth),
        ("the top of binary16", [12, 9], 9, 7, |t, l, v, c| 65_504.0 * (0.3 + smooth(t, l, v, c))),
        ("the bottom of binary16", [12, 9], 9, 7, |t, l, v, c| {
            6e-8 * (1.0 + (10.0 * smooth(t, l, v, c)).floor())
        }),
    ];

fn materials() -> Vec<Case> {
    let mut cases = Vec::new();
    for (name, size, lights, views, value) in MATERIALS {
        for (method_name, method) in [("ensemble", Method::Ensemble), ("tensor", Method::Tensor)] {
            for domain in [Domain::Log, Domain::Linear] {
                let of = if domain == Domain::Log { "log" } else { "linear" };
                cases.push(case(
                    "materials",
                    format!("{method_name}, {of}: {name}"),
                    "largest over least value above zero",
                    "the error that the encoder states of whole blocks, or half of what means alone leave if it is less, 5 % more, and 2^-12 of the range of the coded domain",
                    move |folder| {
                        let set = directions::grid(81).expect("known");
                        let data = dataset(folder, size, &set[..lights], &set[..views], value)?;
                        let (bytes, stated) = encoded(&data, method, domain)?;
                        let file = opened(&bytes)?;
                        let offset = data.statistics().log_offset();
                        let metrics = compare(Source::Data(&data), Source::File(&file, 0), data.description(), offset, None, &|_, _| ())?;
                        let largest = data.statistics().largest as f64;
                        let (measured, range) = if domain == Domain::Log {
                            (metrics.log_rms, ((largest + offset as f64) / offset as f64).ln())
                        } else {
                            (metrics.linear_rms, largest)
                        };
                        let least = (0..size[0] * size[1] * lights * views * 3)
                            .map(|i| value(i / (lights * views * 3), i / 3 % lights, i / 3 / lights % views, i % 3))
                            .filter(|v| *v > 0.0)
                            .fold(f32::MAX, f32::min) as f64;
                        let condition = if largest > 0.0 { largest / least } else { 0.0 };
                        // An encoder that states much is not excused: half of what the means alone would leave is the most.
                        let values = |t: usize, i: usize| {
                            let value = value(t, i / 3 % lights, i / 3 / lights, i % 3) as f64;
                            if domain == Domain::Log { (value + offset as f64).ln() } else { value }
                        };
                        let (texels, columns) = (size[0] * size[1], lights * views * 3);
                        let spread = |i: usize| {
                            let mean = (0..texels).map(|t| values(t, i)).sum::<f64>() / texels as f64;
                            (0..texels).map(|t| (values(t, i) - mean).powi(2)).sum::<f64>()
                        };
                        let of_means = ((0..columns).map(spread).sum::<f64>() / (texels * columns) as f64).sqrt();
                        Ok(Outcome { condition, bound: stated.min(of_means / 2.0) * 1.05 + range * 2f64.powi(-12), measured })
                    },
                ));
            }
        }
    }
    cases
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_does_not_hold() {
        assert!(!Outcome { condition: 1.0, bound: 1.0, measured: f64::NAN }.holds());
        assert!(Outcome { condition: 1.0, bound: 1.0, measured: 1.0 }.holds());
    }

    #[test]
    fn every_case_keeps_its_bound() {
        let folder = tempfile::tempdir().expect("a folder");
        let verdicts = run(folder.path(), |_, _| ());
        assert!(verdicts.len() >= 40, "{}", verdicts.len());
        let broken: Vec<String> = verdicts
            .iter()
            .filter(|v| !v.holds())
            .map(|v| format!("{}: {}: {:?}", v.group, v.name, v.outcome))
            .collect();
        assert!(broken.is_empty(), "{} of {} cases:\n{}", broken.len(), verdicts.len(), broken.join("\n"));
    }
}
