//! Opening a file: every rule is checked once, and what comes back cannot fail.
#![deny(clippy::arithmetic_side_effects)]

use crate::container::directions::{check_directions, largest_candidates};
use crate::container::directory::{DIRECTIONS, EXTERNAL, MEANS, METADATA, SCALES, find_section};
use crate::container::directory_checks::check_directory;
use crate::container::header::{CONTENT_DICTIONARY, CONTENT_MATERIAL, HEADER_LENGTH, Header};
use crate::container::header_checks::check_header;
use crate::container::metadata::{check_external, check_metadata};
use crate::container::pair_table::check_pair_table;
use crate::error::{Finding, First, Part, Rule, Sink};
use crate::kernel::material::{CHANNEL_FULL, Channel, Material, TRANSFER_LOG2};
use crate::kernel::words::{Words, word};
use crate::method;
use crate::selvedge::Selvedge;
use crate::walk::check::Check;
use crate::walk::cost::{Shape, filtered_operations};
use crate::walk::limits::Limits;
use crate::walk::sha256::sha256;

/// Opens a material that embeds its own dictionary.
///
/// # Errors
/// The first broken rule, in the specification's order of checks (1.4).
///
/// ```
/// # let bytes = include_bytes!("../tests/data/carpet07-excerpt.selv");
/// let material = selvedge::open(bytes, &selvedge::Limits::default())?;
/// let up = selvedge::Direction::from_unit_vector([0.0, 0.0, 1.0]);
/// let [r, g, b] = material.filtered(0x8000_0000, 0x4000_0000, up, up).to_f32();
/// assert!(r >= 0.0 && g >= 0.0 && b >= 0.0);
/// # Ok::<(), selvedge::Finding>(())
/// ```
pub fn open<'a>(bytes: &'a [u8], limits: &Limits) -> Result<Selvedge<'a>, Finding> {
    open_with(bytes, None, limits)
}

/// Opens a material whose dictionary may be in a file of its own.
///
/// # Errors
/// As [`open`]; the dictionary is held to the same rules and to the digest that the material references.
pub fn open_with<'a>(
    bytes: &'a [u8],
    dictionary: Option<&'a [u8]>,
    limits: &Limits,
) -> Result<Selvedge<'a>, Finding> {
    let mut first = First::default();
    let opened = check_material(bytes, dictionary, limits, &mut first);
    match (opened, first.0) {
        (Some(selvedge), None) => Ok(selvedge),
        (_, Some(finding)) => Err(finding),
        // A walk that ends early has reported why; should it ever not have, the file is still refused.
        (None, None) => Err(Finding { rule: Rule::HeaderTooShort, part: Part::File, offset: 0, found: 0 }),
    }
}

/// Opens a material as [`open_with`] does and reports every finding, not only the first: `Some` if there is
/// none.
pub fn open_reporting<'a>(
    bytes: &'a [u8],
    dictionary: Option<&'a [u8]>,
    limits: &Limits,
    sink: &mut dyn Sink,
) -> Option<Selvedge<'a>> {
    check_material(bytes, dictionary, limits, sink)
}

/// Walks all rules over a file of either content and reports every finding; `true` if there is none.
pub fn validate(bytes: &[u8], dictionary: Option<&[u8]>, limits: &Limits, sink: &mut dyn Sink) -> bool {
    let words = Words { file: bytes, dictionary: &[] };
    let is_dictionary = bytes.len() >= HEADER_LENGTH as usize && word(words, 4) == CONTENT_DICTIONARY;
    if !is_dictionary {
        return check_material(bytes, dictionary, limits, sink).is_some();
    }
    let mut check = Check::new(words, Part::File, sink);
    walk_dictionary(&mut check, limits);
    if dictionary.is_some() {
        check.find(Rule::ExternalUnwanted, 0, 0);
    }
    check.clean
}

/// The checks of a dictionary file; gives its header.
fn walk_dictionary(check: &mut Check<'_, '_>, limits: &Limits) -> Option<Header> {
    let header = check_header(check, limits)?;
    if !check_directory(check, &header) {
        return None;
    }
    let section = find_section(check, &header, METADATA, 0)?;
    check_metadata(check, section);
    method::check_dictionary(check, &header)?;
    check.clean.then_some(header)
}

