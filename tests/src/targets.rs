//! Bodies of the fuzz targets: each takes any bytes and asserts more than that nothing panics.
//!
//! The targets of `fuzz/` call them under libFuzzer, `soak` calls them without it, and the ordinary tests
//! replay seeds and regressions.

use selvedge::FilteredQuery;
use selvedge::kernel::interpolation::{filtered_values, radiance, texel_values};
use selvedge::{Direction, Finding, First, Limits, Part, Rgb, Selvedge};
use selvedge_tools::check::count;
use selvedge_tools::check::vectors::{Answer, Vector};
use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::error::ToolError;
use selvedge_tools::foreign::ImportOptions;
use selvedge_tools::foreign::archive::Archive;
use selvedge_tools::foreign::btf::Btf;
use selvedge_tools::foreign::bytes::Bytes;
use selvedge_tools::foreign::images::{self, ImageSet};
use selvedge_tools::foreign::pixels::{self, Colours};
use selvedge_tools::format::container::{lay_out, repair_checksums, take_apart};
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::METHODS;
use selvedge_tools::methods::reach::Reach;
use selvedge_tools::methods::read::{model_of, same_triangles};
use selvedge_tools::methods::sparse_ensemble::dictionary_file;
use selvedge_tools::methods::sparse_ensemble::sparsebtf;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A target: its name and its body.
pub struct Target {
    /// Name, that of its file in `fuzz/fuzz_targets` and of its folder of seeds.
    pub name: &'static str,
    /// What it does with any bytes.
    pub run: fn(&[u8]),
    /// Bytes of heap that it may take beyond twice the input, if that is bounded: for third-party files.
    pub memory: Option<usize>,
}

/// All targets.
pub const TARGETS: [Target; 10] = [
    Target { name: "open", run: open, memory: None },
    Target { name: "prefix", run: prefix, memory: None },
    Target { name: "mutate", run: mutate, memory: None },
    Target { name: "generate", run: generate, memory: None },
    Target { name: "paths", run: paths, memory: None },
    Target { name: "importers", run: importers, memory: None },
    Target { name: "btf", run: btf, memory: Some(1 << 20) },
    Target { name: "archive", run: archive, memory: Some(IMAGE_MEMORY + (1 << 20)) },
    Target { name: "pixels", run: image_pixels, memory: Some(IMAGE_MEMORY + (1 << 20)) },
    Target { name: "options", run: options, memory: None },
];

/// Callers of hostile files have limits; these let a sample run in no time.
const LIMITS: Limits = Limits { bytes: 1 << 22, operations: 1 << 18, texels: 1 << 16 };

/// The conformance suite, materials and dictionaries alike.
pub fn suite() -> &'static [Vector] {
    static SUITE: OnceLock<Vec<Vector>> = OnceLock::new();
    SUITE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../spec/vectors");
        selvedge_tools::check::vectors::read(&folder).expect("the suite of the repository")
    })
}

/// Valid materials that need no dictionary.
fn valid() -> impl Iterator<Item = &'static [u8]> {
    suite()
        .iter()
        .filter(|v| matches!(v.answer, Answer::Digest(_)) && v.dictionary.is_none())
        .map(|v| &v.bytes[..])
}

/// A number from the front of the data; zero where it ends.
fn take(data: &mut &[u8]) -> u32 {
    let (front, rest) = data.split_at(data.len().min(2));
    *data = rest;
    front.iter().rev().fold(0, |number, &byte| number << 8 | byte as u32)
}

fn check_finding(finding: Finding, file: &[u8], dictionary: Option<&[u8]>) {
    let part = if finding.part == Part::File { file } else { dictionary.unwrap_or(&[]) };
    // The end of the file and the begin of a directory that is not there may be named.
    assert!(finding.offset as usize <= part.len().max(128), "{finding}");
    assert!(finding.to_string().contains(finding.rule.id()) && !finding.rule.name().is_empty());
}

fn direction(random: &mut Random) -> Direction {
    let wild = random.once_in(4);
    let mut part = |reach: i64| if wild { random.word() as i32 } else { random.range(-reach, reach) as i32 };
    Direction { x_q18: part(263_000), y_q18: part(263_000), z_q15: part(32_800) }
}

