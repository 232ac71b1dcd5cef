//! Opening and validating, what a finding means, and what an open material says of itself.

use crate::lent::{
    Checked, Lent, Place, check, close_material, read, read_material, status, write, write_material,
};
use crate::types::{
    SELVEDGE_ABI_VERSION, SELVEDGE_INVALID, SELVEDGE_LIMITS, SELVEDGE_MISALIGNED, SELVEDGE_NO_RULE,
    SELVEDGE_NOT_OPEN, SELVEDGE_NULL_POINTER, SELVEDGE_OK, SELVEDGE_OVERLAP, SELVEDGE_TOO_LONG,
    SELVEDGE_TOO_SHORT, SELVEDGE_UNSUPPORTED, SELVEDGE_USAGE, selvedge_finding, selvedge_header,
    selvedge_limits, selvedge_material, selvedge_metadata, selvedge_report, selvedge_status, status_of,
};
use core::ffi::{c_char, c_void};
use selvedge::{Finding, Limits, Rule};

/// Version of the interface that this library has.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_abi_version() -> u32 {
    SELVEDGE_ABI_VERSION
}

/// Bytes of a material, for languages that cannot read the header.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_material_size() -> usize {
    size_of::<selvedge_material>()
}

/// Alignment of a material in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_material_alignment() -> usize {
    align_of::<selvedge_material>()
}

/// What a status means, in English.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_status_text(status: selvedge_status) -> *const c_char {
    let text = match status {
        SELVEDGE_OK => c"all is well",
        SELVEDGE_USAGE => c"the dictionary is missing, unwanted or another",
        SELVEDGE_INVALID => c"the file breaks the format",
        SELVEDGE_LIMITS => c"the file asks for more than the limits allow",
        SELVEDGE_UNSUPPORTED => c"this library cannot read the file",
        SELVEDGE_NULL_POINTER => c"a pointer is NULL",
        SELVEDGE_MISALIGNED => c"a pointer is not aligned",
        SELVEDGE_NOT_OPEN => c"the material is not open",
        SELVEDGE_TOO_SHORT => c"a lent buffer is too short",
        SELVEDGE_TOO_LONG => c"a length is too large",
        SELVEDGE_OVERLAP => c"memory to be written overlaps other memory",
        SELVEDGE_NO_RULE => c"there is no rule of this number",
        _ => c"not a status",
    };
    text.as_ptr()
}

/// The limits that apply where none are given.
///
/// # Safety
/// As the header says of pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_default_limits(out: *mut selvedge_limits) -> selvedge_status {
    // SAFETY: the caller's promise is that of `write`.
    status(unsafe { write(out, Limits::default().into()) })
}

/// The files that a caller lends, and its limits.
struct Lending<'a> {
    bytes: &'a [u8],
    dictionary: Option<&'a [u8]>,
    limits: Limits,
}

/// # Safety
/// Pointers with lengths name memory that is initialised and stays as it is during `'a`; `limits` is as in
/// `read`.
unsafe fn lending<'a>(
    bytes: *const u8,
    length: usize,
    dictionary: *const u8,
    dictionary_length: usize,
    limits: *const selvedge_limits,
) -> Checked<Lending<'a>> {
    let bytes = Lent::to_read(bytes, length)?;
    let lent_dictionary = Lent::to_read(dictionary, dictionary_length)?;
    // SAFETY: the caller's promise.
    let bytes = unsafe { bytes.as_slice() };
    // SAFETY: the caller's promise.
    let lent_dictionary = unsafe { lent_dictionary.as_slice() };
    let limits = if limits.is_null() {
        Limits::default()
    } else {
        // SAFETY: the caller's promise is that of `read`.
        unsafe { read(limits) }?.into()
    };
    Ok(Lending { bytes, dictionary: (!dictionary.is_null()).then_some(lent_dictionary), limits })
}

/// Opens a material: [`selvedge::open_with`].
///
/// # Safety
/// As the header says: pointers are NULL where that is allowed or name memory of the stated length, and the
/// bytes of both files stay where and as they are for as long as the material or a copy of it is used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_open(
    bytes: *const u8,
    length: usize,
    dictionary: *const u8,
    dictionary_length: usize,
    limits: *const selvedge_limits,
    out_material: *mut selvedge_material,
    out_finding: *mut selvedge_finding,
) -> selvedge_status {
    let open = || {
        check(out_material)?;
        // Before anything is written, since all of these are read afterwards.
        let read = [
            Place::of_bytes(bytes, length),
            Place::of_bytes(dictionary, dictionary_length),
            Place::of_optional(limits),
        ];
        Place::of_one(out_material).apart_from(&read)?;
        // Whatever was open there is no longer, and no failure from here on leaves anything behind.
        // SAFETY: the caller's promise is that of `write`.
        unsafe { close_material(out_material) }?;
        if !out_finding.is_null() {
            check(out_finding)?;
            Place::of_one(out_finding).apart_from(&read)?;
            Place::of_one(out_finding).apart_from(&[Place::of_one(out_material)])?;
        }
        // SAFETY: the caller's promise is that of `lending`.
        let lent = unsafe { lending(bytes, length, dictionary, dictionary_length, limits) }?;
        let opened = selvedge::open_with(lent.bytes, lent.dictionary, &lent.limits);
        if !out_finding.is_null() {
            let finding = opened.err().map(selvedge_finding::from).unwrap_or_default();
            // SAFETY: the caller's promise is that of `write`.
            unsafe { write(out_finding, finding) }?;
        }
        let selvedge = opened.map_err(|finding| status_of(finding.rule.family()))?;
        // SAFETY: the caller's promise is that of `write`.
        unsafe { write_material(out_material, selvedge) }
    };
    status(open())
}

