//! Opening a file: every rule is checked once, and what comes back cannot fail.

use crate::check::{Check, Section};
use crate::colour::{Rgb, Values};
use crate::cost::{Shape, filtered_operations};
use crate::direction::{Direction, Taps, sample_direction};
use crate::direction_set::{check_directions, largest_candidates};
use crate::directory::{
    DIRECTIONS, EXTERNAL, MEANS, METADATA, SCALES, SPATIAL, check_directory, find_in, find_section,
    read_entry,
};
#[cfg(feature = "sparse-ensemble")]
use crate::ensemble_set::{check_ensemble, check_ensemble_dictionary};
use crate::error::{Finding, First, Part, Rule, Sink};
use crate::header::{CONTENT_DICTIONARY, CONTENT_MATERIAL, Header, check_header};
use crate::interpolation::{
    filtered_values, locate_light, locate_view, point_values, radiance, trilinear_values,
};
use crate::limits::Limits;
#[cfg(feature = "sparse-tensor")]
use crate::material::METHOD_SPARSE_TENSOR;
use crate::material::{CHANNEL_FULL, Channel, METHOD_SPARSE_ENSEMBLE, Material, TRANSFER_LOG2};
use crate::metadata::{Metadata, check_external, check_metadata, read_metadata};
use crate::pair_table::check_pair_table;
use crate::sha256::sha256;
#[cfg(feature = "sparse-tensor")]
use crate::tensor_set::{check_tensor, check_tensor_dictionary};
use crate::words::{Words, word};

/// An open material. Copies are cheap: it borrows the file's bytes and owns nothing.
#[derive(Clone, Copy, Debug)]
pub struct Selvedge<'a> {
    words: Words<'a>,
    header: Header,
    material: Material,
}

/// Opens a material that carries its own dictionary.
///
/// # Errors
/// The first broken rule, in the specification's order of checks (1.4).
///
/// ```
/// # let bytes = include_bytes!("../../tests/data/carpet07-excerpt.selv");
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
/// As [`open`]; the dictionary is held to the same rules and to the digest that the material names.
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
        // A walk that ends early has told why; should it ever not have, the file is still refused.
        (None, None) => Err(Finding { rule: Rule::HeaderTooShort, part: Part::File, offset: 0, found: 0 }),
    }
}

/// Opens a material as [`open_with`] does and tells every finding, not only the first: `Some` if there is
/// none.
pub fn open_telling<'a>(
    bytes: &'a [u8],
    dictionary: Option<&'a [u8]>,
    limits: &Limits,
    sink: &mut dyn Sink,
) -> Option<Selvedge<'a>> {
    check_material(bytes, dictionary, limits, sink)
}

/// Walks all rules over a file of either content and tells every finding; `true` if there is none.
pub fn validate(bytes: &[u8], dictionary: Option<&[u8]>, limits: &Limits, sink: &mut dyn Sink) -> bool {
    let words = Words { file: bytes, dictionary: &[] };
    let is_dictionary = bytes.len() >= 128 && word(words, 4) == CONTENT_DICTIONARY;
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
    check_method_dictionary(check, &header)?;
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

    let mut scaled = 0;
    for (kind, is_scale) in [(MEANS, false), (SCALES, true)] {
        for (c, channel) in (0u32..).zip(material.channels.iter_mut()) {
            if let Some(section) = find_section(check, &header, kind, c) {
                check_pair_table(check, section, &header, is_scale);
                let start = check.section_start(section);
                if is_scale {
                    channel.scale_start = start;
                    scaled += 1;
                } else {
                    channel.mean_start = start;
                }
            }
        }
    }
    let textures = check_method(check, &header, external.as_ref(), &mut material)?;
    if !sound || check.stopped {
        return None;
    }
    let sets = [light, view].map(|section| largest_candidates(check, section));
    let means = header.states.iter().filter(|&&state| state != 0).count() as u32;
    let shape = Shape {
        candidates: sets.map(|set| set.0),
        hull_counts: sets.map(|set| set.1),
        means,
        scales: scaled,
    };
    let operations = filtered_operations(shape, textures);
    check.ensure(operations == header.operations, Rule::StatedOperations, 28, header.operations);
    check.clean.then_some(Selvedge { words, header, material })
}