/// Opens and, where that succeeds, samples on every path; the paths agree and no sample costs more than is
/// stated.
///
/// Gives whether the file is legal.
pub fn open_and_sample(file: &[u8], dictionary: Option<&[u8]>) -> bool {
    let opened = selvedge::open_with(file, dictionary, &LIMITS);
    let mut first = First::default();
    let clean = selvedge::validate(file, dictionary, &LIMITS, &mut first);
    let mut count = 0;
    let mut sink = |finding: Finding| {
        check_finding(finding, file, dictionary);
        count += 1;
        true
    };
    let all_clean = selvedge::validate(file, dictionary, &LIMITS, &mut sink);
    assert_eq!((clean, first.0.is_none()), (all_clean, count == 0));
    match opened {
        Err(finding) => {
            check_finding(finding, file, dictionary);
            // A dictionary is legal by itself and no material.
            let is_dictionary = selvedge_tools::format::container::is_dictionary(file);
            assert!(is_dictionary || first.0 == Some(finding), "{finding}");
            false
        }
        Ok(material) => {
            assert!(clean);
            sample_all_paths(&material, file.len() as u64);
            true
        }
    }
}

/// Every way to a value gives the same words, within the stated cost.
fn sample_all_paths(material: &Selvedge<'_>, seed: u64) {
    let random = &mut Random::new(seed);
    let header = *material.header();
    samples_agree(material, random);
    material.trilinear(
        random.word() >> 12,
        random.word(),
        random.word(),
        direction(random),
        direction(random),
    );
    material.point(random.word(), random.word() >> 22, random.word(), random.word() >> 22);
    images_agree(material, random);
    floats(random);
    // In a buffer of several files every word moves by the same number, the dictionary's by its own.
    let (here, there) = (material.material_at(0, 0), material.material_at(16, 1 << 20));
    assert_eq!(
        (there.file_start, there.light_start, there.channels[0].state),
        (16, here.light_start + 16, here.channels[0].state)
    );
    let metadata = material.metadata();
    assert!(
        metadata.name.len() + metadata.origin.len() + metadata.licence.len() <= header.file_length as usize
    );
    assert!(material.sections().all(|s| s.offset as u64 + s.length as u64 <= header.file_length as u64));
}

/// Batches, single samples and the count of their cost agree, within the stated cost.
fn samples_agree(material: &Selvedge<'_>, random: &mut Random) {
    let header = material.header();
    let queries: Vec<FilteredQuery> = (0..3)
        .map(|_| FilteredQuery {
            u_q32: random.word(),
            v_q32: random.word(),
            light: direction(random),
            view: direction(random),
        })
        .collect();
    let mut scratch = vec![-1; material.batch_scratch_len(queries.len())];
    let mut out = vec![Rgb::default(); queries.len()];
    material.sample_batch(&queries, &mut scratch, &mut out).expect("buffers fit");
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(material.filtered(query.u_q32, query.v_q32, query.light, query.view), *rgb, "{query:?}");
        let level = random.word() % header.level_count;
        let counted = count::filtered(material, level, query.u_q32, query.v_q32, query.light, query.view);
        let counted = counted.expect("a method of these tools");
        assert!(
            counted.operations <= header.operations as u64,
            "{} operations where {} are stated",
            counted.operations,
            header.operations
        );
        let (light, view) = (material.locate_light(query.light), material.locate_view(query.view));
        let (words, m) = (material.words(), material.material());
        let values = filtered_values(words, m, level, query.u_q32, query.v_q32, &light, &view);
        assert_eq!(
            counted.values,
            [values.c0, values.c1, values.c2],
            "the count walks another way than the decoder"
        );
        let whole = material.trilinear(level << 16, query.u_q32, query.v_q32, query.light, query.view);
        assert_eq!(radiance(m, values, &light), whole);
    }
}

/// Images and channels agree with single texels, if the image is small.
fn images_agree(material: &Selvedge<'_>, random: &mut Random) {
    let [width, height] = material.image_size(0);
    if width as usize * height as usize > 1024 {
        return;
    }
    let (light, view) = (direction(random), direction(random));
    let mut scratch = vec![-1; material.image_scratch_len()];
    let mut image = vec![Rgb::default(); (width * height) as usize];
    material.decode_image(0, light, view, &mut scratch, &mut image).expect("buffers fit");
    let mut channels = vec![vec![0; image.len()]; 3];
    for (c, channel) in channels.iter_mut().enumerate() {
        material.decode_channel(c, 0, light, view, &mut scratch, channel).expect("buffers fit");
        let short = channel.len() - 1;
        let error = material
            .decode_channel(c, 0, light, view, &mut scratch, &mut channel[..short])
            .expect_err("one texel too few");
        assert_eq!((error.needed, error.lent), (short + 1, short));
    }
    let (light, view) = (material.locate_light(light), material.locate_view(view));
    for _ in 0..4 {
        let (x, y) = (random.word() % width, random.word() % height);
        let values = texel_values(material.words(), material.material(), x, y, &light, &view);
        let at = (y * width + x) as usize;
        assert_eq!(radiance(material.material(), values, &light), image[at]);
        assert_eq!([values.c0, values.c1, values.c2], [channels[0][at], channels[1][at], channels[2][at]]);
    }
}

