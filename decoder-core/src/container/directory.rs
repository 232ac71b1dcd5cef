//! The directory and the sections that a header calls for (chapters 3.2 and 3.3).

use crate::container::header::{CONTENT_DICTIONARY, ENTRY_LENGTH, HEADER_LENGTH, Header};
use crate::error::{Part, Rule};
use crate::kernel::material::{CHANNEL_FULL, CHANNEL_MEAN, CHANNEL_MISSING};
use crate::method::{Call, METHODS, Per, layer_instance, method_of};
use crate::walk::check::{Check, Section};
use crate::walk::crc32::crc32;

/// Texts, units and frames for people and renderers (3.4).
pub const METADATA: u32 = 0x0001;
/// The digest of an external dictionary (3.5).
pub const EXTERNAL: u32 = 0x0002;
/// Sample directions and their triangulation: instance 0 light, 1 view (5.3).
pub const DIRECTIONS: u32 = 0x0003;
/// Means of a channel for pairs of directions (8.1).
pub const MEANS: u32 = 0x0004;
/// Scales of a channel for pairs of directions (8.2).
pub const SCALES: u32 = 0x0005;
/// Kinds from here on may be skipped by a reader that does not know them.
pub const OPTIONAL: u32 = 0x8000;

/// The entry `index` of a directory.
pub(crate) fn read_entry(word_at: impl Fn(u32) -> u32, index: u32) -> Section {
    let entry = HEADER_LENGTH.wrapping_add(index.wrapping_mul(ENTRY_LENGTH));
    let head = word_at(entry);
    Section {
        kind: head & 0xffff,
        instance: head >> 16,
        offset: word_at(entry.wrapping_add(4)),
        length: word_at(entry.wrapping_add(8)),
        entry,
    }
}

/// The section of a kind and instance, by a directory that was checked.
pub(crate) fn find_section(
    check: &Check<'_, '_>,
    header: &Header,
    kind: u32,
    instance: u32,
) -> Option<Section> {
    find_in(|offset| check.word_at(offset), header.section_count, kind, instance)
}

/// The section of a kind and instance: entries ascend, so the search halves them.
pub(crate) fn find_in(word_at: impl Fn(u32) -> u32, count: u32, kind: u32, instance: u32) -> Option<Section> {
    let key = |section: Section| (section.kind, section.instance);
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = low.wrapping_add(high) >> 1;
        if key(read_entry(&word_at, middle)) < (kind, instance) {
            low = middle.wrapping_add(1);
        } else {
            high = middle;
        }
    }
    let section = read_entry(&word_at, low);
    (low < count && key(section) == (kind, instance)).then_some(section)
}

/// Whether a kind belongs to the critical ones of this version.
fn is_known(kind: u32) -> bool {
    matches!(kind, METADATA | EXTERNAL | DIRECTIONS | MEANS | SCALES)
        || METHODS.iter().any(|method| method.section_rule(kind).is_some())
}

/// What the header says of a section of a known kind.
fn called_for(header: &Header, external: bool, kind: u32, instance: u32) -> Call {
    let in_dictionary = header.content == CONTENT_DICTIONARY;
    let state = header.states.get(instance as usize).copied().unwrap_or(CHANNEL_MISSING);
    let when = |holds: bool, call: Call| if holds { call } else { Call::Foreign };
    let Some(method) = method_of(header.method) else { return Call::Foreign };
    match kind {
        METADATA => when(instance == 0, Call::Required),
        EXTERNAL => when(instance == 0 && !in_dictionary, Call::Allowed),
        DIRECTIONS if in_dictionary => Call::Foreign,
        // A second set that is equal to the first may be left out.
        DIRECTIONS if instance == 1 && header.light_count == header.view_count => Call::Allowed,
        DIRECTIONS => when(instance <= 1, Call::Required),
        MEANS | SCALES if in_dictionary || state == CHANNEL_MISSING => Call::Foreign,
        MEANS if state == CHANNEL_MEAN => Call::Required,
        MEANS => method.means,
        SCALES => when(state == CHANNEL_FULL, method.scales),
        _ if kind >= OPTIONAL => Call::Allowed,
        _ => match method.section_rule(kind) {
            Some(rule) => when(rule.has_instance(header, instance), rule.call(in_dictionary, external)),
            None => Call::Foreign,
        },
    }
}

