//! Directions at their ends: triangulations of hard sets, the horizon, and continuity along the smallest
//! steps.

use super::case::{Case, Outcome, case};
use super::files::{direction, opened, small_file, upward, weight_defect};
use super::weights::hard_sets;
use crate::data::directions;
use crate::error::Result;
use crate::format::triangulate::{project, triangulate};
use crate::math::random::Random;
use crate::methods::{METHODS, Method};
use selvedge::Direction;
use std::path::Path;

pub(super) fn cases() -> Vec<Case> {
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
            "5.7: weights stay whole, just below is where the horizon is, colours are finite and not \
            negative",
            |folder| {
                let set = directions::grid(81).expect("known");
                let bytes = small_file(folder, &set, &set, [4, 4], METHODS[0])?;
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
    for &method in METHODS {
        for what in ["light", "view", "position"] {
            cases.push(case(
                "continuity",
                format!("{}: {what} in the smallest steps", method.name),
                "steps taken",
                "a step changes a weight by 2^15 over the least height of a triangle and one rounding each; \
                times the range of values, and eight roundings; of Q20",
                move |folder| continuity(folder, method, what),
            ));
        }
    }
    cases
}

/// The largest change of a channel value in one step of a light, view or position, against what the weights
/// allow.
fn continuity(folder: &Path, method: &Method, what: &str) -> Result<Outcome> {
    let set = directions::grid(81).expect("known");
    let bytes = small_file(folder, &set, &set, [6, 6], method)?;
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
