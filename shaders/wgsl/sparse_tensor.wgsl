// The sparse tensor (chapter 12). Twin: decoder-core/src/method/sparse_tensor/mod.rs.
//
// After Ruiters and Klein (2009), equation 2: a texel is a few ABRDF atoms, and an ABRDF atom is for each
// view a few light atoms, which are colours for each light. A sample merges the lists of its four texels
// first (section 4.3), so that an ABRDF atom is evaluated once, whatever number of them use it.

// The method's number (3.1-8).
const METHOD_SPARSE_TENSOR: u32 = 2u;
// Part of the light atoms.
const LIGHT_ATOMS_PART: u32 = 0u;
// Part of the fibres.
const FIBRES_PART: u32 = 1u;
// Part of the first directory entry of the lists.
const LISTS_PART: u32 = 2u;
// Half of a unit in the last place, added before a shift by 10 (12.5-1).
const HALF_Q10: i32 = 512;
// Half of a unit in the last place, added before a shift by 17 (12.5-2).
const HALF_Q17: i32 = 0x10000;
// Texels whose lists share a first bit (12.4-1).
const GROUP_TEXELS: u32 = 8u;
// The index of a list that has ended: above all ABRDF atoms.
const LIST_END: u32 = 0xffffffffu;
// The texture of a layer is clamped to this magnitude, Q20: 128 (12.5-6).
const LAYER_BOUND: i32 = 0x08000000i;
// Largest magnitude of an ABRDF atom, Q15 (12.5-3).
const ANGULAR_BOUND: i32 = 32767i;

// The list of a texel, and the coefficient that it stands at (12.4).
struct List {
    stream: u32,
    value_bits: u32,
    low_bits: u32,
    field_bit: u32,
    high_bit: u32,
    high: u32,
    left: u32,
    index: u32,
    coefficient: i32,
}

// Bits that hold `largest` (12.2-2).
fn bit_length(largest: u32) -> u32 {
    // 12.2-2: zero for zero.
    return 32u - countLeadingZeros(largest);
}

// Low bits of the indices of a list of `count` coefficients (12.4-2).
fn list_low_bits(index_bits: u32, count: u32) -> u32 {
    // 12.4-2: by the number alone, so that a list's length is known without its content.
    return index_bits - min(index_bits, bit_length(count));
}

// Bits of a list of `count` coefficients over `atom_count` ABRDF atoms (12.4-2).
fn list_bits(index_bits: u32, value_bits: u32, atom_count: u32, count: u32) -> u32 {
    let low_bits = list_low_bits(index_bits, count);
    // 12.4-2: an empty list has no bits.
    if (count == 0u) {
        return 0u;
    }
    return count * (low_bits + value_bits + 1u) + ((atom_count - 1u) >> low_bits);
}

// First word of the lists of a level and layer, by the directory (12.3-1).
fn lists_start(material: u32, level: u32, layer: u32) -> u32 {
    let rank = level * materials[material].layer_count + layer;
    let entry = part(material, LISTS_PART) + rank * 4u;
    // 12.3-1: the second word of an entry is the byte offset of its section.
    return materials[material].file_start + (word(entry + 1u) >> 2u);
}

// The coefficient that a stored value stands for, Q15: never zero, below one in magnitude (12.4-5).
fn list_coefficient(value: u32, value_bits: u32) -> i32 {
    // 12.4-5: the middle of the value's interval.
    return i32((((value << 1u) | 1u) << (15u - value_bits)) - 0x8000u);
}

// The list at its next coefficient, or at its end (12.4).
fn next_coefficient(list: List) -> List {
    var next = list;
    if (list.left == 0u) {
        next.index = LIST_END;
        return next;
    }
    // 12.4-4: the high part of an index is the number of zeros before its one.
    var window = bit_window(list.stream, next.high_bit);
    while (window == 0u && next.high < 1024u) {
        next.high += 32u;
        next.high_bit += 32u;
        window = bit_window(list.stream, next.high_bit);
    }
    let zeros = countTrailingZeros(window) & 31u;
    next.high += zeros;
    next.high_bit += zeros + 1u;
    let field = bit_window(list.stream, list.field_bit);
    next.field_bit = list.field_bit + list.low_bits + list.value_bits;
    next.left = list.left - 1u;
    next.index = (next.high << list.low_bits) | low_part(field, list.low_bits);
    next.coefficient = list_coefficient(low_part(field >> list.low_bits, list.value_bits), list.value_bits);
    return next;
}