/// The checks of a material, in order. `None` if there was a finding.
fn check_material<'a>(
    bytes: &'a [u8],
    dictionary: Option<&'a [u8]>,
    limits: &Limits,
    sink: &mut dyn Sink,
) -> Option<Selvedge<'a>> {
    let words = Words { file: bytes, dictionary: dictionary.unwrap_or(&[]) };
    let mut checker = Check::new(words, Part::File, sink);
    let check = &mut checker;
    let header = check_header(check, limits)?;
    if !check.ensure(header.content == CONTENT_MATERIAL, Rule::Content, 16, header.content)
        || !check_directory(check, &header)
    {
        return None;
    }
    check_metadata(check, find_section(check, &header, METADATA, 0)?);
    let external = walk_external(check, &header, dictionary, limits)?;

    let light = find_section(check, &header, DIRECTIONS, 0)?;
    let view = find_section(check, &header, DIRECTIONS, 1).unwrap_or(light);
    let mut sound = check_directions(check, light, header.light_count);
    if view != light {
        sound &= check_directions(check, view, header.view_count);
    }
    let mut material = describe(&header);
    material.light_start = check.section_start(light);
    material.view_start = check.section_start(view);

    let [mut means, mut scales] = [0u32; 2];
    for (kind, is_scale) in [(MEANS, false), (SCALES, true)] {
        for (c, channel) in (0u32..).zip(material.channels.iter_mut()) {
            if let Some(section) = find_section(check, &header, kind, c) {
                check_pair_table(check, section, &header, is_scale);
                let start = check.section_start(section);
                if is_scale {
                    channel.scale_start = start;
                    scales = scales.wrapping_add(1);
                } else {
                    channel.mean_start = start;
                    means = means.wrapping_add(1);
                }
            }
        }
    }
    // A method that this build does not have was refused with the header.
    let textures = method::check_material(check, &header, external.as_ref(), &mut material)?;
    if !sound || check.stopped {
        return None;
    }
    let sets = [light, view].map(|section| largest_candidates(check, section));
    let shape =
        Shape { candidates: sets.map(|set| set.0), hull_counts: sets.map(|set| set.1), means, scales };
    let operations = filtered_operations(shape, textures);
    check.ensure(operations == header.operations, Rule::StatedOperations, 28, header.operations);
    check.clean.then_some(Selvedge { words, header, material })
}

/// Walks 3.5. `Some(None)` is a material without an external dictionary.
fn walk_external(
    check: &mut Check<'_, '_>,
    header: &Header,
    dictionary: Option<&[u8]>,
    limits: &Limits,
) -> Option<Option<Header>> {
    let Some(section) = find_section(check, header, EXTERNAL, 0) else {
        return check.ensure(dictionary.is_none(), Rule::ExternalUnwanted, 0, 0).then_some(None);
    };
    let digest = check_external(check, section)?;
    let stated_length = check.word_at(section.offset.wrapping_add(32));
    let Some(dictionary) = dictionary else {
        check.find(Rule::ExternalMissing, section.offset, stated_length);
        return None;
    };
    if !check.ensure(
        stated_length <= limits.bytes,
        Rule::LimitBytes,
        section.offset.wrapping_add(32),
        stated_length,
    ) {
        return None;
    }
    let same = dictionary.len() == stated_length as usize && sha256(dictionary) == digest;
    if !check.ensure(same, Rule::ExternalDigest, section.offset, dictionary.len() as u32) {
        return None;
    }
    let other = check.in_dictionary(|inner| walk_dictionary(inner, limits))?;
    let serves = (0..3).all(|c| !header.is_full(c) || other.is_full(c));
    let fits = other.method == header.method
        && other.light_count == header.light_count
        && other.view_count == header.view_count
        && serves;
    let fits = fits && method::dictionary_fits(check, header, &other);
    check.ensure(fits, Rule::ExternalFit, section.offset, other.edge).then_some(Some(other))
}

/// The fields of a [`Material`] that the header states.
fn describe(header: &Header) -> Material {
    let parameter = header.transfer_parameter;
    let is_log = header.transfer == TRANSFER_LOG2;
    let offset_mantissa = if is_log && parameter != 0 { (parameter & 0x7f_ffff | 0x80_0000) << 8 } else { 0 };
    let exponent = if is_log { ((parameter >> 23) as i32).wrapping_sub(127) } else { parameter as i32 };
    let mut full_count = 0u32;
    let channels = header.states.map(|state| {
        let full_rank = full_count;
        full_count = full_count.wrapping_add((state == CHANNEL_FULL) as u32);
        Channel { state, full_rank, ..Channel::default() }
    });
    Material {
        width: header.width,
        height: header.height,
        level_count: header.level_count,
        light_count: header.light_count,
        view_count: header.view_count,
        transfer: header.transfer,
        cosine_included: header.cosine_included,
        offset_mantissa_q31: offset_mantissa,
        exponent,
        matrix_q13: header.matrix_q13,
        edge: header.edge,
        edge_reciprocal_q18: (1u32 << 18).div_ceil(header.edge.max(1)),
        layer_count: header.layer_count,
        layer_limit: header.layer_count,
        full_count,
        method: header.method,
        channels,
        ..Material::default()
    }
}
