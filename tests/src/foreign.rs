//! Third-party files, written for the tests from the layouts that are known of them, and what must be read from
//! them.
//!
//! Nothing here is shared with the readers of `selvedge_tools::foreign`: numbers are rounded as the file has
//! them, and what is expected is computed from those in binary64 by the formulas of the formats.

use half::f16;
use selvedge_tools::math::random::Random;

/// A `.btf` of the tests and what its values are.
pub struct Written {
    /// What it is.
    pub name: String,
    /// The file.
    pub bytes: Vec<u8>,
    /// Texels along x and y, lights, views.
    pub shape: [usize; 4],
    /// `[texel][view][light][colour]`, before anything is cut.
    pub expected: Vec<[f64; 3]>,
    /// How far binary32 may be from it.
    pub tolerance: f64,
}

/// Directions of the tests: polar angle and azimuth in radians.
pub const LIGHTS: [[f32; 2]; 3] = [[0.0, 0.0], [0.5, 1.0], [1.2, -2.0]];
/// The same of views.
pub const VIEWS: [[f32; 2]; 2] = [[0.1, 3.0], [1.5, 0.25]];
/// Texels along x and y: not as many as pairs, or nothing would tell rows of the one from rows of the other.
const SIZE: [usize; 2] = [4, 2];

/// Little-endian bytes under construction.
#[derive(Default)]
struct Out(Vec<u8>);

impl Out {
    fn u32(&mut self, n: usize) {
        self.0.extend((n as u32).to_le_bytes());
    }

    fn f32(&mut self, n: f32) {
        self.0.extend(n.to_le_bytes());
    }

    fn u32s(&mut self, numbers: impl IntoIterator<Item = usize>) {
        numbers.into_iter().for_each(|n| self.u32(n));
    }

    fn f32s(&mut self, numbers: impl IntoIterator<Item = f32>) {
        numbers.into_iter().for_each(|n| self.f32(n));
    }

    /// Numbers of a width; gives them as they are then.
    fn numbers(&mut self, width: usize, numbers: &[f64]) -> Vec<f64> {
        numbers
            .iter()
            .map(|&n| match width {
                2 => {
                    self.0.extend(f16::from_f64(n).to_le_bytes());
                    f16::from_f64(n).to_f64()
                }
                4 => {
                    self.0.extend((n as f32).to_le_bytes());
                    f64::from(n as f32)
                }
                _ => {
                    self.0.extend(n.to_le_bytes());
                    n
                }
            })
            .collect()
    }

    fn meta(&mut self, version: usize, cosine: usize, channels: &[&str]) {
        let mut meta = Out::default();
        meta.u32(version);
        for text in ["Dome 1", "sen\u{feff}sor", "lamp\u{202e}"] {
            let mut field = text.as_bytes().to_vec();
            field.resize(80, 0);
            meta.0.extend(field);
        }
        meta.f32s([10.0, 1.0, 1.0, 1.0]);
        if version > 1 {
            meta.u32(cosine);
        }
        if version > 2 {
            meta.u32(5);
            meta.0.extend(b"<xml>");
        }
        if version > 3 {
            meta.u32(channels.len());
            for name in channels {
                meta.u32(name.len());
                meta.0.extend(name.as_bytes());
            }
        }
        self.u32(meta.0.len() + 4);
        self.0.extend(meta.0);
    }

    fn directions(&mut self) {
        self.u32(VIEWS.len());
        for view in VIEWS {
            self.f32s(view);
            self.u32(LIGHTS.len());
            self.f32s(LIGHTS.concat());
        }
    }

    fn size(&mut self) {
        self.u32s(SIZE);
    }

    fn rotations(&mut self, count: usize) {
        self.u32(count);
        for i in 0..count {
            // The last is not the identity.
            let turn = if i + 1 == count { 0.6f32 } else { 0.0 };
            self.f32s([turn.cos(), -turn.sin(), 0.0, turn.sin(), turn.cos(), 0.0, 0.0, 0.0, 1.0]);
        }
    }
}

