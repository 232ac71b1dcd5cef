//! The sparse ensemble (chapter 10). Twin: `shaders/wgsl/sparse_ensemble.wgsl`.
//!
//! After SparseBTF (Kavoosighafi et al. 2023), equation 5: a block of texels is a few coefficients over
//! products of one column of each of four factor matrices. A sample blends the rows of the factors
//! first and evaluates once (equation 6), in an order of products that lets work be shared.

#![cfg(feature = "sparse-ensemble")]

pub mod check;
pub mod cost;
#[cfg(feature = "batch")]
pub(crate) mod fast;

use crate::kernel::colour::Values;
use crate::kernel::direction::{Located, Taps};
use crate::kernel::fixed::{HALF_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::material::{CHANNEL_FULL, Material, channel_of, level_size, part};
use crate::kernel::position::{Place, Span, block_count};
use crate::kernel::words::{Words, bit_window, low_part, packed_i16, word};

/// The method's number (3.1-8).
pub const METHOD_SPARSE_ENSEMBLE: u32 = 1;
/// Part of the angular factors of channel 0; the other channels follow.
pub const ANGULAR_PART: u32 = 0;
/// Part of the spatial factors of channel 0; the other channels follow.
pub const SPATIAL_PART: u32 = 3;
/// Part of the tables of atoms of channel 0; the other channels follow.
pub const ATOMS_PART: u32 = 6;
/// Part of the first directory entry of the coefficients.
pub const COEFFICIENTS_PART: u32 = 9;
/// Bits of a record's shift (10.4-3).
pub const SHIFT_BITS: u32 = 5;
/// The texture of a record is clamped to this magnitude, Q20: 32 (10.7-4).
pub const RECORD_BOUND: i32 = 0x0200_0000;
/// Bits that hold the number of low position bits.
pub const LOW_BITS_BITS: u32 = 4;

/// What the fixed fields at the begin of a record say, and where its parts begin (10.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// First word of the bit stream.
    pub stream: u32,
    /// Bits of a value.
    pub value_bits: u32,
    /// Coefficients.
    pub count: u32,
    /// Dictionary of the ensemble.
    pub dictionary: u32,
    /// Right shift of the result.
    pub shift: u32,
    /// Low bits of a position.
    pub low_bits: u32,
    /// First bit of the fields of the coefficients.
    pub fields_bit: u32,
    /// First bit of the high parts of the positions.
    pub highs_bit: u32,
}

/// Where the tables of a channel are, and which of the channels with texture it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tables {
    /// First word of the angular factors.
    pub angular_start: u32,
    /// First word of the spatial factors.
    pub spatial_start: u32,
    /// First word of the table of atoms.
    pub atoms_start: u32,
    /// Rank among the channels with texture.
    pub full_rank: u32,
}

/// The tables of channel `number` (10.1, 10.2, 10.5).
pub fn tables_of(material: &Material, number: u32) -> Tables {
    Tables {
        angular_start: part(material, ANGULAR_PART.wrapping_add(number)),
        spatial_start: part(material, SPATIAL_PART.wrapping_add(number)),
        atoms_start: part(material, ATOMS_PART.wrapping_add(number)),
        full_rank: channel_of(material, number).full_rank,
    }
}

/// First word of the coefficients of a level, layer and channel, by the directory (10.3-1).
pub fn coefficients_start(
    words: Words<'_>,
    material: &Material,
    full_rank: u32,
    level: u32,
    layer: u32,
) -> u32 {
    let layers = level.wrapping_mul(material.layer_count).wrapping_add(layer);
    let rank = layers.wrapping_mul(material.full_count).wrapping_add(full_rank);
    let entry = part(material, COEFFICIENTS_PART).wrapping_add(rank.wrapping_mul(4));
    // 10.3-1: the second word of an entry is the byte offset of its section.
    material.file_start.wrapping_add(word(words, entry.wrapping_add(1)) >> 2)
}

/// Column of the light factor that an atom names (10.5).
#[inline(always)]
pub fn atom_light(atom: u32) -> u32 {
    // Bits 14 to 23 (10.5).
    (atom >> 14) & 0x3ff
}

