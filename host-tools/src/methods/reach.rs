//! Legal materials at the ends of what is legal, as far as methods share them: sizes, directions, tables.
//!
//! Every field takes its smallest and largest value for some seed; sums come as close to their bounds
//! as random numbers get. What a seed gives is only promised to be legal, not to look like a material.

use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::math::random::Random;
use selvedge::container::pair_table::{BASE_BOUND, MEAN_SHIFT_LIMIT, SCALE_SHIFT_LIMIT};
use selvedge::kernel::direction::ONE_Q14;
use selvedge::kernel::material::level_size;
use std::collections::BTreeSet;

/// How large the models grow. It cuts counts, so every branch and every end of a *value* is within any reach.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// Most texels along an axis.
    pub texels: u32,
    /// Most directions of a set.
    pub directions: usize,
    /// Most columns of a factor.
    pub columns: i64,
    /// Most atoms that a dictionary is tried with.
    pub atoms: i64,
}

impl Reach {
    /// As large as tests of all sizes want them.
    pub const FULL: Reach = Reach { texels: 40, directions: 200, columns: 60, atoms: 400 };
    /// A few hundred of anything: what a fuzzer runs thousands of in a second.
    pub const SMALL: Reach = Reach { texels: 5, directions: 7, columns: 4, atoms: 9 };
}

/// What the texture of an extreme material must fit.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Texels along x and y.
    pub size: [u32; 2],
    /// Texels along the side of a block.
    pub edge: u32,
    /// Levels of detail.
    pub levels: u32,
    /// Quality layers.
    pub layers: u32,
    /// Light directions.
    pub lights: usize,
    /// View directions.
    pub views: usize,
    /// How large it may grow.
    pub reach: Reach,
}

impl Extent {
    /// Blocks of each level, for blocks of `edge` texels.
    pub fn blocks(&self, edge: u32) -> Vec<u32> {
        let of_level = |level| self.size.map(|s| level_size(s, level).div_ceil(edge)).iter().product();
        (0..self.levels).map(of_level).collect()
    }
}

/// A legal material by random numbers, as far as methods share it, and which channels are full: with the
/// texture of these it is whole. `each_full` is called for each of them after its tables, for methods that
/// draw their textures between those.
pub fn extreme_frame(
    r: &mut Random,
    reach: Reach,
    mut each_full: impl FnMut(&mut Random, usize, &Extent),
) -> MaterialModel<[bool; 3]> {
    let any_size = r.range(2, reach.texels as i64) as u32;
    let size = [r.pick(&[any_size, any_size, 1, 2, 17]), r.pick(&[any_size / 2 + 1, any_size, 1, 3, 33])]
        .map(|s| s.min(reach.texels));
    let edge = r.range(1, 16) as u32;
    let most_levels = 1 + size[0].max(size[1]).next_power_of_two().trailing_zeros();
    let level_count = r.pick(&[1, 1, most_levels, r.clone().range(1, most_levels as i64) as u32]);
    let layer_count = r.pick(&[1, 1, 1, 2, 3, 8]);
    let offset = r.pick(&[0.0, 1.0, f32::MIN_POSITIVE, 1e-5, 0.7]);
    let transfer = if r.once_in(3) {
        TransferModel::Linear { exponent: r.pick(&[-60, -7, 0, 13, 60]) }
    } else {
        TransferModel::Log2 { offset }
    };
    let plain_matrix = r.once_in(2);
    let matrix_q13 =
        std::array::from_fn(|_| if plain_matrix { r.pick(&[0, 8192, 8192, -4096]) } else { r.entry() });
    let lights = extreme_directions(r, reach);
    let views = if r.once_in(3) { None } else { Some(extreme_directions(r, reach)) };
    let extent = Extent {
        size,
        edge,
        levels: level_count,
        layers: layer_count,
        lights: lights.len(),
        views: views.as_ref().map_or(lights.len(), Vec::len),
        reach,
    };
    let mut full = [false; 3];
    let channels = std::array::from_fn(|c| {
        let state = r.pick(&[0, 1, 2, 2, 2, 2]);
        let mean = (state > 0).then(|| extreme_table(r, &extent, false));
        let scale = (state == 2 && r.once_in(2)).then(|| extreme_table(r, &extent, true));
        full[c] = state == 2;
        if full[c] {
            each_full(r, c, &extent);
        }
        ChannelModel { mean, scale }
    });
    let extras = if r.once_in(4) {
        vec![(0x8001, 7, vec![1; 4 * r.range(0, 9) as usize]), (0xffff, 0xffff, Vec::new())]
    } else {
        Vec::new()
    };
    MaterialModel {
        size,
        level_count,
        edge,
        layer_count,
        transfer,
        cosine_included: r.once_in(2),
        matrix_q13,
        metadata: MetadataModel {
            texel_nm: [r.word(), r.pick(&[0, u32::MAX])],
            frame: r.range(0, 2) as u32,
            image_origin: r.range(0, 2) as u32,
            primaries: r.range(0, 4) as u32,
            texts: ["seed".to_owned(), "\u{10ffff}\u{e9}".repeat(r.range(0, 5) as usize), String::new()],
        },
        lights,
        views,
        channels,
        texture: full,
        extras,
    }
}

