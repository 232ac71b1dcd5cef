//! Bit streams read fast: what `open`, images and batches share (chapter 10.4).
//!
//! The kernel's way through a record is `ensemble.rs`; this one gives the same numbers from 64-bit
//! windows, which a GPU does not have.

/// Up to 57 bits of a stream from `bit` on; zero beyond its end.
#[inline(always)]
pub fn window(stream: &[u8], bit: u32) -> u64 {
    let from = (bit >> 3) as usize;
    match stream.get(from..from.wrapping_add(8)) {
        Some(&[a, b, c, d, e, f, g, h]) => u64::from_le_bytes([a, b, c, d, e, f, g, h]) >> (bit & 7),
        _ => last_window(stream, bit),
    }
}

/// A window that begins less than eight bytes before the end, or after it.
#[cold]
#[inline(never)]
fn last_window(stream: &[u8], bit: u32) -> u64 {
    let rest = stream.get((bit >> 3) as usize..).unwrap_or(&[]);
    rest.iter().take(8).rev().fold(0u64, |bits, &byte| bits << 8 | byte as u64) >> (bit & 7)
}

/// The places of the one bits of a stream.
pub struct Ones<'a> {
    bytes: &'a [u8],
    base: u32,
    end: u32,
    ones: u64,
}

/// Bits looked at together: a whole number of bytes, and with any bit offset within a window.
const STEP: u32 = 56;

impl<'a> Ones<'a> {
    /// From bit `begin` up to bit `end`.
    #[inline(always)]
    pub fn new(bytes: &'a [u8], begin: u32, end: u32) -> Self {
        let mut ones = Ones { bytes, base: begin, end, ones: 0 };
        ones.load();
        ones
    }

    #[inline(always)]
    fn load(&mut self) {
        let left = self.end.saturating_sub(self.base).min(STEP);
        self.ones = window(self.bytes, self.base) & ((1u64 << left).wrapping_sub(1));
    }

    /// The next place.
    #[inline(always)]
    pub fn take(&mut self) -> Option<u32> {
        while self.ones == 0 {
            self.base = self.base.saturating_add(STEP);
            if self.base >= self.end {
                return None;
            }
            self.load();
        }
        let place = self.base.wrapping_add(self.ones.trailing_zeros());
        self.ones &= self.ones.wrapping_sub(1);
        Some(place)
    }
}
