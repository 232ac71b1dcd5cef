//! What `info` prints: the same facts as text and as JSON.

use crate::format::bits::hex;
use crate::methods;
use crate::methods::method::Method;
use selvedge::container::directory::{DIRECTIONS, EXTERNAL, MEANS, METADATA, OPTIONAL, SCALES};
use selvedge::{Finding, Selvedge};
use serde::Serialize;

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
    /// Name of the method, such as `sparse-tensor`.
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

/// Name of a section's kind, and which of its kind it is.
fn section_names(method: &Method, kind: u32, instance: u32) -> (String, String) {
    let channel = |name: &str| (name.to_owned(), format!("channel {instance}"));
    if let Some(section) = method.sections.iter().find(|section| section.kind == kind) {
        return (section.name.to_owned(), (section.instance)(instance));
    }
    match kind {
        METADATA => ("metadata".into(), String::new()),
        EXTERNAL => ("external dictionary".into(), String::new()),
        DIRECTIONS => ("directions".into(), if instance == 0 { "light".into() } else { "view".into() }),
        MEANS => channel("means"),
        SCALES => channel("scales"),
        _ if kind >= OPTIONAL => (format!("optional {kind:#06x}"), format!("{instance}")),
        _ => (format!("{kind:#06x}"), format!("{instance}")),
    }
}

/// What an open file is.
///
/// # Errors
/// Rule 3.1-8 if the tools do not have the file's method.
pub fn info(material: &Selvedge<'_>) -> Result<Info, Finding> {
    let method = methods::of(material)?;
    let (header, metadata) = (material.header(), material.metadata());
    Ok(Info {
        name: metadata.name.into(),
        origin: metadata.origin.into(),
        licence: metadata.licence.into(),
        bytes: header.file_length,
        method: method.name,
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
                let (kind, which) = section_names(method, section.kind, section.instance);
                SectionReport { kind, which, offset: section.offset, length: section.length }
            })
            .collect(),
    })
}

/// The same for people.
pub fn info_text(info: &Info) -> String {
    let [width, height] = info.size;
    let Info { levels, layers, edge, .. } = info;
    let [light, view] = info.directions;
    let cosine = if info.cosine_included { ", light's cosine included" } else { "" };
    let lines = [
        ("origin", info.origin.clone()),
        ("licence", info.licence.clone()),
        ("method", info.method.to_owned()),
        (
            "size",
            format!("{width} x {height} texels, {levels} levels, {layers} layers, blocks of {edge} x {edge}"),
        ),
        ("directions", format!("{light} light, {view} view")),
        ("channels", format!("{}; {}{cosine}", info.channels.join(", "), info.transfer)),
        ("bytes", info.bytes.to_string()),
        ("operations", format!("{} a filtered sample at worst", info.operations)),
        ("digest", info.decode_digest.clone()),
    ];
    let mut text = info.name.clone() + "\n";
    for (name, value) in lines {
        text += &format!("  {name:<12}{value}\n");
    }
    for section in &info.sections {
        text +=
            &format!("  {:>9}  {:>9}  {} {}\n", section.offset, section.length, section.kind, section.which);
    }
    text
}
