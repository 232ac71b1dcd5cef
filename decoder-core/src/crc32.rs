//! The checksum of headers and sections (1.3-1): CRC-32 as in ISO 3309, eight bytes at a time.

const fn tables() -> [[u32; 256]; 8] {
    let mut tables = [[0u32; 256]; 8];
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
    while table < 8 {
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

static TABLES: [[u32; 256]; 8] = tables();

/// CRC-32 of `bytes`, continued from the checksum of what precedes them (0 for nothing).
pub fn crc32(before: u32, bytes: &[u8]) -> u32 {
    let mut crc = !before;
    let at = |table: usize, value: u32| TABLES[table & 7][(value & 0xff) as usize];
    let (chunks, rest) = bytes.as_chunks::<8>();
    for &[a, b, c, d, e, f, g, h] in chunks {
        let low = crc ^ u32::from_le_bytes([a, b, c, d]);
        let high = u32::from_le_bytes([e, f, g, h]);
        crc = at(7, low) ^ at(6, low >> 8) ^ at(5, low >> 16) ^ at(4, low >> 24);
        crc ^= at(3, high) ^ at(2, high >> 8) ^ at(1, high >> 16) ^ at(0, high >> 24);
    }
    for &byte in rest {
        crc = (crc >> 8) ^ at(0, crc ^ byte as u32);
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
