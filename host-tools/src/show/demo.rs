//! The demo: modelled materials are rendered, trained on and encoded ([`super::pipeline`]), measured ones
//! imported from the excerpt in the repository ([`super::excerpt`]); all files are validated, decoded on CPU
//! and GPU and compared word for word, measured against their data, and shown on a page.

use super::{excerpt, pipeline};
use crate::check::info;
use crate::check::validate;
use crate::data::picture::Picture;
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::bits::hex;
use selvedge::{Limits, Selvedge};
use std::path::Path;

/// Runs the demo into a folder; `log` takes each line of progress.
///
/// # Errors
/// If the folder cannot be written, or anything that the demo checks does not hold.
pub fn run(out: &Path, log: &mut dyn FnMut(String)) -> Result<()> {
    std::fs::create_dir_all(out).map_err(ToolError::io(out))?;
    let modelled = pipeline::run(out, log)?;
    let imported = excerpt::import(out, log)?;
    let files = imported.iter().map(|m| (m.path.as_path(), m.bytes.as_slice()));
    let files = files.chain(modelled.written.iter().map(|(path, bytes)| (path.as_path(), bytes.as_slice())));
    let materials = files.map(|(path, bytes)| checked(path, bytes, log)).collect::<Result<Vec<_>>>()?;
    let gpu_line = compare_with_gpu(&materials, log)?;

    let mut rows = String::new();
    let mut balls = Vec::new();
    for (source, material) in imported.iter().zip(&materials) {
        rows += &excerpt::errors(&source.authors, material, log)?;
        balls.push(excerpt::pictures(out, &source.authors, material)?);
    }
    Picture::beside(&balls, 12).save(&out.join("balls.png"))?;
    let page = page(&materials, imported.len(), &modelled.html, &rows, &gpu_line);
    files::write(&out.join("index.html"), page.as_bytes())?;
    log(format!("page: {}", out.join("index.html").display()));
    Ok(())
}

/// A file that was written, validated and opened.
fn checked<'a>(path: &Path, bytes: &'a [u8], log: &mut dyn FnMut(String)) -> Result<Selvedge<'a>> {
    let name = path.display().to_string();
    let report = validate::validate(&name, bytes, None, &validate::Options::default());
    let opened = selvedge::open(bytes, &Limits::default())
        .map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding })?;
    let digest = hex(&opened.decode_digest());
    log(format!("{name}: {} findings, decode digest {}", report.count(), &digest[..16]));
    Ok(opened)
}

