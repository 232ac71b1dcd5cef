//! The reader: a file becomes a model, the way back from [`crate::format::write`].
//!
//! The core opens the file first, so that nothing illegal gets this far. A file that this writer made is
//! written again with the same bytes. A file of another encoder may have other triangles or another grid
//! than the written rule (5.8) gives, or wider fields; a model has none of these, so the writer makes them
//! anew. Fields and the grid change no result. Triangles do: [`same_triangles`] tells.

use crate::format::model::{
    AtomModel, AtomShifts, ChannelModel, CoefficientsModel, DictionaryModel, EnsembleModel, FactorModel,
    ListsModel, MaterialModel, MetadataModel, PairTableModel, RecordModel, TensorModel, TransferModel,
};
use crate::format::triangulate::triangulate;
use selvedge::direction::{hull_start, point, triangles_start};
use selvedge::directory::OPTIONAL;
use selvedge::ensemble::{Record, coefficients_start, read_record};
use selvedge::material::{
    CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR, TRANSFER_LINEAR, level_size,
};
use selvedge::stream::{Ones, window};
use selvedge::tensor::{LIST_END, light_entry, lists_start, next_coefficient, open_list};
use selvedge::words::{Words, high_i16, low_i16, low_part, packed_i16, word};
use selvedge::{Finding, Limits, Selvedge};

/// Opens a material and takes it apart; factors of an external dictionary become the model's own.
///
/// # Errors
/// The first broken rule, as [`selvedge::open_with`].
pub fn read_model(file: &[u8], dictionary: Option<&[u8]>, limits: &Limits) -> Result<MaterialModel, Finding> {
    Ok(model_of(&selvedge::open_with(file, dictionary, limits)?))
}

/// The model of an open material.
pub fn model_of(opened: &Selvedge<'_>) -> MaterialModel {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let metadata = opened.metadata();
    let is_tensor = header.method == METHOD_SPARSE_TENSOR;
    let transfer = if header.transfer == TRANSFER_LINEAR {
        TransferModel::Linear { exponent: header.transfer_parameter as i32 }
    } else {
        TransferModel::Log2 { offset: f32::from_bits(header.transfer_parameter) }
    };
    let bytes_of = |section: &selvedge::Section| {
        words.file[section.offset as usize..][..section.length as usize].to_vec()
    };
    MaterialModel {
        size: [header.width, header.height],
        level_count: header.level_count,
        edge: header.edge,
        layer_count: header.layer_count,
        transfer,
        cosine_included: header.cosine_included != 0,
        matrix_q13: header.matrix_q13.map(|entry| entry as i16),
        metadata: MetadataModel {
            texel_nm: [metadata.texel_width_nm, metadata.texel_height_nm],
            frame: metadata.frame,
            image_origin: metadata.image_origin,
            primaries: metadata.primaries,
            texts: [metadata.name, metadata.origin, metadata.licence].map(str::to_owned),
        },
        lights: points(words, material.light_start),
        views: (material.view_start != material.light_start).then(|| points(words, material.view_start)),
        channels: material.channels.map(|channel| ChannelModel {
            mean: (channel.state != CHANNEL_MISSING).then(|| pair_table(opened, channel.mean_start)),
            scale: (channel.scale_start != 0).then(|| pair_table(opened, channel.scale_start)),
            ensemble: (channel.state == CHANNEL_FULL && !is_tensor).then(|| ensemble(opened, channel)),
        }),
        tensor: is_tensor.then(|| tensor(opened)),
        extras: opened
            .sections()
            .filter(|section| section.kind >= OPTIONAL)
            .map(|section| (section.kind as u16, section.instance as u16, bytes_of(&section)))
            .collect(),
    }
}

