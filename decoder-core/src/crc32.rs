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
        let mut bit = 0;
        while bit < 8 {
            remainder = (remainder >> 1) ^ (0xedb8_8320 & (remainder & 1).wrapping_neg());
            bit += 1;
        }
        tables[0][byte] = remainder;
        byte += 1;
    }
    let mut table = 1;
    while table < STRIDE {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[table - 1][byte];
            tables[table][byte] = (before >> 8) ^ tables[0][(before & 0xff) as usize];
            byte += 1;
        }
        table += 1;
    }
    tables
}

static TABLES: [[u32; 256]; STRIDE] = tables();

/// CRC-32 of `bytes`, continued from the checksum of what precedes them (0 for nothing).
pub fn crc32(before: u32, bytes: &[u8]) -> u32 {
    let mut crc = !before;
    let at = |table: usize, byte: u8| TABLES[table & (STRIDE - 1)][byte as usize];
    let (chunks, rest) = bytes.as_chunks::<STRIDE>();
    for chunk in chunks {
        // The checksum so far meets the first four bytes, or as many as there are.
        let mut next = crc.checked_shr(8 * STRIDE as u32).unwrap_or(0);
        for (i, byte) in chunk.iter().enumerate() {
            let met = if i < 4 { byte ^ (crc >> (8 * i)) as u8 } else { *byte };
            next ^= at(STRIDE - 1 - i, met);
        }
        crc = next;
    }
    for &byte in rest {
        crc = (crc >> 8) ^ at(0, byte ^ crc as u8);
    }
    !crc
}

#[cfg(test)]
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
