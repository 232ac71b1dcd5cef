//! Advice on sparse ensembles: unused atoms and dictionaries, coarse values, one record that is much larger
//! than the others.

use crate::methods::advice::{Advice, Advise, UNUSED_ATOMS, has_own_dictionary, report_count};
use crate::methods::sparse_ensemble::file::{blocks_of_level, record_coefficients};
use crate::methods::sparse_ensemble::layout::{ATOM_WORDS, atom_list, factor_entry};
use rayon::prelude::*;
use selvedge::Selvedge;
use selvedge::kernel::material::{CHANNEL_FULL, channel_of};
use selvedge::kernel::words::word;
use selvedge::method::sparse_ensemble::check::COEFFICIENTS;
use selvedge::method::sparse_ensemble::cost::record_operations;
use selvedge::method::sparse_ensemble::{Tables, tables_of};
use selvedge::method::sparse_ensemble::{coefficients_start, read_record};

static UNUSED_DICTIONARIES: Advice = Advice {
    id: "W2",
    name: "UnusedDictionaries",
    expected: "every own dictionary is in a record",
    hint: "selvedge trim removes them; found is their number",
};

static UNREACHED_VALUES: Advice = Advice {
    id: "W4",
    name: "UnreachedValues",
    expected: "an atom's values use more than a quarter of its range",
    hint: "a smaller step would make its values finer; found is the number of such atoms",
};

static PRICE_OF_ONE_RECORD: Advice = Advice {
    id: "W5",
    name: "PriceOfOneRecord",
    expected: "the largest record costs at most 16 times the mean",
    hint: "one block sets the stated price of all; found is its count",
};

/// All of them.
pub const ADVICE: &[&Advice] =
    &[&UNUSED_ATOMS, &UNUSED_DICTIONARIES, &UNREACHED_VALUES, &PRICE_OF_ONE_RECORD];

/// Coefficients of an atom from which on their range is judged.
const ENOUGH: u32 = 32;
/// How many times the mean the largest record may cost.
const DEAR: u64 = 16;
/// Blocks of a section, and coefficients of its largest record, from which on its cost is judged.
const ENOUGH_BLOCKS: u32 = 16;
const LARGE_RECORD: u32 = 64;

/// What was seen of an atom, values in parts of 65,536.
#[derive(Clone, Copy)]
struct Use {
    count: u32,
    least: u32,
    most: u32,
}

/// Walks the records of a legal material.
pub fn advise(opened: &Selvedge<'_>, advise: &mut Advise<'_>) {
    let words = opened.words();
    let material = opened.material();
    let is_full = |number: &u32| channel_of(material, *number).state == CHANNEL_FULL;
    let full: Vec<Tables> = (0..3).filter(is_full).map(|number| tables_of(material, number)).collect();
    let seen: Vec<_> = full.par_iter().map(|tables| uses(opened, *tables)).collect();
    for (&tables, (atoms, dictionaries)) in full.iter().zip(seen) {
        // Atoms are always in the material's own file, so a word's number is a fourth of its byte offset.
        let all = || {
            (0u32..).zip(&atoms).flat_map(|(k, list)| {
                let [_, first] = atom_list(words, tables, k);
                (0u32..).zip(list).map(move |(i, used)| ((first + i * ATOM_WORDS) * 4, used))
            })
        };
        let unused = all().filter(|(_, used)| used.count == 0);
        report_count(&UNUSED_ATOMS, &mut unused.map(|(at, _)| at), advise);
        let narrow = |used: &Use| used.count >= ENOUGH && (used.most - used.least + 1) * 4 <= 1 << 16;
        let unreached = all().filter(|(_, used)| narrow(used));
        report_count(&UNREACHED_VALUES, &mut unreached.map(|(at, _)| at), advise);
        if has_own_dictionary(opened) {
            let unused = (0u32..).zip(&dictionaries).filter(|(_, used)| !**used);
            let mut offsets = unused.map(|(k, _)| factor_entry(tables.angular_start, k) * 4);
            report_count(&UNUSED_DICTIONARIES, &mut offsets, advise);
        }
    }
    costs(opened, advise);
}

/// How atoms are used, by dictionary; and which dictionaries are.
fn uses(opened: &Selvedge<'_>, tables: Tables) -> (Vec<Vec<Use>>, Vec<bool>) {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let count = word(words, tables.atoms_start);
    let fresh = Use { count: 0, least: u32::MAX, most: 0 };
    let mut atoms: Vec<Vec<Use>> =
        (0..count).map(|k| vec![fresh; atom_list(words, tables, k)[0] as usize]).collect();
    let mut dictionaries = vec![false; count as usize];
    for level in 0..header.level_count {
        for layer in 0..header.layer_count {
            let start = coefficients_start(words, material, tables.full_rank, level, layer);
            for block in 0..blocks_of_level(opened, level) {
                let record = read_record(words, start, block);
                if record.count == 0 {
                    continue;
                }
                let k = record.dictionary as usize;
                dictionaries[k] = true;
                record_coefficients(words, record, |position, value| {
                    let used = &mut atoms[k][position as usize];
                    let value = value << (16 - record.value_bits);
                    let (least, most) = (used.least.min(value), used.most.max(value));
                    *used = Use { count: used.count + 1, least, most };
                });
            }
        }
    }
    (atoms, dictionaries)
}

/// One record much larger than the mean of its section.
fn costs(opened: &Selvedge<'_>, advise: &mut Advise<'_>) {
    let (header, words) = (opened.header(), opened.words());
    for section in opened.sections().filter(|section| section.kind == COEFFICIENTS) {
        let start = section.offset / 4;
        let (blocks, largest) = (word(words, start + 1), word(words, start + 3));
        if blocks < ENOUGH_BLOCKS || largest < LARGE_RECORD {
            continue;
        }
        let of_block = |block| record_operations(read_record(words, start, block).count, header.edge);
        let sum: u64 = (0..blocks).map(of_block).sum();
        if record_operations(largest, header.edge) * blocks as u64 > DEAR * sum {
            advise(&PRICE_OF_ONE_RECORD, section.offset, largest);
        }
    }
}