#[cfg(feature = "gpu")]
fn compare_with_gpu(materials: &[Selvedge<'_>], log: &mut dyn FnMut(String)) -> Result<String> {
    use crate::gpu::runner::{Answer, Gpu, Query, answer_on_cpu, direction_words, random_query};
    use crate::math::random::Random;
    use crate::show::ball::decode_picture;
    use selvedge::Direction;
    let Some(gpu) = Gpu::any()? else {
        log(
            "NO GPU ADAPTER FOUND, NOT EVEN A SOFTWARE ONE: THE KERNEL WAS NOT RUN AND NOTHING WAS COMPARED."
                .into(),
        );
        return Ok("NO ADAPTER FOUND: THE KERNEL WAS NOT RUN".into());
    };
    let loaded = gpu.load(materials);
    let mut random = Random::new(2);
    let (mut words, mut differing) = (0usize, 0usize);
    let mut compare = |gpu: &[Answer], cpu: &[Answer]| {
        words += cpu.len() * 6;
        let differs = |(a, b): (&Answer, &Answer)| {
            (0..3).filter(|&i| a.rgb[i] != b.rgb[i]).count()
                + (0..3).filter(|&i| a.values[i] != b.values[i]).count()
        };
        differing += gpu.iter().zip(cpu).map(differs).sum::<usize>() + gpu.len().abs_diff(cpu.len()) * 6;
    };
    for entry in ["texel", "filtered", "trilinear", "floats"] {
        let queries: Vec<Query> =
            (0..50_000).map(|i| random_query(&mut random, entry, (i % materials.len()) as u32)).collect();
        let cpu: Vec<Answer> = queries
            .iter()
            .map(|query| answer_on_cpu(&materials[query.material as usize], entry, query))
            .collect();
        compare(&gpu.answer(&loaded, entry, &queries)?, &cpu);
    }
    for (number, material) in materials.iter().enumerate() {
        let [light, view] =
            [Direction::from_unit_vector([0.5, 0.1, 0.86]), Direction::from_unit_vector([-0.3, 0.2, 0.93])];
        let query = Query {
            material: number as u32,
            light: direction_words(light),
            view: direction_words(view),
            ..Query::default()
        };
        let size = material.image_size(0);
        let on_gpu = gpu.image(&loaded, query, size)?;
        let picture = decode_picture(material, 0, light, view)?;
        let located = (material.locate_light(light), material.locate_view(view));
        let values = |i: usize| {
            selvedge::kernel::interpolation::texel_values(
                material.words(),
                material.material(),
                i as u32 % size[0],
                i as u32 / size[0],
                &located.0,
                &located.1,
            )
        };
        let answer = |(i, rgb): (usize, &[f32; 3])| {
            let [r, g, b] = rgb.map(f32::to_bits);
            Answer::new(selvedge::Rgb { r, g, b }, values(i))
        };
        let cpu: Vec<Answer> = picture.pixels.iter().enumerate().map(answer).collect();
        compare(&on_gpu, &cpu);
    }
    let line = format!("{}: {words} words compared, {differing} differ", gpu.description);
    log(line.clone());
    if differing > 0 {
        return Err(ToolError::Mismatch(line));
    }
    Ok(line)
}

#[cfg(not(feature = "gpu"))]
fn compare_with_gpu(_: &[Selvedge<'_>], log: &mut dyn FnMut(String)) -> Result<String> {
    log("BUILT WITHOUT THE gpu FEATURE: THE KERNEL WAS NOT RUN AND NOTHING WAS COMPARED.".into());
    Ok("BUILT WITHOUT THE gpu FEATURE".into())
}

fn page(materials: &[Selvedge<'_>], imported: usize, modelled: &str, rows: &str, gpu_line: &str) -> String {
    let facts: String = materials
        .iter()
        .filter_map(|material| info::info(material).ok())
        .map(|info| format!("<pre>{}</pre>", info::info_text(&info)))
        .collect();
    let tiles: String = materials[..imported]
        .iter()
        .map(|material| {
            let name = material.metadata().name;
            format!(
                "<h3>{name}</h3><p><img src=\"{name}.png\" alt=\"{name}\"></p>\
                 <p>U: decoded, the authors', error (white is 2 % of the range)</p>\
                 <p><img src=\"{name}-U.png\" alt=\"U of {name}\"></p><p>V likewise</p>\
                 <p><img src=\"{name}-V.png\" alt=\"V of {name}\"></p>"
            )
        })
        .collect();
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Selvedge demo</title>\
         <style>body{{font:16px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}\
         img{{max-width:100%;image-rendering:pixelated}}pre{{overflow:auto;background:#f4f4f4;padding:1em}}\
         td,th{{padding:.2em 1em;text-align:right}}</style>\
         <h1>Selvedge demo</h1>{modelled}<h2>Measured materials</h2><p>Measured chroma of two materials (SparseBTF \
         2023, from UBO2014), imported without re-encoding. Luminance is the spatial average for each pair of \
         directions, since its texture is not among the data.</p><p><img src=\"balls.png\" alt=\"two balls\"></p>\
         <h2>CPU and GPU</h2><p>{gpu_line}.</p><h2>Error against the authors' values</h2><p>Of the natural \
         logarithm, over 12 pairs of directions. Texture part: signal over error after the mean of each image is \
         subtracted from both. Whole error: the same signal over all of the error.</p>\
         <table><tr><th>material</th><th>channel</th><th>texture part, dB</th><th>whole error, dB</th>\
         <th>largest, ln</th></tr>{rows}</table><h2>Pictures</h2>{tiles}<h2>Files</h2>{facts}</html>\n"
    )
}
