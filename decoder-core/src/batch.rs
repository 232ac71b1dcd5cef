//! Batches of filtered samples: the same bits as one at a time, with the work of a block shared.
//!
//! Queries are sorted by block. A record is unpacked once for all of them, the columns that it uses are
//! blended for eight queries side by side, and each coefficient then costs two vector products.
//! Plain arrays of eight numbers: a compiler makes vector instructions of them where there are any.

use crate::colour::{Rgb, Values};
use crate::direction::{
    Direction, Taps, beyond_hull, clamp_direction, coarse_q14, cross, dot_product, grid_cell, grid_start,
    hull_start, point, ratio_q15, refine, triangles_start,
};
use crate::ensemble::{RECORD_BOUND, Record};
use crate::fixed::{HALF_Q15, ONE_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::interpolation::{VALUE_BOUND, radiance, scale_texture};
use crate::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR};
use crate::open::Selvedge;
use crate::position::{Axis, Span, axis_at_position, block_count};
use crate::records::{Blend, Table, entry, for_each_coefficient, record_of};
use crate::result::{BufferTooSmall, position_from_f32};
use crate::tensor_paths::{Room, TensorSampler};
use crate::words::{Words, high_i16, low_i16, word};

/// A filtered sample to be made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilteredQuery {
    /// u0.32 fraction of the image along x.
    pub u_q32: u32,
    /// u0.32 fraction of the image along y.
    pub v_q32: u32,
    /// Light direction.
    pub light: Direction,
    /// View direction.
    pub view: Direction,
}

impl FilteredQuery {
    /// From a position of any magnitude, which wraps, and unit vectors in the material's tangent frame.
    pub fn from_f32(position: [f32; 2], light: [f32; 3], view: [f32; 3]) -> FilteredQuery {
        let [u_q32, v_q32] = position.map(position_from_f32);
        FilteredQuery {
            u_q32,
            v_q32,
            light: Direction::from_unit_vector(light),
            view: Direction::from_unit_vector(view),
        }
    }
}

/// Queries side by side.
const LANES: usize = 8;
/// One number for each of them.
type Lanes = [i32; LANES];
/// Most columns that an atom can name in a factor.
const COLUMNS: usize = 1024;
/// Words kept of a query: taps of light and view, textures of three channels.
const QUERY_WORDS: usize = 10;
/// Words kept of a query's part in a block: query, rows, weights along x and y, taps. What a block needs
/// stands together, since queries are far apart in memory.
const ITEM_WORDS: usize = 10;
/// Textures kept of a query's part in a block.
const PART_WORDS: usize = 3;
/// Words of a triangle made ready: three lines, then its three words (5.3).
const TRIANGLE_WORDS: usize = 12;
/// Words of a hull edge made ready: two lines, squared length, its two words, the next direction.
const EDGE_WORDS: usize = 10;
/// Words kept of an unpacked coefficient: value, and its atom with columns numbered within the record.
const COEFFICIENT_WORDS: usize = 2;

/// Taps in three words: indices below 1,024, weights and cosine up to 2^15; the third weight is what is left.
fn pack_taps(taps: Taps) -> [i32; 3] {
    let pair = |low: u32, high: u32| (low | high << 16) as i32;
    [
        pair(taps.a, taps.b),
        pair(taps.c, taps.cosine_q15 as u32),
        pair(taps.weight_a_q15 as u32, taps.weight_b_q15 as u32),
    ]
}

fn unpack_taps([ab, c, weights]: [i32; 3]) -> Taps {
    let (low, high) = (|word: i32| word as u32 & 0xffff, |word: i32| word as u32 >> 16);
    let (weight_a, weight_b) = (low(weights) as i32, high(weights) as i32);
    let weight_c = 32_768i32.wrapping_sub(weight_a).wrapping_sub(weight_b);
    Taps {
        a: low(ab),
        b: high(ab),
        c: low(c),
        weight_a_q15: weight_a,
        weight_b_q15: weight_b,
        weight_c_q15: weight_c,
        cosine_q15: high(c) as i32,
    }
}

