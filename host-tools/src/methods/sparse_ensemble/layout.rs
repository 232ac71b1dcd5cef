//! Words of the sections of chapter 10, field by field, and where a file has them.

use selvedge::kernel::words::{Words, word};
use selvedge::method::sparse_ensemble::Tables;

/// Lowest bit of an atom's column of the y factor (10.5-2).
pub const Y_BIT: u32 = 28;
/// Lowest bit of its column of the x factor.
pub const X_BIT: u32 = 24;
/// Lowest bit of its column of the light factor.
pub const LIGHT_BIT: u32 = 14;
/// Lowest bit of its column of the view factor.
pub const VIEW_BIT: u32 = 4;
/// Lowest bit of the step in a quantiser.
pub const STEP_BIT: u32 = 16;
/// Lowest bit of the width of dictionary numbers in the first word of coefficients (10.3-3).
pub const DICTIONARY_BITS_BIT: u32 = 8;
/// Lowest bit of the width of counts.
pub const COUNT_BITS_BIT: u32 = 16;
/// Words in front of the tables of a section of factors or atoms (10.1-1, 10.5-3).
pub const COUNT_WORDS: u32 = 2;
/// Words of a dictionary in the header of a section of factors (10.1-2).
pub const FACTOR_ENTRY_WORDS: u32 = 4;
/// Words of a dictionary in the header of the table of atoms (10.5-4).
pub const LIST_ENTRY_WORDS: u32 = 2;
/// Words of an atom.
pub const ATOM_WORDS: u32 = 2;

const COLUMN_MASK: u32 = (1 << (X_BIT - LIGHT_BIT)) - 1;
const FOUR_BITS: u32 = 0xf;
const EIGHT_BITS: u32 = 0xff;

/// Columns of light, view, x and y of an atom's word (10.5-2).
pub fn atom_columns(word: u32) -> [u32; 4] {
    [
        word >> LIGHT_BIT & COLUMN_MASK,
        word >> VIEW_BIT & COLUMN_MASK,
        word >> X_BIT & FOUR_BITS,
        word >> Y_BIT,
    ]
}

/// Right shift of an atom's products.
pub fn atom_shift(word: u32) -> u32 {
    word & FOUR_BITS
}

/// Bits of a value, by the first word of a section of coefficients (10.3-3).
pub fn value_bits(head: u32) -> u32 {
    head & EIGHT_BITS
}

/// First word of the header of a dictionary in the factors of a tables.
pub fn factor_entry(section: u32, dictionary: u32) -> u32 {
    section + COUNT_WORDS + dictionary * FACTOR_ENTRY_WORDS
}

/// Columns and first word of a table of factors: 0 is light or x, 1 is view or y (10.1-2, 10.2-1).
pub fn factor_table(words: Words<'_>, section: u32, dictionary: u32, second: u32) -> [u32; 2] {
    let entry = factor_entry(section, dictionary) + second;
    [word(words, entry), section + word(words, entry + 2)]
}

/// Number of atoms of a dictionary, and the first word of their list (10.5-4).
pub fn atom_list(words: Words<'_>, tables: Tables, dictionary: u32) -> [u32; 2] {
    let entry = tables.atoms_start + COUNT_WORDS + dictionary * LIST_ENTRY_WORDS;
    [word(words, entry), tables.atoms_start + word(words, entry + 1)]
}

/// Word and quantiser of an atom of a list.
pub fn atom_of_list(words: Words<'_>, list: u32, position: u32) -> [u32; 2] {
    [0, 1].map(|n| word(words, list + position * ATOM_WORDS + n))
}

/// Where the tables of a channel's dictionary are: first word and words of a row (10.1-3, 10.2-1); and its
/// atoms.
#[derive(Clone, Copy, Debug)]
pub struct RecordTables {
    /// Light factor.
    pub light: (u32, u32),
    /// View factor.
    pub view: (u32, u32),
    /// Factor of texels along x.
    pub x: (u32, u32),
    /// Factor of texels along y.
    pub y: (u32, u32),
    /// First word of the atoms.
    pub atoms: u32,
}

impl RecordTables {
    /// Of a dictionary by its number.
    pub fn of(words: Words<'_>, tables: Tables, dictionary: u32) -> RecordTables {
        let table = |section: u32, second: u32| {
            let [columns, table] = factor_table(words, section, dictionary, second);
            (table, columns.div_ceil(2))
        };
        RecordTables {
            light: table(tables.angular_start, 0),
            view: table(tables.angular_start, 1),
            x: table(tables.spatial_start, 0),
            y: table(tables.spatial_start, 1),
            atoms: atom_list(words, tables, dictionary)[1],
        }
    }
}
