//! Counts what the textures of a sample cost, by walking its records: the multiplications of values that 4.2
//! prices.
//!
//! The arithmetic of 10.7 a second time, step by step (the core has it in its plain path, its batches and its
//! images): a walk that strays from the decoder is found out by its values.

use crate::methods::sample::{SampleAt, spans};
use crate::methods::sparse_ensemble::layout::{RecordTables, atom_columns, atom_of_list, atom_shift};
use selvedge::kernel::fixed::{HALF_Q15, clamp_magnitude, multiply_q15, round_shift};
use selvedge::kernel::material::{CHANNEL_FULL, channel_of, level_size};
use selvedge::kernel::position::{Span, block_count};
use selvedge::kernel::words::{Words, bit_window, low_part};
use selvedge::method::sparse_ensemble::{
    RECORD_BOUND, Record, blend_column, blend_span, coefficients_start, dequantise, read_record,
};
use selvedge::method::sparse_ensemble::{Tables, tables_of};
use selvedge::{Selvedge, Values};

/// A coefficient: dequantised, blended twice by three, multiplied with each other and with the value.
const OF_COEFFICIENT: u64 = 9;
/// The end of the sum over x, or of that over y: two products to blend the column, two to multiply by it in
/// halves.
const OF_CLOSE: u64 = 4;

/// The textures of a sample, and the operations that they take.
pub fn count(opened: &Selvedge<'_>, at: &SampleAt, operations: &mut u64) -> Values {
    let material = opened.material();
    let [c0, c1, c2] = [0, 1, 2].map(|number| {
        let full = channel_of(material, number).state == CHANNEL_FULL;
        if full { texture(opened, tables_of(material, number), at, operations) } else { 0 }
    });
    Values { c0, c1, c2 }
}

/// The texture of one channel.
fn texture(opened: &Selvedge<'_>, tables: Tables, at: &SampleAt, operations: &mut u64) -> i32 {
    let (words, m) = (opened.words(), opened.material());
    let mut texture = 0i32;
    for y in spans(at.place.y) {
        for x in spans(at.place.x) {
            let block = y.block * block_count(m, level_size(m.width, at.place.level)) + x.block;
            for layer in 0..m.layer_limit {
                let start = coefficients_start(words, m, tables.full_rank, at.place.level, layer);
                let record = read_record(words, start, block);
                if record.count > 0 {
                    let adds = walk_record(opened, tables, record, [x, y], at, operations);
                    texture = texture.wrapping_add(adds);
                }
            }
        }
    }
    texture
}

/// Positions of a record one after the other, by windows of its high parts.
struct Positions<'a> {
    words: Words<'a>,
    record: Record,
    bit: u32,
    high: u32,
}

impl Positions<'_> {
    /// Position and value of coefficient `index`, which follows the one before.
    fn next(&mut self, index: u32) -> (u32, u32) {
        let record = self.record;
        loop {
            let window = bit_window(self.words, record.stream, self.bit);
            let zeros = window.trailing_zeros();
            self.high += zeros;
            self.bit += zeros;
            if window != 0 {
                self.bit += 1;
                break;
            }
        }
        let field_bits = record.low_bits + record.value_bits;
        let field = bit_window(self.words, record.stream, record.fields_bit + index * field_bits);
        let position = self.high << record.low_bits | low_part(field, record.low_bits);
        (position, low_part(field >> record.low_bits, record.value_bits))
    }
}

/// One record, step by step as 10.7 goes.
fn walk_record(
    opened: &Selvedge<'_>,
    tables: Tables,
    record: Record,
    [x, y]: [Span; 2],
    at: &SampleAt,
    operations: &mut u64,
) -> i32 {
    let words = opened.words();
    let tables = RecordTables::of(words, tables, record.dictionary);
    let (mut total, mut sum_y, mut sum_xy) = (0i32, 0i32, 0i32);
    let (mut at_x, mut at_y) = (0, 0);
    let mut closes = 0;
    let mut close = |sum: i32, u: i32| {
        closes += 1;
        multiply_q15(sum, u)
    };
    let blend_x = |column: u32| blend_span(words, tables.x.0, tables.x.1, x, column);
    let blend_y = |column: u32| blend_span(words, tables.y.0, tables.y.1, y, column);
    let mut positions = Positions { words, record, bit: record.highs_bit, high: 0 };
    for index in 0..record.count {
        let (position, value) = positions.next(index);
        let [atom, quantiser] = atom_of_list(words, tables.atoms, position);
        let [light, view, next_x, next_y] = atom_columns(atom);
        if (next_x, next_y) != (at_x, at_y) {
            sum_y = sum_y.wrapping_add(close(sum_xy, blend_x(at_x)));
            sum_xy = 0;
            at_x = next_x;
        }
        if next_y != at_y {
            total = total.wrapping_add(close(sum_y, blend_y(at_y)));
            sum_y = 0;
            at_y = next_y;
        }
        let u_light = blend_column(words, tables.light.0, tables.light.1, at.light.taps, light);
        let u_view = blend_column(words, tables.view.0, tables.view.1, at.view.taps, view);
        let u_angular = u_light.wrapping_mul(u_view).wrapping_add(HALF_Q15) >> 15;
        let coefficient = dequantise(quantiser, value, record.value_bits);
        sum_xy = sum_xy.wrapping_add(round_shift(coefficient.wrapping_mul(u_angular), atom_shift(atom)));
    }
    sum_y = sum_y.wrapping_add(close(sum_xy, blend_x(at_x)));
    total = total.wrapping_add(close(sum_y, blend_y(at_y)));
    *operations += OF_COEFFICIENT * record.count as u64 + OF_CLOSE * closes;
    clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND)
}
