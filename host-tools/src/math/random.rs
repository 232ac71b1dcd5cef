//! Repeatable random numbers for generated files and queries (SplitMix64, Steele et al. 2014).

/// A generator; equal seeds give equal sequences everywhere.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
    /// Words that are given before those of the generator, last first.
    given: Vec<u32>,
}

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Random {
        Random { state: seed ^ 0x5e1f_ed9e_0000_0000, given: Vec::new() }
    }

    /// From any bytes: they are the first random numbers, four bytes each, so that whoever chooses them
    /// chooses what is made.
    pub fn from_bytes(bytes: &[u8]) -> Random {
        let given =
            bytes.rchunks(4).map(|word| word.iter().fold(0, |word, &byte| word << 8 | byte as u32)).collect();
        Random { given, ..Random::new(bytes.len() as u64) }
    }

    /// 64 random bits.
    pub fn double_word(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 32 random bits.
    pub fn word(&mut self) -> u32 {
        self.given.pop().unwrap_or_else(|| (self.double_word() >> 32) as u32)
    }

    /// From `low` to `high`, both included.
    pub fn range(&mut self, low: i64, high: i64) -> i64 {
        low + (((self.word() as u64) * ((high - low + 1) as u64)) >> 32) as i64
    }

    /// True once in `n`.
    pub fn once_in(&mut self, n: i64) -> bool {
        self.range(1, n) == 1
    }

    /// One of the given.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.range(0, from.len() as i64 - 1) as usize]
    }

    /// A 16-bit table entry, often at an end of its range.
    pub fn entry(&mut self) -> i16 {
        let any = self.range(-32_767, 32_767);
        self.pick(&[any, any, any, -32_767, 32_767, 0, any >> 8, any >> 12]) as i16
    }
}