/// Scratch of one record: columns that it uses, numbered in the order of their first use.
struct Workspace<'s> {
    /// Number within the record of each light and view column, valid where `seen` holds the record's mark.
    numbers: &'s mut [i32],
    /// Mark of the record that last used a column.
    seen: &'s mut [i32],
    /// Columns in the order of their numbers.
    columns: &'s mut [i32],
    /// Blended columns, lane by lane: light ones, then view ones.
    blended: &'s mut [Lanes],
    /// Unpacked coefficients.
    coefficients: &'s mut [[i32; COEFFICIENT_WORDS]],
}

/// What a record uses.
struct Unpacked {
    count: usize,
    lights: usize,
    views: usize,
}

impl Workspace<'_> {
    /// The number of a column of the light (`side` 0) or view (`side` 1) within the record marked `mark`.
    #[inline(always)]
    fn number(&mut self, side: usize, column: u32, mark: i32, used: &mut usize) -> u32 {
        let at = side.wrapping_mul(COLUMNS).wrapping_add(column as usize & (COLUMNS - 1));
        let (Some(seen), Some(number)) = (self.seen.get_mut(at), self.numbers.get_mut(at)) else { return 0 };
        if *seen != mark {
            *seen = mark;
            *number = *used as i32;
            if let Some(slot) = self.columns.get_mut(side.wrapping_mul(COLUMNS).wrapping_add(*used)) {
                *slot = column as i32;
            }
            *used = used.wrapping_add(1);
        }
        *number as u32
    }
}