/// Directions and positions of any floats lie where they may.
fn floats(random: &mut Random) {
    let mut float = || f32::from_bits(random.word());
    let d = Direction::from_unit_vector([float(), float(), float()]);
    assert!(d.x_q18.abs() <= 1 << 18 && d.y_q18.abs() <= 1 << 18 && d.z_q15.abs() <= 1 << 15, "{d:?}");
    let position = float();
    let fraction = selvedge::position_from_f32(position);
    if (0.0..1.0).contains(&position) {
        let exact = (position as f64 * 4_294_967_296.0).floor();
        assert_eq!(fraction as f64, exact, "{position}");
    } else if !position.is_finite() {
        assert_eq!(fraction, 0);
    }
}

/// Any bytes: as they are, with checksums repaired, and cut in two as a material and its dictionary.
pub fn open(data: &[u8]) {
    open_and_sample(data, None);
    let mut file = data.to_vec();
    repair_checksums(&mut file);
    open_and_sample(&file, None);
    let middle = (file.len() / 2) & !15;
    open_and_sample(&file[..middle], Some(&file[middle..]));
}

/// A valid file up to some byte, then any bytes.
pub fn prefix(data: &[u8]) {
    let mut rest = data;
    let number = take(&mut rest) as usize;
    let files: Vec<&[u8]> = valid().collect();
    let base = files[number % files.len()];
    let at = take(&mut rest) as usize % base.len();
    let mut file = base.to_vec();
    let end = (at + rest.len()).min(file.len());
    file[at..end].copy_from_slice(&rest[..end - at]);
    repair_checksums(&mut file);
    open_and_sample(&file, None);
}

/// Structured damage: words of sections changed, sections resized, doubled, taken away, exchanged; then laid
/// out properly.
pub fn mutate(data: &[u8]) {
    let mut rest = data;
    let number = take(&mut rest) as usize;
    let files: Vec<&[u8]> = valid().collect();
    let (mut header, mut parts) = take_apart(files[number % files.len()]);
    let mut edits = 0;
    while !rest.is_empty() && edits < 16 {
        edits += 1;
        let action = take(&mut rest);
        let (at, value) = (take(&mut rest) as usize, take(&mut rest));
        let value = match action >> 8 & 3 {
            0 => value,
            1 => value << 16 | take(&mut rest),
            2 => value as u16 as i16 as i32 as u32,
            _ => 1 << (value & 31),
        };
        if action % 8 == 0 || parts.is_empty() {
            // The length and the counts of sections follow from the layout.
            header[2 + at % 30] = value;
            continue;
        }
        let which = (action >> 3) as usize % parts.len();
        let bytes = &mut parts[which].bytes;
        let words = bytes.len() / 4;
        match action % 8 {
            1..=4 if words > 0 => {
                let at = at % words * 4;
                let old = u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
                let new = if action >> 15 == 0 {
                    value
                } else {
                    old.wrapping_add(value as u16 as i16 as i32 as u32)
                };
                bytes[at..at + 4].copy_from_slice(&new.to_le_bytes());
            }
            5 => bytes.resize((value as usize % 4096).min(bytes.len() + 64) / 4 * 4, 0),
            6 => parts[which].instance = value % 0x1000,
            7 => {
                let other = at % parts.len();
                let moved = parts[which].bytes.clone();
                parts[other].bytes = moved;
            }
            _ => {}
        }
    }
    let mut file = lay_out(header, parts);
    repair_checksums(&mut file);
    open_and_sample(&file, None);
}

