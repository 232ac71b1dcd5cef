//! Checks of the sparse ensemble's sections (chapter 10).
#![deny(clippy::arithmetic_side_effects)]

use crate::container::directory::find_section;
use crate::container::header::Header;
use crate::error::Rule;
use crate::kernel::material::{Material, level_size};
use crate::kernel::words::{Words, word};
use crate::method::rule::{Call, Method, Per, SectionRule, Source, layer_instance};
use crate::method::sparse_ensemble::cost::record_operations;
use crate::method::sparse_ensemble::{
    ANGULAR_PART, ATOMS_PART, COEFFICIENTS_PART, LOW_BITS_BITS, METHOD_SPARSE_ENSEMBLE, SHIFT_BITS,
    SPATIAL_PART, atom_light, atom_shift, atom_view, atom_x, atom_y,
};
use crate::walk::check::{Check, Section};
use crate::walk::stream::{Ones, window};

/// Angular factors of a channel (10.1).
pub const ANGULAR: u32 = 0x0110;
/// Spatial factors of a channel (10.2).
pub const SPATIAL: u32 = 0x0111;
/// Atoms of a channel (10.5).
pub const ATOMS: u32 = 0x0112;
/// Coefficients of a level, layer and channel (10.3). They are found by counting directory entries from the
/// first of them on (10.3-1), so no other kind may come to stand between them.
pub const COEFFICIENTS: u32 = 0x0113;

/// The sparse ensemble, to the rest of the core.
pub(crate) const METHOD: Method = Method {
    number: METHOD_SPARSE_ENSEMBLE,
    largest_edge: 16,
    means: Call::Required,
    scales: Call::Allowed,
    sections: &[
        SectionRule { kind: ANGULAR, per: Per::Channel, source: Source::Dictionary },
        SectionRule { kind: SPATIAL, per: Per::Channel, source: Source::Either },
        SectionRule { kind: ATOMS, per: Per::Channel, source: Source::Material },
        SectionRule { kind: COEFFICIENTS, per: Per::LayerChannel, source: Source::Material },
    ],
};

/// Most dictionaries of an ensemble (10.1-2).
pub const DICTIONARY_LIMIT: u32 = 256;
/// Most columns of an angular factor (10.1-2).
pub const ANGULAR_COLUMN_LIMIT: u32 = 1024;
/// Most atoms of a dictionary (10.5-4).
pub const ATOM_LIMIT: u32 = 65_536;
/// Largest sum of the shifted magnitudes of a record (10.7-7).
pub const SUM_LIMIT: u32 = 65_535;
/// Most low bits of a position (10.4-7).
pub const LOW_BITS_LIMIT: u32 = 12;

/// Walks chapter 10 of a dictionary.
pub(crate) fn check_dictionary(check: &mut Check<'_, '_>, header: &Header) -> Option<()> {
    for c in 0..3 {
        if let Some(section) = find_section(check, header, ANGULAR, c) {
            let angular =
                check_factors(check, section, header.light_count, header.view_count, ANGULAR_COLUMN_LIMIT)?;
            if let Some(section) = find_section(check, header, SPATIAL, c) {
                let spatial = check_factors(check, section, header.edge, header.edge, header.edge)?;
                check.ensure(
                    spatial.count == angular.count,
                    Rule::SpatialCounts,
                    section.offset,
                    spatial.count,
                );
            }
        }
    }
    Some(())
}

/// Spatial factors that the material does not have must be in the dictionary, and for its edge (3.5-5).
pub(crate) fn dictionary_fits(check: &mut Check<'_, '_>, header: &Header, other: &Header) -> bool {
    let lacks = [0, 1, 2].map(|c| header.is_full(c) && find_section(check, header, SPATIAL, c).is_none());
    let there = check.in_dictionary(|inner| {
        (0u32..).zip(lacks).all(|(c, lacks)| !lacks || find_section(inner, other, SPATIAL, c).is_some())
    });
    there && (!lacks.contains(&true) || other.edge == header.edge)
}

