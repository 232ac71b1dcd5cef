//! Reading a file back gives its bytes, and what is trimmed decodes to the bits of the whole.

use proptest::prelude::*;
use selvedge::kernel::interpolation::filtered_values;
use selvedge::kernel::levels::trilinear_values;
use selvedge::{Direction, Limits, Rule, Selvedge, Values};
use selvedge_tests::setting;
use selvedge_tools::check::extreme::{extreme, extreme_of_any_method};
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::format::sector::{Sector, kept_directions};
use selvedge_tools::format::trim::{Keep, Trim, trim};
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::read::{model_of, read_model, same_triangles};
use selvedge_tools::methods::sparse_ensemble;
use selvedge_tools::methods::sparse_ensemble::example::example_model;

fn excerpt() -> Vec<u8> {
    std::fs::read(selvedge_tests::excerpt_file()).expect("excerpt")
}

fn open(file: &[u8]) -> Selvedge<'_> {
    selvedge::open(file, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"))
}

fn cases(count: u32) -> ProptestConfig {
    ProptestConfig {
        cases: setting("SELVEDGE_CASES", count as usize) as u32,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// A direction anywhere, or at and near a sample direction, a middle of two, or the prolongation of two.
fn direction(random: &mut Random, points: &[[i32; 2]]) -> Direction {
    let any = [random.range(-263_000, 263_000) as i32, random.range(-263_000, 263_000) as i32];
    let mut point = || random.pick(points).map(|c| c << 4);
    let (a, b) = (point(), point());
    let [x, y] = match random.range(0, 5) {
        0 => any,
        1 => a,
        2 => a.map(|c| c + random.range(-20, 20) as i32),
        3 => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2],
        4 => [2 * b[0] - a[0], 2 * b[1] - a[1]],
        // Square to the line of two: where edges of the hull in one line meet.
        _ => [a[0] + b[1] - a[1], a[1] - b[0] + a[0]],
    };
    Direction {
        x_q18: x.clamp(-262_144, 262_144),
        y_q18: y.clamp(-262_144, 262_144),
        z_q15: random.range(0, 32_768) as i32,
    }
}

fn sector(random: &mut Random) -> Sector {
    let polar_max = random.pick(&[0.0, 1.0, 20.0, 45.0, 75.0, 90.0]);
    let width = random.pick(&[0.0, 3.0, 40.0, 90.0, 200.0, 359.0]);
    let from = random.range(-400, 400) as f64;
    Sector::new(
        polar_max,
        random
            .once_in(4)
            .then_some([from, from + width])
            .or_else(|| random.once_in(2).then_some([0.0, 90.0])),
    )
    .expect("angles")
}

/// A direction in the sector, after a few tries.
fn inside(random: &mut Random, points: &[[i32; 2]], sector: &Option<Sector>) -> Direction {
    let is_inside = |direction: &Direction| sector.is_none_or(|sector| sector.contains(*direction));
    (0..60)
        .map(|_| direction(random, points))
        .find(is_inside)
        .unwrap_or(Direction { z_q15: 30_000, ..Direction::default() })
}

fn as_array(values: Values) -> [i32; 3] {
    [values.c0, values.c1, values.c2]
}

/// Holds samples of every kind of a trimmed file against those of the whole.
fn hold_trim(model: &MaterialModel, options: &Trim, random: &mut Random, count: usize) {
    let left = trim(model, options).expect("options that fit");
    let (whole_file, left_file) = (write_material(model), write_material(&left));
    let (whole, trimmed) = (open(&whole_file).with_layers(left.layer_count), open(&left_file));
    let all = |points: &[[i32; 2]]| (0..points.len() as u32).collect::<Vec<_>>();
    let lights = options.lights.map_or(all(&model.lights), |sector| kept_directions(&model.lights, &sector));
    let views = options.views.map_or(all(model.views()), |sector| kept_directions(model.views(), &sector));
    assert_eq!((lights.len(), views.len()), (left.lights.len(), left.views().len()));
    assert_eq!(left.views.is_none(), model.views.is_none() && lights == views);
    let keeps_all = options.channels == [Keep::Texture; 3];
    let same = |found: Values, wanted: Values, what: &str| {
        for (c, (found, wanted)) in as_array(found).into_iter().zip(as_array(wanted)).enumerate() {
            let state = left.state(c);
            match options.channels[c] {
                Keep::Texture => assert_eq!(found, wanted, "{what}, channel {c}"),
                Keep::Mean if state == model.state(c) => assert_eq!(found, wanted, "{what}, channel {c}"),
                Keep::Mean => assert_eq!(state, 1),
                Keep::Nothing => assert_eq!((state, found), (0, 0)),
            }
        }
    };
    for _ in 0..count {
        let (x, y) = (random.range(0, 40) as u32, random.range(0, 40) as u32);
        let (l, v) = (
            random.range(0, lights.len() as i64 - 1) as usize,
            random.range(0, views.len() as i64 - 1) as usize,
        );
        let point = trimmed.point_values(x, y, l as u32, v as u32);
        same(point, whole.point_values(x, y, lights[l], views[v]), "point");

        let (u_q32, v_q32) = (random.word(), random.word());
        let (light, view) =
            (inside(random, &model.lights, &options.lights), inside(random, model.views(), &options.views));
        let located = |material: &Selvedge<'_>| (material.locate_light(light), material.locate_view(view));
        let ((l, v), (whole_l, whole_v)) = (located(&trimmed), located(&whole));
        let renumbered = [
            lights[l.taps.a as usize],
            lights[l.taps.b as usize],
            lights[l.taps.c as usize],
            l.taps.weight_a_q15 as u32,
            l.taps.weight_b_q15 as u32,
            l.taps.cosine_q15 as u32,
        ];
        let wanted = [
            whole_l.taps.a,
            whole_l.taps.b,
            whole_l.taps.c,
            whole_l.taps.weight_a_q15 as u32,
            whole_l.taps.weight_b_q15 as u32,
            whole_l.taps.cosine_q15 as u32,
        ];
        assert_eq!(renumbered, wanted, "{light:?}");
        let level = random.range(0, left.level_count as i64 - 1) as u32;
        let at = |m: &Selvedge<'_>, l, v| filtered_values(m.words(), m.material(), level, u_q32, v_q32, l, v);
        same(at(&trimmed, &l, &v), at(&whole, &whole_l, &whole_v), "filtered");
        let level_q16 = random.range(0, ((left.level_count as i64 - 1) << 16).max(0)) as u32;
        let between =
            |m: &Selvedge<'_>, l, v| trilinear_values(m.words(), m.material(), level_q16, u_q32, v_q32, l, v);
        same(between(&trimmed, &l, &v), between(&whole, &whole_l, &whole_v), "between levels");
        if keeps_all {
            assert_eq!(
                trimmed.filtered(u_q32, v_q32, light, view),
                whole.filtered(u_q32, v_q32, light, view)
            );
            assert_eq!(
                trimmed.trilinear(level_q16, u_q32, v_q32, light, view),
                whole.trilinear(level_q16, u_q32, v_q32, light, view)
            );
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn files_are_read_back(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        let file = write_material(&model);
        let read = read_model(&file, None, &Limits::NONE).expect("legal");
        prop_assert!(write_material(&read) == file);
        prop_assert!(same_triangles(&open(&file)));
        prop_assert_eq!(read, model);
    }

    #[test]
    fn split_files_are_read_back(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        prop_assume!(model.has_texture());
        let (file, dictionary) = write_split(&model);
        let read = read_model(&file, Some(&dictionary), &Limits::NONE).expect("legal");
        prop_assert!(write_split(&read) == (file, dictionary));
        prop_assert_eq!(read, model);
    }

    #[test]
    fn layers_levels_channels_and_unused_parts_go(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        let mut random = Random::new(seed);
        let r = &mut random;
        let options = Trim {
            layers: r.once_in(2).then(|| r.range(1, model.layer_count as i64) as u32),
            levels: r.once_in(2).then(|| r.range(1, model.level_count as i64) as u32),
            channels: std::array::from_fn(|_| r.pick(&[Keep::Texture, Keep::Texture, Keep::Mean, Keep::Nothing])),
            unused: r.once_in(2),
            ..Trim::default()
        };
        hold_trim(&model, &options, r, 20);
    }

    #[test]
    fn sectors_keep_their_bits(seed in 0u64..1_000_000) {
        let model = extreme_of_any_method(seed);
        let mut random = Random::new(seed);
        let r = &mut random;
        let lights = (!r.once_in(5)).then(|| sector(r));
        let views = if r.once_in(4) { lights } else { (!r.once_in(5)).then(|| sector(r)) };
        let options = Trim { lights, views, unused: r.once_in(3), ..Trim::default() };
        hold_trim(&model, &options, r, 60);
    }
}

#[test]
fn the_excerpt_and_the_example_are_read_back() {
    let file = excerpt();
    assert!(write_material(&read_model(&file, None, &Limits::NONE).expect("legal")) == file);
    let model = example_model();
    assert_eq!(model_of(&open(&write_material(&model))), Ok(model));
}

/// Hulls that would begin elsewhere if directions left, with queries above a point between two edges in one
/// line.
#[test]
fn the_hull_begins_where_it_did() {
    for (seed, polar_max, [x_q18, y_q18]) in
        [(501_238, 75.0, [170_252, 76_001]), (505_026, 1.0, [816, 32]), (506_440, 90.0, [240, 992])]
    {
        let model = extreme(&sparse_ensemble::METHOD, seed);
        let sector = Sector::new(polar_max, Some([0.0, 90.0])).expect("angles");
        let kept = kept_directions(&model.lights, &sector);
        let left = trim(&model, &Trim { lights: Some(sector), ..Trim::default() }).expect("options that fit");
        let asked = Direction { x_q18, y_q18, z_q15: 20_000 };
        let files = [&model, &left].map(write_material);
        let [whole, trimmed] = files.each_ref().map(|file| open(file).locate_light(asked));
        let point = |located: &selvedge::Located| [located.clamped_x_q18, located.clamped_y_q18];
        assert_eq!(point(&trimmed), point(&whole), "seed {seed}");
        let (trimmed, whole) = (trimmed.taps, whole.taps);
        assert_eq!([trimmed.a, trimmed.b].map(|i| kept[i as usize]), [whole.a, whole.b], "seed {seed}");
        assert_eq!((trimmed.weight_b_q15, trimmed.cosine_q15), (whole.weight_b_q15, whole.cosine_q15));
    }
}

#[test]
fn illegal_files_are_refused() {
    let mut file = excerpt();
    file[0x8000] ^= 1;
    assert_eq!(read_model(&file, None, &Limits::NONE).expect_err("a checksum").rule, Rule::SectionChecksum);
    let few = Limits { operations: 100, ..Limits::NONE };
    assert_eq!(read_model(&excerpt(), None, &few).expect_err("a limit").rule, Rule::LimitOperations);
}

#[test]
fn the_excerpt_is_trimmed() {
    let model = model_of(&open(&excerpt())).expect("known");
    let mut random = Random::new(11);
    let whole = write_material(&model).len();
    for (polar_max, azimuth) in
        [(0.0, None), (30.0, None), (60.0, Some([0.0, 90.0])), (90.0, Some([300.0, 20.0])), (90.0, None)]
    {
        let sector = Sector::new(polar_max, azimuth).expect("angles");
        for (lights, views) in [(Some(sector), None), (None, Some(sector)), (Some(sector), Some(sector))] {
            let options = Trim { lights, views, unused: true, ..Trim::default() };
            hold_trim(&model, &options, &mut random, 60);
            let left = trim(&model, &options).expect("options that fit");
            let length = write_material(&left).len();
            println!(
                "{polar_max} {azimuth:?}: {} lights, {} views, {length} of {whole} bytes",
                left.lights.len(),
                left.views().len()
            );
        }
    }
    let few = kept_directions(&model.lights, &Sector::new(30.0, None).expect("angles"));
    assert!(few.len() < model.lights.len() / 2, "{} directions are kept", few.len());
    let plain = Trim { channels: [Keep::Texture, Keep::Mean, Keep::Nothing], ..Trim::default() };
    hold_trim(&model, &plain, &mut random, 60);
}

#[test]
fn options_that_do_not_fit_are_refused() {
    let model = example_model();
    for options in [
        Trim { layers: Some(2), ..Trim::default() },
        Trim { layers: Some(0), ..Trim::default() },
        Trim { levels: Some(3), ..Trim::default() },
        Trim { lights: Some(Sector { polar_max: 91.0, azimuth: None }), ..Trim::default() },
        Trim { views: Some(Sector { polar_max: f64::NAN, azimuth: None }), ..Trim::default() },
        Trim {
            views: Some(Sector { polar_max: 9.0, azimuth: Some([0.0, f64::INFINITY]) }),
            ..Trim::default()
        },
    ] {
        assert_eq!(trim(&model, &options).expect_err("refused").exit_code(), 1, "{options:?}");
    }
    assert_eq!(trim(&model, &Trim::default()).expect("nothing goes"), model);
}
