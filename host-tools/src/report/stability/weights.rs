//! Bilinear and barycentric weights: none is negative, and they sum to one exactly (chapters 5 and 6).

use super::case::{Case, Outcome, case};
use super::files::{direction, opened, small_file, upward, weight_defect};
use crate::data::directions;
use crate::format::query::query;
use crate::math::random::Random;
use crate::methods::METHODS;
use glam::DVec3;
use selvedge::Direction;
use selvedge::kernel::position::axis_at_position;

/// Sets of directions that are hard to triangulate.
pub(super) fn hard_sets() -> Vec<(&'static str, Vec<DVec3>)> {
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

pub(super) fn cases() -> Vec<Case> {
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
                let bytes = small_file(folder, &set, &set[..set.len().min(3)], [2, 2], METHODS[0])?;
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
