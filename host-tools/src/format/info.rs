//! What `info` tells: the same facts as text and as JSON.

use selvedge::Selvedge;
use selvedge::directory::{
    ANGULAR, ATOMS, COEFFICIENTS, DIRECTIONS, EXTERNAL, FIBRES, LIGHT_ATOMS, LISTS, MEANS, METADATA,
    OPTIONAL, SCALES, SPATIAL,
};
use selvedge::header::METHOD_SPARSE_TENSOR;
use serde::Serialize;

/// Whether bytes are those of a dictionary file.
pub fn is_dictionary(bytes: &[u8]) -> bool {
    bytes.get(16..20) == Some(&selvedge::header::CONTENT_DICTIONARY.to_le_bytes())
}

/// A section, as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct SectionReport {
    /// Name of its kind.
    pub kind: String,
    /// Which of its kind, in words.
    pub which: String,
    /// First byte.
    pub offset: u32,
    /// Bytes.
    pub length: u32,
}

/// What a file is, as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// Name, origin and licence.
    pub name: String,
    /// Where the data are from.
    pub origin: String,
    /// Terms.
    pub licence: String,
    /// Bytes of the file.
    pub bytes: u32,
    /// `sparse ensemble` or `sparse tensor`.
    pub method: &'static str,
    /// Texels.
    pub size: [u32; 2],
    /// Levels of detail.
    pub levels: u32,
    /// Quality layers.
    pub layers: u32,
    /// Block edge.
    pub edge: u32,
    /// Light and view directions.
    pub directions: [u32; 2],
    /// State of each channel.
    pub channels: [&'static str; 3],
    /// `log2` or `linear`.
    pub transfer: &'static str,
    /// The light's cosine is in the values.
    pub cosine_included: bool,
    /// Operations of a filtered sample at worst.
    pub operations: u32,
    /// SHA-256 of what the digest's queries decode to.
    pub decode_digest: String,
    /// Sections in order.
    pub sections: Vec<SectionReport>,
}

/// Bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn section_names(kind: u32, instance: u32) -> (String, String) {
    let channel = |name: &str| (name.to_owned(), format!("channel {instance}"));
    match kind {
        METADATA => ("metadata".into(), String::new()),
        EXTERNAL => ("external dictionary".into(), String::new()),
        DIRECTIONS => ("directions".into(), if instance == 0 { "light".into() } else { "view".into() }),
        MEANS => channel("means"),
        SCALES => channel("scales"),
        ANGULAR => channel("angular factors"),
        SPATIAL => channel("spatial factors"),
        ATOMS => channel("atoms"),
        COEFFICIENTS => (
            "coefficients".into(),
            format!("level {}, layer {}, channel {}", instance >> 8, instance >> 4 & 15, instance & 15),
        ),
        LIGHT_ATOMS => ("light atoms".into(), String::new()),
        FIBRES => ("fibres".into(), String::new()),
        LISTS => ("lists".into(), format!("level {}, layer {}", instance >> 8, instance >> 4 & 15)),
        _ if kind >= OPTIONAL => (format!("optional {kind:#06x}"), format!("{instance}")),
        _ => (format!("{kind:#06x}"), format!("{instance}")),
    }
}

/// What an open file is.
pub fn info(material: &Selvedge<'_>) -> Info {
    let (header, metadata) = (material.header(), material.metadata());
    Info {
        name: metadata.name.into(),
        origin: metadata.origin.into(),
        licence: metadata.licence.into(),
        bytes: header.file_length,
        method: if header.method == METHOD_SPARSE_TENSOR { "sparse tensor" } else { "sparse ensemble" },
        size: [header.width, header.height],
        levels: header.level_count,
        layers: header.layer_count,
        edge: header.edge,
        directions: [header.light_count, header.view_count],
        channels: header
            .states
            .map(|state| ["missing", "mean", "full"].get(state as usize).copied().unwrap_or("?")),
        transfer: if header.transfer == 0 { "log2" } else { "linear" },
        cosine_included: header.cosine_included != 0,
        operations: header.operations,
        decode_digest: hex(&material.decode_digest()),
        sections: material
            .sections()
            .map(|section| {
                let (kind, which) = section_names(section.kind, section.instance);
                SectionReport { kind, which, offset: section.offset, length: section.length }
            })
            .collect(),
    }
}

/// The same for people.
pub fn info_text(info: &Info) -> String {
    let mut text = format!(
        "{}\n  origin      {}\n  licence     {}\n  method      {}\n  size        {} x {} texels, {} levels, {} layers, blocks of {} x {}\n  directions  {} light, {} view\n  channels    {}, {}, {}; {}{}\n  bytes       {}\n  operations  {} a filtered sample at worst\n  digest      {}\n",
        info.name,
        info.origin,
        info.licence,
        info.method,
        info.size[0],
        info.size[1],
        info.levels,
        info.layers,
        info.edge,
        info.edge,
        info.directions[0],
        info.directions[1],
        info.channels[0],
        info.channels[1],
        info.channels[2],
        info.transfer,
        if info.cosine_included { ", light's cosine included" } else { "" },
        info.bytes,
        info.operations,
        info.decode_digest,
    );
    for section in &info.sections {
        text +=
            &format!("  {:>9}  {:>9}  {} {}\n", section.offset, section.length, section.kind, section.which);
    }
    text
}
