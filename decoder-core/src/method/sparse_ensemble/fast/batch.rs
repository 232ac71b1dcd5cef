//! Batches of a sparse ensemble: the same bits as one sample at a time, with the work of a block shared.
//!
//! Queries are sorted by block. A record is unpacked once for all of them, the columns that it uses are
//! blended for eight queries side by side, and each coefficient then costs two vector products.
//! Plain arrays of eight numbers: a compiler makes vector instructions of them where there are any.
//! The sums are those of `record_q20`, of `image.rs` and of the walk of costs in the tools: written four times
//! for speed and for a second reading, held equal by tests.

use super::records::{Blend, Coefficient, factor, for_each_coefficient, record_of};
use crate::fast::finish::finish;
use crate::fast::located::ReadySets;
use crate::fast::table::{Table, entry};
use crate::kernel::colour::Rgb;
use crate::kernel::direction::Taps;
use crate::kernel::fixed::{HALF_Q15, ONE_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::interpolation::place_at_position;
use crate::kernel::material::{CHANNEL_FULL, Material, channel_of};
use crate::kernel::position::{Place, Span, block_count};
use crate::kernel::words::word;
use crate::method::sparse_ensemble::{
    RECORD_BOUND, Record, Tables, atom_light, atom_shift, atom_view, coefficients_start, tables_of,
};
use crate::query::FilteredQuery;
use crate::selvedge::Selvedge;

/// Queries side by side.
const LANES: usize = 8;
/// One number for each of them.
type Lanes = [i32; LANES];
/// Most columns that an atom can name in a factor.
const COLUMNS: usize = 1024;

/// Taps in three words: indices below 1,024, weights and cosine up to 2^15; the third weight is what is left.
type PackedTaps = [i32; 3];

fn pack_taps(taps: Taps) -> PackedTaps {
    let pair = |low: u32, high: u32| (low | high << 16) as i32;
    [
        pair(taps.a, taps.b),
        pair(taps.c, taps.cosine_q15 as u32),
        pair(taps.weight_a_q15 as u32, taps.weight_b_q15 as u32),
    ]
}

#[inline(always)]
fn unpack_taps([ab, c, weights]: PackedTaps) -> Taps {
    let (low, high) = (|word: i32| word as u32 & 0xffff, |word: i32| word as u32 >> 16);
    let (weight_a, weight_b) = (low(weights) as i32, high(weights) as i32);
    Taps {
        a: low(ab),
        b: high(ab),
        c: low(c),
        weight_a_q15: weight_a,
        weight_b_q15: weight_b,
        weight_c_q15: ONE_Q15.wrapping_sub(weight_a).wrapping_sub(weight_b),
        cosine_q15: high(c) as i32,
    }
}

/// What is kept of a query.
#[derive(Clone, Copy)]
struct State {
    light: PackedTaps,
    view: PackedTaps,
    textures: [i32; 3],
}

/// Words of a [`State`] in scratch.
const STATE_WORDS: usize = 9;

impl State {
    fn to_words(self) -> [i32; STATE_WORDS] {
        let State { light: [l0, l1, l2], view: [v0, v1, v2], textures: [t0, t1, t2] } = self;
        [l0, l1, l2, v0, v1, v2, t0, t1, t2]
    }

    #[inline(always)]
    fn from_words(&[l0, l1, l2, v0, v1, v2, t0, t1, t2]: &[i32; STATE_WORDS]) -> State {
        State { light: [l0, l1, l2], view: [v0, v1, v2], textures: [t0, t1, t2] }
    }
}

/// A query's part in a block. What a block needs stands together, since queries are far apart in memory.
#[derive(Clone, Copy)]
struct Item {
    query: i32,
    /// Rows along x and y, a byte each.
    rows: u32,
    x_weights: i32,
    y_weights: i32,
    light: PackedTaps,
    view: PackedTaps,
}

/// Words of an [`Item`] in scratch.
const ITEM_WORDS: usize = 10;

impl Item {
    fn of(query: i32, x: Span, y: Span, state: &State) -> Item {
        let weights = |span: Span| span.weight_a_q15 | span.weight_b_q15 << 16;
        Item {
            query,
            rows: x.row_a | x.row_b << 8 | y.row_a << 16 | y.row_b << 24,
            x_weights: weights(x),
            y_weights: weights(y),
            light: state.light,
            view: state.view,
        }
    }

    /// Its texels along x and y; the block is that of the record.
    #[inline(always)]
    fn spans(&self) -> (Span, Span) {
        let span = |rows: u32, weights: i32| Span {
            block: 0,
            row_a: rows & 0xff,
            row_b: (rows >> 8) & 0xff,
            weight_a_q15: weights & 0xffff,
            weight_b_q15: (weights as u32 >> 16) as i32,
        };
        (span(self.rows, self.x_weights), span(self.rows >> 16, self.y_weights))
    }

    fn to_words(self) -> [i32; ITEM_WORDS] {
        let Item { query, rows, x_weights, y_weights, light: [l0, l1, l2], view: [v0, v1, v2] } = self;
        [query, rows as i32, x_weights, y_weights, l0, l1, l2, v0, v1, v2]
    }

    #[inline(always)]
    fn from_words(words: &[i32; ITEM_WORDS]) -> Item {
        let &[query, rows, x_weights, y_weights, l0, l1, l2, v0, v1, v2] = words;
        Item { query, rows: rows as u32, x_weights, y_weights, light: [l0, l1, l2], view: [v0, v1, v2] }
    }
}

/// Textures kept of a query's part in a block.
const ITEM_TEXTURES: usize = 3;
/// Words kept of an unpacked coefficient: value, and its atom with columns numbered within the record.
const COEFFICIENT_WORDS: usize = 2;

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
    /// Mark of the record at hand.
    mark: i32,
}

