//! Checks of the tables of means and scales (chapters 8.1 and 8.2).

use crate::container::header::Header;
use crate::error::Rule;
use crate::walk::check::{Check, Section};

/// Largest magnitude of a base, Q20 (8.1-6).
pub const BASE_BOUND: i32 = 1 << 26;
/// Largest shift of a table of means (8.1-6).
pub const MEAN_SHIFT_LIMIT: u32 = 11;
/// Largest shift of a table of scales (8.1-6).
pub const SCALE_SHIFT_LIMIT: u32 = 8;

/// Walks 8.1-5 to 8.1-7 for one table.
pub(crate) fn check_pair_table(check: &mut Check<'_, '_>, section: Section, header: &Header, is_scale: bool) {
    let row_words = header.light_count.div_ceil(2);
    // At most 16 + 1024 * 512 * 4 bytes.
    let expected = header.view_count.wrapping_mul(row_words).wrapping_mul(4).wrapping_add(16);
    if !check.ensure(section.length == expected, Rule::TableLength, section.offset, section.length) {
        return;
    }
    let word = |n: u32| check.word_at(section.offset.wrapping_add(n.wrapping_mul(4)));
    let (base, shift, reserved) = (word(0), word(1), [word(2), word(3)]);
    let base_good = if is_scale { base == 0 } else { (base as i32).unsigned_abs() <= BASE_BOUND as u32 };
    check.ensure(base_good, Rule::TableHeader, section.offset, base);
    let shift_good = shift <= if is_scale { SCALE_SHIFT_LIMIT } else { MEAN_SHIFT_LIMIT };
    check.ensure(shift_good, Rule::TableHeader, section.offset.wrapping_add(4), shift);
    for (n, found) in (2u32..).zip(reserved) {
        check.ensure(found == 0, Rule::TableHeader, section.offset.wrapping_add(n.wrapping_mul(4)), found);
    }
    check.packed_rows(
        Rule::TableEntry,
        section.offset.wrapping_add(16),
        header.view_count,
        header.light_count,
    );
}