/// Walks all rules over a material or a dictionary: [`selvedge::validate`].
///
/// # Safety
/// As for [`selvedge_open`]; `report` may be called with `context` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_validate(
    bytes: *const u8,
    length: usize,
    dictionary: *const u8,
    dictionary_length: usize,
    limits: *const selvedge_limits,
    report: Option<selvedge_report>,
    context: *mut c_void,
) -> selvedge_status {
    let walk = || {
        // SAFETY: the caller's promise is that of `lending`.
        let lent = unsafe { lending(bytes, length, dictionary, dictionary_length, limits) }?;
        let mut first = None;
        let mut sink = |finding: Finding| {
            first.get_or_insert(status_of(finding.rule.family()));
            let Some(report) = report else { return false };
            let finding = selvedge_finding::from(finding);
            // SAFETY: the caller gave a function of this type; the finding lives until it returns.
            unsafe { report(context, &finding) != 0 }
        };
        let good = selvedge::validate(lent.bytes, lent.dictionary, &lent.limits, &mut sink);
        // A walk that ends early has told why; should it ever not have, the file is still refused.
        if good { Ok(()) } else { Err(first.unwrap_or(SELVEDGE_INVALID)) }
    };
    status(walk())
}

const RULE_COUNT: usize = Rule::ALL.len();

/// `text` with NUL behind it.
const fn terminated<const N: usize>(text: &str) -> [u8; N] {
    let bytes = text.as_bytes();
    assert!(bytes.len() < N, "a text has room for its NUL");
    let mut out = [0; N];
    let mut at = 0;
    while at < bytes.len() {
        assert!(bytes[at] != 0, "a text ends where C says");
        out[at] = bytes[at];
        at += 1;
    }
    out
}

/// A text of each rule, terminated when the library is compiled; element 0 is empty, for no finding.
macro_rules! rule_texts {
    ($name:ident, $room:literal, $of:expr) => {
        static $name: [[u8; $room]; RULE_COUNT + 1] = {
            let mut texts = [[0; $room]; RULE_COUNT + 1];
            let mut at = 0;
            while at < RULE_COUNT {
                assert!(Rule::ALL[at] as usize == at, "a rule's value is its place in the list");
                texts[at + 1] = terminated($of(Rule::ALL[at]));
                at += 1;
            }
            texts
        };
    };
}

rule_texts!(IDS, 16, Rule::id);
rule_texts!(NAMES, 32, Rule::name);
rule_texts!(TITLES, 128, Rule::title);

fn text_of<const N: usize>(texts: &'static [[u8; N]], rule: u32) -> *const c_char {
    texts.get(rule as usize).map_or(c"".as_ptr(), |text| text.as_ptr().cast())
}

/// Rules that this library checks; their numbers are 1 to this.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_rule_count() -> u32 {
    RULE_COUNT as u32
}

/// A rule's number in the specification.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_rule_id(rule: u32) -> *const c_char {
    text_of(&IDS, rule)
}

/// A rule's name in the conformance table.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_rule_name(rule: u32) -> *const c_char {
    text_of(&NAMES, rule)
}

/// What a rule asks for.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_rule_title(rule: u32) -> *const c_char {
    text_of(&TITLES, rule)
}

/// The status of a file that breaks a rule.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_rule_family(rule: u32) -> selvedge_status {
    let rule = (rule as usize).checked_sub(1).and_then(|index| Rule::ALL.get(index));
    rule.map_or(SELVEDGE_NO_RULE, |rule| status_of(rule.family()))
}

/// The header's fields: [`selvedge::Selvedge::header`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_read_header(
    material: *const selvedge_material,
    out: *mut selvedge_header,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `read_material`.
    let header = unsafe { read_material(material) }.map(|selvedge| selvedge_header::from(selvedge.header()));
    // SAFETY: the caller's promise is that of `write`.
    status(header.and_then(|header| unsafe { write(out, header) }))
}

/// The metadata, whose texts lie in the file's bytes: [`selvedge::Selvedge::metadata`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_read_metadata(
    material: *const selvedge_material,
    out: *mut selvedge_metadata,
) -> selvedge_status {
    let told = || {
        // SAFETY: the caller's promise is that of `read_material`.
        let metadata = unsafe { read_material(material) }?.metadata();
        let told = selvedge_metadata {
            texel_width_nm: metadata.texel_width_nm,
            texel_height_nm: metadata.texel_height_nm,
            frame: metadata.frame,
            image_origin: metadata.image_origin,
            primaries: metadata.primaries,
            name: metadata.name.into(),
            origin: metadata.origin.into(),
            licence: metadata.licence.into(),
        };
        // SAFETY: the caller's promise is that of `write`.
        unsafe { write(out, told) }
    };
    status(told())
}

/// The same material up to a quality layer: [`selvedge::Selvedge::with_layers`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_with_layers(
    material: *const selvedge_material,
    layers: u32,
    out: *mut selvedge_material,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `read_material`. What comes is a copy, so `out` may be
    // `material`.
    let limited = unsafe { read_material(material) }.map(|selvedge| selvedge.with_layers(layers));
    // SAFETY: the caller's promise is that of `write_material`.
    status(limited.and_then(|selvedge| unsafe { write_material(out, selvedge) }))
}
