//! Every path to a value gives the same bits: one texel at a time, whole images, batches; layers, levels.

use proptest::prelude::*;
use selvedge::FilteredQuery;
use selvedge::{Direction, Limits, Rgb, Selvedge};
use selvedge_tools::check::extreme::extreme_of_any_method;
use selvedge_tools::format::texture::Kept;
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::example::example_model;

fn direction(random: &mut Random) -> Direction {
    Direction {
        x_q18: random.range(-263_000, 263_000) as i32,
        y_q18: random.range(-263_000, 263_000) as i32,
        z_q15: random.range(-3, 32_800) as i32,
    }
}

fn batch_equals_plain(material: &Selvedge<'_>, random: &mut Random, count: usize) {
    let queries: Vec<FilteredQuery> = (0..count)
        .map(|_| FilteredQuery {
            u_q32: random.word(),
            v_q32: random.word(),
            light: direction(random),
            view: direction(random),
        })
        .collect();
    let mut scratch = vec![-1; material.batch_scratch_len(count)];
    let mut out = vec![Rgb::default(); count];
    material.sample_batch(&queries, &mut scratch, &mut out).expect("buffers fit");
    for (query, rgb) in queries.iter().zip(&out) {
        assert_eq!(material.filtered(query.u_q32, query.v_q32, query.light, query.view), *rgb, "{query:?}");
    }
    // A method without a fast path of its own needs no scratch.
    if let Some((_, short)) = scratch.split_last_mut() {
        assert!(material.sample_batch(&queries, short, &mut out).is_err());
    }
}

