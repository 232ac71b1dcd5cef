//! The sparse tensor (chapter 12). Twin: `shaders/wgsl/sparse_tensor.wgsl`.
//!
//! After Ruiters and Klein (2009), equation 2: a texel is a few ABRDF atoms, and an ABRDF atom is for each
//! view a few light atoms, which are colours for each light. A sample merges the lists of its four texels
//! first (section 4.3), so that an ABRDF atom is evaluated once, whatever number of them use it.

#![cfg(feature = "sparse-tensor")]

pub mod check;
pub mod cost;
#[cfg(feature = "batch")]
pub(crate) mod fast;

use crate::kernel::colour::Values;
use crate::kernel::direction::{Located, Taps};
use crate::kernel::fixed::{ONE_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::material::{Material, level_size, part};
use crate::kernel::position::Place;
use crate::kernel::words::{Words, bit_window, low_part, word};

/// The method's number (3.1-8).
pub const METHOD_SPARSE_TENSOR: u32 = 2;
/// Part of the light atoms.
pub const LIGHT_ATOMS_PART: u32 = 0;
/// Part of the fibres.
pub const FIBRES_PART: u32 = 1;
/// Part of the first directory entry of the lists.
pub const LISTS_PART: u32 = 2;
/// Half of a unit in the last place, added before a shift by 10 (12.5-1).
pub const HALF_Q10: i32 = 512;
/// Half of a unit in the last place, added before a shift by 17 (12.5-2).
pub const HALF_Q17: i32 = 0x10000;
/// Texels whose lists share a first bit (12.4-1).
pub const GROUP_TEXELS: u32 = 8;
/// The index of a list that has ended: above all ABRDF atoms.
pub const LIST_END: u32 = 0xffff_ffff;
/// The texture of a layer is clamped to this magnitude, Q20: 128 (12.5-6).
pub const LAYER_BOUND: i32 = 0x0800_0000;
/// Largest magnitude of an ABRDF atom, Q15 (12.5-3).
pub const ANGULAR_BOUND: i32 = 32767;

/// The list of a texel, and the coefficient that it stands at (12.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct List {
    /// First word of the bit stream.
    pub stream: u32,
    /// Bits of a value.
    pub value_bits: u32,
    /// Low bits of an index.
    pub low_bits: u32,
    /// First bit of the low part and value of the next coefficient.
    pub field_bit: u32,
    /// First bit of the high part of the next coefficient.
    pub high_bit: u32,
    /// High part of the last index.
    pub high: u32,
    /// Coefficients behind this one.
    pub left: u32,
    /// ABRDF atom of this coefficient, or `LIST_END`.
    pub index: u32,
    /// This coefficient, Q15.
    pub coefficient: i32,
}

/// Bits that hold `largest` (12.2-2).
#[inline(always)]
pub fn bit_length(largest: u32) -> u32 {
    // 12.2-2: zero for zero.
    32u32.wrapping_sub(largest.leading_zeros())
}

/// Low bits of the indices of a list of `count` coefficients (12.4-2).
#[inline(always)]
pub fn list_low_bits(index_bits: u32, count: u32) -> u32 {
    // 12.4-2: by the number alone, so that a list's length is known without its content.
    index_bits.wrapping_sub(index_bits.min(bit_length(count)))
}

/// Bits of a list of `count` coefficients over `atom_count` ABRDF atoms (12.4-2).
#[inline(always)]
pub fn list_bits(index_bits: u32, value_bits: u32, atom_count: u32, count: u32) -> u32 {
    let low_bits = list_low_bits(index_bits, count);
    // 12.4-2: an empty list has no bits.
    if count == 0 {
        return 0;
    }
    count
        .wrapping_mul(low_bits.wrapping_add(value_bits).wrapping_add(1))
        .wrapping_add(atom_count.wrapping_sub(1) >> low_bits)
}

/// First word of the lists of a level and layer, by the directory (12.3-1).
pub fn lists_start(words: Words<'_>, material: &Material, level: u32, layer: u32) -> u32 {
    let rank = level.wrapping_mul(material.layer_count).wrapping_add(layer);
    let entry = part(material, LISTS_PART).wrapping_add(rank.wrapping_mul(4));
    // 12.3-1: the second word of an entry is the byte offset of its section.
    material.file_start.wrapping_add(word(words, entry.wrapping_add(1)) >> 2)
}

/// The coefficient that a stored value stands for, Q15: never zero, below one in magnitude (12.4-5).
#[inline(always)]
pub fn list_coefficient(value: u32, value_bits: u32) -> i32 {
    // 12.4-5: the middle of the value's interval.
    (((value << 1) | 1) << (15u32.wrapping_sub(value_bits))).wrapping_sub(0x8000) as i32
}

