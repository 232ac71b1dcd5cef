//! Counts what a filtered sample costs, by walking it: the multiplications of values that 4.2 prices.
//!
//! The walk uses the core's own parts and follows the plain path step by step; it gives the values too, so
//! that a walk which strays from the decoder is found out. Prices are those of the steps that are taken,
//! where the file states those of the worst sample.

use crate::format::read::RecordTables;
use selvedge::direction::{
    clamp_direction, coarse_q14, cross, grid_cell, grid_start, point, triangles_start,
};
use selvedge::ensemble::{
    RECORD_BOUND, Record, blend_column, blend_span, coefficients_start, dequantise, read_record,
};
use selvedge::fixed::{clamp_magnitude, multiply_q15, round_shift};
use selvedge::interpolation::{VALUE_BOUND, mean_q20, scale_q15, scale_texture};
use selvedge::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR, level_size};
use selvedge::position::{Span, axis_at_position, block_count};
use selvedge::tensor::{LIST_END, lists_start, next_coefficient, open_list};
use selvedge::words::{bit_window, high_i16, low_i16, low_part, packed_i16, word};
use selvedge::{Direction, Selvedge, Taps};

/// A walk's count and what it came to.
pub struct Counted {
    /// Multiplications of values.
    pub operations: u64,
    /// Channel values, Q20.
    pub values: [i32; 3],
}

/// Walks a filtered sample of one level.
pub fn filtered(
    material: &Selvedge<'_>,
    level: u32,
    u_q32: u32,
    v_q32: u32,
    light: Direction,
    view: Direction,
) -> Counted {
    let (words, m) = (material.words(), material.material());
    let mut operations = 18;
    operations += locate(material, m.light_start, light) + locate(material, m.view_start, view);
    let (light, view) = (material.locate_light(light), material.locate_view(view));
    let axis =
        |size: u32, at: u32| axis_at_position(m.edge, m.edge_reciprocal_q18, level_size(size, level), at);
    let (x, y) = (axis(m.width, u_q32), axis(m.height, v_q32));
    let mut given = [0i32; 3];
    if m.method == METHOD_SPARSE_TENSOR && m.full_count > 0 {
        for layer in 0..m.layer_limit {
            let part = walk_layer(material, level, layer, [x, y], light, view, &mut operations);
            given.iter_mut().zip(part).for_each(|(given, part)| *given = given.wrapping_add(part));
        }
    }
    let mut given = given.into_iter();
    let spans = |axis: selvedge::position::Axis| {
        if axis.count == 2 { vec![axis.first, axis.second] } else { vec![axis.first] }
    };
    let values = m.channels.map(|channel| {
        let mut texture = given.next().unwrap_or(0);
        if channel.state == CHANNEL_MISSING {
            return 0;
        }
        let mean = mean_q20(words, m, channel, light, view);
        // Three rows of three products, then three products of rows: twelve, and three for the table's base
        // and shift.
        operations += 15;
        if channel.state != CHANNEL_FULL {
            return clamp_magnitude(mean, VALUE_BOUND);
        }
        let blocks = if m.method == METHOD_SPARSE_TENSOR { Vec::new() } else { spans(y) };
        for span_y in blocks {
            for span_x in spans(x) {
                let block = span_y.block * block_count(m, level_size(m.width, level)) + span_x.block;
                for layer in 0..m.layer_limit {
                    let record =
                        read_record(words, coefficients_start(words, m, channel, level, layer), block);
                    if record.count > 0 {
                        texture = texture.wrapping_add(walk_record(
                            material,
                            channel,
                            record,
                            span_x,
                            span_y,
                            light,
                            view,
                            &mut operations,
                        ));
                    }
                }
            }
        }
        if channel.scale_start != 0 {
            operations += 17;
            texture = scale_texture(
                texture,
                scale_q15(words, m, channel, light, view),
                word(words, channel.scale_start + 1),
            );
        }
        clamp_magnitude(texture.wrapping_add(mean), VALUE_BOUND)
    });
    // Matrix, transfer and presentation.
    operations += 102;
    Counted { operations, values }
}

