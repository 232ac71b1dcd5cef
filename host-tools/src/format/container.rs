//! The container (chapters 3.1 and 3.2): header words, sections laid out, checksums, and the way back.

use crate::format::bits::words_to_bytes;
use selvedge::container::header::{CONTENT_DICTIONARY, ENTRY_LENGTH, HEADER_LENGTH, MAGIC};
use selvedge::crc32;

/// Words of a header.
pub const HEADER_WORDS: usize = HEADER_LENGTH as usize / 4;
/// Bytes between which sections start (3.2-3).
pub const ALIGNMENT: usize = 16;
/// Most sections of a file (3.1-5).
pub const SECTION_LIMIT: usize = 4096;

/// Numbers of the header's words (3.1).
pub mod header_word {
    /// Major version, and the minor one in the upper half.
    pub const VERSION: usize = 2;
    /// Bytes of the file.
    pub const FILE_LENGTH: usize = 3;
    /// Material or dictionary.
    pub const CONTENT: usize = 4;
    /// Number of the method.
    pub const METHOD: usize = 5;
    /// Entries of the directory.
    pub const SECTION_COUNT: usize = 6;
    /// Stated operations of a filtered sample.
    pub const OPERATIONS: usize = 7;
    /// Texels along x.
    pub const WIDTH: usize = 8;
    /// Texels along y.
    pub const HEIGHT: usize = 9;
    /// Light directions.
    pub const LIGHTS: usize = 10;
    /// View directions.
    pub const VIEWS: usize = 11;
    /// Levels of detail.
    pub const LEVELS: usize = 12;
    /// Edge of a block, and layers from bit 8 on.
    pub const EDGE_AND_LAYERS: usize = 13;
    /// States of the channels, a byte each.
    pub const STATES: usize = 14;
    /// Transfer, and the cosine flag in bit 8.
    pub const TRANSFER: usize = 15;
    /// Offset of the logarithm or exponent of linear values.
    pub const TRANSFER_PARAMETER: usize = 16;
    /// First word of the colour matrix.
    pub const MATRIX: usize = 17;
    /// Checksum of header and directory.
    pub const CHECKSUM: usize = 31;
}

use header_word::{CHECKSUM, FILE_LENGTH, SECTION_COUNT};

/// A section before layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawSection {
    /// What it holds.
    pub kind: u32,
    /// Which of its kind.
    pub instance: u32,
    /// Its bytes, a multiple of four.
    pub bytes: Vec<u8>,
}

impl RawSection {
    /// A section of words.
    pub fn of_words(kind: u32, instance: u32, words: &[u32]) -> RawSection {
        RawSection { kind, instance, bytes: words_to_bytes(words) }
    }
}

/// Instance of a section of one level, layer and channel (3.3).
pub fn level_instance(level: usize, layer: usize, channel: usize) -> u32 {
    (level << LEVEL_SHIFT | layer << LAYER_SHIFT | channel) as u32
}

/// Level, layer and channel of an instance.
pub fn level_of_instance(instance: u32) -> [u32; 3] {
    let four_bits = (1 << LAYER_SHIFT) - 1;
    [instance >> LEVEL_SHIFT, instance >> LAYER_SHIFT & four_bits, instance & four_bits]
}

const LEVEL_SHIFT: u32 = 8;
const LAYER_SHIFT: u32 = 4;

/// Word at a byte of a file, if it is there.
fn word_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at.checked_add(4)?)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// First byte of a directory entry.
pub fn entry_at(index: usize) -> usize {
    HEADER_LENGTH as usize + index * ENTRY_LENGTH as usize
}

/// Whether bytes are those of a dictionary file.
pub fn is_dictionary(bytes: &[u8]) -> bool {
    word_at(bytes, header_word::CONTENT * 4) == Some(CONTENT_DICTIONARY)
}

/// The header and the sections of a file whose directory is sound, to be changed and laid out again.
pub fn take_apart(file: &[u8]) -> ([u32; HEADER_WORDS], Vec<RawSection>) {
    let word = |at: usize| word_at(file, at).unwrap_or(0);
    let section = |i: usize| {
        let [key, offset, length] = [0, 4, 8].map(|field| word(entry_at(i) + field));
        let bytes = file[offset as usize..][..length as usize].to_vec();
        RawSection { kind: key & 0xffff, instance: key >> 16, bytes }
    };
    let header: [u32; HEADER_WORDS] = std::array::from_fn(|i| word(i * 4));
    (header, (0..header[SECTION_COUNT] as usize).map(section).collect())
}

/// Header, directory, sections and padding (3.1, 3.2), checksums included.
pub fn lay_out(mut header: [u32; HEADER_WORDS], mut sections: Vec<RawSection>) -> Vec<u8> {
    sections.sort_by_key(|section| (section.kind, section.instance));
    let mut bytes = vec![0u8; entry_at(sections.len())];
    for (i, section) in sections.iter().enumerate() {
        bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
        let entry = [
            section.kind | section.instance << 16,
            bytes.len() as u32,
            section.bytes.len() as u32,
            crc32(0, &section.bytes),
        ];
        bytes[entry_at(i)..entry_at(i + 1)].copy_from_slice(&words_to_bytes(&entry));
        bytes.extend(&section.bytes);
    }
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
    header[FILE_LENGTH] = bytes.len() as u32;
    header[SECTION_COUNT] = sections.len() as u32;
    bytes[..HEADER_LENGTH as usize].copy_from_slice(&words_to_bytes(&header));
    bytes[..MAGIC.len()].copy_from_slice(&MAGIC);
    repair_header_checksum(&mut bytes);
    bytes
}

/// Recomputes the header's checksum (3.1-6).
pub fn repair_header_checksum(bytes: &mut [u8]) {
    let count = word_at(bytes, SECTION_COUNT * 4).unwrap_or(0) as usize;
    let end = entry_at(count.min(SECTION_LIMIT)).min(bytes.len());
    let at = CHECKSUM * 4;
    let sum = crc32(crc32(0, &bytes[..at]), &bytes[HEADER_LENGTH as usize..end]);
    bytes[at..at + 4].copy_from_slice(&sum.to_le_bytes());
}

/// Recomputes every checksum, as far as the directory can be followed; for tests that damage files.
pub fn repair_checksums(bytes: &mut [u8]) {
    if bytes.len() < HEADER_LENGTH as usize {
        return;
    }
    let count = word_at(bytes, SECTION_COUNT * 4).unwrap_or(0) as usize;
    let whole = count.min(SECTION_LIMIT).min((bytes.len() - entry_at(0)) / ENTRY_LENGTH as usize);
    for entry in (0..whole).map(entry_at) {
        let [offset, length] = [4, 8].map(|field| word_at(bytes, entry + field).unwrap_or(0) as usize);
        if let Some(section) = bytes.get(offset..offset.saturating_add(length)) {
            let sum = crc32(0, section);
            bytes[entry + 12..entry + 16].copy_from_slice(&sum.to_le_bytes());
        }
    }
    repair_header_checksum(bytes);
}
