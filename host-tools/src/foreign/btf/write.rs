//! A dataset as `!FMF06FC`, the plainest factorisation of the `.btf` family, which other people's readers
//! open.
//!
//! The mean over the texels is the first component, the principal components of what is left follow: the best
//! approximation of that rank but for the first column, which is not orthogonal to the others. No reader
//! needs it to be.

use super::head::SIGNATURES;
use crate::data::dataset::{Dataset, Description};
use crate::data::directions::to_degrees;
use crate::data::transfer::Domain;
use crate::error::{Result, ToolError};
use crate::files;
use crate::math::pca::pca;
use glam::DVec3;
use std::path::Path;

/// A text field of 80 bytes.
fn field(text: &str) -> [u8; 80] {
    let mut field = [0; 80];
    // The last byte stays zero.
    let mut end = text.len().min(79);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    field[..end].copy_from_slice(&text.as_bytes()[..end]);
    field
}

/// Everything before the factorisation.
fn head(description: &Description) -> Vec<u8> {
    let mut meta = Vec::new();
    meta.extend(4u32.to_le_bytes());
    meta.extend(field(&description.texts[1]));
    meta.extend(field(""));
    meta.extend(field(""));
    let per_mm = if description.texel_nm[0] > 0 { 1e6 / description.texel_nm[0] as f32 } else { 0.0 };
    [per_mm, 1.0, 1.0, 1.0].iter().for_each(|n: &f32| meta.extend(n.to_le_bytes()));
    meta.extend(u32::from(description.cosine_included).to_le_bytes());
    meta.extend(0u32.to_le_bytes());
    meta.extend(3u32.to_le_bytes());
    for name in ["R", "G", "B"] {
        meta.extend((name.len() as u32).to_le_bytes());
        meta.extend(name.as_bytes());
    }
    let mut bytes = SIGNATURES[3].as_bytes().to_vec();
    bytes.extend((meta.len() as u32 + 4).to_le_bytes());
    bytes.extend(meta);
    let angles = |direction: DVec3| {
        to_degrees(direction).into_iter().flat_map(|angle| (angle.to_radians() as f32).to_le_bytes())
    };
    bytes.extend((description.views.len() as u32).to_le_bytes());
    for &view in &description.views {
        bytes.extend(angles(view));
        bytes.extend((description.lights.len() as u32).to_le_bytes());
        description.lights.iter().for_each(|&light| bytes.extend(angles(light)));
    }
    description.size.iter().for_each(|&n| bytes.extend((n as u32).to_le_bytes()));
    bytes
}

/// Writes the first `components` of a dataset in binary32 (fewer if it has no more); returns the RMS error of
/// linear radiance that they leave.
///
/// # Errors
/// If the data cannot be read or the file cannot be written.
pub fn export(dataset: &Dataset, path: &Path, components: usize) -> Result<f64> {
    let description = dataset.description();
    if components < 2 {
        return Err(ToolError::Usage("a .btf has at least two components: the mean and one more".into()));
    }
    let pca = pca(dataset, Domain::Linear, components - 1)?;
    let (mean, of_texels, of_pairs) = pca.factors();
    let rank = pca.rank();
    let columns = rank + 1;
    let length = mean.iter().map(|&m| f64::from(m).powi(2)).sum::<f64>().sqrt();
    let scale = if length > 0.0 { length } else { 1.0 };

    let mut bytes = head(description);
    let ([width, height], rows) = (description.size, description.texel_len());
    bytes.extend((columns as u32).to_le_bytes());
    bytes.push(4);
    [columns, rows, width * height].iter().for_each(|&n| bytes.extend((n as u32).to_le_bytes()));
    let number = |bytes: &mut Vec<u8>, n: f64| bytes.extend((n as f32).to_le_bytes());
    number(&mut bytes, length * ((width * height) as f64).sqrt());
    (0..rank).for_each(|i| {
        number(
            &mut bytes,
            of_texels.iter().skip(i).step_by(rank).map(|&n| f64::from(n).powi(2)).sum::<f64>().sqrt(),
        )
    });
    for (row, mean) in of_pairs.chunks(rank).zip(mean) {
        number(&mut bytes, f64::from(*mean) / scale);
        row.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    }
    for row in of_texels.chunks(rank) {
        number(&mut bytes, scale);
        row.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    }
    files::write(path, &bytes)?;
    Ok(pca.predicted_rms(rank))
}