/// Walks chapter 10 of a material, but for its statement of cost; gives the largest operations of a level's
/// textures.
pub(crate) fn check_material(
    check: &mut Check<'_, '_>,
    header: &Header,
    external: Option<&Header>,
    material: &mut Material,
) -> Option<u64> {
    let mut atoms = [None::<Section>; 3];
    let mut spatial_of = [None::<Factors>; 3];
    let mut angular_of = [None::<Factors>; 3];
    for (c, slot) in (0u32..).zip(angular_of.iter_mut()).filter(|(c, _)| header.is_full(*c)) {
        *slot = Some(match external {
            Some(other) => factors_in_dictionary(check, other, ANGULAR, c)?,
            None => {
                let section = find_section(check, header, ANGULAR, c)?;
                check_factors(check, section, header.light_count, header.view_count, ANGULAR_COLUMN_LIMIT)?
            }
        });
    }
    for (c, slot) in (0u32..).zip(spatial_of.iter_mut()).filter(|(c, _)| header.is_full(*c)) {
        *slot = Some(match (find_section(check, header, SPATIAL, c), external) {
            (Some(section), _) => check_factors(check, section, header.edge, header.edge, header.edge)?,
            (None, Some(other)) => factors_in_dictionary(check, other, SPATIAL, c)?,
            (None, None) => return None,
        });
    }
    for (c, ((angular, spatial), slot)) in
        (0u32..).zip(angular_of.iter().zip(&spatial_of).zip(atoms.iter_mut()))
    {
        let (Some(angular), Some(spatial)) = (*angular, *spatial) else { continue };
        let section = find_section(check, header, ATOMS, c)?;
        let spatial_at = find_section(check, header, SPATIAL, c).unwrap_or(section).offset;
        if !check.ensure(spatial.count == angular.count, Rule::SpatialCounts, spatial_at, spatial.count) {
            return None;
        }
        if !check_atoms(check, section, angular, spatial) {
            return None;
        }
        *slot = Some(section);
        let starts = [angular.start, spatial.start, check.section_start(section)];
        for (first, start) in [ANGULAR_PART, SPATIAL_PART, ATOMS_PART].into_iter().zip(starts) {
            material.set_part(first.wrapping_add(c), start);
        }
    }
    let first = find_in_coefficients(check, header);
    material.set_part(COEFFICIENTS_PART, first.map_or(0, |section| section.entry >> 2));
    let mut records = 0;
    let mut sound = true;
    for level in 0..header.level_count {
        let mut at_level = 0u64;
        for layer in 0..header.layer_count {
            for (c, atoms) in (0u32..).zip(atoms) {
                let Some(atoms) = atoms else { continue };
                let section = find_section(check, header, COEFFICIENTS, layer_instance(level, layer, c))?;
                match check_coefficients(check, section, header, level, atoms) {
                    Some(largest) => {
                        at_level = at_level.wrapping_add(record_operations(largest, header.edge))
                    }
                    None => sound = false,
                }
                if check.stopped {
                    return None;
                }
            }
        }
        records = records.max(at_level);
    }
    sound.then_some(records.wrapping_mul(4))
}

/// Factors of the external dictionary, which was checked with its own file.
fn factors_in_dictionary(
    check: &mut Check<'_, '_>,
    other: &Header,
    kind: u32,
    channel: u32,
) -> Option<Factors> {
    check.in_dictionary(|inner| {
        let start = inner.section_start(find_section(inner, other, kind, channel)?);
        Some(Factors { start, count: word(inner.words, start) })
    })
}

/// The first section of coefficients.
fn find_in_coefficients(check: &Check<'_, '_>, header: &Header) -> Option<Section> {
    let c = (0..3).find(|&c| header.is_full(c))?;
    find_section(check, header, COEFFICIENTS, c)
}

