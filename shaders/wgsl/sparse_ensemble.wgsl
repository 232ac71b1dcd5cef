// The sparse ensemble (chapter 10). Twin: decoder-core/src/method/sparse_ensemble/mod.rs.
//
// After SparseBTF (Kavoosighafi et al. 2023), equation 5: a block of texels is a few coefficients over
// products of one column of each of four factor matrices. A sample blends the rows of the factors
// first and evaluates once (equation 6), in an order of products that lets work be shared.

// The method's number (3.1-8).
const METHOD_SPARSE_ENSEMBLE: u32 = 1u;
// Part of the angular factors of channel 0; the other channels follow.
const ANGULAR_PART: u32 = 0u;
// Part of the spatial factors of channel 0; the other channels follow.
const SPATIAL_PART: u32 = 3u;
// Part of the tables of atoms of channel 0; the other channels follow.
const ATOMS_PART: u32 = 6u;
// Part of the first directory entry of the coefficients.
const COEFFICIENTS_PART: u32 = 9u;
// Bits of a record's shift (10.4-3).
const SHIFT_BITS: u32 = 5u;
// The texture of a record is clamped to this magnitude, Q20: 32 (10.7-4).
const RECORD_BOUND: i32 = 0x02000000i;
// Bits that hold the number of low position bits.
const LOW_BITS_BITS: u32 = 4u;

// What the fixed fields at the begin of a record say, and where its parts begin (10.4).
struct Record {
    stream: u32,
    value_bits: u32,
    count: u32,
    dictionary: u32,
    shift: u32,
    low_bits: u32,
    fields_bit: u32,
    highs_bit: u32,
}

// Where the tables of a channel are, and which of the channels with texture it is.
struct Tables {
    angular_start: u32,
    spatial_start: u32,
    atoms_start: u32,
    full_rank: u32,
}

// The tables of channel `number` (10.1, 10.2, 10.5).
fn tables_of(material: u32, number: u32) -> Tables {
    return Tables(
        part(material, ANGULAR_PART + number),
        part(material, SPATIAL_PART + number),
        part(material, ATOMS_PART + number),
        channel_of(material, number).full_rank,
    );
}

// First word of the coefficients of a level, layer and channel, by the directory (10.3-1).
fn coefficients_start(material: u32, full_rank: u32, level: u32, layer: u32) -> u32 {
    let layers = level * materials[material].layer_count + layer;
    let rank = layers * materials[material].full_count + full_rank;
    let entry = part(material, COEFFICIENTS_PART) + rank * 4u;
    // 10.3-1: the second word of an entry is the byte offset of its section.
    return materials[material].file_start + (word(entry + 1u) >> 2u);
}

// Column of the light factor that an atom names (10.5).
fn atom_light(atom: u32) -> u32 {
    // Bits 14 to 23 (10.5).
    return (atom >> 14u) & 0x3ffu;
}

// Column of the view factor that an atom names (10.5).
fn atom_view(atom: u32) -> u32 {
    // Bits 4 to 13 (10.5).
    return (atom >> 4u) & 0x3ffu;
}

// Column of the factor along x that an atom names (10.5).
fn atom_x(atom: u32) -> u32 {
    // Bits 24 to 27 (10.5).
    return (atom >> 24u) & 0xfu;
}

// Column of the factor along y that an atom names (10.5).
fn atom_y(atom: u32) -> u32 {
    // Bits 28 to 31 (10.5).
    return atom >> 28u;
}

// Right shift of an atom's products (10.5).
fn atom_shift(atom: u32) -> u32 {
    // Bits 0 to 3 (10.5).
    return atom & 0xfu;
}

// The fixed fields of the record of a block (10.4).
fn read_record(start: u32, block: u32) -> Record {
    let widths = word(start);
    let value_bits = widths & 0xffu;
    let dictionary_bits = (widths >> 8u) & 0xffu;
    let count_bits = widths >> 16u;
    let stream = start + 4u + word(start + 1u);
    let bit = word(start + 4u + block);
    // 10.4-2: count, dictionary, shift and low bits fit one window.
    let window = bit_window(stream, bit);
    let count = low_part(window, count_bits);
    let dictionary = low_part(window >> count_bits, dictionary_bits);
    let shift = low_part(window >> (count_bits + dictionary_bits), SHIFT_BITS);
    let low_bits = (window >> (count_bits + dictionary_bits + SHIFT_BITS)) & 0xfu;
    let fields_bit = bit + count_bits + dictionary_bits + SHIFT_BITS + LOW_BITS_BITS;
    let highs_bit = fields_bit + count * (low_bits + value_bits);
    return Record(stream, value_bits, count, dictionary, shift, low_bits, fields_bit, highs_bit);
}

