//! Metadata and the reference to an external dictionary (chapters 3.4 and 3.5).

use crate::error::Rule;
use crate::walk::check::{Check, Section};

/// What a person or a renderer wants to know beside the values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Metadata<'a> {
    /// Width of a texel in nanometres, 0 if unknown.
    pub texel_width_nm: u32,
    /// Height of a texel in nanometres, 0 if unknown.
    pub texel_height_nm: u32,
    /// Axes of the directions: 0 unknown, 1 x to the right and y up in the image, 2 x to the right and y
    /// down.
    pub frame: u32,
    /// Where texel (0, 0) is: 0 unknown, 1 top left, 2 bottom left.
    pub image_origin: u32,
    /// Primaries: 0 unknown, 1 those of Rec. 709, 2 those of Rec. 2020, 3 CIE XYZ, 4 the camera's.
    pub primaries: u32,
    /// Name of the material or dictionary.
    pub name: &'a str,
    /// Where the data are from.
    pub origin: &'a str,
    /// Under which terms they are given.
    pub licence: &'a str,
}

/// Largest legal codes of the words 2, 3 and 4.
const CODES: [u32; 3] = [2, 2, 4];

/// The string whose length word is at `at` of the section: text and where the next begins.
fn read_text(bytes: &[u8], at: usize) -> Option<(&[u8], &[u8], usize)> {
    let length = u32::from_le_bytes(*bytes.get(at..)?.first_chunk::<4>()?) as usize;
    let start = at.checked_add(4)?;
    let end = start.checked_add(length)?;
    let next = end.checked_next_multiple_of(4)?;
    Some((bytes.get(start..end)?, bytes.get(end..next)?, next))
}

/// Characters that are not seen, or that change how others are read, and that no text of a file may have
/// (3.4-3).
pub fn is_invisible(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// A string that can be shown as it is.
fn as_plain_text(text: &[u8]) -> Option<&str> {
    core::str::from_utf8(text).ok().filter(|text| !text.chars().any(is_invisible))
}

/// The metadata of a section that was checked.
pub(crate) fn read_metadata<'a>(bytes: &'a [u8]) -> Option<Metadata<'a>> {
    let word = |n: usize| bytes.as_chunks::<4>().0.get(n).map_or(0, |w| u32::from_le_bytes(*w));
    let (name, _, at) = read_text(bytes, 32)?;
    let (origin, _, at) = read_text(bytes, at)?;
    let (licence, _, _) = read_text(bytes, at)?;
    Some(Metadata {
        texel_width_nm: word(0),
        texel_height_nm: word(1),
        frame: word(2),
        image_origin: word(3),
        primaries: word(4),
        name: as_plain_text(name)?,
        origin: as_plain_text(origin)?,
        licence: as_plain_text(licence)?,
    })
}

/// Walks 3.4.
pub(crate) fn check_metadata(check: &mut Check<'_, '_>, section: Section) {
    let bytes = check.section_bytes(section);
    if !check.ensure(bytes.len() >= 44, Rule::MetadataLength, section.offset, section.length) {
        return;
    }
    for (n, &largest) in (2u32..).zip(&CODES) {
        let at = section.offset.wrapping_add(n.wrapping_mul(4));
        let code = check.word_at(at);
        check.ensure(code <= largest, Rule::MetadataValue, at, code);
    }
    for n in 5u32..8 {
        let at = section.offset.wrapping_add(n.wrapping_mul(4));
        let found = check.word_at(at);
        check.ensure(found == 0, Rule::MetadataValue, at, found);
    }
    let mut at = 32usize;
    for _text in 0..3 {
        let offset = section.offset.wrapping_add(at as u32);
        let Some((text, padding, next)) = read_text(bytes, at) else {
            check.find(Rule::MetadataLength, offset, section.length);
            return;
        };
        let plain = as_plain_text(text).is_some() && padding.iter().all(|&byte| byte == 0);
        check.ensure(plain, Rule::MetadataText, offset, text.len() as u32);
        at = next;
    }
    check.ensure(at == bytes.len(), Rule::MetadataLength, section.offset, section.length);
}

/// Walks 3.5-1; gives the digest.
pub(crate) fn check_external<'a>(check: &mut Check<'a, '_>, section: Section) -> Option<&'a [u8]> {
    let bytes = check.section_bytes(section);
    let tail_zero = bytes.get(36..).is_some_and(|tail| tail.iter().all(|&byte| byte == 0));
    if !check.ensure(section.length == 48 && tail_zero, Rule::ExternalLength, section.offset, section.length)
    {
        return None;
    }
    bytes.get(..32)
}