/// What a record uses.
struct Unpacked {
    count: usize,
    lights: usize,
    views: usize,
}

impl Workspace<'_> {
    /// The number of a column of the light (`side` 0) or view (`side` 1) within the record at hand.
    #[inline(always)]
    fn number(&mut self, side: usize, column: u32, used: &mut usize) -> u32 {
        let at = side.wrapping_mul(COLUMNS).wrapping_add(column as usize & (COLUMNS - 1));
        let (Some(seen), Some(number)) = (self.seen.get_mut(at), self.numbers.get_mut(at)) else {
            return 0;
        };
        if *seen != self.mark {
            *seen = self.mark;
            *number = *used as i32;
            if let Some(slot) = self.columns.get_mut(side.wrapping_mul(COLUMNS).wrapping_add(*used)) {
                *slot = column as i32;
            }
            *used = used.wrapping_add(1);
        }
        *number as u32
    }

    /// Takes an unpacked coefficient, with its columns numbered.
    #[inline(always)]
    fn take(&mut self, c: Coefficient, unpacked: &mut Unpacked) {
        let light = self.number(0, atom_light(c.atom), &mut unpacked.lights);
        let view = self.number(1, atom_view(c.atom), &mut unpacked.views);
        if let Some(slot) = self.coefficients.get_mut(unpacked.count) {
            *slot = [c.value, (c.atom & 0xff00_000f | light << 14 | view << 4) as i32];
        }
        unpacked.count = unpacked.count.wrapping_add(1);
    }
}

/// The parts of a batch's scratch.
struct Scratch<'s> {
    states: &'s mut [[i32; STATE_WORDS]],
    items: &'s mut [[i32; ITEM_WORDS]],
    textures: &'s mut [[i32; ITEM_TEXTURES]],
    /// For each block the number of its first item, and after sorting the end of its items.
    starts: &'s mut [i32],
    ready: &'s mut [i32],
    workspace: Workspace<'s>,
}

/// Words of scratch for `count` queries.
pub(crate) fn batch_scratch_len(selvedge: &Selvedge<'_>, count: usize) -> usize {
    let per_query = STATE_WORDS + 4 * (ITEM_WORDS + ITEM_TEXTURES);
    let ready = ReadySets::scratch_len(selvedge.words(), selvedge.material());
    let shared = ready + 6 * COLUMNS + 2 * COLUMNS * LANES + largest_record(selvedge) * COEFFICIENT_WORDS;
    count.saturating_mul(per_query).saturating_add(block_total(selvedge.material()) + 1 + shared)
}

/// Blocks of level 0 that have records: none if no channel has texture.
fn block_total(material: &Material) -> usize {
    if material.full_count == 0 {
        return 0;
    }
    let along = |size: u32| block_count(material, size) as usize;
    along(material.width).saturating_mul(along(material.height))
}

/// Coefficients of the largest record of level 0.
fn largest_record(selvedge: &Selvedge<'_>) -> usize {
    let (words, material) = (selvedge.words(), selvedge.material());
    let full = material.channels.iter().filter(|channel| channel.state == CHANNEL_FULL);
    let stated = |rank: u32, layer: u32| {
        word(words, coefficients_start(words, material, rank, 0, layer).wrapping_add(3))
    };
    let counts =
        full.flat_map(|channel| (0..material.layer_count).map(move |layer| stated(channel.full_rank, layer)));
    counts.max().unwrap_or(0) as usize
}

