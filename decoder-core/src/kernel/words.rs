//! The file as 32-bit words (chapter 1). Twin: `shaders/wgsl/words.wgsl`.
//!
//! A file is the GPU's buffer: the kernel binds the same bytes as `array<u32>` and uses the same word
//! numbers. A material may stand in two files, its own and an external dictionary; bit 31 of a word
//! number selects the second.

/// Word numbers from here on are of the dictionary's file.
pub const DICTIONARY_START: u32 = 0x8000_0000;

/// The bytes of a material and, where it uses one, of its external dictionary.
#[derive(Clone, Copy, Debug, Default)]
pub struct Words<'a> {
    /// The material's file.
    pub file: &'a [u8],
    /// The dictionary's file; empty if there is none.
    pub dictionary: &'a [u8],
}

/// The word at `index`; zero outside the file (1.2-1). Only a window at the end of a stream reads there, and
/// does not use it.
#[inline(always)]
pub fn word(words: Words<'_>, index: u32) -> u32 {
    let bytes = if index < DICTIONARY_START { words.file } else { words.dictionary };
    match bytes.as_chunks::<4>().0.get((index & 0x7fff_ffff) as usize) {
        Some(chunk) => u32::from_le_bytes(*chunk),
        None => 0,
    }
}

/// The signed 16-bit number `index` of a packed table that begins at word `start`; even ones are low (1.2-2).
#[inline(always)]
pub fn packed_i16(words: Words<'_>, start: u32, index: u32) -> i32 {
    let pair = word(words, start.wrapping_add(index >> 1));
    // 1.2-2: shift the wanted half to the top, then back with its sign.
    ((pair << (16 - ((index & 1) << 4))) as i32) >> 16
}

/// The low half of a word with its sign (1.2-2).
#[inline(always)]
pub fn low_i16(pair: u32) -> i32 {
    // 1.2-2: up, then back with its sign.
    ((pair << 16) as i32) >> 16
}

/// The high half of a word with its sign (1.2-2).
#[inline(always)]
pub fn high_i16(pair: u32) -> i32 {
    // 1.2-2: the shift keeps the sign.
    (pair as i32) >> 16
}

/// 32 bits that begin at bit `bit` of the stream at word `start`, lowest bit first (1.2-3).
#[inline(always)]
pub fn bit_window(words: Words<'_>, start: u32, bit: u32) -> u32 {
    let index = start.wrapping_add(bit >> 5);
    let shift = bit & 31;
    // 1.2-3: the second word is shifted in two steps, since a shift by 32 has no common meaning.
    (word(words, index) >> shift) | ((word(words, index.wrapping_add(1)) << 1) << (31 - shift))
}

/// `count` low bits of a window, for `count <= 31` (10.4-1).
#[inline(always)]
pub fn low_part(window: u32, count: u32) -> u32 {
    // 10.4-1: a mask by shift; the count never reaches 32.
    window & ((1u32 << count).wrapping_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_words_halves_and_bits() {
        let file: [u8; 8] = [0x01, 0x80, 0xff, 0x7f, 0xfe, 0xff, 0x02, 0x00];
        let words = Words { file: &file, dictionary: &file[4..] };
        assert_eq!(word(words, 0), 0x7fff_8001);
        assert_eq!(word(words, 2), 0);
        assert_eq!(word(words, DICTIONARY_START), 0x0002_fffe);
        let halves = [0, 1, 2, 3].map(|i| packed_i16(words, 0, i));
        assert_eq!(halves, [-32767, 32767, -2, 2]);
        let all = u64::from_le_bytes(file);
        for bit in 0..64 {
            assert_eq!(bit_window(words, 0, bit), (all >> bit) as u32, "{bit}");
        }
    }
}