/// The head of a file up to its size, and rotations where the signature says so.
fn begin(signature: &str, version: usize, channels: &[&str]) -> Out {
    let mut out = Out(signature.as_bytes().to_vec());
    out.meta(version, 1, channels);
    out.directions();
    out.size();
    if signature.ends_with('R') {
        out.rotations(if version == 4 { 6 } else { 0 });
    }
    out
}

/// A factorisation: S, U and SxV of `rows x columns`; gives the product, `[row][column]`.
fn factorisation(
    out: &mut Out,
    random: &mut Random,
    width: usize,
    components: usize,
    [rows, columns]: [usize; 2],
    offset: f64,
) -> Vec<f64> {
    let mut some = |count: usize, base: f64| -> Vec<f64> {
        (0..count).map(|_| base + random.range(-1000, 1000) as f64 / 4000.0).collect()
    };
    let (s, mut u, v) =
        (some(components, 1.0), some(rows * components, 0.0), some(columns * components, 1.0));
    // The first component carries the level of the values.
    (0..rows).for_each(|row| u[row * components] += offset);
    out.0.push(width as u8);
    out.u32s([components, rows, columns]);
    out.numbers(width, &s);
    let u = out.numbers(width, &u);
    let v = out.numbers(width, &v);
    (0..rows * columns)
        .map(|i| {
            (0..components).map(|k| u[i / columns * components + k] * v[i % columns * components + k]).sum()
        })
        .collect()
}

/// All texels, as they stand in the file, from values at `(texel of the file, pair, channel)`.
fn arranged(
    value: impl Fn(usize, usize, usize) -> f64,
    colour: impl Fn([f64; 3]) -> [f64; 3],
) -> Vec<[f64; 3]> {
    let pairs = LIGHTS.len() * VIEWS.len();
    (0..SIZE[0] * SIZE[1] * pairs)
        .map(|i| colour([0, 1, 2].map(|c| value(i / pairs, i % pairs, c))))
        .collect()
}

/// The colour models by their numbers, from the published readers.
fn colour(model: usize, matrix: &[f32; 9], mean: &[f32; 3], v: [f64; 3]) -> [f64; 3] {
    const E: f64 = 1e-5;
    let yuv = |[y, u, v]: [f64; 3]| [y + 1.13983 * v, y - 0.39465 * u - 0.5806 * v, y + 2.03211 * u];
    match model {
        0 => v,
        1 => yuv(v),
        3 => [0, 1, 2]
            .map(|c| (0..3).map(|r| v[r] * f64::from(matrix[r * 3 + c])).sum::<f64>() + f64::from(mean[c])),
        4 => [v[0] + v[1] - v[2], v[0] + v[2], v[0] - v[1] - v[2]],
        9 => yuv([v[0].exp() - E, v[1], v[2]]),
        10 => yuv([
            v[0].exp() - E,
            v[1].signum() * (v[1].abs() + E.ln()).exp(),
            v[2].signum() * (v[2].abs() + E.ln()).exp(),
        ]),
        11 => {
            let y = v[0].exp() - E;
            yuv([y, v[1] * (y + E), v[2] * (y + E)])
        }
        _ => v.map(|v| v.exp() - E),
    }
}

fn written(name: String, out: Out, expected: Vec<[f64; 3]>) -> Written {
    let largest = expected.iter().flatten().fold(1.0f64, |a, b| a.max(b.abs()));
    Written {
        name,
        bytes: out.0,
        shape: [SIZE[0], SIZE[1], LIGHTS.len(), VIEWS.len()],
        expected,
        tolerance: largest * 3e-6,
    }
}

