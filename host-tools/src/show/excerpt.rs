//! The measured part of the demo: the excerpt of SparseBTF, imported, measured against the authors' values,
//! and shown.

use super::ball::{decode_picture, render_ball};
use crate::data::picture::{Picture, false_colour};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::units::ONE_Q20;
use crate::format::write;
use crate::methods::sparse_ensemble::sparsebtf::{AuthorsMaterial, VALUE_BITS, read_material};
use selvedge::{Direction, Selvedge};
use std::f64::consts::LN_2;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

macro_rules! excerpt {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../data/sparsebtf/", $name)).as_slice())),*]
    };
}

/// The excerpt, in the authors' layout, with its licence.
const EXCERPT: &[(&str, &[u8])] = excerpt![
    "Coeffs_BTF_carpet07_1e-05_U.bin",
    "Coeffs_BTF_carpet07_1e-05_V.bin",
    "Coeffs_BTF_felt05_1e-05_U.bin",
    "Coeffs_BTF_felt05_1e-05_V.bin",
    "DictEnsOrth4DU.bin",
    "DictEnsOrth4DV.bin",
    "LICENSE-SparseBTF.txt",
    "README.md",
    "carpet07_mean_std.bin",
    "felt05_mean_std.bin",
    "xyz_loc.bin",
];

/// Texture part below which the demo fails, decibels.
const LEAST_SNR_DB: f64 = 40.0;

/// A material of the excerpt, and the file that it became.
pub(super) struct ImportedMaterial {
    pub(super) authors: AuthorsMaterial,
    pub(super) path: PathBuf,
    pub(super) bytes: Vec<u8>,
}

/// Writes the excerpt with its licence, and a file of each of its materials.
pub(super) fn import(out: &Path, log: &mut dyn FnMut(String)) -> Result<Vec<ImportedMaterial>> {
    let folder = out.join("excerpt");
    std::fs::create_dir_all(&folder).map_err(ToolError::io(&folder))?;
    for (name, bytes) in EXCERPT {
        files::write(&folder.join(name), bytes)?;
    }
    let mut all = Vec::new();
    for name in ["carpet07", "felt05"] {
        let authors = read_material(&folder, name, None)?;
        let bytes = write::write_material(&authors.to_model(VALUE_BITS)?);
        let path = out.join(format!("{name}.selv"));
        files::write(&path, &bytes)?;
        log(format!(
            "imported {name}: {} bytes, {} x {} texels, {} light x {} view directions",
            bytes.len(),
            authors.blocks[0] * 10,
            authors.blocks[1] * 10,
            authors.rows[2],
            authors.rows[3]
        ));
        all.push(ImportedMaterial { authors, path, bytes });
    }
    Ok(all)
}

/// Error of a decoded channel against the authors' values.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChannelError {
    /// Texture part: signal to noise after the spatial mean of each image is removed from both, decibels.
    pub texture_snr_db: f64,
    /// The whole error against the texture part of the signal, decibels.
    pub total_snr_db: f64,
    /// Largest error, natural logarithm.
    pub largest: f64,
}

/// Measures a channel over images at `pairs` of sample directions.
pub fn channel_error(
    authors: &AuthorsMaterial,
    material: &Selvedge<'_>,
    channel: usize,
    pairs: &[[usize; 2]],
) -> ChannelError {
    let [width, height] = material.image_size(0);
    let (mut signal, mut error, mut texture_error, mut largest) = (0.0, 0.0, 0.0, 0.0f64);
    for &[light, view] in pairs {
        let pair = view * authors.rows[2] + light;
        let reference = authors.normalised_image(channel, light, view);
        let (mut s, mut s2, mut e, mut e2) = (0.0, 0.0, 0.0, 0.0);
        for (i, n) in reference.iter().enumerate() {
            let values = material.point_values(i as u32 % width, i as u32 / width, light as u32, view as u32);
            let decoded = [values.c0, values.c1, values.c2][channel] as f64 / ONE_Q20 * LN_2;
            let wanted = n * authors.deviation[pair] + authors.mean[pair];
            let difference = decoded - wanted;
            s += wanted;
            s2 += wanted * wanted;
            e += difference;
            e2 += difference * difference;
            largest = largest.max(difference.abs());
        }
        let count = (width * height) as f64;
        signal += s2 / count - (s / count).powi(2);
        error += e2 / count;
        texture_error += e2 / count - (e / count).powi(2);
    }
    ChannelError {
        texture_snr_db: 10.0 * (signal / texture_error).log10(),
        total_snr_db: 10.0 * (signal / error).log10(),
        largest,
    }
}

