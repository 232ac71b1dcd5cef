//! Checks of the header (chapter 3.1) and of the caller's limits (chapter 4.1).

use crate::container::header::{
    CONTENT_DICTIONARY, CONTENT_MATERIAL, EDGE_LIMIT, ENTRY_LENGTH, HEADER_LENGTH, Header, MAGIC,
    MAJOR_VERSION,
};
use crate::error::{Part, Rule};
use crate::kernel::material::{CHANNEL_FULL, TRANSFER_LINEAR, TRANSFER_LOG2, level_size};
use crate::method::method_of;
use crate::walk::check::Check;
use crate::walk::crc32::crc32;
use crate::walk::limits::Limits;

/// Walks 3.1 and 4.1. `None` if what follows could not be found by this header.
pub(crate) fn check_header(check: &mut Check<'_, '_>, limits: &Limits) -> Option<Header> {
    let length = check.bytes.len().min(u32::MAX as usize) as u32;
    let header = check_whole(check, length)?;
    let mut sound = check_sizes(check, &header);
    check_transfer(check, &header);
    check_reserved(check);
    if header.content == CONTENT_DICTIONARY {
        check_dictionary_fields(check, &header);
    }
    // 4.1: the price is compared before anything beyond the directory is touched.
    sound &= check.ensure(length <= limits.bytes, Rule::LimitBytes, 12, length);
    sound &=
        check.ensure(header.operations <= limits.operations, Rule::LimitOperations, 28, header.operations);
    // At most 2^28 where the sizes are sound.
    let texels = header.width.saturating_mul(header.height);
    sound &= check.ensure(texels <= limits.texels, Rule::LimitTexels, 32, texels);
    (sound && !check.stopped).then_some(header)
}

/// What makes the bytes a whole file of this format: 3.1-1 to 3.1-6. `None` ends the walk.
fn check_whole(check: &mut Check<'_, '_>, length: u32) -> Option<Header> {
    if !check.ensure(length >= HEADER_LENGTH, Rule::HeaderTooShort, 0, length) {
        return None;
    }
    let start = [check.word_at(0), check.word_at(4)];
    let magic = [
        u32::from_le_bytes([MAGIC[0], MAGIC[1], MAGIC[2], MAGIC[3]]),
        u32::from_le_bytes([MAGIC[4], MAGIC[5], MAGIC[6], MAGIC[7]]),
    ];
    if start != magic {
        let second = start[0] == magic[0];
        check.find(Rule::Magic, if second { 4 } else { 0 }, start[second as usize]);
        return None;
    }
    let header = Header::read(|offset| check.word_at(offset));
    let major = check.word_at(8) & 0xffff;
    if !check.ensure(major == MAJOR_VERSION, Rule::MajorVersion, 8, major) {
        return None;
    }
    let whole = header.file_length == length && length % 16 == 0 && check.bytes.len() as u64 <= 0xffff_fff0;
    check.ensure(whole, Rule::FileLength, 12, header.file_length);
    // At most 128 + 16 * 4096 bytes: no overflow.
    let directory_end = HEADER_LENGTH.wrapping_add(ENTRY_LENGTH.wrapping_mul(header.section_count.min(4096)));
    let counted = (1..=4096).contains(&header.section_count) && directory_end <= length;
    if !check.ensure(counted, Rule::SectionCount, 24, header.section_count) {
        return None;
    }
    let stated = check.word_at(124);
    let fields = check.bytes.get(..124).unwrap_or(&[]);
    let directory = check.bytes.get(128..directory_end as usize).unwrap_or(&[]);
    let sum = crc32(crc32(0, fields), directory);
    check.ensure(sum == stated, Rule::HeaderChecksum, 124, stated);
    Some(header)
}