// The list of a texel at its first coefficient (12.4).
fn open_list(start: u32, atom_count: u32, texel: u32) -> List {
    let head = word(start);
    let value_bits = head & 0xffu;
    let count_bits = (head >> 8u) & 0xffu;
    let index_bits = (head >> 16u) & 0xffu;
    let groups = (word(start + 1u) + 7u) >> 3u;
    let stream = start + 4u + groups;
    let group_bit = word(start + 4u + (texel >> 3u));
    let place = texel & 7u;
    // 12.4-1, 12.4-3: the counts of a group, then its lists.
    var bit = group_bit + count_bits * GROUP_TEXELS;
    var before = 0u;
    while (before < place) {
        let other = low_part(bit_window(stream, group_bit + before * count_bits), count_bits);
        bit += list_bits(index_bits, value_bits, atom_count, other);
        before += 1u;
    }
    let count = low_part(bit_window(stream, group_bit + place * count_bits), count_bits);
    let low_bits = list_low_bits(index_bits, count);
    let high_bit = bit + count * (low_bits + value_bits);
    return next_coefficient(List(stream, value_bits, low_bits, bit, high_bit, 0u, count, LIST_END, 0));
}

// A list that is at its end: that of a texel without weight.
fn no_list() -> List {
    // 12.5-4: a weight of zero adds zero.
    return List(0u, 0u, 0u, 0u, 0u, 0u, 0u, LIST_END, 0);
}

// Right shift of the sums of an ABRDF atom (12.2).
fn angular_shift(shifts: u32) -> u32 {
    // Bits 0 to 4 (12.2).
    return shifts & 31u;
}

// Right shift of an ABRDF atom's products with its weight (12.2).
fn gain_shift(shifts: u32) -> u32 {
    // Bits 5 to 9 (12.2).
    return (shifts >> 5u) & 31u;
}

// One channel of a light atom at one light: ten bits with their sign (12.1).
fn light_entry(entry: u32, channel: u32) -> i32 {
    // 12.1-4: up, then back with its sign.
    return i32(entry << (22u - channel * 10u)) >> 22u;
}

// One channel of a light atom between three lights, Q14 (12.5-1).
fn blend_light(a: u32, b: u32, c: u32, light: Taps, channel: u32) -> i32 {
    let part_a = light_entry(a, channel) * light.weight_a_q15;
    let part_b = light_entry(b, channel) * light.weight_b_q15;
    let part_c = light_entry(c, channel) * light.weight_c_q15;
    // 12.5-1: the sum is exact, within 2^24; from Q24 to Q14.
    return (part_a + part_b + part_c + HALF_Q10) >> 10u;
}

// Adds one fibre of an ABRDF atom to its sums (12.5-2).
fn add_fibre(material: u32, atom: u32, view: u32, weight_q15: i32, light: Taps, sums: Values) -> Values {
    let light_start = part(material, LIGHT_ATOMS_PART);
    let row_words = word(light_start);
    let row_a = light_start + 2u + light.a * row_words;
    let row_b = light_start + 2u + light.b * row_words;
    let row_c = light_start + 2u + light.c * row_words;
    let fibres_start = part(material, FIBRES_PART);
    let atom_count = word(fibres_start);
    let shape = word(fibres_start + 1u);
    let entries = shape & 0xffu;
    let index_bits = (shape >> 8u) & 0xffu;
    let table = fibres_start + 2u + atom_count;
    let first = (view * atom_count + atom) * entries;
    var result = sums;
    var n = 0u;
    while (n < entries) {
        let at = first + n;
        let pair = word(table + (at >> 1u));
        let entry = (pair >> ((at & 1u) << 4u)) & 0xffffu;
        let index = low_part(entry, index_bits);
        // 12.2-6: the value is the entry without its index.
        let value = i32((entry - index) << 16u) >> 16u;
        // 12.5-2: thirteen fraction bits are left, so that the sums are exact.
        let h = (value * weight_q15 + HALF_Q17) >> 17u;
        let a = word(row_a + index);
        let b = word(row_b + index);
        let c = word(row_c + index);
        result.c0 += h * blend_light(a, b, c, light, 0u);
        result.c1 += h * blend_light(a, b, c, light, 1u);
        result.c2 += h * blend_light(a, b, c, light, 2u);
        n += 1u;
    }
    return result;
}

// Three channels of an ABRDF atom between three views and three lights, Q15 (12.5-3).
fn angular_q15(material: u32, atom: u32, shift: u32, light: Taps, view: Taps) -> Values {
    var sums = Values(0, 0, 0);
    // 12.5-2: a view without weight adds zero.
    if (view.weight_a_q15 != 0) {
        sums = add_fibre(material, atom, view.a, view.weight_a_q15, light, sums);
    }
    if (view.weight_b_q15 != 0) {
        sums = add_fibre(material, atom, view.b, view.weight_b_q15, light, sums);
    }
    if (view.weight_c_q15 != 0) {
        sums = add_fibre(material, atom, view.c, view.weight_c_q15, light, sums);
    }
    // 12.5-3: to 16 bits, by the atom's own shift.
    sums.c0 = clamp_magnitude(round_shift(sums.c0, shift), ANGULAR_BOUND);
    sums.c1 = clamp_magnitude(round_shift(sums.c1, shift), ANGULAR_BOUND);
    sums.c2 = clamp_magnitude(round_shift(sums.c2, shift), ANGULAR_BOUND);
    return sums;
}

