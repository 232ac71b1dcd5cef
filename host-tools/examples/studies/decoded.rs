//! A dataset of what a file decodes to: a part of its texels, at some of its own directions.
//!
//! `cargo run --release -p selvedge-tools --example decoded -- FILE.selv OUT.selvset SIDE EVERY`
//!
//! `SIDE` texels along both sides from the origin, every `EVERY`-th light and view. Used to measure methods
//! on values that come from real coefficients.

use selvedge::{Limits, Rgb};
use selvedge_tools::data::dataset::{Dataset, Description, Sample, Writer};
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::files;
use selvedge_tools::format::query::query;
use selvedge_tools::measure::compare::describe;
use std::path::Path;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, out, side, every] = arguments.as_slice() else {
        return Err(ToolError::Usage("FILE.selv OUT.selvset SIDE EVERY".into()));
    };
    let number = |text: &str| {
        text.parse::<usize>()
            .ok()
            .filter(|n| *n > 0)
            .ok_or_else(|| ToolError::Usage(format!("`{text}` is no number above zero")))
    };
    let (side, every) = (number(side)?, number(every)?);
    let bytes = files::read(Path::new(file))?;
    let material = selvedge::open(&bytes, &Limits::NONE)
        .map_err(|finding| ToolError::Invalid { path: file.into(), finding })?;
    let own = describe(&material);
    let size = own.size.map(|n| n.min(side));
    let pick = |set: &[glam::DVec3]| -> Vec<glam::DVec3> { set.iter().copied().step_by(every).collect() };
    let description = Description {
        size,
        lights: pick(&own.lights),
        views: pick(&own.views),
        sample: Sample::Half,
        ..own.clone()
    };
    let (lights, views) = (description.lights.clone(), description.views.clone());
    let writer = Writer::create(Path::new(out), description)?;
    let (mut scratch, mut image) =
        (vec![0; material.image_scratch_len()], vec![Rgb::default(); own.texels()]);
    let mut rows = vec![0.0f32; size[0] * size[1] * lights.len() * 3];
    for (v, &view) in views.iter().enumerate() {
        for (l, &light) in lights.iter().enumerate() {
            material
                .decode_image(0, query(light), query(view), &mut scratch, &mut image)
                .map_err(|e| ToolError::Mismatch(format!("{e:?}")))?;
            for (i, texel) in rows.chunks_mut(lights.len() * 3).enumerate() {
                texel[l * 3..][..3].copy_from_slice(&image[i / size[0] * own.size[0] + i % size[0]].to_f32());
            }
        }
        for (i, texel) in rows.chunks(lights.len() * 3).enumerate() {
            writer.put(i, v * lights.len(), texel)?;
        }
    }
    writer.finish()?;
    let made = Dataset::open(Path::new(out))?;
    println!(
        "{} x {} texels, {} lights, {} views; mean {:?}, largest {}",
        size[0],
        size[1],
        lights.len(),
        views.len(),
        made.statistics().mean,
        made.statistics().largest
    );
    Ok(())
}