/// Content, method, sizes and counts; `false` if sections cannot be found by them.
fn check_sizes(check: &mut Check<'_, '_>, header: &Header) -> bool {
    let known_content = header.content == CONTENT_MATERIAL || header.content == CONTENT_DICTIONARY;
    let wanted =
        if check.part == Part::Dictionary { header.content == CONTENT_DICTIONARY } else { known_content };
    let mut sound = check.ensure(wanted, Rule::Content, 16, header.content);
    let method = method_of(header.method);
    sound &= check.ensure(method.is_some(), Rule::Method, 20, header.method);
    for (offset, size) in [(32, header.width), (36, header.height)] {
        sound &= check.ensure((1..=16_384).contains(&size), Rule::ImageSize, offset, size);
    }
    for (offset, count) in [(40, header.light_count), (44, header.view_count)] {
        sound &= check.ensure((1..=1024).contains(&count), Rule::DirectionCount, offset, count);
    }
    let in_range = (1..=15).contains(&header.level_count);
    let larger = header.width.max(header.height).min(16_384);
    let needed =
        header.level_count == 1 || in_range && level_size(larger, header.level_count.wrapping_sub(2)) > 1;
    sound &= check.ensure(in_range && needed, Rule::LevelCount, 48, header.level_count);
    let largest_edge = method.map_or(EDGE_LIMIT, |method| method.largest_edge);
    sound &= check.ensure((1..=largest_edge).contains(&header.edge), Rule::BlockEdge, 52, header.edge);
    sound &= check.ensure((1..=8).contains(&header.layer_count), Rule::LayerCount, 53, header.layer_count);
    for (c, &state) in (0u32..).zip(&header.states) {
        sound &= check.ensure(state <= CHANNEL_FULL, Rule::ChannelState, 56u32.wrapping_add(c), state);
    }
    sound
}

/// How values become radiance: nothing is found by these fields.
fn check_transfer(check: &mut Check<'_, '_>, header: &Header) {
    let transfer_known = header.transfer == TRANSFER_LOG2 || header.transfer == TRANSFER_LINEAR;
    check.ensure(transfer_known, Rule::Transfer, 60, header.transfer);
    check.ensure(header.cosine_included <= 1, Rule::Transfer, 61, header.cosine_included);
    let parameter = header.transfer_parameter;
    let parameter_good = if header.transfer == TRANSFER_LINEAR {
        (-60..=60).contains(&(parameter as i32))
    } else {
        parameter == 0 || (0x0080_0000..=0x3f80_0000).contains(&parameter)
    };
    check.ensure(parameter_good, Rule::TransferParameter, 64, parameter);
    for (n, &entry) in (0u32..).zip(&header.matrix_q13) {
        let offset = 68u32.wrapping_add(n.wrapping_mul(2));
        check.ensure(entry != -32768, Rule::ColourMatrix, offset, entry as u32);
    }
}

/// Fields and words that are reserved are zero.
fn check_reserved(check: &mut Check<'_, '_>) {
    for (offset, unused) in [
        (54, check.word_at(52) >> 16),
        (59, check.word_at(56) >> 24),
        (62, check.word_at(60) >> 16),
        (86, check.word_at(84) >> 16),
    ] {
        check.ensure(unused == 0, Rule::HeaderReserved, offset, unused);
    }
    for index in 22u32..31 {
        let found = check.word_at(index.wrapping_mul(4));
        check.ensure(found == 0, Rule::HeaderReserved, index.wrapping_mul(4), found);
    }
}

/// What a dictionary has no use for has the value that says so.
fn check_dictionary_fields(check: &mut Check<'_, '_>, header: &Header) {
    let plain = [
        (28, 0, header.operations),
        (32, 1, header.width),
        (36, 1, header.height),
        (48, 1, header.level_count),
        (53, 1, header.layer_count),
    ];
    for (offset, wanted, found) in plain {
        check.ensure(found == wanted, Rule::DictionaryHeader, offset, found);
    }
    for (c, &state) in (0u32..).zip(&header.states) {
        check.ensure(state != 1, Rule::DictionaryHeader, 56u32.wrapping_add(c), state);
    }
    for index in 15u32..22 {
        let found = check.word_at(index.wrapping_mul(4));
        check.ensure(found == 0, Rule::DictionaryHeader, index.wrapping_mul(4), found);
    }
}
