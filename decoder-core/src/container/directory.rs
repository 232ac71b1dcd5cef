//! The directory's layout, and sections found in it (chapter 3.2).

use crate::container::header::{ENTRY_LENGTH, HEADER_LENGTH, Header};
use crate::walk::check::{Check, Section};

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