/// A set of directions: one, two, many, collinear, co-circular, nearly coincident, on the horizon.
fn extreme_directions(r: &mut Random, reach: Reach) -> Vec<[i32; 2]> {
    let in_disc = |[x, y]: [i32; 2]| x * x + y * y <= ONE_Q14 * ONE_Q14;
    let mut points: Vec<[i32; 2]> = Vec::new();
    match r.range(0, 9) {
        0 => points.push([r.range(-9000, 9000) as i32, r.range(-9000, 9000) as i32]),
        1 => points.extend([[r.pick(&[-ONE_Q14, 0]), 0], [r.pick(&[1, ONE_Q14]), 0]]),
        2 => {
            let (dx, dy) = r.pick(&[(1, 0), (0, 1), (37, -12), (101, 100)]);
            let n = r.range(3, 40) as i32;
            points.extend((0..n).map(|i| [(i - n / 2) * dx, (i - n / 2) * dy]));
            points.sort_by_key(|p| (p[0] * 7919 + p[1] * 104_729) % 1009);
        }
        3 => points.extend([[ONE_Q14, 0], [0, ONE_Q14], [-ONE_Q14, 0], [0, -ONE_Q14], [0, 0]]),
        4 => points.extend([[3, 5], [4, 5], [3, 6], [4, 6], [5, 5]]),
        5 => {
            // Pythagorean points: exactly co-circular.
            let base = [
                [3, 4],
                [4, 3],
                [5, 0],
                [4, -3],
                [3, -4],
                [0, -5],
                [-3, -4],
                [-4, -3],
                [-5, 0],
                [-4, 3],
                [-3, 4],
                [0, 5],
            ];
            let scale = r.range(1, 3276) as i32;
            points.extend(base.map(|p| p.map(|c| c * scale)));
        }
        6 => {
            // Rings as measured grids have them.
            points.push([0, 0]);
            for ring in 1..=r.range(1, 6) {
                let n = ring * 6;
                let radius = ring as f64 * 2100.0;
                points.extend(
                    (0..n)
                        .map(|i| (i as f64 / n as f64 * std::f64::consts::TAU).sin_cos())
                        .map(|(s, c)| [(c * radius) as i32, (s * radius) as i32]),
                );
            }
        }
        7 => points.extend(
            (0..r.range(3, 60)).map(|_| [r.range(-60, 60) as i32 * 190, r.range(-60, 60) as i32 * 190]),
        ),
        _ => {
            let reach = r.pick(&[40, 2000, ONE_Q14 as i64]);
            points.extend(
                (0..r.range(4, 90)).map(|_| [r.range(-reach, reach) as i32, r.range(-reach, reach) as i32]),
            );
        }
    }
    let mut seen = BTreeSet::new();
    points.retain(|&p| in_disc(p) && seen.insert(p));
    points.truncate(reach.directions);
    if points.is_empty() {
        points.push([0, 0]);
    }
    points
}

/// A table for pairs whose fields take their ends.
fn extreme_table(r: &mut Random, extent: &Extent, is_scale: bool) -> PairTableModel {
    let any = r.range(-BASE_BOUND as i64, BASE_BOUND as i64) as i32;
    let base_q20 = if is_scale { 0 } else { r.pick(&[0, any >> 6, any, BASE_BOUND, -BASE_BOUND]) };
    let most = if is_scale { SCALE_SHIFT_LIMIT } else { MEAN_SHIFT_LIMIT } as i64;
    let shift = r.pick(&[0, most, r.clone().range(0, most) as u32 as i64]) as u32;
    let pairs = extent.lights * extent.views;
    PairTableModel { base_q20, shift, entries: (0..pairs).map(|_| r.entry()).collect() }
}