/// Whether the sets of directions of a file are triangulated as the writer would do it.
///
/// If not, a model read from it and written again has other results between sample directions.
pub fn same_triangles(opened: &Selvedge<'_>) -> bool {
    let words = opened.words();
    [opened.material().light_start, opened.material().view_start].iter().all(|&start| {
        let (triangles, hull) = (triangles_start(words, start), hull_start(words, start));
        let corners = |i: u32| {
            let (first, second) = (word(words, triangles + i * 3), word(words, triangles + i * 3 + 1));
            [first & 0xffff, first >> 16, second & 0xffff]
        };
        let written = triangulate(&points(words, start), Some(1));
        (0..word(words, start + 1)).map(corners).eq(written.triangles)
            && (0..word(words, start + 2)).map(|i| word(words, hull + i * 2) & 0xffff).eq(written.hull)
    })
}

fn points(words: Words<'_>, start: u32) -> Vec<[i32; 2]> {
    let at = |index: u32| {
        let pair = point(words, start, index);
        [low_i16(pair), high_i16(pair)]
    };
    (0..word(words, start)).map(at).collect()
}

/// Rows of packed numbers, each padded to a word.
fn packed_rows(words: Words<'_>, table: u32, rows: u32, columns: u32) -> Vec<i16> {
    let row_words = columns.div_ceil(2);
    (0..rows)
        .flat_map(|row| {
            (0..columns).map(move |column| packed_i16(words, table + row * row_words, column) as i16)
        })
        .collect()
}

fn pair_table(opened: &Selvedge<'_>, start: u32) -> PairTableModel {
    let (words, header) = (opened.words(), opened.header());
    PairTableModel {
        base_q20: word(words, start) as i32,
        shift: word(words, start + 1),
        entries: packed_rows(words, start + 4, header.view_count, header.light_count),
    }
}

fn ensemble(opened: &Selvedge<'_>, channel: Channel) -> EnsembleModel {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let factor = |section: u32, k: u32, second: u32, rows: u32| {
        let entry = section + 2 + k * 4 + second;
        let columns = word(words, entry);
        FactorModel { columns, entries: packed_rows(words, section + word(words, entry + 2), rows, columns) }
    };
    let count = word(words, channel.angular_start);
    let dictionaries = (0..count)
        .map(|k| DictionaryModel {
            light: factor(channel.angular_start, k, 0, header.light_count),
            view: factor(channel.angular_start, k, 1, header.view_count),
            x: factor(channel.spatial_start, k, 0, header.edge),
            y: factor(channel.spatial_start, k, 1, header.edge),
        })
        .collect();
    let atoms = (0..count)
        .map(|k| {
            let entry = channel.atoms_start + 2 + k * 2;
            let list = channel.atoms_start + word(words, entry + 1);
            (0..word(words, entry))
                .map(|i| atom(word(words, list + i * 2), word(words, list + i * 2 + 1)))
                .collect()
        })
        .collect();
    let coefficients = (0..header.level_count)
        .map(|level| {
            let blocks: u32 = [header.width, header.height]
                .iter()
                .map(|&size| level_size(size, level).div_ceil(header.edge))
                .product();
            let of_layer = |layer: u32| {
                let start = coefficients_start(words, material, channel, level, layer);
                let records =
                    (0..blocks).map(|block| record(words, read_record(words, start, block))).collect();
                CoefficientsModel { value_bits: word(words, start) & 0xff, records }
            };
            (0..header.layer_count).map(of_layer).collect()
        })
        .collect();
    EnsembleModel { dictionaries, atoms, coefficients }
}