impl Selvedge<'_> {
    /// Words of scratch that [`Selvedge::sample_batch`] needs for `count` queries.
    pub fn batch_scratch_len(&self, count: usize) -> usize {
        if self.material().method == METHOD_SPARSE_TENSOR {
            return self.ready_total() + Room::WORDS + TensorSampler::scratch_len(self);
        }
        let per_query = QUERY_WORDS + 4 * (ITEM_WORDS + PART_WORDS);
        let shared = self.ready_total()
            + 6 * COLUMNS
            + 2 * COLUMNS * LANES
            + self.largest_record() * COEFFICIENT_WORDS;
        count.saturating_mul(per_query).saturating_add(self.block_total() + 1 + shared)
    }

    /// Blocks of level 0 that have records: none if no channel has texture.
    fn block_total(&self) -> usize {
        let material = self.material();
        if material.full_count == 0 {
            return 0;
        }
        (block_count(material, material.width) as usize)
            .saturating_mul(block_count(material, material.height) as usize)
    }

    /// Words of both ready sets of directions.
    fn ready_total(&self) -> usize {
        self.ready_len(self.material().light_start) + self.ready_len(self.material().view_start)
    }

    /// Coefficients of the largest record of level 0.
    fn largest_record(&self) -> usize {
        let (words, material) = (self.words(), self.material());
        let full = material.channels.iter().filter(|channel| channel.state == CHANNEL_FULL);
        let stated = |channel: &Channel, layer: u32| {
            word(
                words,
                crate::ensemble::coefficients_start(words, material, *channel, 0, layer).wrapping_add(3),
            )
        };
        full.flat_map(|channel| (0..material.layer_count).map(move |layer| stated(channel, layer)))
            .max()
            .unwrap_or(0) as usize
    }

    /// Radiance of many filtered samples: `out[i]` equals [`Selvedge::filtered`] of `queries[i]`, bit for
    /// bit.
    ///
    /// The more queries at once, the more of them share a block; tens of thousands are a good batch, and
    /// fewer than 2^28 a legal one.
    ///
    /// # Errors
    /// If `out` is shorter than `queries`, or `scratch` than [`Selvedge::batch_scratch_len`].
    pub fn sample_batch(
        &self,
        queries: &[FilteredQuery],
        scratch: &mut [i32],
        out: &mut [Rgb],
    ) -> Result<(), BufferTooSmall> {
        if out.len() < queries.len() {
            return Err(BufferTooSmall { needed: queries.len(), lent: out.len() });
        }
        let needed = self.batch_scratch_len(queries.len());
        let lent = scratch.len();
        if self.material().method == METHOD_SPARSE_TENSOR {
            return self.sample_tensor(queries, scratch, out).ok_or(BufferTooSmall { needed, lent });
        }
        let parts = self.split_scratch(queries.len(), scratch);
        let Some((states, items, textures, starts, ready, mut workspace)) = parts else {
            return Err(BufferTooSmall { needed, lent });
        };
        self.locate_all(queries, states, ready);
        let textured = self.material().full_count > 0;
        let used = if textured { self.sort_by_block(queries, states, items, starts) } else { 0 };
        textures.get_mut(..used).unwrap_or(&mut []).fill([0; PART_WORDS]);
        workspace.seen.fill(0);
        let mut mark = 0i32;
        for (number, &channel) in self.material().channels.iter().enumerate() {
            if channel.state != CHANNEL_FULL {
                continue;
            }
            let mut begin = 0usize;
            for (block, &end) in (0u32..).zip(starts.iter()) {
                let end = (end as usize).min(used);
                let in_block = items.get(begin..end).unwrap_or(&[]);
                let sums = textures.get_mut(begin..end).unwrap_or(&mut []);
                begin = end;
                for layer in 0..self.material().layer_limit {
                    if in_block.is_empty() {
                        break;
                    }
                    let record = record_of(self.words(), self.material(), channel, 0, layer, block);
                    if record.count > 0 {
                        mark = mark.wrapping_add(1);
                        self.sample_record(channel, number, &record, mark, in_block, sums, &mut workspace);
                    }
                }
            }
        }
        for (item, textures) in items.iter().zip(textures.iter()).take(used) {
            if let Some([_, _, _, _, _, _, t0, t1, t2, _]) = states.get_mut(item[0] as usize) {
                *t0 = t0.wrapping_add(textures[0]);
                *t1 = t1.wrapping_add(textures[1]);
                *t2 = t2.wrapping_add(textures[2]);
            }
        }
        for (state, rgb) in states.iter().zip(out) {
            *rgb = self.finish(state);
        }
        Ok(())
    }

    /// The samples of a sparse tensor, one after the other. `None` if the scratch is too short.
    fn sample_tensor(&self, queries: &[FilteredQuery], scratch: &mut [i32], out: &mut [Rgb]) -> Option<()> {
        let (ready, rest) = scratch.split_at_mut_checked(self.ready_total())?;
        let (room, rest) = rest.split_at_mut_checked(Room::WORDS)?;
        let (unpacked, _) = rest.split_at_mut_checked(TensorSampler::scratch_len(self))?;
        let mut room = Room::new(room)?;
        let material = self.material();
        let (light, view) = ready.split_at_mut(self.ready_len(material.light_start).min(ready.len()));
        let lights = ReadySet::new(self.words(), material.light_start, light);
        let views = ReadySet::new(self.words(), material.view_start, view);
        let sampler = TensorSampler::new(self, unpacked);
        for (query, rgb) in queries.iter().zip(out) {
            let (light, view) = (lights.locate(query.light), views.locate(query.view));
            let mut textures = Values::default();
            if material.full_count > 0 {
                textures = sampler.textures(self, query.u_q32, query.v_q32, light, view, &mut room);
            }
            let [l0, l1, l2] = pack_taps(light);
            let [v0, v1, v2] = pack_taps(view);
            *rgb = self.finish(&[l0, l1, l2, v0, v1, v2, textures.c0, textures.c1, textures.c2, 0]);
        }
        Some(())
    }

    /// Cuts the scratch into its parts; `None` if it is too short.
    #[allow(clippy::type_complexity, reason = "named once, taken apart at once")]
    fn split_scratch<'s>(
        &self,
        count: usize,
        scratch: &'s mut [i32],
    ) -> Option<(
        &'s mut [[i32; QUERY_WORDS]],
        &'s mut [[i32; ITEM_WORDS]],
        &'s mut [[i32; PART_WORDS]],
        &'s mut [i32],
        &'s mut [i32],
        Workspace<'s>,
    )> {
        let (states, rest) = scratch.split_at_mut_checked(count.checked_mul(QUERY_WORDS)?)?;
        let (items, rest) = rest.split_at_mut_checked(count.checked_mul(4 * ITEM_WORDS)?)?;
        let (textures, rest) = rest.split_at_mut_checked(count.checked_mul(4 * PART_WORDS)?)?;
        let (starts, rest) = rest.split_at_mut_checked(self.block_total() + 1)?;
        let (ready, rest) = rest.split_at_mut_checked(self.ready_total())?;
        let (numbers, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
        let (seen, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
        let (columns, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
        let (blended, rest) = rest.split_at_mut_checked(2 * COLUMNS * LANES)?;
        let (coefficients, _) = rest.split_at_mut_checked(self.largest_record() * COEFFICIENT_WORDS)?;
        let workspace = Workspace {
            numbers,
            seen,
            columns,
            blended: blended.as_chunks_mut().0,
            coefficients: coefficients.as_chunks_mut().0,
        };
        Some((
            states.as_chunks_mut().0,
            items.as_chunks_mut().0,
            textures.as_chunks_mut().0,
            starts,
            ready,
            workspace,
        ))
    }

    /// Words of the ready set of directions at `start`.
    fn ready_len(&self, start: u32) -> usize {
        let count = |at: u32| word(self.words(), start.wrapping_add(at)) as usize;
        count(1) * TRIANGLE_WORDS + count(2) * EDGE_WORDS
    }

    fn locate_all(&self, queries: &[FilteredQuery], states: &mut [[i32; QUERY_WORDS]], ready: &mut [i32]) {
        let material = self.material();
        let (light, view) = ready.split_at_mut(self.ready_len(material.light_start).min(ready.len()));
        let light = ReadySet::new(self.words(), material.light_start, light);
        let view = ReadySet::new(self.words(), material.view_start, view);
        for (query, state) in queries.iter().zip(states) {
            let [l0, l1, l2] = pack_taps(light.locate(query.light));
            let [v0, v1, v2] = pack_taps(view.locate(query.view));
            *state = [l0, l1, l2, v0, v1, v2, 0, 0, 0, 0];
        }
    }

    /// A counting sort of the queries' parts by block: afterwards `starts[b]` is the end of block `b`. Gives
    /// the parts.
    fn sort_by_block(
        &self,
        queries: &[FilteredQuery],
        states: &[[i32; QUERY_WORDS]],
        items: &mut [[i32; ITEM_WORDS]],
        starts: &mut [i32],
    ) -> usize {
        let material = self.material();
        let blocks_x = block_count(material, material.width);
        let axes = |query: &FilteredQuery| {
            let axis = |size: u32, position: u32| {
                axis_at_position(material.edge, material.edge_reciprocal_q18, size, position)
            };
            (axis(material.width, query.u_q32), axis(material.height, query.v_q32))
        };
        // One, two or four parts; the common case first and alone.
        let visit = |x: Axis, y: Axis, visit: &mut dyn FnMut(Span, Span)| {
            if x.count == 2 {
                visit(x.second, y.first);
            }
            if y.count == 2 {
                visit(x.first, y.second);
                if x.count == 2 {
                    visit(x.second, y.second);
                }
            }
        };
        let block_at = |x: Span, y: Span| y.block.wrapping_mul(blocks_x).wrapping_add(x.block) as usize;
        starts.fill(0);
        for query in queries {
            let (x_axis, y_axis) = axes(query);
            let mut count = |x: Span, y: Span| {
                if let Some(count) = starts.get_mut(block_at(x, y)) {
                    *count = count.wrapping_add(1);
                }
            };
            count(x_axis.first, y_axis.first);
            visit(x_axis, y_axis, &mut count);
        }
        let mut total = 0i32;
        for start in starts.iter_mut() {
            let count = *start;
            *start = total;
            total = total.wrapping_add(count);
        }
        for (number, (query, state)) in (0i32..).zip(queries.iter().zip(states)) {
            let (x_axis, y_axis) = axes(query);
            let [l0, l1, l2, v0, v1, v2, ..] = *state;
            let mut place = |x: Span, y: Span| {
                let Some(place) = starts.get_mut(block_at(x, y)) else { return };
                let rows = x.row_a | x.row_b << 8 | y.row_a << 16 | y.row_b << 24;
                let weights = |span: Span| span.weight_a_q15 | span.weight_b_q15 << 16;
                if let Some(item) = items.get_mut(*place as usize) {
                    *item = [number, rows as i32, weights(x), weights(y), l0, l1, l2, v0, v1, v2];
                }
                *place = place.wrapping_add(1);
            };
            place(x_axis.first, y_axis.first);
            visit(x_axis, y_axis, &mut place);
        }
        total as usize
    }

    /// Unpacks a record and numbers the columns that it uses.
    #[inline(always)]
    fn unpack(
        &self,
        channel: Channel,
        record: &Record,
        mark: i32,
        workspace: &mut Workspace<'_>,
    ) -> Unpacked {
        let mut unpacked = Unpacked { count: 0, lights: 0, views: 0 };
        for_each_coefficient(self.words(), channel, record, |c| {
            let light = workspace.number(0, (c.atom >> 14) & 0x3ff, mark, &mut unpacked.lights);
            let view = workspace.number(1, (c.atom >> 4) & 0x3ff, mark, &mut unpacked.views);
            if let Some(slot) = workspace.coefficients.get_mut(unpacked.count) {
                *slot = [c.value, (c.atom & 0xff00_000f | light << 14 | view << 4) as i32];
            }
            unpacked.count = unpacked.count.wrapping_add(1);
        });
        unpacked
    }

    /// Adds what a record gives to the textures of the queries that meet its block.
    #[inline(always)]
    fn sample_record(
        &self,
        channel: Channel,
        number: usize,
        record: &Record,
        mark: i32,
        items: &[[i32; ITEM_WORDS]],
        textures: &mut [[i32; PART_WORDS]],
        workspace: &mut Workspace<'_>,
    ) {
        let words = self.words();
        let unpacked = self.unpack(channel, record, mark, workspace);
        let tables = [0, 1].map(|which| Table::new(words, channel.angular_start, record.dictionary, which));
        let spatial = [0, 1].map(|which| Table::new(words, channel.spatial_start, record.dictionary, which));
        let (light_lanes, view_lanes) = workspace.blended.split_at_mut(COLUMNS.min(workspace.blended.len()));
        let (light_columns, view_columns) = workspace.columns.split_at(COLUMNS.min(workspace.columns.len()));
        let light_columns = light_columns.get(..unpacked.lights).unwrap_or(&[]);
        let view_columns = view_columns.get(..unpacked.views).unwrap_or(&[]);
        let coefficients = workspace.coefficients.get(..unpacked.count).unwrap_or(&[]);
        // Not `chunks`: built for size, its division keeps a path to a panic.
        let (mut items, mut textures) = (items, textures);
        while !items.is_empty() {
            let (group, items_left) = items.split_at(LANES.min(items.len()));
            let (sums, textures_left) = textures.split_at_mut(LANES.min(textures.len()));
            (items, textures) = (items_left, textures_left);
            let mut x_spans = [Span::default(); LANES];
            let mut y_spans = [Span::default(); LANES];
            for (lane, item) in group.iter().enumerate() {
                let [_, _, _, _, l0, l1, l2, v0, v1, v2] = *item;
                blend_lane(tables[0], unpack_taps([l0, l1, l2]), light_columns, light_lanes, lane);
                blend_lane(tables[1], unpack_taps([v0, v1, v2]), view_columns, view_lanes, lane);
                let rows = item[1] as u32;
                let span = |rows: u32, weights: i32| Span {
                    block: 0,
                    row_a: rows & 0xff,
                    row_b: (rows >> 8) & 0xff,
                    weight_a_q15: weights & 0xffff,
                    weight_b_q15: (weights as u32 >> 16) as i32,
                };
                x_spans[lane & 7] = span(rows, item[2]);
                y_spans[lane & 7] = span(rows >> 16, item[3]);
            }
            let total = sum_lanes(
                coefficients,
                light_lanes,
                view_lanes,
                |x| blend_spans(spatial[0], &x_spans, x),
                |y| blend_spans(spatial[1], &y_spans, y),
            );
            for (textures, total) in sums.iter_mut().zip(total) {
                if let Some(sum) = textures.get_mut(number) {
                    *sum = sum.wrapping_add(clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND));
                }
            }
        }
    }

    /// [`crate::interpolation::blend_table_q15`] by rows.
    #[inline(always)]
    fn blend_pairs(&self, start: u32, light: Taps, view: Taps) -> i32 {
        let table = Table::of_pairs(self.words(), start, self.material().light_count);
        let row = |view: u32, weight: i32| {
            let row = table.row(view);
            let at = |light: u32, weight: i32| entry(row, light).wrapping_mul(weight);
            let sum = at(light.a, light.weight_a_q15).wrapping_add(at(light.b, light.weight_b_q15));
            multiply_q15(sum.wrapping_add(at(light.c, light.weight_c_q15)), weight)
        };
        row(view.a, view.weight_a_q15)
            .wrapping_add(row(view.b, view.weight_b_q15))
            .wrapping_add(row(view.c, view.weight_c_q15))
    }

    /// Means, scales and colour of a query whose textures are summed.
    fn finish(&self, state: &[i32; QUERY_WORDS]) -> Rgb {
        let (words, material) = (self.words(), self.material());
        let [l0, l1, l2, v0, v1, v2, t0, t1, t2, _] = *state;
        let (light, view) = (unpack_taps([l0, l1, l2]), unpack_taps([v0, v1, v2]));
        let value = |channel: Channel, texture: i32| {
            if channel.state == CHANNEL_MISSING {
                return 0;
            }
            // A channel without texture has none, whatever its method gave.
            let mut texture = if channel.state == CHANNEL_FULL { texture } else { 0 };
            if channel.scale_start != 0 {
                let scale = round_shift(self.blend_pairs(channel.scale_start, light, view), 15);
                texture = scale_texture(texture, scale, word(words, channel.scale_start.wrapping_add(1)));
            }
            let base_q20 = word(words, channel.mean_start) as i32;
            let shift = 15u32.wrapping_sub(word(words, channel.mean_start.wrapping_add(1)));
            let mean =
                round_shift(self.blend_pairs(channel.mean_start, light, view), shift).wrapping_add(base_q20);
            clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
        };
        let [c0, c1, c2] = material.channels;
        radiance(material, Values { c0: value(c0, t0), c1: value(c1, t1), c2: value(c2, t2) }, light)
    }
}

/// A set of directions with the lines of its triangles made ready: the signed areas of 5.4-1 are linear
/// in the point, so each is two products and a sum, exact modulo 2^32.
struct ReadySet<'a, 's> {
    words: Words<'a>,
    start: u32,
    grid: u32,
    grid_size: u32,
    triangles: &'s [[i32; TRIANGLE_WORDS]],
    edges: &'s [[i32; EDGE_WORDS]],
}

/// `value = x * p.x + y * p.y + c`.
fn line(value: impl Fn(i32, i32) -> i32) -> [i32; 3] {
    let c = value(0, 0);
    [value(1, 0).wrapping_sub(c), value(0, 1).wrapping_sub(c), c]
}

/// The value of a line at a point.
#[inline(always)]
fn at_point(x: i32, y: i32, c: i32, point: (i32, i32)) -> i32 {
    x.wrapping_mul(point.0).wrapping_add(y.wrapping_mul(point.1)).wrapping_add(c)
}

impl<'a, 's> ReadySet<'a, 's> {
    fn new(words: Words<'a>, start: u32, scratch: &'s mut [i32]) -> Self {
        let triangle_count = word(words, start.wrapping_add(1)) as usize;
        let (triangles, edges) = scratch.split_at_mut((triangle_count * TRIANGLE_WORDS).min(scratch.len()));
        let (triangles, edges) = (triangles.as_chunks_mut().0, edges.as_chunks_mut().0);
        let at = |index: u32| {
            let pair = point(words, start, index);
            (low_i16(pair), high_i16(pair))
        };
        for (number, ready) in (0u32..).zip(triangles.iter_mut()) {
            let triangle = triangles_start(words, start).wrapping_add(number.wrapping_mul(3));
            let [first, second, third] = [0, 1, 2].map(|n| word(words, triangle.wrapping_add(n)));
            let (a, b, c) = (at(first & 0xffff), at(first >> 16), at(second & 0xffff));
            let side = |p: (i32, i32), q: (i32, i32)| line(|x, y| cross(p.0, p.1, q.0, q.1, x, y));
            let ([a0, a1, a2], [b0, b1, b2], [c0, c1, c2]) = (side(b, c), side(c, a), side(a, b));
            *ready = [a0, a1, a2, b0, b1, b2, c0, c1, c2, first as i32, second as i32, third as i32];
        }
        let count = word(words, start.wrapping_add(2));
        let hull = hull_start(words, start);
        for (number, ready) in (0u32..).zip(edges.iter_mut()) {
            let next = if number.wrapping_add(1) < count { number.wrapping_add(1) } else { 0 };
            let [first, reciprocal] =
                [0, 1].map(|n| word(words, hull.wrapping_add(number.wrapping_mul(2)).wrapping_add(n)));
            let other = word(words, hull.wrapping_add(next.wrapping_mul(2))) & 0xffff;
            let (a, b) = (at(first & 0xffff), at(other));
            let [x, y, c] = line(|x, y| dot_product(a.0, a.1, b.0, b.1, x, y));
            let [ox, oy, oc] = line(|x, y| cross(b.0, b.1, a.0, a.1, x, y));
            let length = dot_product(a.0, a.1, b.0, b.1, b.0, b.1);
            *ready = [x, y, c, ox, oy, oc, length, first as i32, reciprocal as i32, other as i32];
        }
        ReadySet {
            words,
            start,
            grid: grid_start(words, start),
            grid_size: word(words, start.wrapping_add(3)),
            triangles,
            edges,
        }
    }

    /// [`crate::direction::locate`], the same bits.
    #[inline(always)]
    fn locate(&self, asked: Direction) -> Taps {
        let direction = clamp_direction(asked);
        let size = self.grid_size;
        let p = (coarse_q14(direction.x_q18), coarse_q14(direction.y_q18));
        let cell = grid_cell(p.1, size).wrapping_mul(size).wrapping_add(grid_cell(p.0, size));
        let candidates = self.grid.wrapping_add(size.wrapping_mul(size)).wrapping_add(1);
        let first = word(self.words, self.grid.wrapping_add(cell));
        let last = word(self.words, self.grid.wrapping_add(cell).wrapping_add(1));
        for candidate in first..last {
            let number = word(self.words, candidates.wrapping_add(candidate));
            let Some(&[a0, a1, a2, b0, b1, b2, c0, c1, c2, first, second, reciprocal]) =
                self.triangles.get(number as usize)
            else {
                break;
            };
            let area_a = at_point(a0, a1, a2, p);
            let area_b = at_point(b0, b1, b2, p);
            let area_c = at_point(c0, c1, c2, p);
            if (area_a | area_b | area_c) >= 0 {
                let whole = area_a.wrapping_add(area_b).wrapping_add(area_c);
                let shift = second as u32 >> 16;
                let rest = (direction.x_q18.wrapping_sub(p.0 << 4), direction.y_q18.wrapping_sub(p.1 << 4));
                let weight_a = ratio_q15(
                    refine(area_a, whole, a0, a1, rest.0, rest.1),
                    shift,
                    reciprocal as u32,
                    ONE_Q15,
                );
                let weight_b = ratio_q15(
                    refine(area_b, whole, b0, b1, rest.0, rest.1),
                    shift,
                    reciprocal as u32,
                    ONE_Q15.wrapping_sub(weight_a),
                );
                return Taps {
                    a: first as u32 & 0xffff,
                    b: first as u32 >> 16,
                    c: second as u32 & 0xffff,
                    weight_a_q15: weight_a,
                    weight_b_q15: weight_b,
                    weight_c_q15: ONE_Q15.wrapping_sub(weight_a).wrapping_sub(weight_b),
                    cosine_q15: if direction.z_q15 > 0 { ONE_Q15 } else { 0 },
                };
            }
        }
        self.locate_on_hull(direction)
    }

    /// [`crate::direction::locate_on_hull`], the same bits.
    fn locate_on_hull(&self, direction: Direction) -> Taps {
        let p = (coarse_q14(direction.x_q18), coarse_q14(direction.y_q18));
        let on_edge = |edge: &[i32; EDGE_WORDS]| {
            let along = at_point(edge[0], edge[1], edge[2], p);
            (along, edge[6].wrapping_sub(along), at_point(edge[3], edge[4], edge[5], p))
        };
        let Some(last) = self.edges.last() else {
            return beyond_hull(self.words, self.start, direction, 0, 0, 0);
        };
        let mut past_previous = on_edge(last).1 < 0;
        let mut corner = 0;
        for edge in self.edges {
            let (along, left, outside) = on_edge(edge);
            let a = edge[7] as u32 & 0xffff;
            if (along | left | outside) >= 0 {
                let rest = (direction.x_q18.wrapping_sub(p.0 << 4), direction.y_q18.wrapping_sub(p.1 << 4));
                let weight_b = ratio_q15(
                    refine(along, edge[6], edge[0], edge[1], rest.0, rest.1),
                    edge[7] as u32 >> 16,
                    edge[8] as u32,
                    ONE_Q15,
                );
                return beyond_hull(self.words, self.start, direction, a, edge[9] as u32, weight_b);
            }
            if past_previous & (along < 0) {
                corner = a;
            }
            past_previous = left < 0;
        }
        beyond_hull(self.words, self.start, direction, corner, corner, 0)
    }
}

/// Columns of one query's rows, blended into its lane (10.6-1).
#[inline(always)]
fn blend_lane(table: Table<'_>, taps: Taps, columns: &[i32], lanes: &mut [Lanes], lane: usize) {
    let blend = Blend::rows(table, taps);
    for (&column, slots) in columns.iter().zip(lanes) {
        slots[lane & 7] = blend.column(column as u32);
    }
}

/// One column of the spatial rows of each query (10.6-2).
#[inline(always)]
fn blend_spans(table: Table<'_>, spans: &[Span; LANES], column: u32) -> Lanes {
    let mut lanes = [0; LANES];
    for (lane, span) in lanes.iter_mut().zip(spans) {
        let a = entry(table.row(span.row_a), column).wrapping_mul(span.weight_a_q15);
        let b = entry(table.row(span.row_b), column).wrapping_mul(span.weight_b_q15);
        *lane = a.wrapping_add(b).wrapping_add(HALF_Q15) >> 15;
    }
    lanes
}

/// The sums of 10.7 for eight queries.
#[inline(always)]
fn sum_lanes(
    coefficients: &[[i32; COEFFICIENT_WORDS]],
    light_lanes: &[Lanes],
    view_lanes: &[Lanes],
    x_column: impl Fn(u32) -> Lanes,
    y_column: impl Fn(u32) -> Lanes,
) -> Lanes {
    let mut total = [0i32; LANES];
    let mut sum_y = [0i32; LANES];
    let mut sum_xy = [0i32; LANES];
    let mut spatial = 0u32;
    let close = |into: &mut Lanes, from: &mut Lanes, u: Lanes| {
        for ((into, from), u) in into.iter_mut().zip(from.iter_mut()).zip(u) {
            *into = into.wrapping_add(multiply_q15(*from, u));
            *from = 0;
        }
    };
    for &[value, atom] in coefficients {
        let atom = atom as u32;
        let next = atom >> 24;
        if next != spatial {
            close(&mut sum_y, &mut sum_xy, x_column(spatial & 0xf));
            if next >> 4 != spatial >> 4 {
                close(&mut total, &mut sum_y, y_column(spatial >> 4));
            }
            spatial = next;
        }
        let (Some(light), Some(view)) = (
            light_lanes.get(((atom >> 14) & 0x3ff) as usize),
            view_lanes.get(((atom >> 4) & 0x3ff) as usize),
        ) else {
            continue;
        };
        // Rounding as in `round_shift`, for a shift that all lanes share.
        let shift = atom & 0xf;
        let (below, bit) = (shift.saturating_sub(1), (shift != 0) as i32);
        for ((sum, light), view) in sum_xy.iter_mut().zip(light).zip(view) {
            let product = value.wrapping_mul(light.wrapping_mul(*view).wrapping_add(HALF_Q15) >> 15);
            *sum = sum.wrapping_add(product >> shift).wrapping_add((product >> below) & bit);
        }
    }
    close(&mut sum_y, &mut sum_xy, x_column(spatial & 0xf));
    close(&mut total, &mut sum_y, y_column(spatial >> 4));
    total
}
