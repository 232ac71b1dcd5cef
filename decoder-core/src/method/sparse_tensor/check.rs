//! Checks of the sparse tensor's sections (chapter 12).
#![deny(clippy::arithmetic_side_effects)]

use crate::container::directory::find_section;
use crate::container::header::Header;
use crate::error::Rule;
use crate::kernel::material::{Material, level_size};
use crate::kernel::words::{low_part, word};
use crate::method::rule::{Call, Method, Per, SectionRule, Source, layer_instance};
use crate::method::sparse_tensor::cost::layer_operations;
use crate::method::sparse_tensor::{
    FIBRES_PART, GROUP_TEXELS, LIGHT_ATOMS_PART, LISTS_PART, METHOD_SPARSE_TENSOR, bit_length, gain_shift,
    list_bits, list_coefficient, list_low_bits,
};
use crate::walk::check::{Check, Section};
use crate::walk::stream::{Ones, window};

/// Light atoms (12.1).
pub const LIGHT_ATOMS: u32 = 0x0210;
/// Fibres (12.2).
pub const FIBRES: u32 = 0x0211;
/// Lists of the texels of a level and layer (12.3). They are found by counting directory entries from the first
/// of them on (12.3-1), so no other kind may come to stand between them.
pub const LISTS: u32 = 0x0212;

/// The sparse tensor, to the rest of the core. It has no blocks: each texel is one.
pub(crate) const METHOD: Method = Method {
    number: METHOD_SPARSE_TENSOR,
    largest_edge: 1,
    means: Call::Required,
    scales: Call::Allowed,
    sections: &[
        SectionRule { kind: LIGHT_ATOMS, per: Per::File, source: Source::Dictionary },
        SectionRule { kind: FIBRES, per: Per::File, source: Source::Dictionary },
        SectionRule { kind: LISTS, per: Per::Layer, source: Source::Material },
    ],
};

/// Most light atoms (12.1-2).
pub const LIGHT_ATOM_LIMIT: u32 = 256;
/// Most ABRDF atoms (12.2-2).
pub const ATOM_LIMIT: u32 = 1024;
/// Most entries of a fibre (12.2-2).
pub const FIBRE_LIMIT: u32 = 32;
/// Largest sum of the magnitudes of a fibre, Q15: eight (12.2-5).
pub const FIBRE_SUM_LIMIT: u32 = 1 << 18;
/// Most bits of a value (12.3-3).
pub const VALUE_BITS_LIMIT: u32 = 15;
/// Most bits of a count (12.3-3).
pub const COUNT_BITS_LIMIT: u32 = 6;
/// Largest sum of the shifted magnitudes of a list (12.5-8).
pub const LIST_SUM_LIMIT: u32 = 65_534;

/// What the lists are held against.
#[derive(Clone, Copy)]
struct Atoms {
    /// First word of the light atoms, as the kernel counts.
    light_start: u32,
    /// First word of the fibres.
    fibres_start: u32,
    /// ABRDF atoms.
    count: u32,
    /// Entries of a fibre.
    entries: u32,
}

/// Walks chapter 12 of a dictionary.
pub(crate) fn check_dictionary(check: &mut Check<'_, '_>, header: &Header) -> Option<()> {
    if header.has_texture() {
        check_atoms(check, header)?;
    }
    Some(())
}

/// Atoms are wholly in one file or the other, so nothing is left to fit (3.5-5).
pub(crate) fn dictionary_fits(_: &mut Check<'_, '_>, _: &Header, _: &Header) -> bool {
    true
}

/// Walks chapter 12 of a material, but for its statement of cost; gives the largest operations of a level's
/// textures.
pub(crate) fn check_material(
    check: &mut Check<'_, '_>,
    header: &Header,
    external: Option<&Header>,
    material: &mut Material,
) -> Option<u64> {
    if !header.has_texture() {
        return Some(0);
    }
    let atoms = match external {
        Some(other) => check.in_dictionary(|inner| atoms_of(inner, other))?,
        None => check_atoms(check, header)?,
    };
    material.set_part(LIGHT_ATOMS_PART, atoms.light_start);
    material.set_part(FIBRES_PART, atoms.fibres_start);
    material.set_part(LISTS_PART, find_section(check, header, LISTS, 0)?.entry >> 2);
    let mut most = 0;
    let mut sound = true;
    for level in 0..header.level_count {
        let mut at_level = 0u64;
        for layer in 0..header.layer_count {
            let section = find_section(check, header, LISTS, layer_instance(level, layer, 0))?;
            match check_lists(check, section, header, level, atoms) {
                Some(largest) => {
                    at_level = at_level.wrapping_add(layer_operations(largest, atoms.count, atoms.entries))
                }
                None => sound = false,
            }
            if check.stopped {
                return None;
            }
        }
        most = most.max(at_level);
    }
    sound.then_some(most)
}

