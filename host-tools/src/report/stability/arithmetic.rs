//! The decoder's integer arithmetic against exact arithmetic (chapters 2 and 7).

use super::case::{Case, Outcome, case};
use crate::math::random::Random;
use selvedge::kernel::colour::{transfer_linear, transfer_log2};
use selvedge::kernel::fixed::{exp2_q31, multiply_q13, multiply_q15, round_shift};

/// Random draws of a case.
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

pub(super) fn cases() -> Vec<Case> {
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
            "7.2: of the power of two: 2^-28 of the exponential, 2^-30 of the offset that is cut, half a \
            unit of binary32",
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
