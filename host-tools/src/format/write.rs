//! The writer: a model becomes the bytes of a file, laid out by chapter 3. One model gives one file.

use crate::format::model::{
    CoefficientsModel, EnsembleModel, FactorModel, ListsModel, MaterialModel, MetadataModel, PairTableModel,
    TensorModel, TransferModel,
};
use crate::format::triangulate::{Triangulation, triangulate};
use selvedge::cost::{Shape, filtered_operations, layer_operations, record_operations};
use selvedge::direction::{cross, dot_product};
use selvedge::direction_set::{cosine_of, reciprocal_of};
use selvedge::directory::{
    ANGULAR, ATOMS, COEFFICIENTS, DIRECTIONS, EXTERNAL, FIBRES, LIGHT_ATOMS, LISTS, MEANS, METADATA, SCALES,
    SPATIAL,
};
use selvedge::ensemble::{LOW_BITS_BITS, SHIFT_BITS};
use selvedge::ensemble_set::LOW_BITS_LIMIT;
use selvedge::header::{CONTENT_DICTIONARY, CONTENT_MATERIAL, HEADER_LENGTH, MAGIC};
use selvedge::tensor::{GROUP_TEXELS, bit_length, list_low_bits};
use selvedge::{crc32, sha256};

/// A section before layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// What it holds.
    pub kind: u32,
    /// Which of its kind.
    pub instance: u32,
    /// Its bytes, a multiple of four.
    pub bytes: Vec<u8>,
}

/// The header and the sections of a file whose directory is sound, to be changed and laid out again.
pub fn take_apart(file: &[u8]) -> ([u32; 32], Vec<Part>) {
    let word = |at: usize| u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]);
    let entry = |i: usize| {
        let at = 128 + i * 16;
        let (offset, length) = (word(at + 4) as usize, word(at + 8) as usize);
        Part {
            kind: word(at) & 0xffff,
            instance: word(at) >> 16,
            bytes: file[offset..offset + length].to_vec(),
        }
    };
    (std::array::from_fn(|i| word(i * 4)), (0..word(24) as usize).map(entry).collect())
}

/// Words in the byte order of the file.
pub fn words_to_bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// 16-bit numbers two to a word, each row padded to a word.
fn pack_rows(words: &mut Vec<u32>, entries: &[i16], columns: u32) {
    for row in entries.chunks(columns.max(1) as usize) {
        words.extend(
            row.chunks(2)
                .map(|pair| pair[0] as u16 as u32 | (pair.get(1).copied().unwrap_or(0) as u16 as u32) << 16),
        );
    }
}

/// A file that holds a material with its own dictionary.
pub fn write_material(model: &MaterialModel) -> Vec<u8> {
    material_file(model, None)
}

/// A dictionary file and the material that names it.
pub fn write_split(model: &MaterialModel) -> (Vec<u8>, Vec<u8>) {
    let dictionary = write_dictionary(&MaterialModel { extras: Vec::new(), ..model.clone() });
    (material_file(model, Some((&dictionary, false))), dictionary)
}

/// A material that names a dictionary file, whose angular factors its model repeats; its spatial factors are
/// in the dictionary, or its own.
pub fn write_with_dictionary(model: &MaterialModel, dictionary: &[u8], own_spatial: bool) -> Vec<u8> {
    material_file(model, Some((dictionary, own_spatial)))
}