// What a coefficient adds to the weight of its ABRDF atom (12.5-4).
fn corner_weight(coefficient: i32, weight_x_q15: i32, weight_y_q15: i32) -> i32 {
    // 12.5-4: the first product is exact, within 2^30; one rounding.
    return multiply_q15(coefficient * weight_x_q15, weight_y_q15);
}

// The textures of three channels by one layer, Q20 (12.5).
fn layer_q20(material: u32, layer: u32, place: Place, light: Taps, view: Taps) -> Values {
    let x = place.x;
    let y = place.y;
    let level = place.level;
    let start = lists_start(material, level, layer);
    let fibres_start = part(material, FIBRES_PART);
    let atom_count = word(fibres_start);
    let width = level_size(materials[material].width, level);
    let row_first = y.first.block * width;
    let row_second = y.second.block * width;
    // 12.5-4: an axis of one texel has the whole weight there.
    var x_first = ONE_Q15;
    var x_second = 0;
    if (x.count == 2u) {
        x_first = x.first.weight_a_q15;
        x_second = x.second.weight_a_q15;
    }
    var y_first = ONE_Q15;
    var y_second = 0;
    if (y.count == 2u) {
        y_first = y.first.weight_a_q15;
        y_second = y.second.weight_a_q15;
    }
    var list_a = no_list();
    var list_b = no_list();
    var list_c = no_list();
    var list_d = no_list();
    if (x_first != 0 && y_first != 0) {
        list_a = open_list(start, atom_count, row_first + x.first.block);
    }
    if (x_second != 0 && y_first != 0) {
        list_b = open_list(start, atom_count, row_first + x.second.block);
    }
    if (x_first != 0 && y_second != 0) {
        list_c = open_list(start, atom_count, row_second + x.first.block);
    }
    if (x_second != 0 && y_second != 0) {
        list_d = open_list(start, atom_count, row_second + x.second.block);
    }
    var total = Values(0, 0, 0);
    var atom = min(min(list_a.index, list_b.index), min(list_c.index, list_d.index));
    // 12.5-4: the lists ascend, so the least of four heads is next; an atom is evaluated once.
    while (atom != LIST_END) {
        var weight = 0;
        if (list_a.index == atom) {
            weight += corner_weight(list_a.coefficient, x_first, y_first);
            list_a = next_coefficient(list_a);
        }
        if (list_b.index == atom) {
            weight += corner_weight(list_b.coefficient, x_second, y_first);
            list_b = next_coefficient(list_b);
        }
        if (list_c.index == atom) {
            weight += corner_weight(list_c.coefficient, x_first, y_second);
            list_c = next_coefficient(list_c);
        }
        if (list_d.index == atom) {
            weight += corner_weight(list_d.coefficient, x_second, y_second);
            list_d = next_coefficient(list_d);
        }
        let shifts = word(fibres_start + 2u + atom);
        let gain = gain_shift(shifts);
        let angular = angular_q15(material, atom, angular_shift(shifts), light, view);
        // 12.5-5: each product is rounded by the atom's gain; 12.5-8 bounds their sum.
        total.c0 += round_shift(multiply_q15(weight, angular.c0), gain);
        total.c1 += round_shift(multiply_q15(weight, angular.c1), gain);
        total.c2 += round_shift(multiply_q15(weight, angular.c2), gain);
        atom = min(min(list_a.index, list_b.index), min(list_c.index, list_d.index));
    }
    // 12.5-6: to Q20, clamped so that eight layers stay within 2^30.
    let shift = word(start) >> 24u;
    total.c0 = clamp_magnitude(round_shift(total.c0, shift), LAYER_BOUND);
    total.c1 = clamp_magnitude(round_shift(total.c1, shift), LAYER_BOUND);
    total.c2 = clamp_magnitude(round_shift(total.c2, shift), LAYER_BOUND);
    return total;
}

// The textures of all channels, all layers, Q20 (12.5-7).
fn sparse_tensor_textures_q20(material: u32, place: Place, light: Located, view: Located) -> Values {
    var sums = Values(0, 0, 0);
    var layer = 0u;
    // 12.5-7: layers add up; each is rounded by itself.
    while (layer < materials[material].layer_limit) {
        let addend = layer_q20(material, layer, place, light.taps, view.taps);
        sums.c0 += addend.c0;
        sums.c1 += addend.c1;
        sums.c2 += addend.c2;
        layer += 1u;
    }
    return sums;
}
