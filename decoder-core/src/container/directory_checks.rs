//! Checks of the directory, and of the sections that a header calls for (chapters 3.2 and 3.3).

use crate::container::directory::{
    DIRECTIONS, EXTERNAL, MEANS, METADATA, OPTIONAL, SCALES, find_section, read_entry,
};
use crate::container::header::{CONTENT_DICTIONARY, ENTRY_LENGTH, HEADER_LENGTH, Header};
use crate::error::{Part, Rule};
use crate::kernel::material::{CHANNEL_FULL, CHANNEL_MEAN, CHANNEL_MISSING};
use crate::method::rule::{Call, Per, layer_instance};
use crate::method::{METHODS, method_of};
use crate::walk::check::Check;
use crate::walk::crc32::crc32;

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