/// Walks the chapter of the material's method; a method that this build does not have was refused with the
/// header.
#[allow(unused_variables, reason = "a build may have no method")]
fn check_method(
    check: &mut Check<'_, '_>,
    header: &Header,
    external: Option<&Header>,
    material: &mut Material,
) -> Option<u64> {
    match header.method {
        #[cfg(feature = "sparse-ensemble")]
        METHOD_SPARSE_ENSEMBLE => check_ensemble(check, header, external, material),
        #[cfg(feature = "sparse-tensor")]
        METHOD_SPARSE_TENSOR => check_tensor(check, header, external, material),
        _ => None,
    }
}

/// Walks the chapter of a dictionary's method.
#[allow(unused_variables, reason = "a build may have no method")]
fn check_method_dictionary(check: &mut Check<'_, '_>, header: &Header) -> Option<()> {
    match header.method {
        #[cfg(feature = "sparse-ensemble")]
        METHOD_SPARSE_ENSEMBLE => check_ensemble_dictionary(check, header),
        #[cfg(feature = "sparse-tensor")]
        METHOD_SPARSE_TENSOR => check_tensor_dictionary(check, header),
        _ => None,
    }
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
    let stated_length = check.word_at(section.offset + 32);
    let Some(dictionary) = dictionary else {
        check.find(Rule::ExternalMissing, section.offset, stated_length);
        return None;
    };
    if !check.ensure(stated_length <= limits.bytes, Rule::LimitBytes, section.offset + 32, stated_length) {
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
    // Spatial factors that the material does not have must be there, and for its edge.
    let has_blocks = header.method == METHOD_SPARSE_ENSEMBLE;
    let lacks = [0, 1, 2]
        .map(|c| has_blocks && header.is_full(c) && find_section(check, header, SPATIAL, c).is_none());
    let there = check.in_dictionary(|inner| {
        (0u32..).zip(lacks).all(|(c, lacks)| !lacks || find_section(inner, &other, SPATIAL, c).is_some())
    });
    let fits = fits && there && (!lacks.contains(&true) || other.edge == header.edge);
    check.ensure(fits, Rule::ExternalFit, section.offset, other.edge).then_some(Some(other))
}

/// The fields of a [`Material`] that the header states.
fn describe(header: &Header) -> Material {
    let parameter = header.transfer_parameter;
    let is_log = header.transfer == TRANSFER_LOG2;
    let offset_mantissa = if is_log && parameter != 0 { (parameter & 0x7f_ffff | 0x80_0000) << 8 } else { 0 };
    let exponent = if is_log { (parameter >> 23) as i32 - 127 } else { parameter as i32 };
    let mut full_count = 0;
    let channels = header.states.map(|state| {
        let full_rank = full_count;
        full_count += (state == CHANNEL_FULL) as u32;
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

impl<'a> Selvedge<'a> {
    /// The header's fields.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What the kernel knows of this material; word numbers from the start of the file.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// The bytes, as the kernel reads them.
    pub fn words(&self) -> Words<'a> {
        self.words
    }

    /// What a person or a renderer wants to know beside the values.
    pub fn metadata(&self) -> Metadata<'a> {
        let section = find_in(|offset| word(self.words, offset >> 2), self.header.section_count, METADATA, 0);
        let range = section.map(|s| s.offset as usize..s.offset as usize + s.length as usize);
        range.and_then(|range| self.words.file.get(range)).and_then(read_metadata).unwrap_or_default()
    }

    /// The sections of the file, in order.
    pub fn sections(&self) -> impl Iterator<Item = Section> + '_ {
        (0..self.header.section_count).map(|index| read_entry(|offset| word(self.words, offset >> 2), index))
    }

    /// The same material, decoded only up to a quality layer: 1 for the first alone. Its digest is then that
    /// of the layers.
    pub fn with_layers(mut self, layers: u32) -> Self {
        // Not `clamp`, which panics if its bounds cross.
        self.material.layer_limit = layers.min(self.header.layer_count).max(1);
        self
    }

    /// The record for a kernel whose buffer holds this file from word `file_start` on, and the external
    /// dictionary, if there is one, from word `dictionary_start` on. Buffers end before word 2^31.
    pub fn material_at(&self, file_start: u32, dictionary_start: u32) -> Material {
        let place = |start: u32| {
            if start < crate::words::DICTIONARY_START {
                start.wrapping_add(file_start)
            } else {
                (start & 0x7fff_ffff).wrapping_add(dictionary_start)
            }
        };
        let mut material = self.material;
        material.file_start = file_start;
        material.light_start = place(material.light_start);
        material.view_start = place(material.view_start);
        material.coefficient_entry = place(material.coefficient_entry);
        // Zero says that there is none; no section begins in the header.
        for start in [&mut material.light_atoms_start, &mut material.fibres_start] {
            if *start != 0 {
                *start = place(*start);
            }
        }
        for channel in &mut material.channels {
            for start in [
                &mut channel.mean_start,
                &mut channel.scale_start,
                &mut channel.angular_start,
                &mut channel.spatial_start,
                &mut channel.atoms_start,
            ] {
                if *start != 0 {
                    *start = place(*start);
                }
            }
        }
        material
    }

    /// Sample direction `index` of the light, as a query; an index beyond the end is moved to the last.
    pub fn light_direction(&self, index: u32) -> Direction {
        let last = self.material.light_count.wrapping_sub(1);
        sample_direction(self.words, self.material.light_start, index.min(last))
    }

    /// Sample direction `index` of the view, as a query; an index beyond the end is moved to the last.
    pub fn view_direction(&self, index: u32) -> Direction {
        let last = self.material.view_count.wrapping_sub(1);
        sample_direction(self.words, self.material.view_start, index.min(last))
    }

    /// The taps of a light direction; reuse them for many texels.
    pub fn locate_light(&self, direction: Direction) -> Taps {
        locate_light(self.words, &self.material, direction)
    }

    /// The taps of a view direction.
    pub fn locate_view(&self, direction: Direction) -> Taps {
        locate_view(self.words, &self.material, direction)
    }

    /// Radiance of one texel of level 0 for one pair of sample directions (8.5). Indices beyond the end are
    /// moved to the last.
    pub fn point(&self, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Rgb {
        let values = self.point_values(texel_x, texel_y, light_index, view_index);
        radiance(&self.material, values, crate::direction::single_tap(light_index))
    }

    /// Channel values, Q20, of one texel of level 0 for one pair of sample directions (8.5).
    pub fn point_values(&self, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Values {
        point_values(self.words, &self.material, texel_x, texel_y, light_index, view_index)
    }

    /// Radiance at any position and for any directions, at full resolution (8.4). `u` and `v` are u0.32
    /// fractions of the image.
    pub fn filtered(&self, u_q32: u32, v_q32: u32, light: Direction, view: Direction) -> Rgb {
        let light = self.locate_light(light);
        radiance(&self.material, self.filtered_values(u_q32, v_q32, light, self.locate_view(view)), light)
    }

    /// Channel values, Q20, at any position for located directions (8.4).
    pub fn filtered_values(&self, u_q32: u32, v_q32: u32, light: Taps, view: Taps) -> Values {
        filtered_values(self.words, &self.material, 0, u_q32, v_q32, light, view)
    }

    /// Radiance at any position, between two levels of detail (9.2). The level is in Q16: `0x18000` is 1.5.
    pub fn trilinear(
        &self,
        level_q16: u32,
        u_q32: u32,
        v_q32: u32,
        light: Direction,
        view: Direction,
    ) -> Rgb {
        let light = self.locate_light(light);
        let view = self.locate_view(view);
        radiance(
            &self.material,
            trilinear_values(self.words, &self.material, level_q16, u_q32, v_q32, light, view),
            light,
        )
    }
}
