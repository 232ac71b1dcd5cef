//! The checksum of headers and sections (1.3-1): CRC-32 as in ISO 3309.
//!
//! With the `batch` feature sixteen bytes at a time, by 16 KiB of tables; without it, for small machines,
//! one at a time by 1 KiB.

/// Bytes that are taken together.
const STRIDE: usize = if cfg!(feature = "batch") { 16 } else { 1 };

const fn tables() -> [[u32; 256]; STRIDE] {
    let mut tables = [[0u32; 256]; STRIDE];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = byte as u32;
        let mut bit = 0u32;
        while bit < 8 {
            remainder = (remainder >> 1) ^ (0xedb8_8320 & (remainder & 1).wrapping_neg());
            bit = bit.wrapping_add(1);
        }
        tables[0][byte] = remainder;
        byte = byte.wrapping_add(1);
    }
    let mut table = 1;
    while table < STRIDE {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[table.wrapping_sub(1)][byte];
            tables[table][byte] = (before >> 8) ^ tables[0][(before & 0xff) as usize];
            byte = byte.wrapping_add(1);
        }
        table = table.wrapping_add(1);
    }
    tables
}

static TABLES: [[u32; 256]; STRIDE] = tables();

/// Entry of a table by the lowest byte of a word.
#[inline(always)]
fn at(table: usize, word: u32) -> u32 {
    TABLES[table & (STRIDE - 1)][(word & 0xff) as usize]
}

/// What the four bytes of a word add, the last of them `table` bytes before the end of a stride.
#[cfg(feature = "batch")]
#[inline(always)]
fn at_word(table: usize, word: u32) -> u32 {
    (at(table.wrapping_add(3), word) ^ at(table.wrapping_add(2), word >> 8))
        ^ (at(table.wrapping_add(1), word >> 16) ^ at(table, word >> 24))
}

/// Strides of sixteen bytes: the checksum so far meets the first word, the others wait for nothing.
#[cfg(feature = "batch")]
fn strides(mut crc: u32, bytes: &[u8]) -> (u32, &[u8]) {
    let (chunks, rest) = bytes.as_chunks::<STRIDE>();
    for &[a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, d0, d1, d2, d3] in chunks {
        let behind = at_word(8, u32::from_le_bytes([b0, b1, b2, b3]))
            ^ at_word(4, u32::from_le_bytes([c0, c1, c2, c3]));
        let behind = behind ^ at_word(0, u32::from_le_bytes([d0, d1, d2, d3]));
        crc = at_word(12, crc ^ u32::from_le_bytes([a0, a1, a2, a3])) ^ behind;
    }
    (crc, rest)
}

/// No strides: one byte at a time.
#[cfg(not(feature = "batch"))]
fn strides(crc: u32, bytes: &[u8]) -> (u32, &[u8]) {
    (crc, bytes)
}

/// CRC-32 of `bytes`, continued from the checksum of what precedes them (0 for nothing).
pub fn crc32(before: u32, bytes: &[u8]) -> u32 {
    let (mut crc, rest) = strides(!before, bytes);
    for &byte in rest {
        crc = (crc >> 8) ^ at(0, crc ^ byte as u32);
    }
    !crc
}

#[cfg(test)]
#[allow(clippy::arithmetic_side_effects, reason = "a test may end by overflow")]
mod tests {
    use super::crc32;

    #[test]
    fn the_standard_check_value() {
        assert_eq!(crc32(0, b"123456789"), 0xcbf4_3926);
        let long: [u8; 100] = core::array::from_fn(|i| i as u8);
        for split in 0..100 {
            assert_eq!(crc32(crc32(0, &long[..split]), &long[split..]), crc32(0, &long));
        }
    }
}
