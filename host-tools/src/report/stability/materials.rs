//! Whole materials, stiff and degenerate, through every encoder and the decoder.

use super::case::{Case, Outcome, case};
use super::files::{dataset, encoded, opened};
use crate::data::directions;
use crate::data::transfer::Domain;
use crate::encode::goal::{domain_name, rms_of};
use crate::error::Result;
use crate::measure::compare::compare;
use crate::measure::radiance::AtLevel;
use crate::methods::{METHODS, Method};
use std::path::Path;

/// What a value of a material is, by texel, light, view and colour.
type Value = fn(usize, usize, usize, usize) -> f32;

fn smooth(t: usize, l: usize, v: usize, c: usize) -> f32 {
    0.2 + 0.1 * ((t as f32 * 0.9 + l as f32 * 0.4).sin() + (v as f32 * 0.5 + c as f32).cos()) * 0.9
}

/// A material by name, texels, counts of lights and views, and values.
type Material = (&'static str, [usize; 2], usize, usize, Value);

const MATERIALS: [Material; 15] =
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

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for material in MATERIALS {
        for &method in METHODS {
            for domain in [Domain::Log, Domain::Linear] {
                cases.push(case(
                    "materials",
                    format!("{}, {}: {}", method.name, domain_name(domain), material.0),
                    "largest over least value above zero",
                    "the error that the encoder states of whole blocks, \
                     or half of what means alone leave if it is less, 5 % more, \
                     and 2^-12 of the range of the coded domain",
                    move |folder| through_a_file(folder, material, method, domain),
                ));
            }
        }
    }
    cases.push(no_numbers());
    cases
}

/// Encodes and decodes a material: its error against that which the encoder states.
fn through_a_file(folder: &Path, material: Material, method: &Method, domain: Domain) -> Result<Outcome> {
    let (_, size, lights, views, value) = material;
    let set = directions::grid(81).expect("known");
    let data = dataset(folder, size, &set[..lights], &set[..views], value)?;
    let (bytes, stated) = encoded(&data, method, domain)?;
    let file = opened(&bytes)?;
    let offset = data.statistics().log_offset();
    let metrics = compare(&data, &AtLevel::finest(&file), data.description(), offset, None, &|_, _| ())?;
    let largest = data.statistics().largest as f64;
    let range = match domain {
        Domain::Log => ((largest + offset as f64) / offset as f64).ln(),
        Domain::Linear => largest,
    };
    let least = (0..size[0] * size[1] * lights * views * 3)
        .map(|i| value(i / (lights * views * 3), i / 3 % lights, i / 3 / lights % views, i % 3))
        .filter(|v| *v > 0.0)
        .fold(f32::MAX, f32::min) as f64;
    // An encoder that states much is not excused: half of what the means alone would leave is the most.
    let most = error_of_means(material, domain, offset) / 2.0;
    Ok(Outcome {
        condition: if largest > 0.0 { largest / least } else { 0.0 },
        bound: stated.min(most) * 1.05 + range * 2f64.powi(-12),
        measured: rms_of(&metrics, domain),
    })
}

/// The root mean squared error of the mean over all texels, of each pair and colour.
fn error_of_means((_, size, lights, views, value): Material, domain: Domain, offset: f32) -> f64 {
    let values = |t: usize, i: usize| {
        let value = value(t, i / 3 % lights, i / 3 / lights, i % 3) as f64;
        if domain == Domain::Log { (value + offset as f64).ln() } else { value }
    };
    let (texels, columns) = (size[0] * size[1], lights * views * 3);
    let spread = |i: usize| {
        let mean = (0..texels).map(|t| values(t, i)).sum::<f64>() / texels as f64;
        (0..texels).map(|t| (values(t, i) - mean).powi(2)).sum::<f64>()
    };
    ((0..columns).map(spread).sum::<f64>() / (texels * columns) as f64).sqrt()
}

/// Values that are no radiances are refused before anything is computed from it.
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
