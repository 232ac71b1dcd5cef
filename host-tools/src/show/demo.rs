//! The whole story: modelled materials are rendered, trained on and encoded ([`crate::show::story`]), measured ones
//! imported from the excerpt in the repository; all files are validated, decoded on CPU and GPU and compared
//! word for word, measured against their data, and shown.

use crate::check::info;
use crate::check::validate;
use crate::data::picture::{Picture, false_colour};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::bits::hex;
use crate::format::write;
use crate::methods::sparse_ensemble::sparsebtf::{AuthorsMaterial, VALUE_BITS, read_material};
use crate::show::ball::{decode_picture, render_ball};
use crate::show::story;
use selvedge::{Direction, Limits, Selvedge};
use std::f64::consts::LN_2;
use std::fmt::Write as _;
use std::path::Path;

macro_rules! excerpt {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../data/sparsebtf/", $name)).as_slice())),*]
    };
}

/// The excerpt, in the authors' layout, with its licence.
pub const EXCERPT: &[(&str, &[u8])] = excerpt![
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
            let decoded = [values.c0, values.c1, values.c2][channel] as f64 / 1_048_576.0 * LN_2;
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
    light: usize,
    view: usize,
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
            [values.c0, values.c1, values.c2][channel] as f64 / 1_048_576.0 * LN_2
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

#[cfg(feature = "gpu")]
fn compare_with_gpu(materials: &[Selvedge<'_>], say: &mut dyn FnMut(String)) -> Result<String> {
    use crate::gpu::runner::{Answer, Gpu, Query, answer_on_cpu, direction_words, random_query};
    use crate::math::random::Random;
    let Some(gpu) = Gpu::any()? else {
        say(
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
    say(line.clone());
    if differing > 0 {
        return Err(ToolError::Mismatch(line));
    }
    Ok(line)
}

#[cfg(not(feature = "gpu"))]
fn compare_with_gpu(_: &[Selvedge<'_>], say: &mut dyn FnMut(String)) -> Result<String> {
    say("BUILT WITHOUT THE gpu FEATURE: THE KERNEL WAS NOT RUN AND NOTHING WAS COMPARED.".into());
    Ok("BUILT WITHOUT THE gpu FEATURE".into())
}

/// Runs the demo into a folder; `say` takes each line of progress.
pub fn run(out: &Path, say: &mut dyn FnMut(String)) -> Result<()> {
    std::fs::create_dir_all(out).map_err(ToolError::io(out))?;
    let excerpt = out.join("excerpt");
    std::fs::create_dir_all(&excerpt).map_err(ToolError::io(&excerpt))?;
    for (name, bytes) in EXCERPT {
        files::write(&excerpt.join(name), bytes)?;
    }
    let story = story::tell(out, say)?;
    let mut authors = Vec::new();
    let mut written = Vec::new();
    for name in ["carpet07", "felt05"] {
        let material = read_material(&excerpt, name, None)?;
        let bytes = write::write_material(&material.to_model(VALUE_BITS)?);
        let path = out.join(format!("{name}.selv"));
        files::write(&path, &bytes)?;
        say(format!(
            "imported {name}: {} bytes, {} x {} texels, {} light x {} view directions",
            bytes.len(),
            material.blocks[0] * 10,
            material.blocks[1] * 10,
            material.rows[2],
            material.rows[3]
        ));
        authors.push(material);
        written.push((path, bytes));
    }
    let imported = written.len();
    written.extend(story.written);
    let mut materials = Vec::new();
    for (path, bytes) in &written {
        let report =
            validate::validate(&path.display().to_string(), bytes, None, &validate::Options::default());
        let opened = selvedge::open(bytes, &Limits::default())
            .map_err(|finding| ToolError::Invalid { path: path.clone(), finding })?;
        say(format!(
            "{}: {} findings, decode digest {}",
            path.display(),
            report.count(),
            &hex(&opened.decode_digest())[..16]
        ));
        materials.push(opened);
    }
    let gpu_line = compare_with_gpu(&materials, say)?;

    let mut rows = String::new();
    let mut balls = Vec::new();
    let pairs: Vec<[usize; 2]> = (0..12).map(|i| [(i * 37 + 5) % 151, (i * 61 + 9) % 151]).collect();
    for (authors, material) in authors.iter().zip(&materials[..imported]) {
        for (channel, letter) in [(1, "U"), (2, "V")] {
            let error = channel_error(authors, material, channel, &pairs);
            say(format!(
                "{} {letter}: texture part {:.1} dB against the authors' values, largest error {:.1e}",
                authors.name, error.texture_snr_db, error.largest
            ));
            let _ = writeln!(
                rows,
                "<tr><td>{}</td><td>{letter}</td><td>{:.1}</td><td>{:.1}</td><td>{:.1e}</td></tr>",
                authors.name, error.texture_snr_db, error.total_snr_db, error.largest
            );
            if error.texture_snr_db < 40.0 {
                return Err(ToolError::Mismatch(format!(
                    "{} {letter}: only {:.1} dB",
                    authors.name, error.texture_snr_db
                )));
            }
        }
        let light = glam::DVec3::new(-0.45, 0.5, 0.74).normalize();
        balls.push(render_ball(material, 400, light, 6.0)?);
        let light = Direction::from_unit_vector([0.35, 0.3, 0.887]);
        let view = Direction::from_unit_vector([0.0, 0.0, 1.0]);
        let swatch = decode_picture(material, 0, light, view)?;
        swatch.save(&out.join(format!("{}.exr", authors.name)))?;
        swatch.exposed(4.0).enlarged(4).save(&out.join(format!("{}.png", authors.name)))?;
        channel_tiles(authors, material, 1, 20, 0).save(&out.join(format!("{}-U.png", authors.name)))?;
        channel_tiles(authors, material, 2, 20, 0).save(&out.join(format!("{}-V.png", authors.name)))?;
    }
    Picture::beside(&balls, 12).save(&out.join("balls.png"))?;
    files::write(
        &out.join("index.html"),
        page(&materials, imported, &story.html, &rows, &gpu_line).as_bytes(),
    )?;
    say(format!("page: {}", out.join("index.html").display()));
    Ok(())
}

fn page(materials: &[Selvedge<'_>], imported: usize, story: &str, rows: &str, gpu_line: &str) -> String {
    let facts: String = materials
        .iter()
        .filter_map(|material| Some(format!("<pre>{}</pre>", info::info_text(&info::info(material).ok()?))))
        .collect();
    let tiles: String = materials[..imported]
        .iter()
        .map(|material| {
            let name = material.metadata().name;
            format!("<h3>{name}</h3><p><img src=\"{name}.png\" alt=\"{name}\"></p><p>U: decoded, the authors', error (white is 2 % of the range)</p><p><img src=\"{name}-U.png\" alt=\"U of {name}\"></p><p>V likewise</p><p><img src=\"{name}-V.png\" alt=\"V of {name}\"></p>")
        })
        .collect();
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Selvedge demo</title>\
<style>body{{font:16px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}img{{max-width:100%;image-rendering:pixelated}}\
pre{{overflow:auto;background:#f4f4f4;padding:1em}}td,th{{padding:.2em 1em;text-align:right}}</style>\
<h1>Selvedge demo</h1>{story}<h2>Measured materials</h2><p>Measured chroma of two materials (SparseBTF 2023, from UBO2014), imported without encoding anew. Luminance is the spatial \
average for each pair of directions, since its texture is not among the data.</p><p><img src=\"balls.png\" alt=\"two balls\"></p>\
<h2>CPU and GPU</h2><p>{gpu_line}.</p><h2>Error against the authors' values</h2><p>Of the natural logarithm, over 12 pairs of directions. Texture part: signal over error after the mean of each image is taken out of both. Whole error: the same signal over all of the error.</p>\
<table><tr><th>material</th><th>channel</th><th>texture part, dB</th><th>whole error, dB</th><th>largest, ln</th></tr>{rows}</table>\
<h2>Pictures</h2>{tiles}<h2>Files</h2>{facts}</html>\n"
    )
}
