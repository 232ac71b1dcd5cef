//! Records unpacked for whole images and batches: each coefficient once, then used for many samples.

use crate::fast::table::{Table, bytes_from, entry};
use crate::kernel::direction::Taps;
use crate::kernel::fixed::HALF_Q15;
use crate::kernel::material::Material;
use crate::kernel::words::{Words, word};
use crate::method::sparse_ensemble::{Record, Tables, coefficients_start, dequantise, read_record};
use crate::walk::stream::{Ones, window};

/// One coefficient of a record, ready for products.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Coefficient {
    /// The atom's word (10.5-2).
    pub atom: u32,
    /// Its number in the list of the dictionary.
    pub position: u32,
    /// The integer coefficient.
    pub value: i32,
}

/// The record of a block in a layer.
pub(crate) fn record_of(
    words: Words<'_>,
    material: &Material,
    tables: Tables,
    level: u32,
    layer: u32,
    block: u32,
) -> Record {
    read_record(words, coefficients_start(words, material, tables.full_rank, level, layer), block)
}

/// The atoms of dictionary `dictionary`: pairs of words.
pub(crate) fn atoms_of<'a>(words: Words<'a>, tables: Tables, dictionary: u32) -> &'a [[u8; 8]] {
    let entry = tables.atoms_start.wrapping_add(2).wrapping_add(dictionary.wrapping_mul(2));
    let count = word(words, entry) as usize;
    let start = tables.atoms_start.wrapping_add(word(words, entry.wrapping_add(1)));
    let list = bytes_from(words, start).as_chunks::<8>().0;
    list.get(..count).unwrap_or(list)
}

/// Calls `each` for the coefficients of a record, in order.
#[inline(always)]
pub(crate) fn for_each_coefficient(
    words: Words<'_>,
    tables: Tables,
    record: &Record,
    mut each: impl FnMut(Coefficient),
) {
    let stream = bytes_from(words, record.stream);
    let atoms = atoms_of(words, tables, record.dictionary);
    let field_bits = record.low_bits.wrapping_add(record.value_bits);
    let low_mask = (1u32 << record.low_bits).wrapping_sub(1);
    let value_mask = (1u32 << record.value_bits).wrapping_sub(1);
    let mut ones = Ones::new(stream, record.highs_bit, u32::MAX);
    let mut field_bit = record.fields_bit;
    for index in 0..record.count {
        let Some(place) = ones.take() else { return };
        let high = place.wrapping_sub(record.highs_bit).wrapping_sub(index);
        let field = window(stream, field_bit) as u32;
        field_bit = field_bit.wrapping_add(field_bits);
        let position = (high << record.low_bits) | (field & low_mask);
        let Some(&[a0, a1, a2, a3, q0, q1, q2, q3]) = atoms.get(position as usize) else { return };
        let quantiser = u32::from_le_bytes([q0, q1, q2, q3]);
        let value = dequantise(quantiser, (field >> record.low_bits) & value_mask, record.value_bits);
        each(Coefficient { atom: u32::from_le_bytes([a0, a1, a2, a3]), position, value });
    }
}

/// Table `which` (0 or 1) of dictionary `dictionary` of the factors at `start`, in either file.
pub(crate) fn factor<'a>(words: Words<'a>, start: u32, dictionary: u32, which: u32) -> Table<'a> {
    let entry = start.wrapping_add(2).wrapping_add(dictionary.wrapping_mul(4));
    let columns = word(words, entry.wrapping_add(which));
    let table = start.wrapping_add(word(words, entry.wrapping_add(2).wrapping_add(which)));
    Table::new(words, table, columns)
}

/// Three rows of a table by the weights of taps.
#[derive(Clone, Copy)]
pub(crate) struct Blend<'a> {
    rows: [&'a [[u8; 2]]; 3],
    taps: Taps,
}

impl<'a> Blend<'a> {
    /// The rows that the taps name.
    #[inline(always)]
    pub fn rows(table: Table<'a>, taps: Taps) -> Blend<'a> {
        Blend { rows: [table.row(taps.a), table.row(taps.b), table.row(taps.c)], taps }
    }

    /// One column, Q15, one rounding (10.6-1).
    #[inline(always)]
    pub fn column(&self, column: u32) -> i32 {
        let [a, b, c] = self.rows;
        let sum = entry(a, column)
            .wrapping_mul(self.taps.weight_a_q15)
            .wrapping_add(entry(b, column).wrapping_mul(self.taps.weight_b_q15));
        sum.wrapping_add(entry(c, column).wrapping_mul(self.taps.weight_c_q15)).wrapping_add(HALF_Q15) >> 15
    }
}