/// Column of the view factor that an atom names (10.5).
#[inline(always)]
pub fn atom_view(atom: u32) -> u32 {
    // Bits 4 to 13 (10.5).
    (atom >> 4) & 0x3ff
}

/// Column of the factor along x that an atom names (10.5).
#[inline(always)]
pub fn atom_x(atom: u32) -> u32 {
    // Bits 24 to 27 (10.5).
    (atom >> 24) & 0xf
}

/// Column of the factor along y that an atom names (10.5).
#[inline(always)]
pub fn atom_y(atom: u32) -> u32 {
    // Bits 28 to 31 (10.5).
    atom >> 28
}

/// Right shift of an atom's products (10.5).
#[inline(always)]
pub fn atom_shift(atom: u32) -> u32 {
    // Bits 0 to 3 (10.5).
    atom & 0xf
}

/// The fixed fields of the record of a block (10.4).
pub fn read_record(words: Words<'_>, start: u32, block: u32) -> Record {
    let widths = word(words, start);
    let value_bits = widths & 0xff;
    let dictionary_bits = (widths >> 8) & 0xff;
    let count_bits = widths >> 16;
    let stream = start.wrapping_add(4).wrapping_add(word(words, start.wrapping_add(1)));
    let bit = word(words, start.wrapping_add(4).wrapping_add(block));
    // 10.4-2: count, dictionary, shift and low bits fit one window.
    let window = bit_window(words, stream, bit);
    let count = low_part(window, count_bits);
    let dictionary = low_part(window >> count_bits, dictionary_bits);
    let shift = low_part(window >> count_bits.wrapping_add(dictionary_bits), SHIFT_BITS);
    let low_bits = (window >> count_bits.wrapping_add(dictionary_bits).wrapping_add(SHIFT_BITS)) & 0xf;
    let fields_bit = bit
        .wrapping_add(count_bits)
        .wrapping_add(dictionary_bits)
        .wrapping_add(SHIFT_BITS)
        .wrapping_add(LOW_BITS_BITS);
    let highs_bit = fields_bit.wrapping_add(count.wrapping_mul(low_bits.wrapping_add(value_bits)));
    Record { stream, value_bits, count, dictionary, shift, low_bits, fields_bit, highs_bit }
}

/// The integer coefficient that a stored value stands for (10.5-1).
///
/// `value < 2^16` and `step < 2^16`, so the product with the half added is below 2^32.
#[inline(always)]
pub fn dequantise(quantiser: u32, value: u32, value_bits: u32) -> i32 {
    let base = ((quantiser << 16) as i32) >> 16;
    let step = quantiser >> 16;
    let half = (1u32 << value_bits) >> 1;
    // 10.5-1: base + round(value * step / 2^value_bits).
    base.wrapping_add((value.wrapping_mul(step).wrapping_add(half) >> value_bits) as i32)
}

/// One column of three rows of a factor by their weights, Q15 (10.6-1).
#[inline(always)]
pub fn blend_column(words: Words<'_>, table: u32, row_words: u32, taps: Taps, column: u32) -> i32 {
    let a = packed_i16(words, table.wrapping_add(taps.a.wrapping_mul(row_words)), column)
        .wrapping_mul(taps.weight_a_q15);
    let b = packed_i16(words, table.wrapping_add(taps.b.wrapping_mul(row_words)), column)
        .wrapping_mul(taps.weight_b_q15);
    let c = packed_i16(words, table.wrapping_add(taps.c.wrapping_mul(row_words)), column)
        .wrapping_mul(taps.weight_c_q15);
    // 10.6-1: the sum is exact, within 2^30; one rounding.
    a.wrapping_add(b).wrapping_add(c).wrapping_add(HALF_Q15) >> 15
}