/// A channel's decoded values, the authors', and their difference in false colour, side by side.
fn channel_tiles(
    authors: &AuthorsMaterial,
    material: &Selvedge<'_>,
    channel: usize,
    [light, view]: [usize; 2],
) -> Picture {
    let [width, height] = material.image_size(0).map(|s| s as usize);
    let pair = view * authors.rows[2] + light;
    let reference: Vec<f64> = authors
        .normalised_image(channel, light, view)
        .iter()
        .map(|n| n * authors.deviation[pair] + authors.mean[pair])
        .collect();
    let decoded: Vec<f64> = (0..width * height)
        .map(|i| {
            let values =
                material.point_values((i % width) as u32, (i / width) as u32, light as u32, view as u32);
            [values.c0, values.c1, values.c2][channel] as f64 / ONE_Q20 * LN_2
        })
        .collect();
    let (low, high) =
        reference.iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    let grey = |values: &[f64]| {
        Picture::from_fn(width, height, |x, y| {
            [(((values[y * width + x] - low) / (high - low)).clamp(0.0, 1.0).powf(2.2)) as f32; 3]
        })
    };
    let error = Picture::from_fn(width, height, |x, y| {
        false_colour(
            ((decoded[y * width + x] - reference[y * width + x]).abs() / ((high - low) * 0.02)) as f32,
        )
    });
    Picture::beside(&[grey(&decoded).enlarged(4), grey(&reference).enlarged(4), error.enlarged(4)], 8)
}

/// Rows of the page's table of errors.
///
/// # Errors
/// If a channel's texture is too far from the authors' values.
pub(super) fn errors(
    authors: &AuthorsMaterial,
    material: &Selvedge<'_>,
    log: &mut dyn FnMut(String),
) -> Result<String> {
    let pairs: Vec<[usize; 2]> = (0..12).map(|i| [(i * 37 + 5) % 151, (i * 61 + 9) % 151]).collect();
    let mut rows = String::new();
    for (channel, letter) in [(1, "U"), (2, "V")] {
        let error = channel_error(authors, material, channel, &pairs);
        log(format!(
            "{} {letter}: texture part {:.1} dB against the authors' values, largest error {:.1e}",
            authors.name, error.texture_snr_db, error.largest
        ));
        let _ = writeln!(
            rows,
            "<tr><td>{}</td><td>{letter}</td><td>{:.1}</td><td>{:.1}</td><td>{:.1e}</td></tr>",
            authors.name, error.texture_snr_db, error.total_snr_db, error.largest
        );
        if error.texture_snr_db < LEAST_SNR_DB {
            return Err(ToolError::Mismatch(format!(
                "{} {letter}: only {:.1} dB",
                authors.name, error.texture_snr_db
            )));
        }
    }
    Ok(rows)
}

/// Writes the pictures of a material; returns its ball.
pub(super) fn pictures(out: &Path, authors: &AuthorsMaterial, material: &Selvedge<'_>) -> Result<Picture> {
    let name = &authors.name;
    let light = Direction::from_unit_vector([0.35, 0.3, 0.887]);
    let view = Direction::from_unit_vector([0.0, 0.0, 1.0]);
    let swatch = decode_picture(material, 0, light, view)?;
    swatch.save(&out.join(format!("{name}.exr")))?;
    swatch.exposed(4.0).enlarged(4).save(&out.join(format!("{name}.png")))?;
    channel_tiles(authors, material, 1, [20, 0]).save(&out.join(format!("{name}-U.png")))?;
    channel_tiles(authors, material, 2, [20, 0]).save(&out.join(format!("{name}-V.png")))?;
    render_ball(material, 400, glam::DVec3::new(-0.45, 0.5, 0.74).normalize(), 6.0)
}
