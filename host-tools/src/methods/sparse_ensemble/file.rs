//! Sections of chapter 10: written, and read from an open material.

use crate::format::bits::{BitWriter, bits_for, pack_rows, packed_rows};
use crate::format::container::{RawSection, level_instance};
use crate::methods::sparse_ensemble::layout::{
    ATOM_WORDS, COUNT_BITS_BIT, COUNT_WORDS, DICTIONARY_BITS_BIT, FACTOR_ENTRY_WORDS, LIST_ENTRY_WORDS,
    atom_list, atom_of_list, factor_table, value_bits,
};
use crate::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel, RecordModel,
};
use selvedge::Selvedge;
use selvedge::kernel::material::{CHANNEL_FULL, channel_of, level_size};
use selvedge::kernel::words::{Words, low_part, word};
use selvedge::method::sparse_ensemble::check::LOW_BITS_LIMIT;
use selvedge::method::sparse_ensemble::check::{ANGULAR, ATOMS, COEFFICIENTS, SPATIAL};
use selvedge::method::sparse_ensemble::{LOW_BITS_BITS, Record, SHIFT_BITS, coefficients_start, read_record};
use selvedge::method::sparse_ensemble::{Tables, tables_of};
use selvedge::walk::stream::{Ones, window};

/// Angular and spatial factors of every channel (10.1, 10.2).
pub fn dictionary_sections(texture: &EnsembleTexture) -> Vec<RawSection> {
    let of_channel = |(c, ensemble): (usize, &EnsembleModel)| {
        let angular = ensemble.dictionaries.iter().map(|d| [&d.light, &d.view]).collect();
        let spatial = ensemble.dictionaries.iter().map(|d| [&d.x, &d.y]).collect();
        [factor_section(ANGULAR, c, angular), factor_section(SPATIAL, c, spatial)]
    };
    texture.full().flat_map(of_channel).collect()
}

/// Atoms and coefficients of every channel (10.3 to 10.5).
pub fn own_sections(texture: &EnsembleTexture) -> Vec<RawSection> {
    let mut sections = Vec::new();
    for (c, ensemble) in texture.full() {
        sections.push(atoms_section(c, ensemble));
        for (level, layers) in ensemble.coefficients.iter().enumerate() {
            for (layer, coefficients) in layers.iter().enumerate() {
                let words = coefficient_words(coefficients, ensemble.dictionaries.len() as u32);
                sections.push(RawSection::of_words(COEFFICIENTS, level_instance(level, layer, c), &words));
            }
        }
    }
    sections
}

/// The count of coefficients of the largest record.
pub fn largest_count(coefficients: &CoefficientsModel) -> u32 {
    coefficients.records.iter().map(|record| record.coefficients.len()).max().unwrap_or(0) as u32
}

/// Two tables of each dictionary.
fn factor_section(kind: u32, channel: usize, pairs: Vec<[&FactorModel; 2]>) -> RawSection {
    let mut words = vec![pairs.len() as u32, 0];
    let mut tables = Vec::new();
    let first = COUNT_WORDS + pairs.len() as u32 * FACTOR_ENTRY_WORDS;
    for pair in &pairs {
        words.extend(pair.map(|factor| factor.columns));
        for factor in pair {
            words.push(first + tables.len() as u32);
            pack_rows(&mut tables, &factor.entries, factor.columns);
        }
    }
    words.extend(tables);
    RawSection::of_words(kind, channel as u32, &words)
}

fn atoms_section(channel: usize, ensemble: &EnsembleModel) -> RawSection {
    let mut words = vec![ensemble.atoms.len() as u32, 0];
    let mut start = COUNT_WORDS + ensemble.atoms.len() as u32 * LIST_ENTRY_WORDS;
    for atoms in &ensemble.atoms {
        words.extend([atoms.len() as u32, start]);
        start += atoms.len() as u32 * ATOM_WORDS;
    }
    words.extend(ensemble.atoms.iter().flatten().flat_map(|atom| [atom.word(), atom.quantiser()]));
    RawSection::of_words(ATOMS, channel as u32, &words)
}

/// The number of low bits that makes the positions of a record shortest (10.4, Elias-Fano).
fn best_low_bits(positions: impl Iterator<Item = u32> + Clone) -> u32 {
    let count = positions.clone().count() as u32;
    let last = positions.last().unwrap_or(0);
    (0..=LOW_BITS_LIMIT).min_by_key(|&low| count * low + (last >> low)).unwrap_or(0)
}