/// A legal model grown from the data is written, read, written again with the same bytes, and sampled.
pub fn generate(data: &[u8]) {
    // Full sizes cost a hundred times more, so most inputs grow small models; some seeds have lengths of full
    // ones.
    let reach = if data.len() % 64 == 0 { Reach::FULL } else { Reach::SMALL };
    // The last byte says which method; without one it is the first.
    let method = METHODS[data.last().map_or(0, |&byte| byte as usize) % METHODS.len()];
    let model = (method.extreme)(&mut Random::from_bytes(data), reach);
    let file = write_material(&model);
    let material = selvedge::open(&file, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"));
    sample_all_paths(&material, data.len() as u64);
    assert!(same_triangles(&material));
    let back = model_of(&material).expect("a method of these tools");
    assert!(back == model, "the model changed on its way through a file");
    assert!(write_material(&back) == file, "decoding and encoding is not the identity");
    if model.has_texture() {
        let (split, dictionary) = write_split(&model);
        let split = selvedge::open_with(&split, Some(&dictionary), &Limits::NONE)
            .unwrap_or_else(|finding| panic!("{finding}"));
        let query = Direction { x_q18: 1000, y_q18: -70_000, z_q15: 30_000 };
        assert_eq!(split.filtered(7, 1 << 31, query, query), material.filtered(7, 1 << 31, query, query));
    }
}

/// Any queries of valid files, on all paths.
pub fn paths(data: &[u8]) {
    let mut rest = data;
    let files: Vec<&[u8]> = valid().collect();
    let material =
        selvedge::open(files[take(&mut rest) as usize % files.len()], &Limits::NONE).expect("a valid vector");
    let wide = |rest: &mut &[u8]| take(rest) << 16 | take(rest);
    let mut queries = Vec::new();
    while !rest.is_empty() && queries.len() < 8 {
        let direction = |rest: &mut &[u8]| {
            let [x, y, z] = [wide(rest), wide(rest), wide(rest)];
            // All words, and those that mean something.
            let near = |word: u32, reach: i32| {
                if word & 1 == 0 { word as i32 } else { (word as i32 >> 1) % (reach + 2) }
            };
            Direction { x_q18: near(x, 262_144), y_q18: near(y, 262_144), z_q15: near(z, 32_768) }
        };
        let (light, view) = (direction(&mut rest), direction(&mut rest));
        queries.push(FilteredQuery { u_q32: wide(&mut rest), v_q32: wide(&mut rest), light, view });
    }
    let mut scratch = vec![-1; material.batch_scratch_len(queries.len())];
    let mut out = vec![Rgb::default(); queries.len()];
    material.sample_batch(&queries, &mut scratch, &mut out).expect("buffers fit");
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(material.filtered(query.u_q32, query.v_q32, query.light, query.view), *rgb, "{query:?}");
        for located in [material.locate_light(query.light), material.locate_view(query.view)] {
            let taps = located.taps;
            assert_eq!(taps.weight_a_q15 + taps.weight_b_q15 + taps.weight_c_q15, 32_768);
            assert!(
                taps.weight_a_q15 >= 0
                    && taps.weight_b_q15 >= 0
                    && taps.weight_c_q15 >= 0
                    && (0..=32_768).contains(&taps.cosine_q15)
            );
        }
    }
}

/// Reads bytes as every kind of third-party or working file that there is.
pub fn importers(data: &[u8]) {
    let mut rest = data;
    let kind = take(&mut rest);
    let scratch = Scratch::new();
    let put =
        |name: &str, bytes: &[u8]| std::fs::write(scratch.0.join(name), bytes).expect("a file of its own");
    match kind % 5 {
        0 => {
            put("a.selvset", rest);
            if let Ok(dataset) = Dataset::open(&scratch.0.join("a.selvset")) {
                let description = dataset.description();
                assert!(description.texels() * description.pairs() <= 1 << 32);
                let _ = dataset.image(0, 0);
            }
        }
        1 => drop(dictionary_file::from_bytes(Path::new("a.selvdict"), rest.to_vec())),
        2 | 3 => {
            let ending = if kind % 5 == 2 { "png" } else { "exr" };
            put(&format!("tl000_pl000_tv000_pv000.{ending}"), rest);
            import_folder(&scratch.0);
        }
        _ => {
            // One of the foreign files is the data, the others are as they were.
            let excerpt = crate::excerpt_folder();
            let mut names: Vec<PathBuf> = std::fs::read_dir(&excerpt)
                .expect("excerpt")
                .filter_map(|e| e.ok().map(|e| e.path()))
                .collect();
            names.retain(|path| path.extension().is_some_and(|ending| ending == "bin"));
            names.sort();
            let chosen = (kind / 5) as usize % names.len();
            for (i, path) in names.iter().enumerate() {
                let name = path.file_name().expect("a file").to_string_lossy();
                let bytes = std::fs::read(path).expect("excerpt");
                if i == chosen {
                    let mut changed = bytes;
                    let at = take(&mut rest) as usize % changed.len().max(1);
                    let end = (at + rest.len()).min(changed.len());
                    changed[at..end].copy_from_slice(&rest[..end - at]);
                    put(&name, &changed);
                } else {
                    put(&name, &bytes);
                }
            }
            if let Ok(names) = sparsebtf::materials_in(&scratch.0)
                && let Some(name) = names.first()
                && let Ok(material) = sparsebtf::read_material(&scratch.0, name, None)
                && let Ok(model) = material.to_model(6)
            {
                // Whatever is imported is a legal file.
                selvedge::open(&write_material(&model), &Limits::NONE)
                    .unwrap_or_else(|finding| panic!("{finding}"));
            }
        }
    }
}

