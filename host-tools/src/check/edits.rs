//! Changes to the bytes of a file, as recipes of the conformance suite state them.

use crate::error::{Result, ToolError};
use crate::format::bits::words_to_bytes;
use crate::format::container::{
    HEADER_WORDS, RawSection, SECTION_LIMIT, entry_at, header_word, lay_out, take_apart,
};
use crate::format::triangulate::{triangulate, with_grid};
use crate::format::write::directions_section;
use serde::Deserialize;

/// Bytes of the vectors that were made before, by name.
pub(super) type Made<'a> = dyn Fn(&str) -> Option<&'a [u8]> + 'a;

/// A number, or one in hexadecimal as text.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Number {
    Plain(i64),
    Text(String),
}

impl Number {
    pub(super) fn get(&self) -> Result<u32> {
        let wide = match self {
            Number::Plain(n) => Some(*n),
            Number::Text(text) => text.strip_prefix("0x").and_then(|hex| i64::from_str_radix(hex, 16).ok()),
        };
        let fits = wide.filter(|n| (-(1i64 << 31)..1i64 << 32).contains(n));
        fits.map(|n| n as u32).ok_or_else(|| ToolError::Usage(format!("{self:?} is no number of 32 bits")))
    }
}

/// Four bytes a word, of a recipe.
fn words_of(numbers: &[Number]) -> Result<Vec<u8>> {
    Ok(words_to_bytes(&numbers.iter().map(Number::get).collect::<Result<Vec<u32>>>()?))
}

/// One change to the bytes. Places are `12`, `entry 0003.0000 + 4` or `section 0003.0000 + 48`.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum Edit {
    /// Writes a number of 1, 2 or 4 bytes.
    Set { set: String, to: Number, width: Option<usize> },
    /// Flips bits of a byte.
    Flip { flip: String, bits: u8 },
    /// Shortens the file to so many bytes.
    Cut { cut: usize },
    /// Adds zeros at its end.
    Extend { extend: usize },
    /// New words for a section; the file is laid out again.
    Words { section: String, words: Vec<Number> },
    /// More words at the end of a section.
    Append { section: String, append: Vec<Number> },
    /// Fewer bytes at the end of a section.
    Drop { section: String, drop: usize },
    /// Bytes `from` to `to` of a section, turned left.
    Rotate { section: String, rotate: [usize; 3] },
    /// A byte of a section; the file is laid out again.
    Byte { section: String, byte: usize, to: u8 },
    /// Takes a section away.
    Remove { remove: String },
    /// A new section.
    Add { add: String, words: Vec<Number> },
    /// A set of directions with triangles, hull and grid as given, or triangulated with a grid of this size.
    Directions {
        directions: u32,
        points: Vec<[i32; 2]>,
        triangles: Option<Vec<[u32; 3]>>,
        hull: Option<Vec<u32>>,
        grid: u32,
    },
    /// Digest and length of the external dictionary become those of a vector.
    Reference { reference: String },
}

/// A place in a file by its recipe's words.
pub(super) fn place(file: &[u8], text: &str) -> Result<usize> {
    let bad = || ToolError::Usage(format!("`{text}` is no place of the file"));
    let (base, add) = match text.split_once('+') {
        Some((base, add)) => (base.trim(), add.trim().parse().map_err(|_| bad())?),
        None => (text.trim(), 0usize),
    };
    if let Ok(offset) = base.parse::<usize>() {
        return Ok(offset + add);
    }
    let (what, section) = base.split_once(' ').ok_or_else(bad)?;
    let (kind, instance) = section_key(section)?;
    let word = |at: usize| file.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let count = word(header_word::SECTION_COUNT * 4).unwrap_or(0) as usize;
    let entry = (0..count.min(SECTION_LIMIT))
        .map(entry_at)
        .find(|&e| word(e) == Some(kind | instance << 16))
        .ok_or_else(bad)?;
    match what {
        "entry" => Ok(entry + add),
        "section" => Ok(word(entry + 4).ok_or_else(bad)? as usize + add),
        _ => Err(bad()),
    }
}

/// Kind and instance of `0113.0000`.
fn section_key(text: &str) -> Result<(u32, u32)> {
    let parts = text
        .split_once('.')
        .map(|(kind, instance)| (u32::from_str_radix(kind, 16), u32::from_str_radix(instance, 16)));
    let Some((Ok(kind), Ok(instance))) = parts else {
        return Err(ToolError::Usage(format!("`{text}` is no section")));
    };
    Ok((kind, instance))
}