/// The list at its next coefficient, or at its end (12.4).
#[inline(always)]
pub fn next_coefficient(words: Words<'_>, list: List) -> List {
    let mut next = list;
    if list.left == 0 {
        next.index = LIST_END;
        return next;
    }
    // 12.4-4: the high part of an index is the number of zeros before its one.
    let mut window = bit_window(words, list.stream, next.high_bit);
    while window == 0 && next.high < 1024 {
        next.high = next.high.wrapping_add(32);
        next.high_bit = next.high_bit.wrapping_add(32);
        window = bit_window(words, list.stream, next.high_bit);
    }
    let zeros = window.trailing_zeros() & 31;
    next.high = next.high.wrapping_add(zeros);
    next.high_bit = next.high_bit.wrapping_add(zeros).wrapping_add(1);
    let field = bit_window(words, list.stream, list.field_bit);
    next.field_bit = list.field_bit.wrapping_add(list.low_bits).wrapping_add(list.value_bits);
    next.left = list.left.wrapping_sub(1);
    next.index = (next.high << list.low_bits) | low_part(field, list.low_bits);
    next.coefficient = list_coefficient(low_part(field >> list.low_bits, list.value_bits), list.value_bits);
    next
}

/// The list of a texel at its first coefficient (12.4).
pub fn open_list(words: Words<'_>, start: u32, atom_count: u32, texel: u32) -> List {
    let head = word(words, start);
    let value_bits = head & 0xff;
    let count_bits = (head >> 8) & 0xff;
    let index_bits = (head >> 16) & 0xff;
    let groups = word(words, start.wrapping_add(1)).wrapping_add(7) >> 3;
    let stream = start.wrapping_add(4).wrapping_add(groups);
    let group_bit = word(words, start.wrapping_add(4).wrapping_add(texel >> 3));
    let place = texel & 7;
    // 12.4-1, 12.4-3: the counts of a group, then its lists.
    let mut bit = group_bit.wrapping_add(count_bits.wrapping_mul(GROUP_TEXELS));
    let mut before = 0u32;
    while before < place {
        let other = low_part(
            bit_window(words, stream, group_bit.wrapping_add(before.wrapping_mul(count_bits))),
            count_bits,
        );
        bit = bit.wrapping_add(list_bits(index_bits, value_bits, atom_count, other));
        before = before.wrapping_add(1);
    }
    let count = low_part(
        bit_window(words, stream, group_bit.wrapping_add(place.wrapping_mul(count_bits))),
        count_bits,
    );
    let low_bits = list_low_bits(index_bits, count);
    let high_bit = bit.wrapping_add(count.wrapping_mul(low_bits.wrapping_add(value_bits)));
    next_coefficient(
        words,
        List {
            stream,
            value_bits,
            low_bits,
            field_bit: bit,
            high_bit,
            high: 0,
            left: count,
            index: LIST_END,
            coefficient: 0,
        },
    )
}

/// A list that is at its end: that of a texel without weight.
pub fn no_list() -> List {
    // 12.5-4: a weight of zero adds zero.
    List {
        stream: 0,
        value_bits: 0,
        low_bits: 0,
        field_bit: 0,
        high_bit: 0,
        high: 0,
        left: 0,
        index: LIST_END,
        coefficient: 0,
    }
}

/// Right shift of the sums of an ABRDF atom (12.2).
#[inline(always)]
pub fn angular_shift(shifts: u32) -> u32 {
    // Bits 0 to 4 (12.2).
    shifts & 31
}

/// Right shift of an ABRDF atom's products with its weight (12.2).
#[inline(always)]
pub fn gain_shift(shifts: u32) -> u32 {
    // Bits 5 to 9 (12.2).
    (shifts >> 5) & 31
}

/// One channel of a light atom at one light: ten bits with their sign (12.1).
#[inline(always)]
pub fn light_entry(entry: u32, channel: u32) -> i32 {
    // 12.1-4: up, then back with its sign.
    ((entry << (22u32.wrapping_sub(channel.wrapping_mul(10)))) as i32) >> 22
}

/// One channel of a light atom between three lights, Q14 (12.5-1).
#[inline(always)]
pub fn blend_light(a: u32, b: u32, c: u32, light: Taps, channel: u32) -> i32 {
    let part_a = light_entry(a, channel).wrapping_mul(light.weight_a_q15);
    let part_b = light_entry(b, channel).wrapping_mul(light.weight_b_q15);
    let part_c = light_entry(c, channel).wrapping_mul(light.weight_c_q15);
    // 12.5-1: the sum is exact, within 2^24; from Q24 to Q14.
    part_a.wrapping_add(part_b).wrapping_add(part_c).wrapping_add(HALF_Q10) >> 10
}