/// A section of factors that was checked, in either file.
#[derive(Clone, Copy)]
pub(crate) struct Factors {
    /// Its first word, as the kernel counts.
    pub start: u32,
    /// Dictionaries.
    pub count: u32,
}

/// Columns of the two tables of dictionary `k` of a section of factors.
pub(crate) fn columns(words: Words<'_>, start: u32, k: u32) -> (u32, u32) {
    let at = start.wrapping_add(2).wrapping_add(k.wrapping_mul(4));
    (word(words, at), word(words, at.wrapping_add(1)))
}

/// Walks 10.1 for the angular factors (`first_rows` lights, `second_rows` views) or 10.2 for the spatial.
pub(crate) fn check_factors(
    check: &mut Check<'_, '_>,
    section: Section,
    first_rows: u32,
    second_rows: u32,
    limit: u32,
) -> Option<Factors> {
    let offset = section.offset;
    if !check.ensure(section.length >= 8, Rule::FactorLength, offset, section.length) {
        return None;
    }
    let count = check.word_at(offset);
    let reserved = check.word_at(offset.wrapping_add(4));
    let counted = (1..=DICTIONARY_LIMIT).contains(&count)
        && section.length >= count.min(DICTIONARY_LIMIT).wrapping_mul(16).wrapping_add(8);
    if !check.ensure(counted, Rule::FactorCounts, offset, count) {
        return None;
    }
    check.ensure(reserved == 0, Rule::FactorCounts, offset.wrapping_add(4), reserved);
    let factors = Factors { start: check.section_start(section), count };
    let mut end = (count as u64).wrapping_mul(16).wrapping_add(8);
    for k in 0..count {
        let at = offset.wrapping_add(8).wrapping_add(k.wrapping_mul(16));
        let (first, second) = columns(check.words, factors.start, k);
        for (n, found) in [(0, first), (4, second)] {
            if !check.ensure((1..=limit).contains(&found), Rule::FactorCounts, at.wrapping_add(n), found) {
                return None;
            }
        }
        for (n, rows, columns) in [(8, first_rows, first), (12, second_rows, second)] {
            let stated = check.word_at(at.wrapping_add(n));
            if !check.ensure(
                (stated as u64).wrapping_mul(4) == end,
                Rule::FactorOffset,
                at.wrapping_add(n),
                stated,
            ) {
                return None;
            }
            end = end.wrapping_add((rows as u64).wrapping_mul(columns.div_ceil(2) as u64).wrapping_mul(4));
        }
    }
    if !check.ensure(section.length as u64 == end, Rule::FactorLength, offset, section.length) {
        return None;
    }
    for k in 0..count {
        let (first, second) = columns(check.words, factors.start, k);
        for (n, rows, columns) in [(8, first_rows, first), (12, second_rows, second)] {
            let table =
                check.word_at(offset.wrapping_add(8).wrapping_add(k.wrapping_mul(16)).wrapping_add(n));
            check.packed_rows(Rule::FactorEntry, offset.wrapping_add(table.wrapping_mul(4)), rows, columns);
            if check.stopped {
                return None;
            }
        }
    }
    Some(factors)
}

