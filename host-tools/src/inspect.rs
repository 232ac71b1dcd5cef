//! What `info` and `validate` tell: the same facts as text and as JSON.

use selvedge::directory::{ANGULAR, ATOMS, COEFFICIENTS, DIRECTIONS, EXTERNAL, MEANS, METADATA, OPTIONAL, SCALES, SPATIAL};
use selvedge::{Finding, Limits, Part, Selvedge};
use serde::Serialize;

/// Most findings that are kept in words for one rule; all are counted.
const KEPT: usize = 20;

/// Whether bytes are those of a dictionary file.
pub fn is_dictionary(bytes: &[u8]) -> bool {
    bytes.get(16..20) == Some(&selvedge::header::CONTENT_DICTIONARY.to_le_bytes())
}

/// One finding, as JSON.
#[derive(Clone, Debug, Serialize, PartialEq, Eq)]
pub struct FindingReport {
    /// Number of the rule.
    pub rule: &'static str,
    /// Name of the rule.
    pub name: &'static str,
    /// What it asks for.
    pub title: &'static str,
    /// `invalid`, `unsupported`, `limits` or `usage`.
    pub family: &'static str,
    /// `file` or `dictionary`.
    pub part: &'static str,
    /// Byte offset.
    pub offset: u32,
    /// What was found there.
    pub found: u32,
}

impl From<Finding> for FindingReport {
    fn from(finding: Finding) -> Self {
        FindingReport {
            rule: finding.rule.id(),
            name: finding.rule.name(),
            title: finding.rule.title(),
            family: match finding.rule.family() {
                selvedge::Family::Invalid => "invalid",
                selvedge::Family::Unsupported => "unsupported",
                selvedge::Family::Limits => "limits",
                selvedge::Family::Usage => "usage",
            },
            part: if finding.part == Part::File { "file" } else { "dictionary" },
            offset: finding.offset,
            found: finding.found,
        }
    }
}

/// Everything found in one file, as JSON.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Validation {
    /// The file, as it was named.
    pub file: String,
    /// No rule is broken.
    pub valid: bool,
    /// How many findings there were.
    pub count: usize,
    /// The findings, at most twenty for a rule.
    pub findings: Vec<FindingReport>,
    /// The exit code of the first.
    #[serde(skip)]
    pub exit_code: u8,
}

/// Walks all rules over a file.
pub fn validate(name: &str, bytes: &[u8], dictionary: Option<&[u8]>, limits: &Limits) -> Validation {
    let mut report = Validation { file: name.to_owned(), ..Validation::default() };
    let mut kept = std::collections::BTreeMap::<_, usize>::new();
    report.valid = selvedge::validate(bytes, dictionary, limits, &mut |finding: Finding| {
        if report.count == 0 {
            report.exit_code = crate::error::exit_code_of(finding.rule);
        }
        report.count += 1;
        let of_rule = kept.entry(finding.rule).or_default();
        *of_rule += 1;
        if *of_rule <= KEPT {
            report.findings.push(finding.into());
        }
        true
    });
    report
}

/// The same for people: a line a finding, nothing where all is well.
pub fn validation_text(report: &Validation) -> String {
    let mut text = String::new();
    for f in &report.findings {
        let part = if f.part == "dictionary" { " (dictionary)" } else { "" };
        text += &format!("{}{part}: {} at byte {}: {}; found {} ({:#x})\n", report.file, f.rule, f.offset, f.title, f.found, f.found);
    }
    if report.count > report.findings.len() {
        text += &format!("{}: {} findings in all\n", report.file, report.count);
    }
    text
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
        COEFFICIENTS => ("coefficients".into(), format!("level {}, layer {}, channel {}", instance >> 8, instance >> 4 & 15, instance & 15)),
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
        size: [header.width, header.height],
        levels: header.level_count,
        layers: header.layer_count,
        edge: header.edge,
        directions: [header.light_count, header.view_count],
        channels: header.states.map(|state| ["missing", "mean", "full"].get(state as usize).copied().unwrap_or("?")),
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
        "{}\n  origin      {}\n  licence     {}\n  size        {} x {} texels, {} levels, {} layers, blocks of {} x {}\n  directions  {} light, {} view\n  channels    {}, {}, {}; {}{}\n  bytes       {}\n  operations  {} a filtered sample at worst\n  digest      {}\n",
        info.name,
        info.origin,
        info.licence,
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
        text += &format!("  {:>9}  {:>9}  {} {}\n", section.offset, section.length, section.kind, section.which);
    }
    text
}