/// The atoms of a file that was checked.
fn atoms_of(check: &Check<'_, '_>, header: &Header) -> Option<Atoms> {
    let light = find_section(check, header, LIGHT_ATOMS, 0)?;
    let fibres = find_section(check, header, FIBRES, 0)?;
    let entries = check.word_at(fibres.offset.wrapping_add(4)) & 0xff;
    Some(Atoms {
        light_start: check.section_start(light),
        fibres_start: check.section_start(fibres),
        count: check.word_at(fibres.offset),
        entries,
    })
}

/// Walks 12.1 and 12.2.
fn check_atoms(check: &mut Check<'_, '_>, header: &Header) -> Option<Atoms> {
    let light_atoms = check_light_atoms(check, header)?;
    check_fibres(check, header, light_atoms)?;
    atoms_of(check, header)
}

/// Walks 12.1; gives the number of light atoms.
fn check_light_atoms(check: &mut Check<'_, '_>, header: &Header) -> Option<u32> {
    let section = find_section(check, header, LIGHT_ATOMS, 0)?;
    let offset = section.offset;
    if !check.ensure(section.length >= 8, Rule::LightAtomsLength, offset, section.length) {
        return None;
    }
    let (count, reserved) = (check.word_at(offset), check.word_at(offset.wrapping_add(4)));
    let counted =
        check.ensure((1..=LIGHT_ATOM_LIMIT).contains(&count), Rule::LightAtomsCounts, offset, count);
    check.ensure(reserved == 0, Rule::LightAtomsCounts, offset.wrapping_add(4), reserved);
    // At most 8 + 4 * 1024 * 256 bytes.
    if !counted
        || !check.ensure(
            section.length == header.light_count.wrapping_mul(4).wrapping_mul(count).wrapping_add(8),
            Rule::LightAtomsLength,
            offset,
            section.length,
        )
    {
        return None;
    }
    let mut unused = 0xc000_0000u32;
    for c in (0..3).filter(|&c| !header.is_full(c)) {
        unused |= 0x3ff << c.wrapping_mul(10);
    }
    let rows = check.section_bytes(section).get(8..).unwrap_or(&[]);
    for (n, entry) in (0u32..).zip(rows.as_chunks::<4>().0) {
        let entry = u32::from_le_bytes(*entry);
        check.ensure(
            entry & unused == 0,
            Rule::LightAtomsEntry,
            offset.wrapping_add(8).wrapping_add(n.wrapping_mul(4)),
            entry,
        );
        if check.stopped {
            return None;
        }
    }
    Some(count)
}

