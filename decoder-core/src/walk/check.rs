//! The one checker: it walks the rules in the specification's order and tells every finding to a sink.
//!
//! `open` is this checker with a sink that stops at the first finding, so a validator and the decoder
//! cannot disagree. Structural findings end the part of the walk that depends on them.

use crate::error::{Finding, Part, Rule, Sink};
use crate::kernel::words::{DICTIONARY_START, Words, word};

/// The state of a walk over one file.
pub(crate) struct Check<'a, 's> {
    /// Both files, as the kernel sees them.
    pub words: Words<'a>,
    /// The file that is walked.
    pub bytes: &'a [u8],
    /// Which of the two it is.
    pub part: Part,
    /// Number of its first word.
    pub start: u32,
    /// Nothing was found so far.
    pub clean: bool,
    /// The sink wants no more.
    pub stopped: bool,
    sink: &'s mut dyn Sink,
}

/// A section by the directory: bytes from the start of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// What it holds.
    pub kind: u32,
    /// Which of its kind.
    pub instance: u32,
    /// First byte.
    pub offset: u32,
    /// Bytes without padding.
    pub length: u32,
    /// Byte offset of its directory entry.
    pub entry: u32,
}

impl<'a, 's> Check<'a, 's> {
    pub fn new(words: Words<'a>, part: Part, sink: &'s mut dyn Sink) -> Self {
        let (bytes, start) = match part {
            Part::File => (words.file, 0),
            Part::Dictionary => (words.dictionary, DICTIONARY_START),
        };
        Check { words, bytes, part, start, clean: true, stopped: false, sink }
    }

    /// A walk over the external dictionary that tells the same sink.
    pub fn in_dictionary<T>(&mut self, walk: impl FnOnce(&mut Check<'a, '_>) -> T) -> T {
        let mut inner = Check::new(self.words, Part::Dictionary, &mut *self.sink);
        inner.stopped = self.stopped;
        let result = walk(&mut inner);
        let (clean, stopped) = (inner.clean, inner.stopped);
        self.clean &= clean;
        self.stopped = stopped;
        result
    }

    /// Tells one finding.
    pub fn find(&mut self, rule: Rule, offset: u32, found: u32) {
        self.clean = false;
        if !self.stopped && !self.sink.report(Finding { rule, part: self.part, offset, found }) {
            self.stopped = true;
        }
    }

    /// Tells a finding unless `holds`; gives `holds` back.
    pub fn ensure(&mut self, holds: bool, rule: Rule, offset: u32, found: u32) -> bool {
        if !holds {
            self.find(rule, offset, found);
        }
        holds
    }

    /// The word at a byte offset that is a multiple of four.
    pub fn word_at(&self, offset: u32) -> u32 {
        word(self.words, self.start | (offset >> 2))
    }

    /// The bytes of a section; empty if it is not in the file, which the directory's check excludes.
    pub fn section_bytes(&self, section: Section) -> &'a [u8] {
        let start = section.offset as usize;
        self.bytes.get(start..start.saturating_add(section.length as usize)).unwrap_or(&[])
    }

    /// First word of a section, as the kernel counts.
    pub fn section_start(&self, section: Section) -> u32 {
        self.start | (section.offset >> 2)
    }

    /// Every entry of a packed table: not -32768, and an unused half zero. `columns` entries a row.
    pub fn packed_rows(&mut self, rule: Rule, offset: u32, rows: u32, columns: u32) {
        let row_words = columns.div_ceil(2);
        let length = (rows as usize).saturating_mul(row_words as usize).saturating_mul(4);
        let table = self.bytes.get(offset as usize..(offset as usize).saturating_add(length)).unwrap_or(&[]);
        let (pairs, _) = table.as_chunks::<4>();
        // One pass without branches says whether anything is wrong; only then is it looked for.
        let banned = pairs.iter().fold(false, |bad, &[a, b, c, d]| {
            bad | (u16::from_le_bytes([a, b]) == 0x8000) | (u16::from_le_bytes([c, d]) == 0x8000)
        });
        let odd = columns & 1 == 1;
        let unused = odd
            && pairs
                .chunks_exact((row_words as usize).max(1))
                .any(|row| row.last().is_some_and(|&[_, _, c, d]| c | d != 0));
        if !banned && !unused {
            return;
        }
        for (index, &[a, b, c, d]) in pairs.iter().enumerate() {
            let index = index as u32;
            let at = offset.wrapping_add(index.wrapping_mul(4));
            let last = odd && index.checked_rem(row_words.max(1)).unwrap_or(0) == row_words.wrapping_sub(1);
            let (low, high) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
            if low == 0x8000 {
                self.find(rule, at, low as u32);
            }
            if high == 0x8000 || last && high != 0 {
                self.find(rule, at.wrapping_add(2), high as u32);
            }
            if self.stopped {
                return;
            }
        }
    }
}