/// A section of coefficients (10.3, 10.4).
fn coefficient_words(coefficients: &CoefficientsModel, dictionaries: u32) -> Vec<u32> {
    let largest = largest_count(coefficients);
    let dictionary_bits = bits_for(dictionaries - 1);
    let count_bits = bits_for(largest).max(1);
    let mut stream = BitWriter::default();
    let mut starts = Vec::with_capacity(coefficients.records.len());
    for record in &coefficients.records {
        starts.push(stream.length());
        let list = &record.coefficients;
        stream.push(list.len() as u32, count_bits);
        if list.is_empty() {
            stream.push(0, dictionary_bits + SHIFT_BITS + LOW_BITS_BITS);
            continue;
        }
        let low_bits = best_low_bits(list.iter().map(|c| c.0));
        stream.push(record.dictionary, dictionary_bits);
        stream.push(record.shift, SHIFT_BITS);
        stream.push(low_bits, LOW_BITS_BITS);
        stream.push_list(list, low_bits, coefficients.value_bits);
    }
    let mut words = vec![
        coefficients.value_bits | dictionary_bits << DICTIONARY_BITS_BIT | count_bits << COUNT_BITS_BIT,
        coefficients.records.len() as u32,
        stream.length(),
        largest,
    ];
    words.extend(starts);
    words.extend(stream.into_words());
    words
}

/// The textures of an open material.
pub fn read(opened: &Selvedge<'_>) -> EnsembleTexture {
    let material = opened.material();
    let channel = |number: u32| {
        let full = channel_of(material, number).state == CHANNEL_FULL;
        full.then(|| read_ensemble(opened, tables_of(material, number)))
    };
    EnsembleTexture { channels: [0, 1, 2].map(channel) }
}

fn read_ensemble(opened: &Selvedge<'_>, tables: Tables) -> EnsembleModel {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let factor = |section: u32, k: u32, second: u32, rows: u32| {
        let [columns, table] = factor_table(words, section, k, second);
        FactorModel { columns, entries: packed_rows(words, table, rows, columns) }
    };
    let count = word(words, tables.atoms_start);
    let dictionary = |k: u32| DictionaryModel {
        light: factor(tables.angular_start, k, 0, header.light_count),
        view: factor(tables.angular_start, k, 1, header.view_count),
        x: factor(tables.spatial_start, k, 0, header.edge),
        y: factor(tables.spatial_start, k, 1, header.edge),
    };
    let atoms = |k: u32| {
        let [length, list] = atom_list(words, tables, k);
        let atom = |i: u32| {
            let [word, quantiser] = atom_of_list(words, list, i);
            AtomModel::of_words(word, quantiser)
        };
        (0..length).map(atom).collect()
    };
    let of_level = |level: u32| {
        let blocks = blocks_of_level(opened, level);
        let of_layer = |layer: u32| {
            let start = coefficients_start(words, material, tables.full_rank, level, layer);
            let record = |block: u32| read_record_model(words, read_record(words, start, block));
            let records = (0..blocks).map(record).collect();
            CoefficientsModel { value_bits: value_bits(word(words, start)), records }
        };
        (0..header.layer_count).map(of_layer).collect()
    };
    EnsembleModel {
        dictionaries: (0..count).map(dictionary).collect(),
        atoms: (0..count).map(atoms).collect(),
        coefficients: (0..header.level_count).map(of_level).collect(),
    }
}

/// Blocks of a level.
pub fn blocks_of_level(opened: &Selvedge<'_>, level: u32) -> u32 {
    let header = opened.header();
    [header.width, header.height].iter().map(|&size| level_size(size, level).div_ceil(header.edge)).product()
}

/// The positions and values of a record (10.4), walked as the decoder does.
fn read_record_model(words: Words<'_>, record: Record) -> RecordModel {
    if record.count == 0 {
        return RecordModel::default();
    }
    let mut coefficients = Vec::with_capacity(record.count as usize);
    record_coefficients(words, record, |position, value| coefficients.push((position, value as u16)));
    RecordModel { dictionary: record.dictionary, shift: record.shift, coefficients }
}

/// Position and value of each coefficient of a record that has some.
pub fn record_coefficients(words: Words<'_>, record: Record, mut each: impl FnMut(u32, u32)) {
    let field_bits = record.low_bits + record.value_bits;
    // Coefficients are in the material's own file, whose words are numbered from zero.
    let bytes = &words.file[record.stream as usize * 4..];
    let end = (bytes.len() as u64 * 8).min(u32::MAX as u64) as u32;
    let mut ones = Ones::new(bytes, record.highs_bit, end);
    for index in 0..record.count {
        let Some(place) = ones.take() else { return };
        let high = place - record.highs_bit - index;
        let field = window(bytes, record.fields_bit + index * field_bits) as u32;
        each(
            high << record.low_bits | low_part(field, record.low_bits),
            low_part(field >> record.low_bits, record.value_bits),
        );
    }
}