/// Adds one fibre of an ABRDF atom to its sums (12.5-2).
pub fn add_fibre(
    words: Words<'_>,
    material: &Material,
    atom: u32,
    view: u32,
    weight_q15: i32,
    light: Taps,
    sums: Values,
) -> Values {
    let light_start = part(material, LIGHT_ATOMS_PART);
    let row_words = word(words, light_start);
    let row_a = light_start.wrapping_add(2).wrapping_add(light.a.wrapping_mul(row_words));
    let row_b = light_start.wrapping_add(2).wrapping_add(light.b.wrapping_mul(row_words));
    let row_c = light_start.wrapping_add(2).wrapping_add(light.c.wrapping_mul(row_words));
    let fibres_start = part(material, FIBRES_PART);
    let atom_count = word(words, fibres_start);
    let shape = word(words, fibres_start.wrapping_add(1));
    let entries = shape & 0xff;
    let index_bits = (shape >> 8) & 0xff;
    let table = fibres_start.wrapping_add(2).wrapping_add(atom_count);
    let first = view.wrapping_mul(atom_count).wrapping_add(atom).wrapping_mul(entries);
    let mut result = sums;
    let mut n = 0u32;
    while n < entries {
        let at = first.wrapping_add(n);
        let pair = word(words, table.wrapping_add(at >> 1));
        let entry = (pair >> ((at & 1) << 4)) & 0xffff;
        let index = low_part(entry, index_bits);
        // 12.2-6: the value is the entry without its index.
        let value = ((entry.wrapping_sub(index) << 16) as i32) >> 16;
        // 12.5-2: thirteen fraction bits are left, so that the sums are exact.
        let h = value.wrapping_mul(weight_q15).wrapping_add(HALF_Q17) >> 17;
        let a = word(words, row_a.wrapping_add(index));
        let b = word(words, row_b.wrapping_add(index));
        let c = word(words, row_c.wrapping_add(index));
        result.c0 = result.c0.wrapping_add(h.wrapping_mul(blend_light(a, b, c, light, 0)));
        result.c1 = result.c1.wrapping_add(h.wrapping_mul(blend_light(a, b, c, light, 1)));
        result.c2 = result.c2.wrapping_add(h.wrapping_mul(blend_light(a, b, c, light, 2)));
        n = n.wrapping_add(1);
    }
    result
}

/// Three channels of an ABRDF atom between three views and three lights, Q15 (12.5-3).
pub fn angular_q15(
    words: Words<'_>,
    material: &Material,
    atom: u32,
    shift: u32,
    light: Taps,
    view: Taps,
) -> Values {
    let mut sums = Values { c0: 0, c1: 0, c2: 0 };
    // 12.5-2: a view without weight adds zero.
    if view.weight_a_q15 != 0 {
        sums = add_fibre(words, material, atom, view.a, view.weight_a_q15, light, sums);
    }
    if view.weight_b_q15 != 0 {
        sums = add_fibre(words, material, atom, view.b, view.weight_b_q15, light, sums);
    }
    if view.weight_c_q15 != 0 {
        sums = add_fibre(words, material, atom, view.c, view.weight_c_q15, light, sums);
    }
    // 12.5-3: to 16 bits, by the atom's own shift.
    sums.c0 = clamp_magnitude(round_shift(sums.c0, shift), ANGULAR_BOUND);
    sums.c1 = clamp_magnitude(round_shift(sums.c1, shift), ANGULAR_BOUND);
    sums.c2 = clamp_magnitude(round_shift(sums.c2, shift), ANGULAR_BOUND);
    sums
}

/// What a coefficient adds to the weight of its ABRDF atom (12.5-4).
#[inline(always)]
pub fn corner_weight(coefficient: i32, weight_x_q15: i32, weight_y_q15: i32) -> i32 {
    // 12.5-4: the first product is exact, within 2^30; one rounding.
    multiply_q15(coefficient.wrapping_mul(weight_x_q15), weight_y_q15)
}

