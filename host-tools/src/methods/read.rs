//! The reader: an open material becomes a model again.
//!
//! The core opens the file first, so that nothing illegal gets this far. A file that this writer made is
//! written again with the same bytes. A file of another encoder may have other triangles or another grid
//! than the written rule (5.8) gives, or wider fields; a model has none of these, so the writer recomputes
//! them. Fields and the grid change no result. Triangles do: see [`same_triangles`].

use crate::format::bits::packed_rows;
use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::format::triangulate::triangulate;
use crate::methods::registry;
use selvedge::container::directory::OPTIONAL;
use selvedge::kernel::direction::{hull_start, point, triangles_start};
use selvedge::kernel::material::{Channel, TRANSFER_LINEAR};
use selvedge::kernel::words::{Words, high_i16, low_i16, word};
use selvedge::{Finding, Limits, Section, Selvedge};

/// Words in front of the rows of a table for pairs (8.1-5).
const TABLE_WORDS: u32 = 4;
/// Words of a triangle (5.4) and of a hull edge (5.7).
const TRIANGLE_WORDS: u32 = 3;
const HULL_WORDS: u32 = 2;

/// Opens a material and takes it apart; factors of an external dictionary become the model's own.
///
/// # Errors
/// The first broken rule, as [`selvedge::open_with`].
pub fn read_model(file: &[u8], dictionary: Option<&[u8]>, limits: &Limits) -> Result<MaterialModel, Finding> {
    model_of(&selvedge::open_with(file, dictionary, limits)?)
}

/// The model of an open material.
///
/// # Errors
/// Rule 3.1-8 if the tools do not have its method ([`crate::methods::METHODS`]).
pub fn model_of(opened: &Selvedge<'_>) -> Result<MaterialModel, Finding> {
    let method = registry::of(opened)?;
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let metadata = opened.metadata();
    let transfer = if header.transfer == TRANSFER_LINEAR {
        TransferModel::Linear { exponent: header.transfer_parameter as i32 }
    } else {
        TransferModel::Log2 { offset: f32::from_bits(header.transfer_parameter) }
    };
    let table = |start: u32| (start != 0).then(|| pair_table(opened, start));
    let channel = |channel: Channel| ChannelModel {
        mean: table(channel.mean_start),
        scale: table(channel.scale_start),
    };
    let bytes_of =
        |section: &Section| words.file[section.offset as usize..][..section.length as usize].to_vec();
    let extra = |section: Section| (section.kind as u16, section.instance as u16, bytes_of(&section));
    Ok(MaterialModel {
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
        channels: material.channels.map(channel),
        texture: (method.read)(opened),
        extras: opened.sections().filter(|section| section.kind >= OPTIONAL).map(extra).collect(),
    })
}

/// Whether the sets of directions of a file are triangulated as the writer would do it.
///
/// If not, a model read from it and written again has other results between sample directions.
pub fn same_triangles(opened: &Selvedge<'_>) -> bool {
    let words = opened.words();
    [opened.material().light_start, opened.material().view_start].iter().all(|&start| {
        let (triangles, hull) = (triangles_start(words, start), hull_start(words, start));
        let corners = |i: u32| {
            let [first, second] = [0, 1].map(|n| word(words, triangles + i * TRIANGLE_WORDS + n));
            [first & 0xffff, first >> 16, second & 0xffff]
        };
        let written = triangulate(&points(words, start), Some(1));
        (0..word(words, start + 1)).map(corners).eq(written.triangles)
            && (0..word(words, start + 2))
                .map(|i| word(words, hull + i * HULL_WORDS) & 0xffff)
                .eq(written.hull)
    })
}

fn points(words: Words<'_>, start: u32) -> Vec<[i32; 2]> {
    let at = |index: u32| {
        let pair = point(words, start, index);
        [low_i16(pair), high_i16(pair)]
    };
    (0..word(words, start)).map(at).collect()
}

fn pair_table(opened: &Selvedge<'_>, start: u32) -> PairTableModel {
    let (words, header) = (opened.words(), opened.header());
    PairTableModel {
        base_q20: word(words, start) as i32,
        shift: word(words, start + 1),
        entries: packed_rows(words, start + TABLE_WORDS, header.view_count, header.light_count),
    }
}
