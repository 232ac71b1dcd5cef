// The file as 32-bit words (chapter 1). Twin: decoder-core/src/kernel/words.rs.
//
// All files stand in one buffer; word numbers in a Material already count from its begin.

@group(0) @binding(0) var<storage, read> files: array<u32>;

// The word at `index`; zero outside the file (1.2-1). Only a window at the end of a stream reads there, and does not use it.
fn word(index: u32) -> u32 {
    return files[index];
}

// The signed 16-bit number `index` of a packed table that begins at word `start`; even ones are low (1.2-2).
fn packed_i16(start: u32, index: u32) -> i32 {
    let pair = word(start + (index >> 1u));
    // 1.2-2: shift the wanted half to the top, then back with its sign.
    return i32(pair << (16u - ((index & 1u) << 4u))) >> 16u;
}

// The low half of a word with its sign (1.2-2).
fn low_i16(pair: u32) -> i32 {
    // 1.2-2: up, then back with its sign.
    return i32(pair << 16u) >> 16u;
}

// The high half of a word with its sign (1.2-2).
fn high_i16(pair: u32) -> i32 {
    // 1.2-2: the shift keeps the sign.
    return i32(pair) >> 16u;
}

// 32 bits that begin at bit `bit` of the stream at word `start`, lowest bit first (1.2-3).
fn bit_window(start: u32, bit: u32) -> u32 {
    let index = start + (bit >> 5u);
    let shift = bit & 31u;
    // 1.2-3: the second word is shifted in two steps, since a shift by 32 has no common meaning.
    return (word(index) >> shift) | ((word(index + 1u) << 1u) << (31u - shift));
}

// `count` low bits of a window, for count <= 31 (10.4-1).
fn low_part(window: u32, count: u32) -> u32 {
    // 10.4-1: a mask by shift; the count never reaches 32.
    return window & ((1u << count) - 1u);
}