/// Walks 10.5. `false` if the records cannot be held against it.
pub(crate) fn check_atoms(
    check: &mut Check<'_, '_>,
    section: Section,
    angular: Factors,
    spatial: Factors,
) -> bool {
    let count = angular.count;
    let offset = section.offset;
    let head = count.wrapping_mul(8).wrapping_add(8);
    if !check.ensure(section.length >= head, Rule::AtomsLength, offset, section.length) {
        return false;
    }
    let stated = check.word_at(offset);
    let reserved = check.word_at(offset.wrapping_add(4));
    let mut sound = check.ensure(stated == count, Rule::AtomsCounts, offset, stated);
    check.ensure(reserved == 0, Rule::AtomsCounts, offset.wrapping_add(4), reserved);
    let mut end = head as u64;
    for k in 0..count {
        let at = offset.wrapping_add(8).wrapping_add(k.wrapping_mul(8));
        let (atoms, start) = (check.word_at(at), check.word_at(at.wrapping_add(4)));
        let holds = atoms <= ATOM_LIMIT && (start as u64).wrapping_mul(4) == end;
        sound &= check.ensure(holds, Rule::AtomsCounts, at, atoms);
        end = end.wrapping_add((atoms.min(ATOM_LIMIT) as u64).wrapping_mul(8));
    }
    sound &= check.ensure(section.length as u64 == end, Rule::AtomsLength, offset, section.length);
    if !sound {
        return false;
    }
    for k in 0..count {
        let (lights, views) = columns(check.words, angular.start, k);
        let (xs, ys) = columns(check.words, spatial.start, k);
        let (atoms, start) = (
            check.word_at(offset.wrapping_add(8).wrapping_add(k.wrapping_mul(8))),
            check.word_at(offset.wrapping_add(12).wrapping_add(k.wrapping_mul(8))),
        );
        let mut before = None;
        for i in 0..atoms {
            let at = offset.wrapping_add(start.wrapping_mul(4)).wrapping_add(i.wrapping_mul(8));
            let (atom, quantiser) = (check.word_at(at), check.word_at(at.wrapping_add(4)));
            let named = atom_view(atom) < views
                && atom_light(atom) < lights
                && atom_x(atom) < xs
                && atom_y(atom) < ys;
            sound &= check.ensure(named, Rule::AtomColumn, at, atom);
            sound &= check.ensure(before.is_none_or(|before| before < atom >> 4), Rule::AtomOrder, at, atom);
            before = Some(atom >> 4);
            let base = ((quantiser << 16) as i32) >> 16;
            let holds = base != -32768 && base.wrapping_add((quantiser >> 16) as i32) <= 32_767;
            sound &= check.ensure(holds, Rule::AtomQuantiser, at.wrapping_add(4), quantiser);
            if check.stopped {
                return false;
            }
        }
    }
    sound
}

/// What the records of a section are read by.
struct Stream<'a> {
    bytes: &'a [u8],
    bits: u32,
    value_bits: u32,
    dictionary_bits: u32,
    count_bits: u32,
}

/// Walks 10.3, 10.4 and 10.7-7; gives the largest count of a record.
pub(crate) fn check_coefficients(
    check: &mut Check<'_, '_>,
    section: Section,
    header: &Header,
    level: u32,
    atoms: Section,
) -> Option<u32> {
    let offset = section.offset;
    if !check.ensure(section.length >= 16, Rule::CoefficientsLength, offset, section.length) {
        return None;
    }
    let widths = check.word_at(offset);
    let (value_bits, dictionary_bits, count_bits) = (widths & 0xff, (widths >> 8) & 0xff, widths >> 16);
    let widths_good =
        (1..=16).contains(&value_bits) && dictionary_bits <= 8 && (1..=15).contains(&count_bits);
    if !check.ensure(widths_good, Rule::CoefficientsHeader, offset, widths) {
        return None;
    }
    let along = |size: u32| level_size(size, level).div_ceil(header.edge.max(1));
    let blocks = along(header.width).wrapping_mul(along(header.height));
    let stated = check.word_at(offset.wrapping_add(4));
    if !check.ensure(stated == blocks, Rule::CoefficientsHeader, offset.wrapping_add(4), stated) {
        return None;
    }
    let bits = check.word_at(offset.wrapping_add(8));
    let expected = (blocks as u64)
        .wrapping_mul(4)
        .wrapping_add(16)
        .wrapping_add((bits.div_ceil(32) as u64).wrapping_mul(4));
    if !check.ensure(section.length as u64 == expected, Rule::CoefficientsLength, offset, section.length) {
        return None;
    }
    let stream_offset = offset.wrapping_add(16).wrapping_add(blocks.wrapping_mul(4));
    let bytes =
        check.bytes.get(stream_offset as usize..offset.wrapping_add(section.length) as usize).unwrap_or(&[]);
    let table = check.bytes.get(offset.wrapping_add(16) as usize..stream_offset as usize).unwrap_or(&[]);
    let stream = Stream { bytes, bits, value_bits, dictionary_bits, count_bits };
    let mut end = 0u32;
    let mut largest = 0;
    for (block, entry) in (0u32..).zip(table.as_chunks::<4>().0) {
        let bit = u32::from_le_bytes(*entry);
        let at = offset.wrapping_add(16).wrapping_add(block.wrapping_mul(4));
        if !check.ensure(bit == end, Rule::RecordPlace, at, bit) {
            return None;
        }
        let (next, count) = check_record(check, &stream, bit, stream_offset, atoms)?;
        end = next;
        largest = largest.max(count);
    }
    if !check.ensure(end == bits, Rule::RecordPlace, offset.wrapping_add(8), bits) {
        return None;
    }
    // Fewer than 32 bits are left, all in the last word.
    let rest = if bits % 32 == 0 { 0 } else { window(bytes, bits) as u32 & (u32::MAX >> (bits % 32)) };
    check.ensure(rest == 0, Rule::StreamEnd, offset.wrapping_add(section.length).wrapping_sub(4), rest);
    let stated = check.word_at(offset.wrapping_add(12));
    check.ensure(stated == largest, Rule::LargestCount, offset.wrapping_add(12), stated);
    Some(largest)
}

