//! The kernel on an adapter gives the core's words: real and extreme materials, every entry point.
//!
//! `SELVEDGE_SAMPLES` sets the samples per entry point, half on extreme files. A backend without an
//! adapter is said loudly; `SELVEDGE_REQUIRE_GPU=1` makes it a failure.

use selvedge::{Direction, Limits, Selvedge};
use selvedge_tests::{excerpt_folder, full_data_folder, setting};
use selvedge_tools::check::extreme::extreme_of_any_method;
use selvedge_tools::format::write;
use selvedge_tools::gpu::runner;
use selvedge_tools::gpu::runner::{Answer, Gpu, Query, answer_on_cpu, direction_words, random_query};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::METHODS;
use selvedge_tools::methods::sparse_ensemble::example::example_model;
use selvedge_tools::methods::sparse_ensemble::sparsebtf;

const ENTRIES: [&str; 4] = ["texel", "filtered", "trilinear", "floats"];
const EXTREME_FILES: u64 = 160;

fn adapter(backends: &str) -> Option<Gpu> {
    let gpu = Gpu::new(runner::backends(backends)).expect("the device is created once there is an adapter");
    match &gpu {
        Some(gpu) => println!("{backends}: {}", gpu.description),
        None => {
            eprintln!("SKIPPED: NO {} ADAPTER: THE KERNEL WAS NOT RUN ON IT", backends.to_uppercase());
            assert!(
                std::env::var_os("SELVEDGE_REQUIRE_GPU").is_none() || backends != "vulkan",
                "SELVEDGE_REQUIRE_GPU is set"
            );
        }
    }
    gpu
}

/// Bytes of materials, each with its external dictionary or nothing.
fn real_files() -> Vec<(Vec<u8>, Vec<u8>)> {
    let folder = full_data_folder("the full materials; the excerpt is used").unwrap_or_else(excerpt_folder);
    let mut files: Vec<(Vec<u8>, Vec<u8>)> = Vec::new();
    for name in ["carpet07", "felt05"] {
        let model = sparsebtf::read_material(&folder, name, None).and_then(|m| m.to_model(10)).expect("data");
        files.push((write::write_material(&model), Vec::new()));
    }
    files.extend(METHODS.iter().map(|method| (write::write_material(&(method.example)()), Vec::new())));
    files
}

fn extreme_files() -> Vec<(Vec<u8>, Vec<u8>)> {
    let split = |seed: u64| {
        let model = extreme_of_any_method(seed);
        let has_texture = model.has_texture();
        if seed % 5 == 0 && has_texture {
            write::write_split(&model)
        } else {
            (write::write_material(&model), Vec::new())
        }
    };
    let suite = selvedge_tests::targets::suite();
    let of_suite = suite
        .iter()
        .filter(|v| matches!(v.answer, selvedge_tools::check::vectors::Answer::Digest(_)))
        .map(|v| {
            let dictionary = v.dictionary.as_ref().and_then(|path| suite.iter().find(|d| d.path == *path));
            (v.bytes.clone(), dictionary.map_or(Vec::new(), |d| d.bytes.clone()))
        });
    (0..EXTREME_FILES).map(split).chain(of_suite).collect()
}

fn open(files: &[(Vec<u8>, Vec<u8>)]) -> Vec<Selvedge<'_>> {
    fn open_one((file, dictionary): &(Vec<u8>, Vec<u8>)) -> Selvedge<'_> {
        let dictionary = (!dictionary.is_empty()).then_some(dictionary.as_slice());
        selvedge::open_with(file, dictionary, &Limits::NONE).expect("legal")
    }
    files.iter().map(open_one).collect()
}

/// A query at the ends: any words at all.
fn extreme_query(random: &mut Random, entry: &str, material: u32) -> Query {
    if random.once_in(2) {
        return random_query(random, entry, material);
    }
    let mut word = || {
        let any = random.word();
        random.pick(&[
            any,
            any >> 17,
            any >> 8,
            0,
            u32::MAX,
            0x8000_0000,
            0x3f80_0000,
            0x7f80_0000,
            262_144,
            0u32.wrapping_sub(262_144),
        ])
    };
    let mut three = || [word(), word(), word()];
    let (light, view, [u, v, level_q16]) = (three(), three(), three());
    Query { material, u, v, level_q16, light, view }
}