/// Walks 12.2.
fn check_fibres(check: &mut Check<'_, '_>, header: &Header, light_atoms: u32) -> Option<()> {
    let section = find_section(check, header, FIBRES, 0)?;
    let offset = section.offset;
    if !check.ensure(section.length >= 8, Rule::FibresLength, offset, section.length) {
        return None;
    }
    let (count, shape) = (check.word_at(offset), check.word_at(offset.wrapping_add(4)));
    let (entries, index_bits) = (shape & 0xff, shape >> 8);
    let counted = check.ensure((1..=ATOM_LIMIT).contains(&count), Rule::FibresShape, offset, count);
    let shaped =
        (1..=FIBRE_LIMIT).contains(&entries) && index_bits == bit_length(light_atoms.wrapping_sub(1));
    if !check.ensure(shaped, Rule::FibresShape, offset.wrapping_add(4), shape) || !counted {
        return None;
    }
    // At most 2^25 entries.
    let total = header.view_count.wrapping_mul(count).wrapping_mul(entries);
    let expected = (count as u64)
        .wrapping_mul(4)
        .wrapping_add(8)
        .wrapping_add((total.div_ceil(2) as u64).wrapping_mul(4));
    if !check.ensure(section.length as u64 == expected, Rule::FibresLength, offset, section.length) {
        return None;
    }
    for n in 0..count {
        let at = offset.wrapping_add(8).wrapping_add(n.wrapping_mul(4));
        let shifts = check.word_at(at);
        check.ensure(shifts >> 10 == 0, Rule::FibresShifts, at, shifts);
        if check.stopped {
            return None;
        }
    }
    let table = offset.wrapping_add(8).wrapping_add(count.wrapping_mul(4));
    let bytes = check.bytes.get(table as usize..offset.wrapping_add(section.length) as usize).unwrap_or(&[]);
    let mut halves = bytes.as_chunks::<2>().0.iter();
    let index_mask = (1u16 << index_bits).wrapping_sub(1);
    for fibre in 0..header.view_count.wrapping_mul(count) {
        let mut sum = 0u32;
        for n in 0..entries {
            let Some(half) = halves.next() else { break };
            let entry = u16::from_le_bytes(*half);
            let index = entry & index_mask;
            check.ensure(
                (index as u32) < light_atoms,
                Rule::FibreIndex,
                table.wrapping_add(fibre.wrapping_mul(entries).wrapping_add(n).wrapping_mul(2)),
                entry as u32,
            );
            sum = sum.wrapping_add((entry.wrapping_sub(index) as i16).unsigned_abs() as u32);
        }
        check.ensure(
            sum <= FIBRE_SUM_LIMIT,
            Rule::FibreSum,
            table.wrapping_add(fibre.wrapping_mul(entries).wrapping_mul(2)),
            sum,
        );
        if check.stopped {
            return None;
        }
    }
    if let Some(half) = halves.next() {
        let unused = u16::from_le_bytes(*half) as u32;
        check.ensure(unused == 0, Rule::FibreIndex, table.wrapping_add(total.wrapping_mul(2)), unused);
    }
    if check.stopped { None } else { Some(()) }
}

/// What the lists of a section are read by.
struct Stream<'a> {
    bytes: &'a [u8],
    offset: u32,
    bits: u32,
    value_bits: u32,
    count_bits: u32,
    index_bits: u32,
}

/// Walks 12.3, 12.4 and 12.5-8; gives the largest count of a list.
fn check_lists(
    check: &mut Check<'_, '_>,
    section: Section,
    header: &Header,
    level: u32,
    atoms: Atoms,
) -> Option<u32> {
    let offset = section.offset;
    if !check.ensure(section.length >= 16, Rule::ListsLength, offset, section.length) {
        return None;
    }
    let head = check.word_at(offset);
    let (value_bits, count_bits, index_bits, shift) =
        (head & 0xff, (head >> 8) & 0xff, (head >> 16) & 0xff, head >> 24);
    let in_range = (1..=VALUE_BITS_LIMIT).contains(&value_bits)
        && (1..=COUNT_BITS_LIMIT).contains(&count_bits)
        && shift <= 31;
    if !check.ensure(
        in_range && index_bits == bit_length(atoms.count.wrapping_sub(1)),
        Rule::ListsHeader,
        offset,
        head,
    ) {
        return None;
    }
    let texels = level_size(header.width, level).wrapping_mul(level_size(header.height, level));
    let stated = check.word_at(offset.wrapping_add(4));
    if !check.ensure(stated == texels, Rule::ListsHeader, offset.wrapping_add(4), stated) {
        return None;
    }
    let groups = texels.div_ceil(GROUP_TEXELS);
    let bits = check.word_at(offset.wrapping_add(8));
    let expected = (groups as u64)
        .wrapping_mul(4)
        .wrapping_add(16)
        .wrapping_add((bits.div_ceil(32) as u64).wrapping_mul(4));
    if !check.ensure(section.length as u64 == expected, Rule::ListsLength, offset, section.length) {
        return None;
    }
    let stream_offset = offset.wrapping_add(16).wrapping_add(groups.wrapping_mul(4));
    let bytes =
        check.bytes.get(stream_offset as usize..offset.wrapping_add(section.length) as usize).unwrap_or(&[]);
    let table = check.bytes.get(offset.wrapping_add(16) as usize..stream_offset as usize).unwrap_or(&[]);
    let stream = Stream { bytes, offset: stream_offset, bits, value_bits, count_bits, index_bits };
    let (mut end, mut largest) = (0u32, 0);
    for (group, entry) in (0u32..).zip(table.as_chunks::<4>().0) {
        let stated = u32::from_le_bytes(*entry);
        if !check.ensure(
            stated == end,
            Rule::ListPlace,
            offset.wrapping_add(16).wrapping_add(group.wrapping_mul(4)),
            stated,
        ) {
            return None;
        }
        let left = texels.wrapping_sub(group.wrapping_mul(GROUP_TEXELS));
        (end, largest) = check_group(check, &stream, stated, left, atoms, largest)?;
    }
    if !check.ensure(end == bits, Rule::ListPlace, offset.wrapping_add(8), bits) {
        return None;
    }
    // Fewer than 32 bits are left, all in the last word.
    let rest = if bits % 32 == 0 { 0 } else { window(bytes, bits) as u32 & (u32::MAX >> (bits % 32)) };
    check.ensure(rest == 0, Rule::ListsEnd, offset.wrapping_add(section.length).wrapping_sub(4), rest);
    let stated = check.word_at(offset.wrapping_add(12));
    check.ensure(stated == largest, Rule::ListsLargest, offset.wrapping_add(12), stated);
    Some(largest)
}

