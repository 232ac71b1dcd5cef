//! What the cases share: small datasets and files of them, and directions.

use crate::data::dataset::{Dataset, Description, Sample};
use crate::data::transfer::Domain;
use crate::encode::encoder::{self, Common, Encoder, Levels};
use crate::encode::goal::Goal;
use crate::error::{Result, ToolError};
use crate::math::random::Random;
use crate::methods::sparse_ensemble::encode::settings::SparseEnsemble;
use crate::methods::sparse_tensor::encode::fit::{Shape, Training};
use crate::methods::sparse_tensor::encode::options::SparseTensor;
use crate::methods::{Method, sparse_ensemble, sparse_tensor};
use crate::progress::Quiet;
use glam::DVec3;
use selvedge::{Direction, Limits, Selvedge, Taps};
use std::path::Path;

/// A dataset of a function of texel, light, view and colour.
pub(super) fn dataset(
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

/// The encoder of a method with options that make its files of small datasets as exact as they can be.
fn exact(method: &Method, transfer: Domain) -> Result<(Box<dyn Encoder>, Common)> {
    let common = Common { transfer, ..Common::default() };
    match method.number {
        n if n == sparse_ensemble::METHOD.number => {
            let coefficients = Some([60, 30, 30]);
            let encoder = SparseEnsemble { edge: Some(4), coefficients, ..SparseEnsemble::DEFAULT };
            Ok((Box::new(encoder), common))
        }
        n if n == sparse_tensor::METHOD.number => {
            let shape = Shape { light_atoms: 12, abrdf_atoms: 24, entries: 6, coefficients: 8 };
            let training = Training { iterations: 6, rounds: 2, seed: 1 };
            let encoder = SparseTensor { shape: Some(shape), rank: 24, training, ..SparseTensor::DEFAULT };
            Ok((Box::new(encoder), Common { value_bits: Some([12; 3]), ..common }))
        }
        // Its cases fail, so that a new method is not left out silently.
        _ => Err(ToolError::Mismatch(format!("{}: no options for the cases of stability", method.name))),
    }
}

/// A file of a dataset, as exact as its encoder makes it, and the root mean squared error that the encoder
/// states, in the domain that is coded.
pub(super) fn encoded(data: &Dataset, method: &Method, domain: Domain) -> Result<(Vec<u8>, f64)> {
    let (encoder, common) = exact(method, domain)?;
    let levels = Levels::of(data);
    let made = encoder::encode(encoder.as_ref(), &levels, Goal::AsGiven, &common, &Quiet)?;
    // The stated error is of whole blocks, of which the image may be a part that has all of the error.
    let edge = opened(&made.bytes)?.material().edge as usize;
    let [width, height] = data.description().size;
    let blocks = width.next_multiple_of(edge) * height.next_multiple_of(edge);
    Ok((made.bytes, made.predicted_rms * (blocks as f64 / (width * height) as f64).sqrt()))
}

/// A small legal file with these lights and views, of smooth random numbers.
pub(super) fn small_file(
    folder: &Path,
    lights: &[DVec3],
    views: &[DVec3],
    size: [usize; 2],
    method: &Method,
) -> Result<Vec<u8>> {
    let wave = |t: usize, l: DVec3, v: DVec3, c: usize| {
        ((t % 5) as f64 * 0.3 + 2.0 * l.x + l.y * v.x * 3.0 + v.y + c as f64 * 0.2).sin() * 0.4
            + 0.6 * l.z.max(0.05)
    };
    let data =
        dataset(folder, size, lights, views, |t, l, v, c| wave(t, lights[l], views[v], c).max(0.0) as f32)?;
    encoded(&data, method, Domain::Log).map(|(bytes, _)| bytes)
}

/// Opens a file of a case.
pub(super) fn opened(bytes: &[u8]) -> Result<Selvedge<'_>> {
    selvedge::open(bytes, &Limits::NONE).map_err(|finding| ToolError::Mismatch(finding.to_string()))
}

/// A random direction of the upper hemisphere, uniform over it.
pub(super) fn upward(random: &mut Random) -> DVec3 {
    let (z, azimuth) = (random.range(0, 1_000_000) as f64 / 1e6, random.range(0, 6_283_185) as f64 / 1e6);
    DVec3::new((1.0 - z * z).sqrt() * azimuth.cos(), (1.0 - z * z).sqrt() * azimuth.sin(), z)
}

/// A unit vector as a query has it.
pub(super) fn direction(v: DVec3) -> Direction {
    Direction::from_unit_vector([v.x, v.y, v.z].map(|c| c as f32))
}

/// How far barycentric weights are from legal: their sum from one, and the smallest below zero; Q15.
pub(super) fn weight_defect(taps: Taps) -> f64 {
    let w = [taps.weight_a_q15, taps.weight_b_q15, taps.weight_c_q15];
    (w.iter().sum::<i32>() - 32_768).abs().max(-w.into_iter().min().unwrap_or(0)) as f64
}