fn material_file(model: &MaterialModel, external: Option<(&[u8], bool)>) -> Vec<u8> {
    let mut parts = vec![metadata_part(&model.metadata)];
    if let Some((dictionary, _)) = external {
        let mut bytes = sha256(dictionary).to_vec();
        bytes.extend(words_to_bytes(&[dictionary.len() as u32, 0, 0, 0]));
        parts.push(Part { kind: EXTERNAL, instance: 0, bytes });
    }
    let light = triangulate(&model.lights, None);
    parts.push(directions_part(0, &model.lights, &light));
    let view = model.views.as_ref().map(|views| {
        let view = triangulate(views, None);
        parts.push(directions_part(1, views, &view));
        view
    });
    let light_count = model.lights.len() as u32;
    for (kind, table) in [(MEANS, 0), (SCALES, 1)] {
        for (c, channel) in (0u32..).zip(&model.channels) {
            let table = if table == 0 { &channel.mean } else { &channel.scale };
            parts.extend(table.as_ref().map(|table| pair_table_part(kind, c, table, light_count)));
        }
    }
    let ensembles: Vec<(u32, &EnsembleModel)> = (0u32..)
        .zip(&model.channels)
        .filter_map(|(c, channel)| Some((c, channel.ensemble.as_ref()?)))
        .collect();
    let kinds: &[u32] = match external {
        None => &[ANGULAR, SPATIAL],
        Some((_, true)) => &[SPATIAL],
        Some((_, false)) => &[],
    };
    parts.extend(factor_parts(&ensembles, kinds));
    parts.extend(ensembles.iter().map(|&(c, ensemble)| atoms_part(c, ensemble)));
    let tensor = model.tensor.as_ref().filter(|_| model.has_texture());
    if let (Some(tensor), None) = (tensor, external) {
        parts.extend(tensor_atoms(tensor));
    }
    let mut textures = 0;
    for level in 0..model.level_count {
        let mut at_level = 0;
        for layer in 0..model.layer_count {
            for &(c, ensemble) in &ensembles {
                let coefficients = &ensemble.coefficients[level as usize][layer as usize];
                let largest =
                    coefficients.records.iter().map(|record| record.coefficients.len()).max().unwrap_or(0)
                        as u32;
                at_level += 4 * record_operations(largest, model.edge);
                let bytes = coefficients_bytes(coefficients, ensemble.dictionaries.len() as u32, largest);
                parts.push(Part { kind: COEFFICIENTS, instance: level << 8 | layer << 4 | c, bytes });
            }
            if let Some(tensor) = tensor {
                let lists = &tensor.lists[level as usize][layer as usize];
                let largest = lists.lists.iter().map(Vec::len).max().unwrap_or(0) as u32;
                at_level += layer_operations(largest, tensor.atoms.len() as u32, tensor.entries);
                parts.push(Part {
                    kind: LISTS,
                    instance: level << 8 | layer << 4,
                    bytes: lists_bytes(lists, tensor.atoms.len() as u32, largest),
                });
            }
        }
        textures = textures.max(at_level);
    }
    parts.extend(extra_parts(model));

    let view = view.as_ref().unwrap_or(&light);
    let states = [0, 1, 2].map(|c| model.state(c));
    let shape = Shape {
        candidates: [light.largest_cell(), view.largest_cell()],
        hull_counts: [light.hull.len() as u32, view.hull.len() as u32],
        means: states.iter().filter(|&&state| state > 0).count() as u32,
        scales: model.channels.iter().filter(|channel| channel.scale.is_some()).count() as u32,
    };
    let mut header = header_words(CONTENT_MATERIAL, model, states);
    header[7] = filtered_operations(shape, textures);
    header[8] = model.size[0];
    header[9] = model.size[1];
    header[12] = model.level_count;
    header[13] = model.edge | model.layer_count << 8;
    let (transfer, parameter) = match model.transfer {
        TransferModel::Log2 { offset } => (0, offset.to_bits()),
        TransferModel::Linear { exponent } => (1, exponent as u32),
    };
    header[15] = transfer | (model.cosine_included as u32) << 8;
    header[16] = parameter;
    let mut matrix = Vec::new();
    pack_rows(&mut matrix, &model.matrix_q13, 9);
    header[17..22].copy_from_slice(&matrix);
    lay_out(header, parts)
}