/// A layer of a sparse tensor, step by step as 12.5 goes, by maps instead of a merge of lists.
fn walk_layer(
    material: &Selvedge<'_>,
    level: u32,
    layer: u32,
    axes: [selvedge::position::Axis; 2],
    light: Taps,
    view: Taps,
    operations: &mut u64,
) -> [i32; 3] {
    let (words, m) = (material.words(), material.material());
    let start = lists_start(words, m, level, layer);
    let (atom_count, shape) = (word(words, m.fibres_start), word(words, m.fibres_start + 1));
    let ends = |axis: selvedge::position::Axis| match axis.count {
        2 => vec![(axis.first.block, axis.first.weight_a_q15), (axis.second.block, axis.second.weight_a_q15)],
        _ => vec![(axis.first.block, 32_768)],
    };
    let mut weights = std::collections::BTreeMap::<u32, i32>::new();
    for (row, weight_y) in ends(axes[1]) {
        for (column, weight_x) in ends(axes[0]) {
            let mut list = open_list(words, start, atom_count, row * level_size(m.width, level) + column);
            while list.index != LIST_END {
                // A product, and one in halves.
                *operations += 3;
                let weight = weights.entry(list.index).or_default();
                *weight = weight.wrapping_add(multiply_q15(list.coefficient * weight_x, weight_y));
                list = next_coefficient(words, list);
            }
        }
    }
    let mut total = [0i32; 3];
    let row = |index: u32| m.light_atoms_start + 2 + index * word(words, m.light_atoms_start);
    let (entries, mask) = (shape & 0xff, (1u32 << (shape >> 8 & 0xff)) - 1);
    for (atom, weight) in weights {
        let mut sums = [0i32; 3];
        for (view, weight) in
            [(view.a, view.weight_a_q15), (view.b, view.weight_b_q15), (view.c, view.weight_c_q15)]
        {
            for n in 0..entries {
                let entry = packed_i16(
                    words,
                    m.fibres_start + 2 + atom_count,
                    (view * atom_count + atom) * entries + n,
                ) as u32
                    & 0xffff;
                let (index, value) = (entry & mask, (entry & !mask) as u16 as i16 as i32);
                // The entry's weight, three channels of three lights, and three products.
                *operations += 13;
                let h = (value * weight + (1 << 16)) >> 17;
                for (c, sum) in sums.iter_mut().enumerate() {
                    let at = |light: u32, weight: i32| {
                        ((word(words, row(light) + index) << (22 - c * 10)) as i32 >> 22) * weight
                    };
                    let u = (at(light.a, light.weight_a_q15)
                        + at(light.b, light.weight_b_q15)
                        + at(light.c, light.weight_c_q15)
                        + 512)
                        >> 10;
                    *sum += h * u;
                }
            }
        }
        let shifts = word(words, m.fibres_start + 2 + atom);
        *operations += 6;
        for (total, sum) in total.iter_mut().zip(sums) {
            let angular = clamp_magnitude(round_shift(sum, shifts & 31), 32_767);
            *total = total.wrapping_add(round_shift(multiply_q15(weight, angular), shifts >> 5 & 31));
        }
    }
    total.map(|total| clamp_magnitude(round_shift(total, word(words, start) >> 24), 1 << 27))
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
            // Two weights by reciprocal; the areas at full precision are moved by two products each.
            return 2 + 6 * seen + 7;
        }
    }
    2 + 6 * seen + 6 * word(words, start + 2) as u64 + 7
}

/// One record, step by step as 10.7 goes.
#[allow(clippy::too_many_arguments, reason = "those of its twin in the core, and the count")]
fn walk_record(
    material: &Selvedge<'_>,
    channel: Channel,
    record: Record,
    x: Span,
    y: Span,
    light: Taps,
    view: Taps,
    operations: &mut u64,
) -> i32 {
    let words = material.words();
    let RecordTables { light: light_table, view: view_table, x: x_table, y: y_table, atoms } =
        RecordTables::of(words, channel, record.dictionary);
    let field_bits = record.low_bits + record.value_bits;
    let (mut total, mut sum_y, mut sum_xy) = (0i32, 0i32, 0i32);
    let (mut at_x, mut at_y) = (0, 0);
    let (mut bit, mut high) = (record.highs_bit, 0);
    // A close of the sum over x, or of that over y: two products to blend the column, two to multiply by it
    // in halves.
    let mut close = |sum: i32, u: i32| {
        *operations += 4;
        multiply_q15(sum, u)
    };
    let mut of_coefficients = 0;
    for index in 0..record.count {
        loop {
            let window = bit_window(words, record.stream, bit);
            if window != 0 {
                high += window.trailing_zeros();
                bit += window.trailing_zeros() + 1;
                break;
            }
            high += 32;
            bit += 32;
        }
        let field = bit_window(words, record.stream, record.fields_bit + index * field_bits);
        let position = high << record.low_bits | low_part(field, record.low_bits);
        let value = low_part(field >> record.low_bits, record.value_bits);
        let (atom, quantiser) = (word(words, atoms + position * 2), word(words, atoms + position * 2 + 1));
        let (next_x, next_y) = (atom >> 24 & 0xf, atom >> 28);
        if (next_x, next_y) != (at_x, at_y) {
            sum_y = sum_y.wrapping_add(close(sum_xy, blend_span(words, x_table.0, x_table.1, x, at_x)));
            sum_xy = 0;
            at_x = next_x;
        }
        if next_y != at_y {
            total = total.wrapping_add(close(sum_y, blend_span(words, y_table.0, y_table.1, y, at_y)));
            sum_y = 0;
            at_y = next_y;
        }
        let u_light = blend_column(words, light_table.0, light_table.1, light, atom >> 14 & 0x3ff);
        let u_view = blend_column(words, view_table.0, view_table.1, view, atom >> 4 & 0x3ff);
        let u_angular = u_light.wrapping_mul(u_view).wrapping_add(1 << 14) >> 15;
        sum_xy = sum_xy.wrapping_add(round_shift(
            dequantise(quantiser, value, record.value_bits).wrapping_mul(u_angular),
            atom & 0xf,
        ));
        // Dequantised, blended twice by three, multiplied with each other and with the coefficient.
        of_coefficients += 9;
    }
    sum_y = sum_y.wrapping_add(close(sum_xy, blend_span(words, x_table.0, x_table.1, x, at_x)));
    total = total.wrapping_add(close(sum_y, blend_span(words, y_table.0, y_table.1, y, at_y)));
    *operations += of_coefficients;
    clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND)
}
