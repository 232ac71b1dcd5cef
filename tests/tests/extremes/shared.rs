//! What every method shares: sizes, levels, directions, tables, transfer, taps, axes, values, results.

use crate::Seen;
use selvedge::container::pair_table::BASE_BOUND;
use selvedge::kernel::direction::{ONE_Q14, ONE_Q18, hull_start};
use selvedge::kernel::fixed::ONE_Q15;
use selvedge::kernel::interpolation::{VALUE_BOUND, radiance};
use selvedge::kernel::position::axis_at_position;
use selvedge::kernel::words::word;
use selvedge::{Direction, Located, Selvedge, Taps, Values};
use selvedge_tools::format::model::{ChannelModel, MaterialModel, TransferModel};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::sparse_ensemble::example::example_model;
use selvedge_tools::methods::sparse_ensemble::model::EnsembleTexture;

/// What must be reached. Words behind a colon are values.
pub const LIST: &[&str] = &[
    "width: 1",
    "height: 1",
    "levels: 1",
    "levels: 15",
    "layers: 1",
    "layers: 8",
    "edge: 1",
    "edge: 16",
    "lights: 1",
    "lights: 2",
    "lights: 1024",
    "state: 0",
    "state: 1",
    "state: 2",
    "transfer: log",
    "transfer: linear",
    "offset: 0",
    "offset: least",
    "offset: 1",
    "exponent: -60",
    "exponent: 60",
    "cosine: no",
    "cosine: yes",
    "matrix: -32767",
    "matrix: 32767",
    "views: shared",
    "views: own",
    "triangles: none",
    "triangles: some",
    "horizon direction",
    "mean base: -2^26",
    "mean base: 2^26",
    "mean shift: 0",
    "mean shift: 11",
    "mean entry: -32767",
    "mean entry: 32767",
    "scale: none",
    "scale: some",
    "scale shift: 0",
    "scale shift: 8",
    "optional section",
    "taps: triangle",
    "taps: hull edge",
    "taps: hull corner",
    "taps: one direction",
    "cosine: below the horizon",
    "cosine: less than one",
    "axis: one block",
    "axis: two blocks",
    "axis: wraps around",
    "values: clamped above",
    "values: clamped below",
    "between levels",
    "result: zero",
    "result: largest",
];

/// What the model has.
pub fn of_model(model: &MaterialModel, seen: &mut Seen) {
    seen.add("width", model.size[0] as i64);
    seen.add("height", model.size[1] as i64);
    seen.add("levels", model.level_count as i64);
    seen.add("layers", model.layer_count as i64);
    seen.add("edge", model.edge as i64);
    seen.add("lights", model.lights.len() as i64);
    model.matrix_q13.iter().for_each(|&entry| seen.add("matrix", entry as i64));
    match model.transfer {
        TransferModel::Log2 { offset } => {
            seen.say(true, "transfer: log");
            seen.say(offset == 0.0, "offset: 0");
            seen.say(offset == f32::MIN_POSITIVE, "offset: least");
            seen.say(offset == 1.0, "offset: 1");
        }
        TransferModel::Linear { exponent } => {
            seen.say(true, "transfer: linear");
            seen.add("exponent", exponent as i64);
        }
    }
    seen.say(model.cosine_included, "cosine: yes");
    seen.say(!model.cosine_included, "cosine: no");
    seen.say(model.views.is_none(), "views: shared");
    seen.say(model.views.is_some(), "views: own");
    let horizon = ONE_Q14 * ONE_Q14;
    seen.say(model.lights.iter().any(|[x, y]| x * x + y * y == horizon), "horizon direction");
    seen.say(!model.extras.is_empty(), "optional section");
    for (c, full) in model.texture.channels().into_iter().enumerate() {
        seen.add("state", model.state(c) as i64);
        of_channel(&model.channels[c], full, seen);
    }
}