/// Walks 3.2 and 3.3. `false` if sections could not be found by this directory.
pub(crate) fn check_directory(check: &mut Check<'_, '_>, header: &Header) -> bool {
    let length = check.bytes.len().min(u32::MAX as usize) as u64;
    let mut sound = true;
    let mut before: Option<(u32, u32)> = None;
    let mut end =
        (HEADER_LENGTH as u64).wrapping_add((ENTRY_LENGTH as u64).wrapping_mul(header.section_count as u64));
    for index in 0..header.section_count {
        let section = read_entry(|offset| check.word_at(offset), index);
        let known = is_known(section.kind) || section.kind >= OPTIONAL;
        sound &= check.ensure(known, Rule::SectionKind, section.entry, section.kind);
        let key = (section.kind, section.instance);
        let ascends = before.is_none_or(|before| before < key);
        sound &= check.ensure(ascends, Rule::SectionOrder, section.entry, check.word_at(section.entry));
        before = Some(key);
        let aligned = end.next_multiple_of(16);
        let placed = section.offset as u64 == aligned;
        sound &= check.ensure(placed, Rule::SectionOffset, section.entry.wrapping_add(4), section.offset);
        let section_end = (section.offset as u64).wrapping_add(section.length as u64);
        let fits = section.length % 4 == 0 && section_end <= length;
        sound &= check.ensure(fits, Rule::SectionLength, section.entry.wrapping_add(8), section.length);
        if check.stopped || !sound {
            return false;
        }
        check_padding(check, end, aligned);
        end = section_end;
    }
    let aligned = end.next_multiple_of(16);
    check_padding(check, end, aligned.min(length));
    sound &= check.ensure(aligned == length, Rule::FileEnd, end as u32, length as u32);
    for index in 0..header.section_count {
        let section = read_entry(|offset| check.word_at(offset), index);
        let at = section.entry.wrapping_add(12);
        let stated = check.word_at(at);
        let sum = crc32(0, check.section_bytes(section));
        check.ensure(sum == stated, Rule::SectionChecksum, at, stated);
        if check.stopped {
            return false;
        }
    }
    sound & check_calls(check, header)
}

/// Bytes between sections are zero (3.2-5).
fn check_padding(check: &mut Check<'_, '_>, from: u64, to: u64) {
    let padding = check.bytes.get(from as usize..to as usize).unwrap_or(&[]);
    if let Some(at) = padding.iter().position(|&byte| byte != 0) {
        let found = padding.get(at).copied().unwrap_or(0);
        check.find(Rule::SectionPadding, (from as u32).wrapping_add(at as u32), found as u32);
    }
}

/// Walks 3.3.
fn check_calls(check: &mut Check<'_, '_>, header: &Header) -> bool {
    let external = find_section(check, header, EXTERNAL, 0).is_some();
    let mut sound = true;
    let mut require = |check: &mut Check<'_, '_>, kind: u32, instance: u32| {
        let missing = called_for(header, external, kind, instance) == Call::Required
            && find_section(check, header, kind, instance).is_none();
        sound &= check.ensure(!missing, Rule::SectionMissing, HEADER_LENGTH, kind | instance << 16);
    };
    for kind in [METADATA, EXTERNAL, DIRECTIONS, MEANS, SCALES] {
        (0..3).for_each(|instance| require(check, kind, instance));
    }
    let sections = method_of(header.method).map_or(&[][..], |method| method.sections);
    for rule in sections.iter().filter(|rule| matches!(rule.per, Per::File | Per::Channel)) {
        (0..3).for_each(|instance| require(check, rule.kind, instance));
    }
    for level in 0..header.level_count {
        for layer in 0..header.layer_count {
            for rule in sections.iter().filter(|rule| matches!(rule.per, Per::Layer | Per::LayerChannel)) {
                (0..3).for_each(|channel| require(check, rule.kind, layer_instance(level, layer, channel)));
            }
        }
    }
    for index in 0..header.section_count {
        let section = read_entry(|offset| check.word_at(offset), index);
        if section.kind < OPTIONAL {
            let foreign = called_for(header, external, section.kind, section.instance) == Call::Foreign;
            sound &=
                check.ensure(!foreign, Rule::SectionForeign, section.entry, check.word_at(section.entry));
        }
    }
    sound && !check.stopped && (check.part == Part::File || header.content == CONTENT_DICTIONARY)
}