// The integer coefficient that a stored value stands for (10.5-1).
fn dequantise(quantiser: u32, value: u32, value_bits: u32) -> i32 {
    let base = i32(quantiser << 16u) >> 16u;
    let step = quantiser >> 16u;
    let half = (1u << value_bits) >> 1u;
    // 10.5-1: base + round(value * step / 2^value_bits).
    return base + i32((value * step + half) >> value_bits);
}

// One column of three rows of a factor by their weights, Q15 (10.6-1).
fn blend_column(table: u32, row_words: u32, taps: Taps, column: u32) -> i32 {
    let a = packed_i16(table + taps.a * row_words, column) * taps.weight_a_q15;
    let b = packed_i16(table + taps.b * row_words, column) * taps.weight_b_q15;
    let c = packed_i16(table + taps.c * row_words, column) * taps.weight_c_q15;
    // 10.6-1: the sum is exact, within 2^30; one rounding.
    return (a + b + c + HALF_Q15) >> 15u;
}

// One column of two rows of a spatial factor by their weights, Q15 (10.6-2).
fn blend_span(table: u32, row_words: u32, span: Span, column: u32) -> i32 {
    let a = packed_i16(table + span.row_a * row_words, column) * span.weight_a_q15;
    let b = packed_i16(table + span.row_b * row_words, column) * span.weight_b_q15;
    // 10.6-2: the sum is exact, within 2^30; one rounding.
    return (a + b + HALF_Q15) >> 15u;
}

// What one record adds to the texture of a channel, Q20 (10.7).
fn record_q20(tables: Tables, record: Record, x: Span, y: Span, light: Taps, view: Taps) -> i32 {
    // 10.1-3, 10.2-2, 10.5-2: the tables of the record's dictionary.
    let angular_start = tables.angular_start;
    let angular = angular_start + 2u + record.dictionary * 4u;
    let light_row_words = (word(angular) + 1u) >> 1u;
    let view_row_words = (word(angular + 1u) + 1u) >> 1u;
    let light_table = angular_start + word(angular + 2u);
    let view_table = angular_start + word(angular + 3u);
    let spatial_start = tables.spatial_start;
    let spatial = spatial_start + 2u + record.dictionary * 4u;
    let x_row_words = (word(spatial) + 1u) >> 1u;
    let y_row_words = (word(spatial + 1u) + 1u) >> 1u;
    let x_table = spatial_start + word(spatial + 2u);
    let y_table = spatial_start + word(spatial + 3u);
    let atoms_start = tables.atoms_start;
    let atoms = atoms_start + word(atoms_start + 3u + record.dictionary * 2u);

    let field_bits = record.low_bits + record.value_bits;
    var total = 0;
    var sum_y = 0;
    var sum_xy = 0;
    var column_x = 0u;
    var column_y = 0u;
    var column_light = 0xffffffffu;
    var column_view = 0xffffffffu;
    var u_light = 0;
    var u_view = 0;
    var bit = record.highs_bit;
    var high = 0u;
    var index = 0u;
    while (index < record.count) {
        // 10.4-4: the high part of a position is the number of zeros before its one.
        var window = bit_window(record.stream, bit);
        while (window == 0u && high < 65536u) {
            high += 32u;
            bit += 32u;
            window = bit_window(record.stream, bit);
        }
        let zeros = countTrailingZeros(window) & 31u;
        high += zeros;
        bit += zeros + 1u;
        // 10.4-5: low part and value stand side by side at a fixed distance.
        let field = bit_window(record.stream, record.fields_bit + index * field_bits);
        let position = (high << record.low_bits) | low_part(field, record.low_bits);
        let value = low_part(field >> record.low_bits, record.value_bits);
        let atom = word(atoms + position * 2u);
        let quantiser = word(atoms + position * 2u + 1u);
        let coefficient = dequantise(quantiser, value, record.value_bits);

        // 10.7-3: a change of the spatial atom closes its sum; a change of y also that of x.
        let next_x = atom_x(atom);
        let next_y = atom_y(atom);
        if (next_x != column_x || next_y != column_y) {
            sum_y += multiply_q15(sum_xy, blend_span(x_table, x_row_words, x, column_x));
            sum_xy = 0;
            column_x = next_x;
        }
        if (next_y != column_y) {
            total += multiply_q15(sum_y, blend_span(y_table, y_row_words, y, column_y));
            sum_y = 0;
            column_y = next_y;
        }
        // 10.7-1: the product of the two angular columns is rounded to Q15.
        let next_light = atom_light(atom);
        if (next_light != column_light) {
            column_light = next_light;
            u_light = blend_column(light_table, light_row_words, light, next_light);
        }
        let next_view = atom_view(atom);
        if (next_view != column_view) {
            column_view = next_view;
            u_view = blend_column(view_table, view_row_words, view, next_view);
        }
        let u_angular = (u_light * u_view + HALF_Q15) >> 15u;
        // 10.7-2: times the coefficient, by the atom's own shift; within 2^30 before it.
        sum_xy += round_shift(coefficient * u_angular, atom_shift(atom));
        index += 1u;
    }
    sum_y += multiply_q15(sum_xy, blend_span(x_table, x_row_words, x, column_x));
    total += multiply_q15(sum_y, blend_span(y_table, y_row_words, y, column_y));
    // 10.7-4: to Q20, clamped so that four blocks of eight layers stay within 2^30.
    return clamp_magnitude(round_shift(total, record.shift), RECORD_BOUND);
}