/// One record: its end and count, or nothing if what follows cannot be found.
#[inline]
fn check_record(
    check: &mut Check<'_, '_>,
    stream: &Stream<'_>,
    bit: u32,
    stream_offset: u32,
    atoms: Section,
) -> Option<(u32, u32)> {
    let at = stream_offset.wrapping_add((bit >> 5).wrapping_mul(4));
    let head = window(stream.bytes, bit);
    let mask = |bits: u32| (1u64 << bits).wrapping_sub(1);
    let count = (head & mask(stream.count_bits)) as u32;
    let dictionary = (head >> stream.count_bits & mask(stream.dictionary_bits)) as u32;
    let after = stream.count_bits.wrapping_add(stream.dictionary_bits);
    let shift = (head >> after & mask(SHIFT_BITS)) as u32;
    let low_bits = (head >> after.wrapping_add(SHIFT_BITS) & mask(LOW_BITS_BITS)) as u32;
    let header_bits = after.wrapping_add(SHIFT_BITS).wrapping_add(LOW_BITS_BITS);
    let field_bits = low_bits.wrapping_add(stream.value_bits);
    let fields = (bit as u64).wrapping_add(header_bits as u64);
    let highs = fields.wrapping_add((count as u64).wrapping_mul(field_bits as u64));
    if !check.ensure(highs.wrapping_add(count as u64) <= stream.bits as u64, Rule::RecordPlace, at, bit) {
        return None;
    }
    if count == 0 {
        check.ensure(dictionary | shift | low_bits == 0, Rule::RecordHeader, at, head as u32);
        return Some((fields as u32, 0));
    }
    let dictionaries = check.word_at(atoms.offset);
    let good = dictionary < dictionaries && low_bits <= LOW_BITS_LIMIT;
    if !check.ensure(good, Rule::RecordHeader, at, head as u32) {
        return None;
    }
    let entry = atoms.offset.wrapping_add(8).wrapping_add(dictionary.wrapping_mul(8));
    let (atom_count, atom_start) = (check.word_at(entry), check.word_at(entry.wrapping_add(4)));
    let list =
        check.bytes.get(atoms.offset.wrapping_add(atom_start.wrapping_mul(4)) as usize..).unwrap_or(&[]);
    let list = list.as_chunks::<8>().0;
    let list = list.get(..atom_count as usize).unwrap_or(&[]);

    let layout = Layout {
        value_bits: stream.value_bits,
        low_bits,
        count,
        fields: fields as u32,
        highs: highs as u32,
        end: stream.bits,
    };
    let scan = scan_record(stream.bytes, list, layout);
    if let Some(position) = scan.beyond {
        check.find(Rule::RecordPositions, at, position);
        return None;
    }
    if !check.ensure(scan.count == count, Rule::RecordPlace, at, bit)
        || !check.ensure(scan.ascends, Rule::RecordPositions, at, bit)
    {
        return None;
    }
    let (sum, end) = (scan.sum, scan.end);
    // Zeros cost time and no multiplication, so their number is bounded by that of the coefficients.
    let zeros = end.wrapping_sub(highs as u32).wrapping_sub(count);
    if !check.ensure(zeros <= count.wrapping_mul(32).wrapping_add(32), Rule::RecordZeros, at, zeros) {
        return None;
    }
    check.ensure(sum <= SUM_LIMIT, Rule::RecordSum, at, sum);
    if check.stopped { None } else { Some((end, count)) }
}