fn decorrelated(model: usize, width: usize, version: usize, channels: &[&str], transposed: bool) -> Written {
    let mut random = Random::new((model * 100 + width) as u64);
    let mut out = begin("!DFMF08FCR", version, channels);
    let (matrix, mean) = ([0.5, 0.5, 0.4, -0.5, 0.2, 0.3, 0.1, -0.4, 0.9f32], [0.7, 0.8, 0.9f32]);
    out.u32(4);
    out.u32(model);
    out.f32s(mean);
    out.f32s(matrix);
    let (texels, pairs) = (SIZE[0] * SIZE[1], LIGHTS.len() * VIEWS.len());
    // U and V of the model 10 are logarithms over e.
    let offset = |c: usize| if model == 10 && c > 0 { 9.0 } else { 0.6 };
    let planes: Vec<Vec<f64>> = (0..channels.len())
        .map(|c| {
            factorisation(
                &mut out,
                &mut random,
                width,
                4 - c,
                if transposed { [texels, pairs] } else { [pairs, texels] },
                offset(c),
            )
        })
        .collect();
    let value = |texel: usize, pair: usize, c: usize| {
        planes[c.min(channels.len() - 1)]
            [if transposed { texel * pairs + pair } else { pair * texels + texel }]
    };
    let expected = arranged(value, |v| colour(model, &matrix, &mean, v));
    written(
        format!(
            "DFMF08FCR, model {model}, {width} bytes, version {version}, {} channels{}",
            channels.len(),
            if transposed { ", transposed" } else { "" }
        ),
        out,
        expected,
    )
}

fn full(
    signature: &str,
    extension: Option<(u8, bool, bool)>,
    width: usize,
    channels: &[&str],
    transposed: bool,
) -> Written {
    let mut random = Random::new(width as u64 + 7);
    let mut out = begin(signature, 4, channels);
    let mut is_log = false;
    if let Some((version, log, heights)) = extension {
        out.0.push(version);
        if version >= 1 {
            is_log = log;
            out.u32(usize::from(log));
        }
        if version >= 2 {
            out.u32s([2, if heights { 2 } else { 0 }]);
            if heights {
                out.numbers(2, &[0.25, 0.5, 0.75, 1.0]);
            }
        }
    }
    let count = channels.len();
    let (texels, pairs) = (SIZE[0] * SIZE[1], LIGHTS.len() * VIEWS.len());
    out.u32(5);
    let plane = factorisation(
        &mut out,
        &mut random,
        width,
        5,
        if transposed { [texels * count, pairs] } else { [pairs * count, texels] },
        0.5,
    );
    let value = |texel: usize, pair: usize, c: usize| {
        let c = c.min(count - 1);
        plane[if transposed {
            (texel * count + c) * pairs + pair
        } else {
            (pair * count + c) * texels + texel
        }]
    };
    let expected = arranged(value, |v| if is_log { v.map(|v| v.exp() - 1e-5) } else { v });
    let extension = extension.map_or(String::new(), |(version, log, heights)| {
        format!(", extension {version}, log {log}, heights {heights}")
    });
    written(
        format!(
            "{}{extension}, {width} bytes, {count} channels{}",
            &signature[1..],
            if transposed { ", transposed" } else { "" }
        ),
        out,
        expected,
    )
}

fn by_view(signature: &str, old: bool, width: usize, transposed: bool) -> Written {
    let mut random = Random::new(width as u64 + 70);
    let (texels, lights) = (SIZE[0] * SIZE[1], LIGHTS.len());
    let mut out = if old {
        let mut out = Out(signature.as_bytes().to_vec());
        out.u32(301_074);
        out.u32(3);
        out.size();
        out.u32(VIEWS.len());
        out.directions();
        out
    } else {
        let mut out = begin(signature, 4, &["R", "G", "B"]);
        out.u32(3);
        out.u32(VIEWS.len());
        out
    };
    let mut planes = Vec::new();
    for view in 0..VIEWS.len() {
        let components = 3 - view;
        let (weights, dimension) = if transposed { (lights, texels * 3) } else { (texels, lights * 3) };
        let mut some = |count: usize, base: f64| -> Vec<f64> {
            (0..count).map(|_| base + random.range(-1000, 1000) as f64 / 4000.0).collect()
        };
        out.0.push(width as u8);
        out.u32s([components, weights, dimension]);
        out.numbers(width, &some(components, 1.0));
        let mean = out.numbers(width, &some(dimension, 1.5));
        let c = out.numbers(width, &some(dimension * components, 0.0));
        let w = out.numbers(width, &some(weights * components, 0.0));
        planes.push((components, mean, c, w));
    }
    let value = |texel: usize, pair: usize, channel: usize| {
        let (components, mean, c, w) = &planes[pair / lights];
        let light = pair % lights;
        let (at, weight) =
            if transposed { (texel * 3 + channel, light) } else { (light * 3 + channel, texel) };
        mean[at] + (0..*components).map(|k| c[at * components + k] * w[weight * components + k]).sum::<f64>()
    };
    let expected = arranged(value, |v| v);
    let words =
        [if old { ", older layout" } else { "" }, if transposed { ", transposed" } else { "" }].concat();
    written(format!("{}, {width} bytes{words}", &signature[1..]), out, expected)
}

