//! Counts what a filtered sample costs, by walking it: the multiplications of values that 4.2 prices.
//!
//! The walk uses the core's own parts and follows the plain path step by step, the method its own part; it
//! gives the values too, so that a walk which strays from the decoder is found out. Prices are those of the
//! steps that are taken, where the file states those of the worst sample.

use crate::methods;
use crate::methods::sample::SampleAt;
use selvedge::kernel::direction::{
    clamp_direction, coarse_q14, cross, grid_cell, grid_start, point, triangles_start,
};
use selvedge::kernel::fixed::clamp_magnitude;
use selvedge::kernel::interpolation::{VALUE_BOUND, mean_q20, scale_q15, scale_texture};
use selvedge::kernel::material::{CHANNEL_FULL, CHANNEL_MISSING, level_size};
use selvedge::kernel::position::{Place, axis_at_position};
use selvedge::kernel::words::{high_i16, low_i16, word};
use selvedge::{Direction, Finding, Selvedge, Values};

/// Both axes.
const OF_AXES: u64 = 18;
/// A mean: three rows of three products, then three products of rows, and three for base and shift.
const OF_MEAN: u64 = 15;
/// A scale: as a mean, and its product in halves.
const OF_SCALE: u64 = 17;
/// Matrix, transfer and presentation.
const OF_COLOUR: u64 = 102;
/// The cell of the grid.
const OF_GRID: u64 = 2;
/// A candidate's three areas, and a hull edge.
const OF_CORNERS: u64 = 6;
const OF_HULL_EDGE: u64 = 6;
/// Two weights by reciprocal; the areas at full precision are moved by two products each.
const OF_WEIGHTS: u64 = 7;

/// A walk's count and what it came to.
pub struct Counted {
    /// Multiplications of values.
    pub operations: u64,
    /// Channel values, Q20.
    pub values: [i32; 3],
}

/// Walks a filtered sample of one level.
///
/// # Errors
/// Rule 3.1-8 if the tools do not have the file's method.
pub fn filtered(
    opened: &Selvedge<'_>,
    level: u32,
    u_q32: u32,
    v_q32: u32,
    light: Direction,
    view: Direction,
) -> Result<Counted, Finding> {
    let method = methods::of(opened)?;
    let (words, m) = (opened.words(), opened.material());
    let mut operations = OF_AXES + OF_COLOUR;
    operations += locate(opened, m.light_start, light) + locate(opened, m.view_start, view);
    let (light, view) = (opened.locate_light(light), opened.locate_view(view));
    let axis =
        |size: u32, at: u32| axis_at_position(m.edge, m.edge_reciprocal_q18, level_size(size, level), at);
    let (x, y) = (axis(m.width, u_q32), axis(m.height, v_q32));
    let at = SampleAt { place: Place { level, x, y }, light, view };
    let none = Values::default();
    let textures = if m.full_count > 0 { (method.count)(opened, &at, &mut operations) } else { none };
    let mut textures = [textures.c0, textures.c1, textures.c2].into_iter();
    let values = m.channels.map(|channel| {
        let mut texture = textures.next().unwrap_or(0);
        if channel.state == CHANNEL_MISSING {
            return 0;
        }
        let mut mean = 0;
        if channel.mean_start != 0 {
            operations += OF_MEAN;
            mean = mean_q20(words, m, channel, light.taps, view.taps);
        }
        if channel.state == CHANNEL_FULL && channel.scale_start != 0 {
            operations += OF_SCALE;
            let scale = scale_q15(words, m, channel, light.taps, view.taps);
            texture = scale_texture(texture, scale, word(words, channel.scale_start + 1));
        }
        clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
    });
    Ok(Counted { operations, values })
}

/// Candidates of the direction's cell up to the one that holds it, and all edges of the hull where none does.
pub fn locate(material: &Selvedge<'_>, start: u32, direction: Direction) -> u64 {
    let words = material.words();
    let asked = clamp_direction(direction);
    let (px, py) = (coarse_q14(asked.x_q18), coarse_q14(asked.y_q18));
    let size = word(words, start + 3);
    let cell = grid_cell(py, size) * size + grid_cell(px, size);
    let grid = grid_start(words, start);
    let at = |index: u32| {
        let pair = point(words, start, index);
        (low_i16(pair), high_i16(pair))
    };
    let mut seen = 0;
    for candidate in word(words, grid + cell)..word(words, grid + cell + 1) {
        seen += 1;
        let triangle = triangles_start(words, start) + word(words, grid + size * size + 1 + candidate) * 3;
        let (first, second) = (word(words, triangle), word(words, triangle + 1));
        let corners = [at(first & 0xffff), at(first >> 16), at(second & 0xffff)];
        let inside = (0..3).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            cross(a.0, a.1, b.0, b.1, px, py) >= 0
        });
        if inside {
            return OF_GRID + OF_CORNERS * seen + OF_WEIGHTS;
        }
    }
    OF_GRID + OF_CORNERS * seen + OF_HULL_EDGE * word(words, start + 2) as u64 + OF_WEIGHTS
}
