//! The writer: a model becomes the bytes of a file, laid out by chapter 3. One model gives one file.

use crate::format::bits::{pack_rows, words_to_bytes};
use crate::format::container::{HEADER_WORDS, RawSection, header_word, lay_out};
use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::format::triangulate::{Triangulation, triangulate};
use selvedge::container::directions::{cosine_of, reciprocal_of};
use selvedge::container::directory::{DIRECTIONS, EXTERNAL, MEANS, METADATA, SCALES};
use selvedge::container::header::{CONTENT_DICTIONARY, CONTENT_MATERIAL, MAJOR_VERSION};
use selvedge::kernel::direction::{cross, dot_product};
use selvedge::kernel::material::{CHANNEL_FULL, CHANNEL_MISSING, TRANSFER_LINEAR, TRANSFER_LOG2};
use selvedge::sha256;
use selvedge::walk::cost::{Shape, filtered_operations};

/// Bit of the layers in their word, and of the cosine flag in that of the transfer.
const SECOND_BYTE: u32 = 8;
/// Words of the colour matrix.
const MATRIX_WORDS: usize = 5;

/// A file that holds a material with its own dictionary.
pub fn write_material(model: &MaterialModel) -> Vec<u8> {
    material_file(model, None)
}

/// A material that references its dictionary, and the dictionary file.
pub fn write_split(model: &MaterialModel) -> (Vec<u8>, Vec<u8>) {
    let dictionary = write_dictionary(&MaterialModel { extras: Vec::new(), ..model.clone() });
    (material_file(model, Some((&dictionary, &[]))), dictionary)
}

/// A material that references a dictionary file, whose sections its model repeats; those of `own_kinds` are
/// its own nevertheless.
pub fn write_with_dictionary(model: &MaterialModel, dictionary: &[u8], own_kinds: &[u32]) -> Vec<u8> {
    material_file(model, Some((dictionary, own_kinds)))
}

/// A dictionary file: what the texture of a model can share, its name and its optional sections.
pub fn write_dictionary(model: &MaterialModel) -> Vec<u8> {
    let mut sections = vec![metadata_section(&model.metadata)];
    sections.extend(model.texture.dictionary_sections());
    sections.extend(extra_sections(model));
    let full = |full: bool| if full { CHANNEL_FULL } else { CHANNEL_MISSING };
    let mut header = header_words(CONTENT_DICTIONARY, model, model.texture.channels().map(full));
    header[header_word::WIDTH] = 1;
    header[header_word::HEIGHT] = 1;
    header[header_word::LEVELS] = 1;
    header[header_word::EDGE_AND_LAYERS] = model.edge | 1 << SECOND_BYTE;
    lay_out(header, sections)
}

/// The file of a material; with an external dictionary, its bytes and the kinds that are not taken from it.
fn material_file(model: &MaterialModel, external: Option<(&[u8], &[u32])>) -> Vec<u8> {
    let mut sections = vec![metadata_section(&model.metadata)];
    let mut shared = model.texture.dictionary_sections();
    if let Some((dictionary, own_kinds)) = external {
        sections.push(external_section(dictionary));
        shared.retain(|section| own_kinds.contains(&section.kind));
    }
    let light = triangulate(&model.lights, None);
    sections.push(directions_section(0, &model.lights, &light));
    let view = model.views.as_ref().map(|views| {
        let view = triangulate(views, None);
        sections.push(directions_section(1, views, &view));
        view
    });
    let light_count = model.lights.len() as u32;
    for (c, ChannelModel { mean, scale }) in (0u32..).zip(&model.channels) {
        let table = |kind, table| pair_table_section(kind, c, table, light_count);
        sections.extend(mean.as_ref().map(|mean| table(MEANS, mean)));
        sections.extend(scale.as_ref().map(|scale| table(SCALES, scale)));
    }
    sections.extend(shared);
    sections.extend(model.texture.own_sections());
    sections.extend(extra_sections(model));

    let view = view.as_ref().unwrap_or(&light);
    let shape = Shape {
        candidates: [light.largest_cell(), view.largest_cell()],
        hull_counts: [light.hull.len() as u32, view.hull.len() as u32],
        means: model.channels.iter().filter(|channel| channel.mean.is_some()).count() as u32,
        scales: model.channels.iter().filter(|channel| channel.scale.is_some()).count() as u32,
    };
    let of_level = |level: u32| model.texture.operations(model.edge, level as usize);
    let textures = if model.has_texture() { (0..model.level_count).map(of_level).max() } else { None };
    let mut header = header_words(CONTENT_MATERIAL, model, [0, 1, 2].map(|c| model.state(c)));
    header[header_word::OPERATIONS] = filtered_operations(shape, textures.unwrap_or(0));
    header[header_word::WIDTH] = model.size[0];
    header[header_word::HEIGHT] = model.size[1];
    header[header_word::LEVELS] = model.level_count;
    header[header_word::EDGE_AND_LAYERS] = model.edge | model.layer_count << SECOND_BYTE;
    let (transfer, parameter) = match model.transfer {
        TransferModel::Log2 { offset } => (TRANSFER_LOG2, offset.to_bits()),
        TransferModel::Linear { exponent } => (TRANSFER_LINEAR, exponent as u32),
    };
    header[header_word::TRANSFER] = transfer | (model.cosine_included as u32) << SECOND_BYTE;
    header[header_word::TRANSFER_PARAMETER] = parameter;
    let mut matrix = Vec::new();
    pack_rows(&mut matrix, &model.matrix_q13, model.matrix_q13.len() as u32);
    header[header_word::MATRIX..][..MATRIX_WORDS].copy_from_slice(&matrix);
    lay_out(header, sections)
}

/// What both contents state.
fn header_words(content: u32, model: &MaterialModel, states: [u32; 3]) -> [u32; HEADER_WORDS] {
    let mut header = [0; HEADER_WORDS];
    header[header_word::VERSION] = MAJOR_VERSION;
    header[header_word::CONTENT] = content;
    header[header_word::METHOD] = model.method();
    header[header_word::LIGHTS] = model.lights.len() as u32;
    header[header_word::VIEWS] = model.views().len() as u32;
    header[header_word::STATES] = u32::from_le_bytes([states[0] as u8, states[1] as u8, states[2] as u8, 0]);
    header
}

/// The reference to a dictionary (3.5).
fn external_section(dictionary: &[u8]) -> RawSection {
    let mut bytes = sha256(dictionary).to_vec();
    bytes.extend(words_to_bytes(&[dictionary.len() as u32, 0, 0, 0]));
    RawSection { kind: EXTERNAL, instance: 0, bytes }
}

fn metadata_section(metadata: &MetadataModel) -> RawSection {
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
    RawSection { kind: METADATA, instance: 0, bytes }
}

/// A set of directions as a section (5.3).
pub fn directions_section(instance: u32, points: &[[i32; 2]], t: &Triangulation) -> RawSection {
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
    RawSection::of_words(DIRECTIONS, instance, &words)
}

/// A table for pairs of directions (8.1, 8.2).
fn pair_table_section(kind: u32, channel: u32, table: &PairTableModel, light_count: u32) -> RawSection {
    let mut words = vec![table.base_q20 as u32, table.shift, 0, 0];
    pack_rows(&mut words, &table.entries, light_count);
    RawSection::of_words(kind, channel, &words)
}

fn extra_sections(model: &MaterialModel) -> impl Iterator<Item = RawSection> + '_ {
    model.extras.iter().map(|(kind, instance, bytes)| RawSection {
        kind: *kind as u32,
        instance: *instance as u32,
        bytes: bytes.clone(),
    })
}