/// The textures of three channels by one layer, Q20 (12.5).
pub fn layer_q20(
    words: Words<'_>,
    material: &Material,
    layer: u32,
    place: &Place,
    light: Taps,
    view: Taps,
) -> Values {
    let x = place.x;
    let y = place.y;
    let level = place.level;
    let start = lists_start(words, material, level, layer);
    let fibres_start = part(material, FIBRES_PART);
    let atom_count = word(words, fibres_start);
    let width = level_size(material.width, level);
    let row_first = y.first.block.wrapping_mul(width);
    let row_second = y.second.block.wrapping_mul(width);
    // 12.5-4: an axis of one texel has the whole weight there.
    let mut x_first = ONE_Q15;
    let mut x_second = 0i32;
    if x.count == 2 {
        x_first = x.first.weight_a_q15;
        x_second = x.second.weight_a_q15;
    }
    let mut y_first = ONE_Q15;
    let mut y_second = 0i32;
    if y.count == 2 {
        y_first = y.first.weight_a_q15;
        y_second = y.second.weight_a_q15;
    }
    let mut list_a = no_list();
    let mut list_b = no_list();
    let mut list_c = no_list();
    let mut list_d = no_list();
    if x_first != 0 && y_first != 0 {
        list_a = open_list(words, start, atom_count, row_first.wrapping_add(x.first.block));
    }
    if x_second != 0 && y_first != 0 {
        list_b = open_list(words, start, atom_count, row_first.wrapping_add(x.second.block));
    }
    if x_first != 0 && y_second != 0 {
        list_c = open_list(words, start, atom_count, row_second.wrapping_add(x.first.block));
    }
    if x_second != 0 && y_second != 0 {
        list_d = open_list(words, start, atom_count, row_second.wrapping_add(x.second.block));
    }
    let mut total = Values { c0: 0, c1: 0, c2: 0 };
    let mut atom = list_a.index.min(list_b.index).min(list_c.index.min(list_d.index));
    // 12.5-4: the lists ascend, so the least of four heads is next; an atom is evaluated once.
    while atom != LIST_END {
        let mut weight = 0i32;
        if list_a.index == atom {
            weight = weight.wrapping_add(corner_weight(list_a.coefficient, x_first, y_first));
            list_a = next_coefficient(words, list_a);
        }
        if list_b.index == atom {
            weight = weight.wrapping_add(corner_weight(list_b.coefficient, x_second, y_first));
            list_b = next_coefficient(words, list_b);
        }
        if list_c.index == atom {
            weight = weight.wrapping_add(corner_weight(list_c.coefficient, x_first, y_second));
            list_c = next_coefficient(words, list_c);
        }
        if list_d.index == atom {
            weight = weight.wrapping_add(corner_weight(list_d.coefficient, x_second, y_second));
            list_d = next_coefficient(words, list_d);
        }
        let shifts = word(words, fibres_start.wrapping_add(2).wrapping_add(atom));
        let gain = gain_shift(shifts);
        let angular = angular_q15(words, material, atom, angular_shift(shifts), light, view);
        // 12.5-5: each product is rounded by the atom's gain; 12.5-8 bounds their sum.
        total.c0 = total.c0.wrapping_add(round_shift(multiply_q15(weight, angular.c0), gain));
        total.c1 = total.c1.wrapping_add(round_shift(multiply_q15(weight, angular.c1), gain));
        total.c2 = total.c2.wrapping_add(round_shift(multiply_q15(weight, angular.c2), gain));
        atom = list_a.index.min(list_b.index).min(list_c.index.min(list_d.index));
    }
    // 12.5-6: to Q20, clamped so that eight layers stay within 2^30.
    let shift = word(words, start) >> 24;
    total.c0 = clamp_magnitude(round_shift(total.c0, shift), LAYER_BOUND);
    total.c1 = clamp_magnitude(round_shift(total.c1, shift), LAYER_BOUND);
    total.c2 = clamp_magnitude(round_shift(total.c2, shift), LAYER_BOUND);
    total
}

/// The textures of all channels, all layers, Q20 (12.5-7).
// Apart, so that a sample of another method does not pay for this one's stack.
#[inline(never)]
pub fn sparse_tensor_textures_q20(
    words: Words<'_>,
    material: &Material,
    place: &Place,
    light: &Located,
    view: &Located,
) -> Values {
    let mut sums = Values { c0: 0, c1: 0, c2: 0 };
    let mut layer = 0u32;
    // 12.5-7: layers add up; each is rounded by itself.
    while layer < material.layer_limit {
        let addend = layer_q20(words, material, layer, place, light.taps, view.taps);
        sums.c0 = sums.c0.wrapping_add(addend.c0);
        sums.c1 = sums.c1.wrapping_add(addend.c1);
        sums.c2 = sums.c2.wrapping_add(addend.c2);
        layer = layer.wrapping_add(1);
    }
    sums
}