/// The lists of a group, of whose texels `left` or more are in the image: its end and the largest count so
/// far.
fn check_group(
    check: &mut Check<'_, '_>,
    stream: &Stream<'_>,
    first: u32,
    left: u32,
    atoms: Atoms,
    mut largest: u32,
) -> Option<(u32, u32)> {
    let place = |bit: u32| stream.offset.wrapping_add((bit >> 5).wrapping_mul(4));
    let heads = stream.count_bits.wrapping_mul(GROUP_TEXELS);
    if !check.ensure(
        (first as u64).wrapping_add(heads as u64) <= stream.bits as u64,
        Rule::ListPlace,
        place(first),
        first,
    ) {
        return None;
    }
    let counts = window(stream.bytes, first);
    let mut bit = first.wrapping_add(heads);
    for n in 0..GROUP_TEXELS {
        let count = (counts >> n.wrapping_mul(stream.count_bits)) as u32
            & (1u32 << stream.count_bits).wrapping_sub(1);
        if !check.ensure(count == 0 || n < left, Rule::ListOutside, place(first), count) {
            return None;
        }
        let length = list_bits(stream.index_bits, stream.value_bits, atoms.count, count);
        if !check.ensure(
            (bit as u64).wrapping_add(length as u64) <= stream.bits as u64,
            Rule::ListPlace,
            place(bit),
            bit,
        ) {
            return None;
        }
        if count > 0 {
            check_list(check, stream, bit, count, length, atoms);
        }
        if check.stopped {
            return None;
        }
        bit = bit.wrapping_add(length);
        largest = largest.max(count);
    }
    Some((bit, largest))
}

/// One list: its indices, and the bound of its sum.
fn check_list(
    check: &mut Check<'_, '_>,
    stream: &Stream<'_>,
    bit: u32,
    count: u32,
    length: u32,
    atoms: Atoms,
) {
    let at = stream.offset.wrapping_add((bit >> 5).wrapping_mul(4));
    let low_bits = list_low_bits(stream.index_bits, count);
    let field_bits = low_bits.wrapping_add(stream.value_bits);
    let highs = bit.wrapping_add(count.wrapping_mul(field_bits));
    let mut ones = Ones::new(stream.bytes, highs, bit.wrapping_add(length));
    let (mut seen, mut next, mut sum, mut sound) = (0u32, 0u32, 0u32, true);
    while let Some(place) = ones.take() {
        if seen < count {
            let field = window(stream.bytes, bit.wrapping_add(seen.wrapping_mul(field_bits))) as u32;
            let index = place.wrapping_sub(highs).wrapping_sub(seen) << low_bits | low_part(field, low_bits);
            sound &= index >= next && index < atoms.count;
            next = index.wrapping_add(1);
            let coefficient =
                list_coefficient(low_part(field >> low_bits, stream.value_bits), stream.value_bits);
            let shifts = word(
                check.words,
                atoms.fibres_start.wrapping_add(2).wrapping_add(index.min(atoms.count.wrapping_sub(1))),
            );
            sum = sum.wrapping_add(coefficient.unsigned_abs().div_ceil(1 << gain_shift(shifts)));
        }
        seen = seen.wrapping_add(1);
    }
    if check.ensure(sound && seen == count, Rule::ListIndices, at, bit) {
        check.ensure(sum <= LIST_SUM_LIMIT, Rule::ListSum, at, sum);
    }
}