/// A dictionary file: the factors of a model, its name and its optional sections.
pub fn write_dictionary(model: &MaterialModel) -> Vec<u8> {
    let mut parts = vec![metadata_part(&model.metadata)];
    let ensembles: Vec<(u32, &EnsembleModel)> = (0u32..)
        .zip(&model.channels)
        .filter_map(|(c, channel)| Some((c, channel.ensemble.as_ref()?)))
        .collect();
    parts.extend(factor_parts(&ensembles, &[ANGULAR, SPATIAL]));
    parts.extend(model.tensor.iter().filter(|_| model.has_texture()).flat_map(tensor_atoms));
    parts.extend(extra_parts(model));
    let states = [0, 1, 2].map(|c| if model.state(c) == 2 { 2 } else { 0 });
    let mut header = header_words(CONTENT_DICTIONARY, model, states);
    header[8] = 1;
    header[9] = 1;
    header[12] = 1;
    header[13] = model.edge | 1 << 8;
    lay_out(header, parts)
}

/// What both contents state.
fn header_words(content: u32, model: &MaterialModel, states: [u32; 3]) -> [u32; 32] {
    let mut header = [0; 32];
    header[2] = 1;
    header[4] = content;
    header[5] = model.method();
    header[10] = model.lights.len() as u32;
    header[11] = model.views().len() as u32;
    header[14] = states[0] | states[1] << 8 | states[2] << 16;
    header
}

/// Header, directory, sections and padding (3.1, 3.2), checksums included.
pub fn lay_out(mut header: [u32; 32], mut parts: Vec<Part>) -> Vec<u8> {
    parts.sort_by_key(|part| (part.kind, part.instance));
    let mut bytes = vec![0u8; HEADER_LENGTH as usize + parts.len() * 16];
    for (i, part) in parts.iter().enumerate() {
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        let entry = [
            part.kind | part.instance << 16,
            bytes.len() as u32,
            part.bytes.len() as u32,
            crc32(0, &part.bytes),
        ];
        let at = HEADER_LENGTH as usize + i * 16;
        bytes[at..at + 16].copy_from_slice(&words_to_bytes(&entry));
        bytes.extend(&part.bytes);
    }
    bytes.resize(bytes.len().next_multiple_of(16), 0);
    header[3] = bytes.len() as u32;
    header[6] = parts.len() as u32;
    bytes[..128].copy_from_slice(&words_to_bytes(&header));
    bytes[..8].copy_from_slice(&MAGIC);
    repair_header_checksum(&mut bytes);
    bytes
}

/// Writes the header's checksum anew (3.1-6).
pub fn repair_header_checksum(bytes: &mut [u8]) {
    let count = u32::from_le_bytes([bytes[24], bytes[25], bytes[26], bytes[27]]) as usize;
    let end = (128 + count.min(4096) * 16).min(bytes.len());
    let sum = crc32(crc32(0, &bytes[..124]), &bytes[128..end]);
    bytes[124..128].copy_from_slice(&sum.to_le_bytes());
}

/// Writes every checksum anew, as far as the directory can be followed; for tests that damage files.
pub fn repair_checksums(bytes: &mut [u8]) {
    if bytes.len() < 128 {
        return;
    }
    let word = |bytes: &[u8], at: usize| {
        bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])) as usize
    };
    let count = word(bytes, 24).min(4096);
    let whole = count.min((bytes.len() - 128) / 16);
    for entry in (0..whole).map(|i| 128 + i * 16) {
        let (offset, length) = (word(bytes, entry + 4), word(bytes, entry + 8));
        if let Some(section) = bytes.get(offset..offset.saturating_add(length)) {
            let sum = crc32(0, section);
            bytes[entry + 12..entry + 16].copy_from_slice(&sum.to_le_bytes());
        }
    }
    repair_header_checksum(bytes);
}