fn compare(
    gpu: &Gpu,
    files: &[(Vec<u8>, Vec<u8>)],
    samples: usize,
    what: &str,
    query: impl Fn(&mut Random, &str, u32) -> Query,
) {
    let materials = open(files);
    let loaded = gpu.load(&materials);
    for entry in ENTRIES {
        let mut random = Random::new(0xe0 + entry.len() as u64);
        // Neighbouring invocations share a material, as in a renderer.
        let queries: Vec<Query> =
            (0..samples).map(|i| query(&mut random, entry, (i * materials.len() / samples) as u32)).collect();
        let answers = gpu.answer(&loaded, entry, &queries).expect("answers");
        let mut lit = 0usize;
        for (query, answer) in queries.iter().zip(&answers) {
            let wanted = answer_on_cpu(&materials[query.material as usize], entry, query);
            assert_eq!(wanted, *answer, "{what} {entry} {query:?}");
            lit += (wanted.rgb != [0; 3]) as usize;
        }
        assert_eq!(answers.len(), samples);
        assert!(lit > samples / 10, "{what} {entry}: only {lit} answers are not black");
        println!("{what} {entry}: {samples} samples, 0 differing words, {lit} not black");
    }
    let mut texels = 0;
    let mut random = Random::new(77);
    let mut number = 0;
    while texels < samples {
        let material = &materials[number % materials.len()];
        let size = material.image_size(0);
        let mut direction = || Direction {
            x_q18: random.range(-262_144, 262_144) as i32,
            y_q18: random.range(-262_144, 262_144) as i32,
            z_q15: random.range(0, 32_768) as i32,
        };
        let (light, view) = (direction(), direction());
        let query = Query {
            material: (number % materials.len()) as u32,
            light: direction_words(light),
            view: direction_words(view),
            ..Query::default()
        };
        let answers = gpu.image(&loaded, query, size).expect("image");
        let mut scratch = vec![0; material.image_scratch_len()];
        let mut image = vec![selvedge::Rgb::default(); answers.len()];
        material.decode_image(0, light, view, &mut scratch, &mut image).expect("buffers fit");
        let mut values = vec![vec![0; answers.len()]; 3];
        for (channel, values) in values.iter_mut().enumerate() {
            material.decode_channel(channel, 0, light, view, &mut scratch, values).expect("buffers fit");
        }
        for (i, answer) in answers.iter().enumerate() {
            let wanted =
                Answer { rgb: image[i].to_words(), values: [values[0][i], values[1][i], values[2][i]] };
            assert_eq!(wanted, *answer, "{what} image {number} texel {i}");
        }
        texels += answers.len();
        number += 1;
        // Small images cost a dispatch each: enough of them is enough.
        if number >= 20 * materials.len()
            && texels >= samples / 50
            && what == "extreme"
            && std::env::var_os("SELVEDGE_SAMPLES").is_none()
        {
            break;
        }
    }
    println!("{what} image: {texels} texels of {number} images, 0 differing words");
}

#[test]
fn vulkan_gives_the_cores_words() {
    let Some(gpu) = adapter("vulkan") else { return };
    let samples = setting("SELVEDGE_SAMPLES", 40_000) / 2;
    compare(&gpu, &real_files(), samples, "real", random_query);
    compare(&gpu, &extreme_files(), samples, "extreme", extreme_query);
}

/// A second way of translation: GLSL by naga.
#[test]
fn gl_gives_the_cores_words() {
    let Some(gpu) = adapter("gl") else { return };
    let samples = setting("SELVEDGE_SAMPLES", 40_000).min(200_000) / 2;
    compare(&gpu, &real_files(), samples, "real", random_query);
    compare(&gpu, &extreme_files(), samples, "extreme", extreme_query);
}

/// The comparison can fail: one bit of a file differs between the two sides.
#[test]
fn a_planted_difference_is_found() {
    let Some(gpu) = adapter("vulkan") else { return };
    let files = real_files();
    let materials = open(&files[2..]);
    let mut model = example_model();
    model.channels[0].mean.as_mut().expect("there").entries[0] += 1;
    let other = [(write::write_material(&model), Vec::new())];
    let loaded = gpu.load(&open(&other));
    let query = Query::default();
    let answers = gpu.answer(&loaded, "texel", &[query]).expect("answers");
    assert_ne!(answers[0], answer_on_cpu(&materials[0], "texel", &query));
}
