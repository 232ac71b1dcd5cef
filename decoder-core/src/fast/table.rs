//! Packed tables read by rows: columns of factors, and means and scales of pairs of directions.

use crate::kernel::direction::Taps;
use crate::kernel::fixed::multiply_q15;
use crate::kernel::words::{DICTIONARY_START, Words};

/// Bytes of the file that holds word `start`, from there on.
pub(crate) fn bytes_from<'a>(words: Words<'a>, start: u32) -> &'a [u8] {
    let file = if start < DICTIONARY_START { words.file } else { words.dictionary };
    file.get(((start & 0x7fff_ffff) as usize).wrapping_mul(4)..).unwrap_or(&[])
}

/// A factor's table: the bytes of its rows, and how long one is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Table<'a> {
    bytes: &'a [u8],
    row_bytes: usize,
}

impl<'a> Table<'a> {
    /// The packed rows from word `start` on, of `columns` entries each, in either file.
    pub fn new(words: Words<'a>, start: u32, columns: u32) -> Table<'a> {
        let row_bytes = (columns.wrapping_add(1) >> 1).wrapping_mul(4) as usize;
        Table { bytes: bytes_from(words, start), row_bytes }
    }

    /// The rows of a table of means or scales at `start`: one for each view, an entry for each light.
    pub fn of_pairs(words: Words<'a>, start: u32, light_count: u32) -> Table<'a> {
        Table::new(words, start.wrapping_add(4), light_count)
    }

    /// A row; its columns may run on into the next row, which no checked file asks for.
    #[inline(always)]
    pub fn row(&self, row: u32) -> &'a [[u8; 2]] {
        let start = self.row_bytes.wrapping_mul(row as usize);
        self.bytes.get(start..start.wrapping_add(self.row_bytes)).unwrap_or(&[]).as_chunks::<2>().0
    }
}

/// Entry of a row; zero outside, which no checked file asks for.
#[inline(always)]
pub(crate) fn entry(row: &[[u8; 2]], column: u32) -> i32 {
    row.get(column as usize).map_or(0, |&bytes| i16::from_le_bytes(bytes) as i32)
}

/// [`crate::kernel::interpolation::blend_table_q15`] by rows: the same bits.
#[inline(always)]
pub(crate) fn blend_pairs(words: Words<'_>, start: u32, light_count: u32, light: Taps, view: Taps) -> i32 {
    let table = Table::of_pairs(words, start, light_count);
    let row = |view: u32, weight: i32| {
        let row = table.row(view);
        let at = |light: u32, weight: i32| entry(row, light).wrapping_mul(weight);
        let sum = at(light.a, light.weight_a_q15).wrapping_add(at(light.b, light.weight_b_q15));
        multiply_q15(sum.wrapping_add(at(light.c, light.weight_c_q15)), weight)
    };
    row(view.a, view.weight_a_q15)
        .wrapping_add(row(view.b, view.weight_b_q15))
        .wrapping_add(row(view.c, view.weight_c_q15))
}