fn store(compression: u8, lines: usize, channels: &[&str]) -> Written {
    let mut random = Random::new(lines as u64);
    let mut out = Out(b"!BDIF06R2!".to_vec());
    out.meta(3 + usize::from(channels.len() != 3), 1, channels);
    out.directions();
    out.size();
    out.u32(lines);
    out.0.push(compression);
    let mask = [1u8, 0, 1, 1, 1, 1, 1, 0];
    out.0.extend(mask);
    out.rotations(0);
    let (texels, count) = (SIZE[0] * SIZE[1], LIGHTS.len() * VIEWS.len() * channels.len());
    let numbers: Vec<f64> =
        (0..texels * count).map(|_| f16::from_f64(random.range(0, 4000) as f64 / 1000.0).to_f64()).collect();
    let is_there = |texel: usize| compression == 0 || mask[texel] != 0;
    let there: Vec<usize> = (0..texels).filter(|&texel| is_there(texel)).collect();
    for chunk in there.chunks(lines * SIZE[0]) {
        out.u32(chunk.len() * count * 2);
        chunk.iter().for_each(|&texel| {
            out.numbers(2, &numbers[texel * count..][..count]);
        });
    }
    let value = |texel: usize, pair: usize, c: usize| {
        if is_there(texel) {
            numbers[texel * count + pair * channels.len() + c.min(channels.len() - 1)]
        } else {
            0.0
        }
    };
    let expected = arranged(value, |v| v);
    Written {
        tolerance: 0.0,
        ..written(
            format!("BDIF06R2!, compression {compression}, {lines} lines, {} channels", channels.len()),
            out,
            expected,
        )
    }
}

/// A file of every variant that is read.
pub fn btf_variants() -> Vec<Written> {
    const RGB: &[&str] = &["R", "G", "B"];
    let mut all = Vec::new();
    for model in [0, 1, 3, 4, 9, 10, 11, 12] {
        for width in [2, 4, 8] {
            all.push(decorrelated(model, width, 4, RGB, false));
        }
    }
    for version in 1..4 {
        all.push(decorrelated(11, 4, version, RGB, false));
    }
    all.push(decorrelated(0, 4, 4, &["550"], false));
    all.push(decorrelated(11, 2, 4, RGB, true));
    for extension in [
        (0, false, false),
        (1, false, false),
        (1, true, false),
        (2, true, false),
        (2, false, true),
        (2, true, true),
    ] {
        all.push(full("!FMF12FCER", Some(extension), 4, RGB, false));
    }
    for width in [2, 4, 8] {
        all.push(full("!FMF12FCER", Some((2, true, false)), width, RGB, true));
        all.push(full("!FMF06FCR", None, width, RGB, false));
        all.push(full("!FMF06FC", None, width, RGB, false));
        for transposed in [false, true] {
            all.push(by_view("!PVF06FCR", false, width, transposed));
            all.push(by_view("!PVF06FC", false, width, transposed));
            all.push(by_view("!PVF06FC", true, width, transposed));
        }
    }
    all.push(full("!FMF06FC", None, 4, &["Y"], false));
    all.push(full("!FMF06FC", None, 4, &["Y"], true));
    for compression in [0, 2] {
        for lines in [1, 2, 5] {
            all.push(store(compression, lines, RGB));
        }
        all.push(store(compression, 1, &["Y"]));
    }
    all
}