fn tensor(opened: &Selvedge<'_>) -> TensorModel {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let channels = material.channels.map(|channel| channel.state == CHANNEL_FULL);
    if !header.has_texture() {
        return TensorModel { channels, ..TensorModel::default() };
    }
    let light_atoms = word(words, material.light_atoms_start);
    let light = |n: u32| {
        let entry = word(words, material.light_atoms_start + 2 + n);
        [0, 1, 2].map(|c| light_entry(entry, c) as i16)
    };
    let (count, entries) =
        (word(words, material.fibres_start), word(words, material.fibres_start + 1) & 0xff);
    let shifts = |n: u32| {
        let shifts = word(words, material.fibres_start + 2 + n);
        AtomShifts { angular: shifts & 31, gain: shifts >> 5 & 31 }
    };
    let of_level = |level: u32| {
        let texels: u32 = [header.width, header.height].iter().map(|&size| level_size(size, level)).product();
        let of_layer = |layer: u32| {
            let start = lists_start(words, material, level, layer);
            let head = word(words, start);
            let lists = (0..texels).map(|texel| list(words, start, count, texel)).collect();
            ListsModel { value_bits: head & 0xff, shift: head >> 24, lists }
        };
        (0..header.layer_count).map(of_layer).collect()
    };
    TensorModel {
        channels,
        light_atoms,
        lights: (0..header.light_count * light_atoms).map(light).collect(),
        entries,
        atoms: (0..count).map(shifts).collect(),
        fibres: (0..header.view_count * count * entries)
            .map(|n| packed_i16(words, material.fibres_start + 2 + count, n) as u16)
            .collect(),
        lists: (0..header.level_count).map(of_level).collect(),
    }
}

/// The ABRDF atoms and values of a texel's list (12.4).
pub(crate) fn list(words: Words<'_>, start: u32, atom_count: u32, texel: u32) -> Vec<(u32, u16)> {
    let mut list = open_list(words, start, atom_count, texel);
    let mut coefficients = Vec::new();
    while list.index != LIST_END {
        // The way back from 12.4-5.
        let value = (list.coefficient + 0x8000) as u32 >> (16 - list.value_bits);
        coefficients.push((list.index, value as u16));
        list = next_coefficient(words, list);
    }
    coefficients
}

fn atom(word: u32, quantiser: u32) -> AtomModel {
    AtomModel {
        light: word >> 14 & 0x3ff,
        view: word >> 4 & 0x3ff,
        x: word >> 24 & 0xf,
        y: word >> 28,
        shift: word & 0xf,
        base: quantiser as u16 as i16,
        step: (quantiser >> 16) as u16,
    }
}

/// The positions and values of a record (10.4), walked as the decoder does.
fn record(words: Words<'_>, record: Record) -> RecordModel {
    if record.count == 0 {
        return RecordModel::default();
    }
    let mut coefficients = Vec::with_capacity(record.count as usize);
    record_coefficients(words, record, |position, value| coefficients.push((position, value as u16)));
    RecordModel { dictionary: record.dictionary, shift: record.shift, coefficients }
}

/// Where the tables of a channel's dictionary are: first word and words of a row (10.1-3, 10.2-1); and its
/// atoms.
pub(crate) struct RecordTables {
    pub light: (u32, u32),
    pub view: (u32, u32),
    pub x: (u32, u32),
    pub y: (u32, u32),
    pub atoms: u32,
}

impl RecordTables {
    /// Of a dictionary by its number.
    pub fn of(words: Words<'_>, channel: Channel, dictionary: u32) -> RecordTables {
        let table = |section: u32, second: u32| {
            let entry = section + 2 + dictionary * 4 + second;
            (section + word(words, entry + 2), word(words, entry).div_ceil(2))
        };
        RecordTables {
            light: table(channel.angular_start, 0),
            view: table(channel.angular_start, 1),
            x: table(channel.spatial_start, 0),
            y: table(channel.spatial_start, 1),
            atoms: channel.atoms_start + word(words, channel.atoms_start + 3 + dictionary * 2),
        }
    }
}

/// Position and value of each coefficient of a record that has some.
pub(crate) fn record_coefficients(words: Words<'_>, record: Record, mut each: impl FnMut(u32, u32)) {
    let field_bits = record.low_bits + record.value_bits;
    // Coefficients are in the material's own file, whose words are numbered from zero.
    let bytes = &words.file[record.stream as usize * 4..];
    let mut ones = Ones::new(bytes, record.highs_bit, (bytes.len() as u64 * 8).min(u32::MAX as u64) as u32);
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
