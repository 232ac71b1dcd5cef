//! Numbers packed into words, and streams of bits, lowest first.

use selvedge::kernel::words::{Words, packed_i16};

/// Words in the byte order of the file.
pub fn words_to_bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Appends 16-bit numbers two to a word, each row of `columns` padded to a word.
pub fn pack_rows(words: &mut Vec<u32>, entries: &[i16], columns: u32) {
    let low = |entry: Option<&i16>| entry.map_or(0, |&entry| entry as u16 as u32);
    for row in entries.chunks(columns.max(1) as usize) {
        words.extend(row.chunks(2).map(|pair| low(pair.first()) | low(pair.get(1)) << 16));
    }
}

/// Rows of packed numbers from word `table` on, as [`pack_rows`] writes them.
pub fn packed_rows(words: Words<'_>, table: u32, rows: u32, columns: u32) -> Vec<i16> {
    let row_words = columns.div_ceil(2);
    let row =
        |row: u32| (0..columns).map(move |column| packed_i16(words, table + row * row_words, column) as i16);
    (0..rows).flat_map(row).collect()
}

/// Bits that hold `0 ..= largest`.
pub fn bits_for(largest: u32) -> u32 {
    u32::BITS - largest.leading_zeros()
}

/// A stream of bits that grows.
#[derive(Debug, Default)]
pub struct BitWriter {
    words: Vec<u32>,
    length: u32,
}

impl BitWriter {
    /// Bits so far.
    pub fn length(&self) -> u32 {
        self.length
    }

    /// The stream in words; bits after its end are zero.
    pub fn into_words(self) -> Vec<u32> {
        self.words
    }

    /// Appends the lowest `count` bits of a value.
    pub fn push(&mut self, value: u32, count: u32) {
        for i in 0..count {
            if self.length % u32::BITS == 0 {
                self.words.push(0);
            }
            *self.words.last_mut().expect("just pushed") |=
                (value.checked_shr(i).unwrap_or(0) & 1) << (self.length % u32::BITS);
            self.length += 1;
        }
    }

    /// Ascending positions and their values: low parts with values, then high parts in unary (10.4-4,
    /// 10.4-5). Gives the last high part.
    pub fn push_list(&mut self, list: &[(u32, u16)], low_bits: u32, value_bits: u32) -> u32 {
        for &(position, value) in list {
            self.push(position, low_bits);
            self.push(value as u32, value_bits);
        }
        let mut high = 0;
        for &(position, _) in list {
            self.push(0, (position >> low_bits) - high);
            self.push(1, 1);
            high = position >> low_bits;
        }
        high
    }
}