// The texture of one block, all layers, Q20 (10.7-5).
fn block_q20(material: u32, tables: Tables, level: u32, x: Span, y: Span, light: Taps, view: Taps) -> i32 {
    let blocks_x = block_count(material, level_size(materials[material].width, level));
    let block = y.block * blocks_x + x.block;
    var sum = 0;
    var layer = 0u;
    // 10.7-5: layers add up; each record is rounded by itself.
    while (layer < materials[material].layer_limit) {
        let start = coefficients_start(material, tables.full_rank, level, layer);
        let record = read_record(start, block);
        if (record.count > 0u) {
            sum += record_q20(tables, record, x, y, light, view);
        }
        layer += 1u;
    }
    return sum;
}

// The texture of a channel: the sum over one, two or four blocks, Q20 (10.7-6).
fn texture_q20(material: u32, number: u32, place: Place, light: Taps, view: Taps) -> i32 {
    let tables = tables_of(material, number);
    let x = place.x;
    let y = place.y;
    var sum = 0;
    var corner = 0u;
    // 10.7-6: the weights are in the rows, so the blocks only add.
    while (corner < x.count * y.count) {
        var span_x = x.first;
        if ((corner & 1u) != 0u && x.count == 2u) {
            span_x = x.second;
        }
        // select(if false, if true, condition)
        let in_second_row = select(corner, corner >> 1u, x.count == 2u);
        var span_y = y.first;
        if (in_second_row != 0u) {
            span_y = y.second;
        }
        sum += block_q20(material, tables, place.level, span_x, span_y, light, view);
        corner += 1u;
    }
    return sum;
}

// The textures of all channels, Q20; zero for a channel without texture (10.7).
fn sparse_ensemble_textures_q20(material: u32, place: Place, light: Located, view: Located) -> Values {
    var values = Values(0, 0, 0);
    // 10.7-6: a loop, so that a compiler for GPUs makes one copy of a channel.
    for (var number = 0u; number < 3u; number++) {
        var texture = 0;
        if (channel_of(material, number).state == CHANNEL_FULL) {
            texture = texture_q20(material, number, place, light.taps, view.taps);
        }
        if (number == 0u) {
            values.c0 = texture;
        }
        if (number == 1u) {
            values.c1 = texture;
        }
        if (number == 2u) {
            values.c2 = texture;
        }
    }
    return values;
}