fn metadata_part(metadata: &MetadataModel) -> Part {
    let mut bytes = words_to_bytes(&[
        metadata.texel_nm[0],
        metadata.texel_nm[1],
        metadata.frame,
        metadata.image_origin,
        metadata.primaries,
        0,
        0,
        0,
    ]);
    for text in &metadata.texts {
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    Part { kind: METADATA, instance: 0, bytes }
}

/// A set of directions as a section (5.3).
pub fn directions_part(instance: u32, points: &[[i32; 2]], t: &Triangulation) -> Part {
    let mut words = vec![
        points.len() as u32,
        t.triangles.len() as u32,
        t.hull.len() as u32,
        t.grid_size,
        t.candidates.len() as u32,
        0,
        0,
        0,
    ];
    for &[x, y] in points {
        words.extend([x as u16 as u32 | (y as u16 as u32) << 16, cosine_of(x, y)]);
    }
    for &[a, b, c] in &t.triangles {
        let [p, q, r] = [a, b, c].map(|i| points[i as usize]);
        let area = cross(p[0], p[1], q[0], q[1], r[0], r[1]);
        let (shift, reciprocal) = reciprocal_of(area as u32);
        words.extend([a | b << 16, c | shift << 16, reciprocal]);
    }
    for (i, &a) in t.hull.iter().enumerate() {
        let (p, q) = (points[a as usize], points[t.hull[(i + 1) % t.hull.len()] as usize]);
        let (shift, reciprocal) = reciprocal_of(dot_product(p[0], p[1], q[0], q[1], q[0], q[1]) as u32);
        words.extend([a | shift << 16, reciprocal]);
    }
    words.extend(&t.starts);
    words.extend(&t.candidates);
    Part { kind: DIRECTIONS, instance, bytes: words_to_bytes(&words) }
}

fn pair_table_part(kind: u32, channel: u32, table: &PairTableModel, light_count: u32) -> Part {
    let mut words = vec![table.base_q20 as u32, table.shift, 0, 0];
    pack_rows(&mut words, &table.entries, light_count);
    Part { kind, instance: channel, bytes: words_to_bytes(&words) }
}

fn extra_parts(model: &MaterialModel) -> impl Iterator<Item = Part> + '_ {
    model.extras.iter().map(|(kind, instance, bytes)| Part {
        kind: *kind as u32,
        instance: *instance as u32,
        bytes: bytes.clone(),
    })
}

fn factor_parts(ensembles: &[(u32, &EnsembleModel)], kinds: &[u32]) -> Vec<Part> {
    let mut parts = Vec::new();
    for &(c, ensemble) in ensembles {
        for &kind in kinds {
            let pairs: Vec<[&FactorModel; 2]> = ensemble
                .dictionaries
                .iter()
                .map(|d| if kind == ANGULAR { [&d.light, &d.view] } else { [&d.x, &d.y] })
                .collect();
            let mut words = vec![pairs.len() as u32, 0];
            let mut tables = Vec::new();
            let head = 2 + pairs.len() as u32 * 4;
            for pair in &pairs {
                words.extend(pair.map(|factor| factor.columns));
                for factor in pair {
                    words.push(head + tables.len() as u32);
                    pack_rows(&mut tables, &factor.entries, factor.columns);
                }
            }
            words.extend(tables);
            parts.push(Part { kind, instance: c, bytes: words_to_bytes(&words) });
        }
    }
    parts
}

fn atoms_part(channel: u32, ensemble: &EnsembleModel) -> Part {
    let mut words = vec![ensemble.atoms.len() as u32, 0];
    let mut start = 2 + ensemble.atoms.len() as u32 * 2;
    for atoms in &ensemble.atoms {
        words.extend([atoms.len() as u32, start]);
        start += atoms.len() as u32 * 2;
    }
    words.extend(ensemble.atoms.iter().flatten().flat_map(|atom| [atom.word(), atom.quantiser()]));
    Part { kind: ATOMS, instance: channel, bytes: words_to_bytes(&words) }
}

/// Bits, lowest first.
#[derive(Default)]
struct BitWriter {
    words: Vec<u32>,
    length: u32,
}

impl BitWriter {
    fn push(&mut self, value: u32, count: u32) {
        for i in 0..count {
            if self.length % 32 == 0 {
                self.words.push(0);
            }
            *self.words.last_mut().expect("just pushed") |=
                (value.checked_shr(i).unwrap_or(0) & 1) << (self.length % 32);
            self.length += 1;
        }
    }