fn of_channel(channel: &ChannelModel, full: bool, seen: &mut Seen) {
    if let Some(mean) = &channel.mean {
        seen.add("mean shift", mean.shift as i64);
        seen.ends("mean entry", &mean.entries);
        seen.say(mean.base_q20 == -BASE_BOUND, "mean base: -2^26");
        seen.say(mean.base_q20 == BASE_BOUND, "mean base: 2^26");
    }
    if let Some(scale) = &channel.scale {
        seen.add("scale shift", scale.shift as i64);
    }
    seen.say(full && channel.scale.is_none(), "scale: none");
    seen.say(channel.scale.is_some(), "scale: some");
}

/// What the file and samples of it reach.
pub fn of_samples(material: &Selvedge<'_>, seen: &mut Seen, seed: u64) {
    let (m, words) = (*material.material(), material.words());
    seen.say(word(words, m.light_start + 1) == 0, "triangles: none");
    seen.say(word(words, m.light_start + 1) > 0, "triangles: some");
    let mut random = Random::new(seed);
    for _ in 0..60 {
        let mut direction = || Direction {
            x_q18: random.range(-ONE_Q18 as i64, ONE_Q18 as i64) as i32,
            y_q18: random.range(-ONE_Q18 as i64, ONE_Q18 as i64) as i32,
            z_q15: random.range(-2000, ONE_Q15 as i64) as i32,
        };
        let (asked, view) = (direction(), direction());
        let located = material.locate_light(asked);
        of_taps(material, located.taps, seen);
        let u = random.word();
        let axis = axis_at_position(m.edge, m.edge_reciprocal_q18, m.width, u);
        seen.say(axis.count == 1, "axis: one block");
        seen.say(axis.count == 2, "axis: two blocks");
        seen.say(axis.count == 2 && axis.second.block < axis.first.block, "axis: wraps around");
        let values = material.filtered_values(u, random.word(), &located, &material.locate_view(view));
        of_values(material, values, &located, seen);
        if m.level_count > 1 {
            let at = |level_q16| material.trilinear(level_q16, u, 7, asked, view);
            seen.say(at(0) != at(0x8000), "between levels");
        }
    }
}

fn of_taps(material: &Selvedge<'_>, taps: Taps, seen: &mut Seen) {
    let (words, start) = (material.words(), material.material().light_start);
    let hull = word(words, start + 2);
    let on_edge = taps.a != taps.b && taps.a == taps.c || taps.weight_c_q15 == 0 && taps.weight_b_q15 > 0;
    seen.say(taps.weight_c_q15 > 0, "taps: triangle");
    seen.say(hull > 0 && on_edge, "taps: hull edge");
    seen.say(hull > 0 && taps.a == taps.b && hull_start(words, start) > 0, "taps: hull corner");
    seen.say(hull == 0, "taps: one direction");
    seen.say(taps.cosine_q15 == 0, "cosine: below the horizon");
    seen.say((1..ONE_Q15).contains(&taps.cosine_q15), "cosine: less than one");
}

fn of_values(material: &Selvedge<'_>, values: Values, light: &Located, seen: &mut Seen) {
    for value in [values.c0, values.c1, values.c2] {
        seen.say(value == VALUE_BOUND, "values: clamped above");
        seen.say(value == -VALUE_BOUND, "values: clamped below");
    }
    let rgb = radiance(material.material(), values, light).to_words();
    seen.say(rgb.contains(&0), "result: zero");
    seen.say(rgb.contains(&f32::MAX.to_bits()), "result: largest");
}

/// Files that no random number would make: many levels, many directions.
pub fn made() -> Vec<MaterialModel> {
    let mut deep = example_model();
    deep.size = [16_384, 1];
    deep.level_count = 15;
    deep.texture = Box::new(EnsembleTexture::default());
    deep.channels[0].scale = None;
    let mut many = deep.clone();
    many.lights = (0..1024).map(|i| [i % 32 * 500 - 7750, i / 32 * 500 - 7750]).collect();
    for mean in many.channels.iter_mut().filter_map(|channel| channel.mean.as_mut()) {
        mean.entries = vec![7; 1024 * 1024];
    }
    many.level_count = 1;
    vec![deep, many]
}