/// A large `DFMF08FCR` as UBO2014 has them, written piece by piece: colour model 11, binary16, a plausible
/// cloth of the stated numbers of components.
///
/// # Errors
/// On I/O.
pub fn write_large(
    out: &mut impl std::io::Write,
    size: [usize; 2],
    directions: &[[f32; 2]],
    components: [usize; 3],
) -> std::io::Result<()> {
    let mut head = Out(b"!DFMF08FCR".to_vec());
    head.meta(4, 1, &["R", "G", "B"]);
    head.u32(directions.len());
    for view in directions {
        head.f32s(*view);
        head.u32(directions.len());
        head.f32s(directions.concat());
    }
    head.u32s(size);
    head.u32(0);
    head.u32(components[0]);
    head.u32(11);
    (0..12).for_each(|_| head.f32(0.0));
    out.write_all(&head.0)?;
    let (texels, pairs) = (size[0] * size[1], directions.len() * directions.len());
    let vector =
        |[polar, azimuth]: [f32; 2]| [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
    let mut random = Random::new(1);
    for (channel, count) in components.into_iter().enumerate() {
        let mut block = Out(vec![2]);
        block.u32s([count, pairs, texels]);
        block.numbers(2, &vec![1.0; count]);
        // Rows of pairs: the level of a diffuse surface with a lobe, then smooth waves over both directions,
        // weaker and finer.
        let phases: Vec<[f64; 5]> = (0..count)
            .map(|k| {
                [0, 1, 2, 3, 4].map(|_| random.range(-1000, 1000) as f64 / 1000.0 * (2.0 + k as f64 / 6.0))
            })
            .collect();
        for pair in 0..pairs {
            let (l, v) =
                (vector(directions[pair % directions.len()]), vector(directions[pair / directions.len()]));
            let row: Vec<f64> = (0..count)
                .map(|k| {
                    let wave = phases[k][0] * f64::from(l[0])
                        + phases[k][1] * f64::from(l[1])
                        + phases[k][2] * f64::from(v[0])
                        + phases[k][3] * f64::from(v[1]);
                    let half: f32 = l[2] + v[2];
                    let level =
                        [f64::from(l[2].max(0.02)).ln() - 1.5 + f64::from(half - 1.0), 0.05, 0.02][channel];
                    if k == 0 {
                        level
                    } else {
                        (wave + phases[k][4]).sin() * [0.5, 0.02, 0.02][channel] / (k as f64).powf(0.8)
                    }
                })
                .collect();
            block.numbers(2, &row);
        }
        out.write_all(&block.0)?;
        // Rows of texels: waves over the weave, and noise.
        for y in 0..size[1] {
            let mut line = Out::default();
            for x in 0..size[0] {
                let row: Vec<f64> = (0..count)
                    .map(|k| {
                        let (fx, fy) = ((1 + k % 7) as f64, (1 + k / 7) as f64);
                        let wave = (fx * x as f64 * 0.157).sin() * (fy * y as f64 * 0.157 + k as f64).cos();
                        if k == 0 { 1.0 } else { wave + random.range(-100, 100) as f64 / 1000.0 }
                    })
                    .collect();
                line.numbers(2, &row);
            }
            out.write_all(&line.0)?;
        }
    }
    Ok(())
}

/// A zip archive of stored files.
pub fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut directory = Vec::new();
    for (name, bytes) in files {
        let offset = out.len() as u32;
        let (crc, length) = (selvedge::crc32(0, bytes), bytes.len() as u32);
        let mut common = Vec::new();
        // Version 2.0, no flags, stored, a date.
        [20u16, 0, 0, 0, 0x5821].iter().for_each(|n| common.extend(n.to_le_bytes()));
        [crc, length, length].iter().for_each(|n| common.extend(n.to_le_bytes()));
        [name.len() as u16, 0].iter().for_each(|n| common.extend(n.to_le_bytes()));
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(*bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // Comment, disk, attributes, offset.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = out.len() as u32;
    out.extend(&directory);
    out.extend(b"PK\x05\x06");
    [0u16, 0, files.len() as u16, files.len() as u16].iter().for_each(|n| out.extend(n.to_le_bytes()));
    [directory.len() as u32, start].iter().for_each(|n| out.extend(n.to_le_bytes()));
    out.extend([0; 2]);
    out
}

/// A Radiance picture without run lengths; `rows` as they stand in the file.
pub fn radiance(header: &str, resolution: &str, rows: &[[u8; 4]]) -> Vec<u8> {
    let mut out = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n{resolution}\n").into_bytes();
    rows.iter().for_each(|rgbe| out.extend(rgbe));
    out
}