/// One column of two rows of a spatial factor by their weights, Q15 (10.6-2).
#[inline(always)]
pub fn blend_span(words: Words<'_>, table: u32, row_words: u32, span: Span, column: u32) -> i32 {
    let a = packed_i16(words, table.wrapping_add(span.row_a.wrapping_mul(row_words)), column)
        .wrapping_mul(span.weight_a_q15);
    let b = packed_i16(words, table.wrapping_add(span.row_b.wrapping_mul(row_words)), column)
        .wrapping_mul(span.weight_b_q15);
    // 10.6-2: the sum is exact, within 2^30; one rounding.
    a.wrapping_add(b).wrapping_add(HALF_Q15) >> 15
}

/// What one record adds to the texture of a channel, Q20 (10.7).
pub fn record_q20(
    words: Words<'_>,
    tables: Tables,
    record: Record,
    x: Span,
    y: Span,
    light: Taps,
    view: Taps,
) -> i32 {
    // 10.1-3, 10.2-2, 10.5-2: the tables of the record's dictionary.
    let angular_start = tables.angular_start;
    let angular = angular_start.wrapping_add(2).wrapping_add(record.dictionary.wrapping_mul(4));
    let light_row_words = word(words, angular).wrapping_add(1) >> 1;
    let view_row_words = word(words, angular.wrapping_add(1)).wrapping_add(1) >> 1;
    let light_table = angular_start.wrapping_add(word(words, angular.wrapping_add(2)));
    let view_table = angular_start.wrapping_add(word(words, angular.wrapping_add(3)));
    let spatial_start = tables.spatial_start;
    let spatial = spatial_start.wrapping_add(2).wrapping_add(record.dictionary.wrapping_mul(4));
    let x_row_words = word(words, spatial).wrapping_add(1) >> 1;
    let y_row_words = word(words, spatial.wrapping_add(1)).wrapping_add(1) >> 1;
    let x_table = spatial_start.wrapping_add(word(words, spatial.wrapping_add(2)));
    let y_table = spatial_start.wrapping_add(word(words, spatial.wrapping_add(3)));
    let atoms_start = tables.atoms_start;
    let atoms = atoms_start.wrapping_add(word(
        words,
        atoms_start.wrapping_add(3).wrapping_add(record.dictionary.wrapping_mul(2)),
    ));

    let field_bits = record.low_bits.wrapping_add(record.value_bits);
    let mut total = 0i32;
    let mut sum_y = 0i32;
    let mut sum_xy = 0i32;
    let mut column_x = 0u32;
    let mut column_y = 0u32;
    let mut column_light = 0xffff_ffffu32;
    let mut column_view = 0xffff_ffffu32;
    let mut u_light = 0i32;
    let mut u_view = 0i32;
    let mut bit = record.highs_bit;
    let mut high = 0u32;
    let mut index = 0u32;
    while index < record.count {
        // 10.4-4: the high part of a position is the number of zeros before its one.
        let mut window = bit_window(words, record.stream, bit);
        while window == 0 && high < 65_536 {
            high = high.wrapping_add(32);
            bit = bit.wrapping_add(32);
            window = bit_window(words, record.stream, bit);
        }
        let zeros = window.trailing_zeros() & 31;
        high = high.wrapping_add(zeros);
        bit = bit.wrapping_add(zeros).wrapping_add(1);
        // 10.4-5: low part and value stand side by side at a fixed distance.
        let field =
            bit_window(words, record.stream, record.fields_bit.wrapping_add(index.wrapping_mul(field_bits)));
        let position = (high << record.low_bits) | low_part(field, record.low_bits);
        let value = low_part(field >> record.low_bits, record.value_bits);
        let atom = word(words, atoms.wrapping_add(position.wrapping_mul(2)));
        let quantiser = word(words, atoms.wrapping_add(position.wrapping_mul(2)).wrapping_add(1));
        let coefficient = dequantise(quantiser, value, record.value_bits);

        // 10.7-3: a change of the spatial atom closes its sum; a change of y also that of x.
        let next_x = atom_x(atom);
        let next_y = atom_y(atom);
        if next_x != column_x || next_y != column_y {
            sum_y = sum_y
                .wrapping_add(multiply_q15(sum_xy, blend_span(words, x_table, x_row_words, x, column_x)));
            sum_xy = 0;
            column_x = next_x;
        }
        if next_y != column_y {
            total =
                total.wrapping_add(multiply_q15(sum_y, blend_span(words, y_table, y_row_words, y, column_y)));
            sum_y = 0;
            column_y = next_y;
        }
        // 10.7-1: the product of the two angular columns is rounded to Q15.
        let next_light = atom_light(atom);
        if next_light != column_light {
            column_light = next_light;
            u_light = blend_column(words, light_table, light_row_words, light, next_light);
        }
        let next_view = atom_view(atom);
        if next_view != column_view {
            column_view = next_view;
            u_view = blend_column(words, view_table, view_row_words, view, next_view);
        }
        let u_angular = u_light.wrapping_mul(u_view).wrapping_add(HALF_Q15) >> 15;
        // 10.7-2: times the coefficient, by the atom's own shift; within 2^30 before it.
        sum_xy = sum_xy.wrapping_add(round_shift(coefficient.wrapping_mul(u_angular), atom_shift(atom)));
        index = index.wrapping_add(1);
    }
    sum_y = sum_y.wrapping_add(multiply_q15(sum_xy, blend_span(words, x_table, x_row_words, x, column_x)));
    total = total.wrapping_add(multiply_q15(sum_y, blend_span(words, y_table, y_row_words, y, column_y)));
    // 10.7-4: to Q20, clamped so that four blocks of eight layers stay within 2^30.
    clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND)
}