    /// Ascending positions and their values: low parts with values, then high parts in unary (10.4-4,
    /// 10.4-5). Gives the last high part.
    fn push_list(&mut self, list: &[(u32, u16)], low_bits: u32, value_bits: u32) -> u32 {
        for &(position, value) in list {
            self.push(position, low_bits);
            self.push(value as u32, value_bits);
        }
        let mut high = 0;
        for &(position, _) in list {
            self.push(0, (position >> low_bits) - high);
            self.push(1, 1);
            high = position >> low_bits;
        }
        high
    }
}

/// Bits that hold `0 ..= largest`.
fn bits_for(largest: u32) -> u32 {
    32 - largest.leading_zeros()
}

/// The number of low bits that makes the positions of a record shortest (10.4, Elias-Fano).
fn best_low_bits(positions: impl Iterator<Item = u32> + Clone) -> u32 {
    let count = positions.clone().count() as u32;
    let last = positions.last().unwrap_or(0);
    (0..=LOW_BITS_LIMIT).min_by_key(|&low| count * low + (last >> low)).unwrap_or(0)
}

fn coefficients_bytes(coefficients: &CoefficientsModel, dictionaries: u32, largest: u32) -> Vec<u8> {
    let dictionary_bits = bits_for(dictionaries - 1);
    let count_bits = bits_for(largest).max(1);
    let mut stream = BitWriter::default();
    let mut starts = Vec::with_capacity(coefficients.records.len());
    for record in &coefficients.records {
        starts.push(stream.length);
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
        coefficients.value_bits | dictionary_bits << 8 | count_bits << 16,
        coefficients.records.len() as u32,
        stream.length,
        largest,
    ];
    words.extend(starts);
    words.extend(stream.words);
    words_to_bytes(&words)
}

/// Light atoms and fibres (12.1, 12.2).
fn tensor_atoms(tensor: &TensorModel) -> [Part; 2] {
    let mut words = vec![tensor.light_atoms, 0];
    let field = |entry: &[i16; 3], c: usize| (entry[c] as u32 & 0x3ff) << (c * 10);
    words.extend(tensor.lights.iter().map(|entry| field(entry, 0) | field(entry, 1) | field(entry, 2)));
    let light = Part { kind: LIGHT_ATOMS, instance: 0, bytes: words_to_bytes(&words) };
    let mut words = vec![tensor.atoms.len() as u32, tensor.entries | bit_length(tensor.light_atoms - 1) << 8];
    words.extend(tensor.atoms.iter().map(|atom| atom.angular | atom.gain << 5));
    let entries: Vec<i16> = tensor.fibres.iter().map(|&entry| entry as i16).collect();
    pack_rows(&mut words, &entries, entries.len() as u32);
    [light, Part { kind: FIBRES, instance: 0, bytes: words_to_bytes(&words) }]
}

/// A section of lists (12.3, 12.4).
fn lists_bytes(model: &ListsModel, atoms: u32, largest: u32) -> Vec<u8> {
    let (count_bits, index_bits) = (bits_for(largest).max(1), bit_length(atoms - 1));
    let mut stream = BitWriter::default();
    let mut starts = Vec::new();
    for group in model.lists.chunks(GROUP_TEXELS as usize) {
        starts.push(stream.length);
        for n in 0..GROUP_TEXELS as usize {
            stream.push(group.get(n).map_or(0, Vec::len) as u32, count_bits);
        }
        for list in group.iter().filter(|list| !list.is_empty()) {
            let low_bits = list_low_bits(index_bits, list.len() as u32);
            let high = stream.push_list(list, low_bits, model.value_bits);
            stream.push(0, ((atoms - 1) >> low_bits) - high);
        }
    }
    let head = model.value_bits | count_bits << 8 | index_bits << 16 | model.shift << 24;
    let mut words = vec![head, model.lists.len() as u32, stream.length, largest];
    words.extend(starts);
    words.extend(stream.words);
    words_to_bytes(&words)
}