fn import_folder(path: &Path) {
    let output = path.join("out.selvset");
    if images::import(path, &output, &ImportOptions::default(), &|_, _| ()).is_ok() {
        Dataset::open(&output).expect("what was imported can be opened");
    } else {
        assert!(!output.exists(), "an output was left");
    }
}

/// Bytes that decoding an image of a hostile file may take.
pub const IMAGE_MEMORY: usize = 4 << 20;

/// Containers of Bonn: refused with a place inside the file, or every texel that is asked for has its
/// numbers.
pub fn btf(data: &[u8]) {
    let length = data.len() as u64;
    let inside = |error: ToolError| match error {
        ToolError::Foreign { offset, what, .. } => {
            assert!(offset <= length && !what.is_empty(), "{offset} of {length}: {what}")
        }
        other => panic!("{other}"),
    };
    let btf = match Btf::read(Bytes::from_memory(Path::new("a.btf"), data.to_vec())) {
        Ok(btf) => btf,
        Err(error) => return inside(error),
    };
    let (head, texels) = (btf.head(), btf.head().size[0] * btf.head().size[1]);
    // The light list stands in the file for each view.
    assert!(btf.texel_len() as u64 / 3 <= length / 8, "{} numbers of a texel", btf.texel_len());
    assert!(head.unread < length);
    let mut values = vec![0.0; btf.texel_len() * 2.min(texels)];
    for first in [0, texels.saturating_sub(2)] {
        if let Err(error) = btf.texels(first, 2.min(texels), &mut values) {
            inside(error);
        }
    }
    // A number of the file that is no number is found when its row is read.
    if head.height_map.is_some()
        && let Err(error) = btf.height_map()
    {
        inside(error);
    }
}

/// Zip archives of images: refused with words, or the first and the last image have their pixels.
pub fn archive(data: &[u8]) {
    let Ok(archive) = Archive::from_bytes(Bytes::from_memory(Path::new("a.zip"), data.to_vec())) else {
        return;
    };
    assert!(archive.names().expect("the directory is read").len() <= data.len());
    let Ok(set) = ImageSet::of(archive, IMAGE_MEMORY) else { return };
    let options = ImportOptions { memory: IMAGE_MEMORY, ..ImportOptions::default() };
    let [width, height] = set.description().size;
    for pair in [0, set.description().pairs() - 1] {
        if let Ok((pixels, _)) = set.image(pair, &options) {
            assert_eq!(pixels.len(), width * height);
            assert!(pixels.as_flattened().iter().all(|v| (0.0..=65_504.0).contains(v)));
        }
    }
}

/// Single images: refused with words, or as many pixels as the head says.
pub fn image_pixels(data: &[u8]) {
    let Ok(opened) = pixels::open(Box::new(std::io::Cursor::new(data)), IMAGE_MEMORY) else { return };
    let [width, height] = opened.size;
    assert!(width * height * pixels::PIXEL_BYTES <= IMAGE_MEMORY);
    if let Ok(pixels) = opened.pixels(Colours::Auto) {
        assert_eq!(pixels.len(), width * height);
    }
}

/// A folder that goes when it is let go.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Scratch {
        use std::sync::atomic::{AtomicU64, Ordering};
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        // Memory where there is a folder in it.
        let shared = Path::new("/dev/shm");
        let base = if shared.is_dir() { shared.to_owned() } else { std::env::temp_dir() };
        let path =
            base.join(format!("selvedge-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed)));
        std::fs::create_dir_all(&path).expect("a folder of its own");
        Scratch(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Lines of arguments: refused with words, or understood the same way twice.
pub fn options(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let arguments: Vec<String> = text.split(['\0', '\n']).take(40).map(str::to_owned).collect();
    let answer = selvedge_tools::cli::understands(&arguments);
    assert_eq!(answer, selvedge_tools::cli::understands(&arguments));
    assert!(answer.is_ok() || !answer.unwrap_err().is_empty());
}