fn image_equals_plain(material: &Selvedge<'_>, random: &mut Random) {
    let (light, view) = (direction(random), direction(random));
    let (light_taps, view_taps) = (material.locate_light(light), material.locate_view(view));
    let [width, height] = material.image_size(0);
    let mut scratch = vec![-1; material.image_scratch_len()];
    let mut image = vec![Rgb::default(); (width * height) as usize];
    material.decode_image(0, light, view, &mut scratch, &mut image).expect("buffers fit");
    for (i, rgb) in (0u32..).zip(&image) {
        let values = selvedge::kernel::interpolation::texel_values(
            material.words(),
            material.material(),
            i % width,
            i / width,
            &light_taps,
            &view_taps,
        );
        assert_eq!(selvedge::kernel::interpolation::radiance(material.material(), values, &light_taps), *rgb);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn extreme_files_decode_alike_on_every_path(seed in 0u64..1_000_000) {
        let file = write_material(&extreme_of_any_method(seed));
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        let mut random = Random::new(seed);
        batch_equals_plain(&material, &mut random, 70);
        image_equals_plain(&material, &mut random);
    }

    #[test]
    fn an_external_dictionary_changes_nothing(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        prop_assume!(model.has_texture());
        let whole = write_material(&model);
        let (file, dictionary) = write_split(&model);
        let whole = selvedge::open(&whole, &Limits::NONE).expect("legal");
        let split = selvedge::open_with(&file, Some(&dictionary), &Limits::NONE).expect("legal");
        prop_assert_eq!(whole.decode_digest(), split.decode_digest());
        let mut random = Random::new(seed);
        batch_equals_plain(&split, &mut random, 20);
        image_equals_plain(&split, &mut random);
    }

    /// A prefix of the layers is a file of its own that decodes as the whole one limited to it.
    #[test]
    fn layers_are_prefixes(seed in 0u64..1_000_000, layers in 1u32..8) {
        let mut model = extreme_of_any_method(seed);
        let layers = layers.min(model.layer_count);
        let whole = write_material(&model);
        model.layer_count = layers;
        let all = |points: &[[i32; 2]]| (0..points.len() as u32).collect::<Vec<_>>();
        let (lights, views) = (all(&model.lights), all(model.views()));
        model.texture.keep(&Kept {
            layers: layers as usize,
            levels: model.level_count as usize,
            channels: [true; 3],
            lights: &lights,
            views: &views,
        });
        let trimmed = write_material(&model);
        let whole = selvedge::open(&whole, &Limits::NONE).expect("legal").with_layers(layers);
        let trimmed = selvedge::open(&trimmed, &Limits::NONE).expect("legal");
        prop_assert_eq!(whole.decode_digest(), trimmed.decode_digest());
    }

    /// Weights of any direction sum to one and name directions that are there.
    #[test]
    fn weights_sum_to_one(seed in 0u64..1_000_000) {
        let file = write_material(&extreme_of_any_method(seed));
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        let mut random = Random::new(seed);
        for _ in 0..200 {
            let asked = direction(&mut random);
            let taps = material.locate_light(asked).taps;
            prop_assert_eq!(taps.weight_a_q15 + taps.weight_b_q15 + taps.weight_c_q15, 32_768);
            prop_assert!([taps.weight_a_q15, taps.weight_b_q15, taps.weight_c_q15].iter().all(|w| (0..=32_768).contains(w)));
            prop_assert!([taps.a, taps.b, taps.c].iter().all(|&i| i < material.header().light_count));
            prop_assert!((0..=32_768).contains(&taps.cosine_q15));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// A direction is inside one triangle, on a side of two, at a corner of several, or outside all; taps tell the place itself.
    #[test]
    fn a_direction_is_in_one_triangle_or_on_the_hull(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        let file = write_material(&model);
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        let triangles = selvedge_tools::format::triangulate::triangulate(&model.lights, None).triangles;
        let mut random = Random::new(seed);
        for _ in 0..100 {
            let asked = direction(&mut random);
            let p = [asked.x_q18, asked.y_q18].map(|c| (c.clamp(-262_144, 262_144) + 8) >> 4);
            let at = |i: u32| model.lights[i as usize];
            let side = |a: [i32; 2], b: [i32; 2]| (b[0] - a[0]) as i64 * (p[1] - a[1]) as i64 - (b[1] - a[1]) as i64 * (p[0] - a[0]) as i64;
            let sides = |t: &[u32; 3]| [side(at(t[0]), at(t[1])), side(at(t[1]), at(t[2])), side(at(t[2]), at(t[0]))];
            let strictly = triangles.iter().filter(|t| sides(t).iter().all(|&s| s > 0)).count();
            let touched = triangles.iter().filter(|t| sides(t).iter().all(|&s| s >= 0)).count();
            prop_assert!(strictly <= 1 && (strictly == 0 || touched == 1), "{} {}", strictly, touched);
            let taps = material.locate_light(asked).taps;
            if touched > 0 {
                // Continuity: whichever triangle answers, its weights give the place back, so neighbours agree along their side.
                let weights = [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)];
                for c in 0..2 {
                    let blend: i64 = weights.iter().map(|&(i, w)| at(i)[c] as i64 * w as i64).sum();
                    let wanted = [asked.x_q18, asked.y_q18][c].clamp(-262_144, 262_144) as f64 / 16.0;
                    prop_assert!((blend as f64 / 32_768.0 - wanted).abs() <= 3.0, "{} {}", blend as f64 / 32_768.0, wanted);
                }
            } else {
                prop_assert_eq!(taps.weight_c_q15, 0);
            }
        }
    }

    /// A file, its model and a file again are the same bytes.
    #[test]
    fn decoding_and_encoding_is_the_identity(seed in 0u64..1_000_000) {
        let file = write_material(&extreme_of_any_method(seed));
        let back = selvedge_tools::methods::read::read_model(&file, None, &Limits::NONE).expect("legal");
        prop_assert!(write_material(&back) == file);
    }
}

/// Written in the model's own terms: a sample direction is found, alone and whole.
#[test]
fn sample_directions_are_found() {
    for seed in 0..120 {
        let model = extreme_of_any_method(seed);
        let file = write_material(&model);
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        for (i, &[x, y]) in model.lights.iter().enumerate() {
            let asked = material.light_direction(i as u32);
            assert_eq!([asked.x_q18, asked.y_q18], [x << 4, y << 4]);
            let taps = material.locate_light(asked).taps;
            let weight: i32 =
                [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)]
                    .iter()
                    .filter(|t| t.0 as usize == i)
                    .map(|t| t.1)
                    .sum();
            assert_eq!(weight, 32_768, "seed {seed} direction {i}");
        }
    }
}

/// Beyond the hull the place on it is the nearest, against a search in binary64.
#[test]
fn the_place_on_the_hull_is_the_nearest() {
    for seed in 0..60 {
        let model = extreme_of_any_method(seed);
        let file = write_material(&model);
        let material = selvedge::open(&file, &Limits::NONE).expect("legal");
        let triangulation = selvedge_tools::format::triangulate::triangulate(&model.lights, None);
        let mut random = Random::new(seed);
        for _ in 0..200 {
            let asked = direction(&mut random);
            let p = [asked.x_q18, asked.y_q18].map(|c| c.clamp(-262_144, 262_144) as f64 / 16.0);
            let taps = material.locate_light(asked).taps;
            let at = |i: u32| model.lights[i as usize].map(|c| c as f64);
            let blend: [f64; 2] = std::array::from_fn(|c| {
                (at(taps.a)[c] * taps.weight_a_q15 as f64
                    + at(taps.b)[c] * taps.weight_b_q15 as f64
                    + at(taps.c)[c] * taps.weight_c_q15 as f64)
                    / 32_768.0
            });
            let distance = |q: [f64; 2]| ((q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2)).sqrt();
            let hull = &triangulation.hull;
            let nearest = (0..hull.len()).map(|i| {
                let (a, b) = (at(hull[i]), at(hull[(i + 1) % hull.len()]));
                let d = [b[0] - a[0], b[1] - a[1]];
                let t = (((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]))
                    .clamp(0.0, 1.0);
                distance([a[0] + t * d[0], a[1] + t * d[1]])
            });
            let nearest = nearest.fold(if hull.is_empty() { distance(at(0)) } else { f64::MAX }, f64::min);
            let inside = taps.weight_c_q15 > 0 || distance(blend) < 3.0;
            assert!(
                inside || (distance(blend) - nearest).abs() < 3.0,
                "seed {seed} {asked:?}: {} {nearest}",
                distance(blend)
            );
        }
    }
}

/// At a sample direction and a texel's centre a filtered sample is the point sample.
#[test]
fn filtered_samples_meet_point_samples() {
    let file = write_material(&example_model());
    let material = selvedge::open(&file, &Limits::NONE).expect("legal");
    let model = example_model();
    for light in 0..5u32 {
        for view in 0..5u32 {
            let at = |i: u32| {
                let [x, y] = model.lights[i as usize];
                Direction { x_q18: x << 4, y_q18: y << 4, z_q15: 32_768 }
            };
            let (l, v) = (material.locate_light(at(light)), material.locate_view(at(view)));
            // The centre of texel (0, 1) of 3 x 2, where the fractions of u and v are exactly representable:
            // v.
            let values = material.filtered_values(((1u64 << 32) / 6 + 1) as u32, 0xc000_0000, &l, &v);
            let point = material.point_values(0, 1, light, view);
            assert!((values.c0 - point.c0).abs() <= 200 && values.c1 == point.c1, "{values:?} {point:?}");
        }
    }
}

/// Decoding needs no mutable state: many threads over one material.
#[test]
fn materials_are_shared_by_threads() {
    fn is_shareable<T: Send + Sync>() {}
    is_shareable::<Selvedge<'_>>();
    let file = write_material(&extreme_of_any_method(8));
    let material = selvedge::open(&file, &Limits::NONE).expect("legal");
    let digests: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| material.decode_digest())).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(digests.windows(2).all(|pair| pair[0] == pair[1]));
}