/// The texture of one block, all layers, Q20 (10.7-5).
pub fn block_q20(
    words: Words<'_>,
    material: &Material,
    tables: Tables,
    level: u32,
    x: Span,
    y: Span,
    light: Taps,
    view: Taps,
) -> i32 {
    let blocks_x = block_count(material, level_size(material.width, level));
    let block = y.block.wrapping_mul(blocks_x).wrapping_add(x.block);
    let mut sum = 0i32;
    let mut layer = 0u32;
    // 10.7-5: layers add up; each record is rounded by itself.
    while layer < material.layer_limit {
        let start = coefficients_start(words, material, tables.full_rank, level, layer);
        let record = read_record(words, start, block);
        if record.count > 0 {
            sum = sum.wrapping_add(record_q20(words, tables, record, x, y, light, view));
        }
        layer = layer.wrapping_add(1);
    }
    sum
}

/// The texture of a channel: the sum over one, two or four blocks, Q20 (10.7-6).
pub fn texture_q20(
    words: Words<'_>,
    material: &Material,
    number: u32,
    place: &Place,
    light: Taps,
    view: Taps,
) -> i32 {
    let tables = tables_of(material, number);
    let x = place.x;
    let y = place.y;
    let mut sum = 0i32;
    let mut corner = 0u32;
    // 10.7-6: the weights are in the rows, so the blocks only add.
    while corner < x.count.wrapping_mul(y.count) {
        let span_x = if (corner & 1) != 0 && x.count == 2 { x.second } else { x.first };
        let in_second_row = if x.count == 2 { corner >> 1 } else { corner };
        let span_y = if in_second_row != 0 { y.second } else { y.first };
        sum = sum.wrapping_add(block_q20(words, material, tables, place.level, span_x, span_y, light, view));
        corner = corner.wrapping_add(1);
    }
    sum
}

/// The textures of all channels, Q20; zero for a channel without texture (10.7).
// Apart, so that a sample of another method does not pay for this one's stack.
#[inline(never)]
pub fn sparse_ensemble_textures_q20(
    words: Words<'_>,
    material: &Material,
    place: &Place,
    light: &Located,
    view: &Located,
) -> Values {
    let mut values = Values { c0: 0, c1: 0, c2: 0 };
    // 10.7-6: a loop, so that a compiler for GPUs makes one copy of a channel.
    for number in 0..3u32 {
        let mut texture = 0i32;
        if channel_of(material, number).state == CHANNEL_FULL {
            texture = texture_q20(words, material, number, place, light.taps, view.taps);
        }
        if number == 0 {
            values.c0 = texture;
        }
        if number == 1 {
            values.c1 = texture;
        }
        if number == 2 {
            values.c2 = texture;
        }
    }
    values
}