/// Cuts the scratch into its parts; `None` if it is too short.
fn split_scratch<'s>(selvedge: &Selvedge<'_>, count: usize, scratch: &'s mut [i32]) -> Option<Scratch<'s>> {
    let (words, material) = (selvedge.words(), selvedge.material());
    let (states, rest) = scratch.split_at_mut_checked(count.checked_mul(STATE_WORDS)?)?;
    let (items, rest) = rest.split_at_mut_checked(count.checked_mul(4 * ITEM_WORDS)?)?;
    let (textures, rest) = rest.split_at_mut_checked(count.checked_mul(4 * ITEM_TEXTURES)?)?;
    let (starts, rest) = rest.split_at_mut_checked(block_total(material) + 1)?;
    let (ready, rest) = rest.split_at_mut_checked(ReadySets::scratch_len(words, material))?;
    let (numbers, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
    let (seen, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
    let (columns, rest) = rest.split_at_mut_checked(2 * COLUMNS)?;
    let (blended, rest) = rest.split_at_mut_checked(2 * COLUMNS * LANES)?;
    let (coefficients, _) =
        rest.split_at_mut_checked(largest_record(selvedge).checked_mul(COEFFICIENT_WORDS)?)?;
    seen.fill(0);
    let (blended, coefficients) = (blended.as_chunks_mut().0, coefficients.as_chunks_mut().0);
    let workspace = Workspace { numbers, seen, columns, blended, coefficients, mark: 0 };
    Some(Scratch {
        states: states.as_chunks_mut().0,
        items: items.as_chunks_mut().0,
        textures: textures.as_chunks_mut().0,
        starts,
        ready,
        workspace,
    })
}

/// Samples level 0, block by block. `None` if the scratch is too short.
pub(crate) fn batch(
    selvedge: &Selvedge<'_>,
    queries: &[FilteredQuery],
    scratch: &mut [i32],
    out: &mut [Rgb],
) -> Option<()> {
    let (words, material) = (selvedge.words(), selvedge.material());
    let Scratch { states, items, textures, starts, ready, mut workspace } =
        split_scratch(selvedge, queries.len(), scratch)?;
    let sets = ReadySets::new(words, material, ready);
    for (query, state) in queries.iter().zip(states.iter_mut()) {
        let light = pack_taps(sets.light.locate(query.light).taps);
        let view = pack_taps(sets.view.locate(query.view).taps);
        *state = State { light, view, textures: [0; 3] }.to_words();
    }
    let mut used = 0;
    if material.full_count > 0 {
        used = sort_by_block(material, queries, states, items, starts);
    }
    textures.get_mut(..used).unwrap_or(&mut []).fill([0; ITEM_TEXTURES]);
    for number in (0..3).filter(|&number| channel_of(material, number).state == CHANNEL_FULL) {
        let sampler = Sampler { selvedge, tables: tables_of(material, number), number };
        sampler.sample_blocks(items, textures, starts, used, &mut workspace);
    }
    for (item, textures) in items.iter().zip(textures.iter()).take(used) {
        if let Some([_, _, _, _, _, _, t0, t1, t2]) = states.get_mut(Item::from_words(item).query as usize) {
            *t0 = t0.wrapping_add(textures[0]);
            *t1 = t1.wrapping_add(textures[1]);
            *t2 = t2.wrapping_add(textures[2]);
        }
    }
    for (state, rgb) in states.iter().zip(out) {
        let state = State::from_words(state);
        let (light, view) = (unpack_taps(state.light), unpack_taps(state.view));
        *rgb = finish(words, material, state.textures, light, view);
    }
    Some(())
}

/// Calls `each` for the one, two or four blocks of a place; the common case first and alone.
#[inline(always)]
fn for_each_block(place: &Place, mut each: impl FnMut(Span, Span)) {
    let Place { x, y, .. } = place;
    each(x.first, y.first);
    if x.count == 2 {
        each(x.second, y.first);
    }
    if y.count == 2 {
        each(x.first, y.second);
        if x.count == 2 {
            each(x.second, y.second);
        }
    }
}

/// A counting sort of the queries' parts by block: afterwards `starts[b]` is the end of block `b`. Gives the
/// number of parts.
fn sort_by_block(
    material: &Material,
    queries: &[FilteredQuery],
    states: &[[i32; STATE_WORDS]],
    items: &mut [[i32; ITEM_WORDS]],
    starts: &mut [i32],
) -> usize {
    let blocks_x = block_count(material, material.width);
    let place_of = |query: &FilteredQuery| place_at_position(material, 0, query.u_q32, query.v_q32);
    let block_at = |x: Span, y: Span| y.block.wrapping_mul(blocks_x).wrapping_add(x.block) as usize;
    starts.fill(0);
    for query in queries {
        for_each_block(&place_of(query), |x, y| {
            if let Some(count) = starts.get_mut(block_at(x, y)) {
                *count = count.wrapping_add(1);
            }
        });
    }
    let mut total = 0i32;
    for start in starts.iter_mut() {
        let count = *start;
        *start = total;
        total = total.wrapping_add(count);
    }
    for (number, (query, state)) in (0i32..).zip(queries.iter().zip(states)) {
        let state = State::from_words(state);
        for_each_block(&place_of(query), |x, y| {
            let Some(next) = starts.get_mut(block_at(x, y)) else { return };
            if let Some(item) = items.get_mut(*next as usize) {
                *item = Item::of(number, x, y, &state).to_words();
            }
            *next = next.wrapping_add(1);
        });
    }
    total as usize
}

/// Samples one channel.
struct Sampler<'a, 'b> {
    selvedge: &'b Selvedge<'a>,
    tables: Tables,
    number: u32,
}

impl Sampler<'_, '_> {
    /// Adds what every record gives to the textures of the items, block by block.
    fn sample_blocks(
        &self,
        items: &[[i32; ITEM_WORDS]],
        textures: &mut [[i32; ITEM_TEXTURES]],
        starts: &[i32],
        used: usize,
        workspace: &mut Workspace<'_>,
    ) {
        let (words, material) = (self.selvedge.words(), self.selvedge.material());
        let mut begin = 0usize;
        for (block, &end) in (0u32..).zip(starts.iter()) {
            let end = (end as usize).min(used);
            let in_block = items.get(begin..end).unwrap_or(&[]);
            let sums = textures.get_mut(begin..end).unwrap_or(&mut []);
            begin = end;
            for layer in 0..material.layer_limit {
                if in_block.is_empty() {
                    break;
                }
                let record = record_of(words, material, self.tables, 0, layer, block);
                if record.count > 0 {
                    workspace.mark = workspace.mark.wrapping_add(1);
                    self.sample_record(&record, in_block, sums, workspace);
                }
            }
        }
    }

    /// Adds what a record gives to the textures of the items that meet its block.
    #[inline(always)]
    fn sample_record(
        &self,
        record: &Record,
        items: &[[i32; ITEM_WORDS]],
        textures: &mut [[i32; ITEM_TEXTURES]],
        workspace: &mut Workspace<'_>,
    ) {
        let (words, tables) = (self.selvedge.words(), self.tables);
        let mut unpacked = Unpacked { count: 0, lights: 0, views: 0 };
        for_each_coefficient(words, tables, record, |c| workspace.take(c, &mut unpacked));
        let angular = [0, 1].map(|which| factor(words, tables.angular_start, record.dictionary, which));
        let spatial = [0, 1].map(|which| factor(words, tables.spatial_start, record.dictionary, which));
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
                let item = Item::from_words(item);
                blend_lane(angular[0], unpack_taps(item.light), light_columns, light_lanes, lane);
                blend_lane(angular[1], unpack_taps(item.view), view_columns, view_lanes, lane);
                (x_spans[lane & (LANES - 1)], y_spans[lane & (LANES - 1)]) = item.spans();
            }
            let total = sum_lanes(
                coefficients,
                light_lanes,
                view_lanes,
                |x| blend_spans(spatial[0], &x_spans, x),
                |y| blend_spans(spatial[1], &y_spans, y),
            );
            for (textures, total) in sums.iter_mut().zip(total) {
                if let Some(sum) = textures.get_mut(self.number as usize) {
                    *sum = sum.wrapping_add(clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND));
                }
            }
        }
    }
}

/// Columns of one query's rows, blended into its lane (10.6-1).
#[inline(always)]
fn blend_lane(table: Table<'_>, taps: Taps, columns: &[i32], lanes: &mut [Lanes], lane: usize) {
    let blend = Blend::rows(table, taps);
    for (&column, slots) in columns.iter().zip(lanes) {
        slots[lane & (LANES - 1)] = blend.column(column as u32);
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
        let (Some(light), Some(view)) =
            (light_lanes.get(atom_light(atom) as usize), view_lanes.get(atom_view(atom) as usize))
        else {
            continue;
        };
        // Rounding as in `round_shift`, for a shift that all lanes share.
        let shift = atom_shift(atom);
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
