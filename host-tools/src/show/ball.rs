//! Decoded materials as pictures: a whole image, or a ball. Presentation only.

use crate::data::picture::Picture;
use crate::error::{Result, ToolError};
use selvedge::FilteredQuery;
use selvedge::{Direction, Rgb, Selvedge};

/// A ball of the material under a distant light: orthographic, the texture laid on from the front.
///
/// `size` is the picture's side in pixels, `light` a vector towards the light, and `exposure` a factor of
/// linear radiance.
///
/// # Errors
/// [`ToolError::Mismatch`] if the core refuses the buffers of its own sizes.
pub fn render_ball(
    material: &Selvedge<'_>,
    size: usize,
    light: glam::DVec3,
    exposure: f32,
) -> Result<Picture> {
    const OVERSAMPLING: usize = 2;
    const BACKGROUND: f32 = 0.12;
    let wide = size * OVERSAMPLING;
    let mut queries = Vec::new();
    let mut places = Vec::new();
    let mut background = vec![0.0; size * size];
    for y in 0..wide {
        for x in 0..wide {
            let [px, py] = [x, y].map(|c| (c as f64 + 0.5) / wide as f64 * 2.1 - 1.05);
            let square = px * px + py * py;
            if square >= 1.0 {
                background[y / OVERSAMPLING * size + x / OVERSAMPLING] +=
                    BACKGROUND / (OVERSAMPLING * OVERSAMPLING) as f32;
                continue;
            }
            let normal = glam::DVec3::new(px, -py, (1.0 - square).sqrt());
            let tangent = (glam::DVec3::X - normal * normal.x).normalize_or(glam::DVec3::Z);
            let bitangent = normal.cross(tangent);
            let local = |v: glam::DVec3| {
                let [x, y, z] = [v.dot(tangent), v.dot(bitangent), v.dot(normal)].map(|c| c as f32);
                Direction::from_unit_vector([x, y, z])
            };
            let fraction = |turns: f64| (turns.rem_euclid(1.0) * 4_294_967_296.0) as u32;
            let (u, v) = (normal.x.asin() * 1.6, normal.y.asin() * 1.6);
            queries.push(FilteredQuery {
                u_q32: fraction(u),
                v_q32: fraction(v),
                light: local(light),
                view: local(glam::DVec3::Z),
            });
            places.push(y / OVERSAMPLING * size + x / OVERSAMPLING);
        }
    }
    let mut out = vec![Rgb::default(); queries.len()];
    let mut scratch = vec![0; material.batch_scratch_len(queries.len())];
    material
        .sample_batch(&queries, &mut scratch, &mut out)
        .map_err(|error| ToolError::Mismatch(error.to_string()))?;
    let weight = exposure / (OVERSAMPLING * OVERSAMPLING) as f32;
    let mut picture = Picture::from_fn(size, size, |x, y| [background[y * size + x]; 3]);
    for (place, rgb) in places.into_iter().zip(out) {
        for (sum, c) in picture.pixels[place].iter_mut().zip(rgb.to_f32()) {
            *sum += c * weight;
        }
    }
    Ok(picture)
}

/// An image of the whole material at one pair of directions: linear radiance, row by row, of a level of
/// detail from 0, the finest.
///
/// # Errors
/// [`ToolError::Mismatch`] if the core refuses the buffers of its own sizes.
pub fn decode_picture(
    material: &Selvedge<'_>,
    level: u32,
    light: Direction,
    view: Direction,
) -> Result<Picture> {
    let [width, height] = material.image_size(level).map(|s| s as usize);
    let mut out = vec![Rgb::default(); width * height];
    let mut scratch = vec![0; material.image_scratch_len()];
    material
        .decode_image(level, light, view, &mut scratch, &mut out)
        .map_err(|error| ToolError::Mismatch(error.to_string()))?;
    Ok(Picture { width, height, pixels: out.into_iter().map(Rgb::to_f32).collect() })
}