impl Edit {
    /// Whether places of later edits and of the expectation are looked up behind this edit.
    pub(super) fn moves(&self) -> bool {
        !matches!(self, Edit::Set { .. } | Edit::Flip { .. } | Edit::Cut { .. } | Edit::Extend { .. })
    }

    pub(super) fn apply(&self, file: &mut Vec<u8>, made: &Made<'_>) -> Result<()> {
        let outside = || ToolError::Usage(format!("{self:?} lies outside the file"));
        match self {
            Edit::Set { set, to, width } => {
                let (at, width, value) = (place(file, set)?, width.unwrap_or(4), to.get()?.to_le_bytes());
                let slot = file.get_mut(at..at + width).ok_or_else(outside)?;
                let new = value.get(..width).ok_or_else(outside)?;
                if slot == new {
                    return Err(ToolError::Usage(format!("{self:?} changes nothing")));
                }
                slot.copy_from_slice(new);
            }
            Edit::Flip { flip, bits } => {
                let at = place(file, flip)?;
                *file.get_mut(at).ok_or_else(outside)? ^= bits;
            }
            Edit::Cut { cut } => file.truncate(*cut),
            Edit::Extend { extend } => file.resize(file.len() + extend, 0),
            Edit::Remove { remove } => {
                let key = section_key(remove)?;
                with_parts(file, |parts| parts.retain(|part| (part.kind, part.instance) != key));
            }
            Edit::Add { add, words } => {
                let ((kind, instance), bytes) = (section_key(add)?, words_of(words)?);
                with_parts(file, |parts| parts.push(RawSection { kind, instance, bytes }));
            }
            Edit::Words { section, words } => *section_of(file, section)? = words_of(words)?,
            Edit::Append { section, append } => section_of(file, section)?.extend(words_of(append)?),
            Edit::Drop { section, drop } => {
                let mut bytes = section_of(file, section)?;
                let left = bytes.len().checked_sub(*drop).ok_or_else(outside)?;
                bytes.truncate(left);
            }
            Edit::Rotate { section, rotate: [from, to, by] } => {
                section_of(file, section)?.get_mut(*from..*to).ok_or_else(outside)?.rotate_left(*by)
            }
            Edit::Byte { section, byte, to } => {
                *section_of(file, section)?.get_mut(*byte).ok_or_else(outside)? = *to
            }
            Edit::Directions { directions, points, triangles, hull, grid } => {
                let own = triangulate(points, None);
                let t = with_grid(
                    points,
                    triangles.clone().unwrap_or(own.triangles),
                    hull.clone().unwrap_or(own.hull),
                    *grid,
                );
                *section_of(file, &format!("0003.{directions:04x}"))? =
                    directions_section(*directions, points, &t).bytes;
            }
            Edit::Reference { reference } => {
                let other = made(reference).ok_or_else(|| {
                    ToolError::Usage(format!("{reference}: no recipe before this one has the name"))
                })?;
                let words = words_to_bytes(&[other.len() as u32, 0, 0, 0]);
                *section_of(file, "0002.0000")? = [&selvedge::sha256(other)[..], &words].concat();
            }
        }
        Ok(())
    }
}

/// Changes the sections of a file and lays it out again.
fn with_parts(file: &mut Vec<u8>, change: impl FnOnce(&mut Vec<RawSection>)) {
    let (header, mut parts) = take_apart(file);
    change(&mut parts);
    *file = lay_out(header, parts);
}

/// The bytes of a section; the file is laid out again when they are let go.
struct SectionBytes<'a> {
    file: &'a mut Vec<u8>,
    header: [u32; HEADER_WORDS],
    parts: Vec<RawSection>,
    at: usize,
}

fn section_of<'a>(file: &'a mut Vec<u8>, section: &str) -> Result<SectionBytes<'a>> {
    let key = section_key(section)?;
    let (header, parts) = take_apart(file);
    let at = parts.iter().position(|part| (part.kind, part.instance) == key);
    let at = at.ok_or_else(|| ToolError::Usage(format!("the file has no section {section}")))?;
    Ok(SectionBytes { file, header, parts, at })
}

impl std::ops::Deref for SectionBytes<'_> {
    type Target = Vec<u8>;

    fn deref(&self) -> &Vec<u8> {
        &self.parts[self.at].bytes
    }
}

impl std::ops::DerefMut for SectionBytes<'_> {
    fn deref_mut(&mut self) -> &mut Vec<u8> {
        &mut self.parts[self.at].bytes
    }
}

impl Drop for SectionBytes<'_> {
    fn drop(&mut self) {
        *self.file = lay_out(self.header, std::mem::take(&mut self.parts));
    }
}