/// Where the parts of a record are.
#[derive(Clone, Copy)]
struct Layout {
    value_bits: u32,
    low_bits: u32,
    count: u32,
    fields: u32,
    highs: u32,
    end: u32,
}

/// What a record was found to hold.
struct Scan {
    /// Coefficients before the stream ended.
    count: u32,
    /// The bit after the last.
    end: u32,
    /// Sum of the shifted magnitudes.
    sum: u32,
    /// Positions ascend.
    ascends: bool,
    /// A position that no atom has.
    beyond: Option<u32>,
}

/// The hot loop of `open`: apart from everything else, so that it runs in registers.
#[inline(never)]
fn scan_record(bytes: &[u8], list: &[[u8; 8]], layout: Layout) -> Scan {
    let Layout { value_bits, low_bits, count, fields, highs, end } = layout;
    let low_mask = (1u32 << low_bits).wrapping_sub(1);
    let value_mask = (1u32 << value_bits).wrapping_sub(1);
    let half = (1u32 << value_bits) >> 1;
    let mut field_bit = fields;
    let mut ones = Ones::new(bytes, highs, end);
    // Locals, not fields of the result, so that they stay in registers.
    let (mut count_so_far, mut last, mut sum, mut order, mut beyond) = (0u32, highs, 0i32, 0i64, None);
    let mut next = 0i64;
    while count_so_far < count {
        let Some(place) = ones.take() else { break };
        last = place.wrapping_add(1);
        let high = place.wrapping_sub(highs).wrapping_sub(count_so_far);
        let field = window(bytes, field_bit) as u32;
        field_bit = field_bit.wrapping_add(low_bits.wrapping_add(value_bits));
        // 64 bits: a high part beyond all atoms must not wrap back to one.
        let position = (high as u64) << low_bits | (field & low_mask) as u64;
        let Some(&[a, _, _, _, b0, b1, s0, s1]) = usize::try_from(position).ok().and_then(|at| list.get(at))
        else {
            beyond = Some(position as u32);
            break;
        };
        // Negative if a position does not ascend; looked at once, at the end.
        order |= (position as i64).wrapping_sub(next);
        next = (position as i64).wrapping_add(1);
        let step = u16::from_le_bytes([s0, s1]) as u32;
        let value = (field >> low_bits) & value_mask;
        let coefficient = (i16::from_le_bytes([b0, b1]) as i32)
            .wrapping_add((value.wrapping_mul(step).wrapping_add(half) >> value_bits) as i32);
        // The floor of the negative magnitude is the ceiling of the magnitude, negated.
        let negative = coefficient.min(coefficient.wrapping_neg());
        sum = sum.wrapping_sub(negative >> atom_shift(a as u32));
        count_so_far = count_so_far.wrapping_add(1);
    }
    Scan { count: count_so_far, end: last, sum: sum as u32, ascends: order >= 0, beyond }
}
