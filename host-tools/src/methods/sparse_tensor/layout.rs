//! Words of the sections of chapter 12, field by field, and where a file has them.

use selvedge::Material;
use selvedge::kernel::material::part;
use selvedge::kernel::words::{Words, word};
use selvedge::method::sparse_tensor::{FIBRES_PART, LIGHT_ATOMS_PART, bit_length};

/// Words in front of light atoms and of fibres (12.1-1, 12.2-1).
pub const COUNT_WORDS: u32 = 2;
/// Bits of a channel of a light atom's entry (12.1-3).
pub const CHANNEL_BITS: u32 = 10;
/// Lowest bit of the gain shift in an ABRDF atom's word (12.2-3).
pub const GAIN_BIT: u32 = 5;
/// Lowest bit of the index bits in the second word of the fibres (12.2-2), and of the count bits of lists
/// (12.3-3).
pub const SECOND_BYTE: u32 = 8;
/// Lowest bit of the index bits of lists.
pub const INDEX_BITS_BIT: u32 = 16;
/// Lowest bit of the shift of lists.
pub const LIST_SHIFT_BIT: u32 = 24;

const EIGHT_BITS: u32 = 0xff;
const FIVE_BITS: u32 = 31;

/// The bits of a channel's field in a light atom's entry.
pub fn channel_field(value: i16, channel: usize) -> u32 {
    (value as u32 & ((1 << CHANNEL_BITS) - 1)) << (channel as u32 * CHANNEL_BITS)
}

/// The bits of a fibre's entry that number its light atom; the others are its value (12.2-6).
pub fn index_mask(light_atoms: u32) -> u16 {
    ((1u32 << bit_length(light_atoms - 1)) - 1) as u16
}

/// Light atoms of a file.
pub fn light_atom_count(words: Words<'_>, material: &Material) -> u32 {
    word(words, part(material, LIGHT_ATOMS_PART))
}

/// First word of the row of a light direction in the light atoms.
pub fn light_row(words: Words<'_>, material: &Material, light: u32) -> u32 {
    part(material, LIGHT_ATOMS_PART) + COUNT_WORDS + light * light_atom_count(words, material)
}

/// ABRDF atoms of a file.
pub fn atom_count(words: Words<'_>, material: &Material) -> u32 {
    word(words, part(material, FIBRES_PART))
}

/// Entries of a fibre, and the bits that number a light atom in one.
pub fn fibre_shape(words: Words<'_>, material: &Material) -> [u32; 2] {
    let shape = word(words, part(material, FIBRES_PART) + 1);
    [shape & EIGHT_BITS, shape >> SECOND_BYTE & EIGHT_BITS]
}

/// Word of the shifts of an ABRDF atom.
pub fn shifts_at(material: &Material, atom: u32) -> u32 {
    part(material, FIBRES_PART) + COUNT_WORDS + atom
}

/// Angular shift and gain shift of an ABRDF atom (12.2-3).
pub fn atom_shifts(words: Words<'_>, material: &Material, atom: u32) -> [u32; 2] {
    let shifts = word(words, shifts_at(material, atom));
    [shifts & FIVE_BITS, shifts >> GAIN_BIT & FIVE_BITS]
}

/// First word of the fibres' entries.
pub fn entries_start(words: Words<'_>, material: &Material) -> u32 {
    shifts_at(material, atom_count(words, material))
}

/// Bits of a value and right shift of the totals, by the first word of a section of lists (12.3-3).
pub fn value_bits_and_shift(head: u32) -> [u32; 2] {
    [head & EIGHT_BITS, head >> LIST_SHIFT_BIT]
}

/// Right shift of a blended entry of light atoms, from Q24 to Q14 (12.5-1).
pub const LIGHT_SHIFT: u32 = 10;
/// Right shift of a weighted entry of a fibre, to thirteen fraction bits (12.5-2).
pub const FIBRE_SHIFT: u32 = 17;
