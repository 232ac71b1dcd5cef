//! Structures and constants of `selvedge.h`, with the same names, fields and order.

use core::ffi::{c_char, c_void};
use core::mem::{MaybeUninit, offset_of};
use selvedge::{Direction, Family, FilteredQuery, Finding, Header, Limits, Located, Part, Rgb, Taps, Values};

/// Version of this interface; another number is another interface.
pub const SELVEDGE_ABI_VERSION: u32 = 2;
/// 64-bit words of a [`selvedge_material`].
pub const SELVEDGE_MATERIAL_WORDS: usize = 64;
/// Bytes of a decode digest.
pub const SELVEDGE_DIGEST_LENGTH: usize = 32;
/// Most queries of a batch: 2^28 - 1.
pub const SELVEDGE_BATCH_LIMIT: usize = 268_435_455;

/// All is well.
pub const SELVEDGE_OK: i32 = 0;
/// The wrong thing was given along with the file: a dictionary that is missing, unwanted or another.
pub const SELVEDGE_USAGE: i32 = 1;
/// The file breaks the format.
pub const SELVEDGE_INVALID: i32 = 3;
/// The file asks for more than the limits allow.
pub const SELVEDGE_LIMITS: i32 = 4;
/// The file is not known to be wrong, but this library cannot read it.
pub const SELVEDGE_UNSUPPORTED: i32 = 5;
/// A pointer is NULL that may not be.
pub const SELVEDGE_NULL_POINTER: i32 = 16;
/// A pointer is not aligned for its type.
pub const SELVEDGE_MISALIGNED: i32 = 17;
/// The material was not opened, or is not one.
pub const SELVEDGE_NOT_OPEN: i32 = 18;
/// A lent buffer is too short.
pub const SELVEDGE_TOO_SHORT: i32 = 19;
/// A length is larger than any memory, or a batch has too many queries.
pub const SELVEDGE_TOO_LONG: i32 = 20;
/// Memory to be written overlaps other memory of the call.
pub const SELVEDGE_OVERLAP: i32 = 21;
/// There is no rule of this number.
pub const SELVEDGE_NO_RULE: i32 = 22;

/// A finding is about the file itself.
pub const SELVEDGE_PART_FILE: u32 = 0;
/// A finding is about the external dictionary.
pub const SELVEDGE_PART_DICTIONARY: u32 = 1;
/// A channel that is not in the file.
pub const SELVEDGE_CHANNEL_MISSING: u32 = 0;
/// A channel that is a mean for each pair of directions.
pub const SELVEDGE_CHANNEL_MEAN: u32 = 1;
/// A channel with texture.
pub const SELVEDGE_CHANNEL_FULL: u32 = 2;
/// Channels are base-two logarithms.
pub const SELVEDGE_TRANSFER_LOG2: u32 = 0;
/// Channels are linear.
pub const SELVEDGE_TRANSFER_LINEAR: u32 = 1;
/// One in Q15.
pub const SELVEDGE_ONE_Q15: i32 = 32_768;
/// One in Q18.
pub const SELVEDGE_ONE_Q18: i32 = 262_144;
/// One in Q20.
pub const SELVEDGE_ONE_Q20: i32 = 1_048_576;

/// What a function has to say.
pub type selvedge_status = i32;
/// [`Direction`].
pub type selvedge_direction = Direction;
/// [`Taps`].
pub type selvedge_taps = Taps;
/// [`Located`].
pub type selvedge_located = Located;
/// [`Values`].
pub type selvedge_values = Values;
/// [`Rgb`].
pub type selvedge_rgb = Rgb;

/// Takes a finding; zero ends the validation.
#[cfg(not(feature = "std"))]
// One that may unwind would call for a personality function, which firmware does not have.
pub type selvedge_report =
    unsafe extern "C" fn(context: *mut c_void, finding: *const selvedge_finding) -> i32;

/// Takes a finding; zero ends the validation.
///
/// The type may unwind, so that a C++ exception thrown through it is an abort and not undefined.
#[cfg(feature = "std")]
pub type selvedge_report =
    unsafe extern "C-unwind" fn(context: *mut c_void, finding: *const selvedge_finding) -> i32;

/// An open material, in memory of the caller.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct selvedge_material {
    // Not integers: the words hold pointers too, and a copy has to keep what they may reach.
    pub(crate) opaque: [MaybeUninit<u64>; SELVEDGE_MATERIAL_WORDS],
}

impl selvedge_material {
    /// What a C program writes as `= {0}`: no open material.
    pub const CLOSED: selvedge_material =
        selvedge_material { opaque: [MaybeUninit::new(0); SELVEDGE_MATERIAL_WORDS] };
}

/// What the caller is willing to spend: [`Limits`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct selvedge_limits {
    /// Bytes of the file, and of the dictionary.
    pub bytes: u32,
    /// Operations of a filtered sample.
    pub operations: u32,
    /// Texels of level 0.
    pub texels: u32,
}

impl From<Limits> for selvedge_limits {
    fn from(Limits { bytes, operations, texels }: Limits) -> Self {
        selvedge_limits { bytes, operations, texels }
    }
}

impl From<selvedge_limits> for Limits {
    fn from(selvedge_limits { bytes, operations, texels }: selvedge_limits) -> Self {
        Limits { bytes, operations, texels }
    }
}

/// A broken rule: [`Finding`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct selvedge_finding {
    /// Number of the rule from 1 on; 0 for no finding.
    pub rule: u32,
    /// [`SELVEDGE_PART_FILE`] or [`SELVEDGE_PART_DICTIONARY`].
    pub part: u32,
    /// Bytes from the start of that file.
    pub offset: u32,
    /// What was found there.
    pub found: u32,
}

impl From<Finding> for selvedge_finding {
    fn from(Finding { rule, part, offset, found }: Finding) -> Self {
        let part = if part == Part::Dictionary { SELVEDGE_PART_DICTIONARY } else { SELVEDGE_PART_FILE };
        // Rules stand in `Rule::ALL` in the order of their values; zero is left for no finding.
        selvedge_finding { rule: rule as u32 + 1, part, offset, found }
    }
}

/// The status of a family of rules.
pub(crate) fn status_of(family: Family) -> selvedge_status {
    match family {
        Family::Invalid => SELVEDGE_INVALID,
        Family::Unsupported => SELVEDGE_UNSUPPORTED,
        Family::Limits => SELVEDGE_LIMITS,
        Family::Usage => SELVEDGE_USAGE,
    }
}

/// The header's fields: [`Header`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct selvedge_header {
    /// Minor version.
    pub minor_version: u32,
    /// Bytes of the file.
    pub file_length: u32,
    /// 0 for a material.
    pub content: u32,
    /// Number of the method, by chapter 3.1 of the specification.
    pub method: u32,
    /// Entries of the directory.
    pub section_count: u32,
    /// Stated operations of a filtered sample at worst.
    pub operations: u32,
    /// Texels along x.
    pub width: u32,
    /// Texels along y.
    pub height: u32,
    /// Light directions.
    pub light_count: u32,
    /// View directions.
    pub view_count: u32,
    /// Levels of detail.
    pub level_count: u32,
    /// Texels along the side of a block.
    pub edge: u32,
    /// Quality layers.
    pub layer_count: u32,
    /// State of each channel.
    pub states: [u32; 3],
    /// Transfer.
    pub transfer: u32,
    /// 1 if the light's cosine is in the values.
    pub cosine_included: u32,
    /// Bits of the log offset, or the linear exponent.
    pub transfer_parameter: u32,
    /// Colour matrix, row by row.
    pub matrix_q13: [i32; 9],
}

impl From<&Header> for selvedge_header {
    fn from(header: &Header) -> Self {
        // Taken apart by name, so that a new field is not forgotten here.
        let &Header {
            minor_version,
            file_length,
            content,
            method,
            section_count,
            operations,
            width,
            height,
            light_count,
            view_count,
            level_count,
            edge,
            layer_count,
            states,
            transfer,
            cosine_included,
            transfer_parameter,
            matrix_q13,
        } = header;
        selvedge_header {
            minor_version,
            file_length,
            content,
            method,
            section_count,
            operations,
            width,
            height,
            light_count,
            view_count,
            level_count,
            edge,
            layer_count,
            states,
            transfer,
            cosine_included,
            transfer_parameter,
            matrix_q13,
        }
    }
}

/// A text within the file's bytes, without a NUL at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct selvedge_text {
    /// UTF-8.
    pub text: *const c_char,
    /// Bytes.
    pub length: usize,
}

impl From<&str> for selvedge_text {
    fn from(text: &str) -> Self {
        selvedge_text { text: text.as_ptr().cast(), length: text.len() }
    }
}

/// What a person or a renderer wants to know: [`selvedge::Metadata`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct selvedge_metadata {
    /// Width of a texel in nanometres, 0 if unknown.
    pub texel_width_nm: u32,
    /// Height of a texel in nanometres, 0 if unknown.
    pub texel_height_nm: u32,
    /// Axes of the directions.
    pub frame: u32,
    /// Where texel (0, 0) is.
    pub image_origin: u32,
    /// Primaries.
    pub primaries: u32,
    /// Name of the material.
    pub name: selvedge_text,
    /// Where the data are from.
    pub origin: selvedge_text,
    /// Under which terms they are given.
    pub licence: selvedge_text,
}

/// A filtered sample to be made: [`FilteredQuery`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct selvedge_query {
    /// u0.32 fraction of the image along x.
    pub u_q32: u32,
    /// u0.32 fraction of the image along y.
    pub v_q32: u32,
    /// Light direction.
    pub light: selvedge_direction,
    /// View direction.
    pub view: selvedge_direction,
}

impl From<FilteredQuery> for selvedge_query {
    fn from(FilteredQuery { u_q32, v_q32, light, view }: FilteredQuery) -> Self {
        selvedge_query { u_q32, v_q32, light, view }
    }
}

// A batch's queries are read where they lie: an array of ours is an array of the core's.
const _: () = {
    assert!(
        size_of::<selvedge_query>() == size_of::<FilteredQuery>()
            && align_of::<selvedge_query>() == align_of::<FilteredQuery>()
    );
    assert!(offset_of!(selvedge_query, u_q32) == offset_of!(FilteredQuery, u_q32));
    assert!(offset_of!(selvedge_query, v_q32) == offset_of!(FilteredQuery, v_q32));
    assert!(offset_of!(selvedge_query, light) == offset_of!(FilteredQuery, light));
    assert!(offset_of!(selvedge_query, view) == offset_of!(FilteredQuery, view));
};

// Constants that are the core's.
const _: () = {
    assert!(SELVEDGE_CHANNEL_MISSING == selvedge::kernel::material::CHANNEL_MISSING);
    assert!(SELVEDGE_CHANNEL_MEAN == selvedge::kernel::material::CHANNEL_MEAN);
    assert!(SELVEDGE_CHANNEL_FULL == selvedge::kernel::material::CHANNEL_FULL);
    assert!(SELVEDGE_TRANSFER_LOG2 == selvedge::kernel::material::TRANSFER_LOG2);
    assert!(SELVEDGE_TRANSFER_LINEAR == selvedge::kernel::material::TRANSFER_LINEAR);
    assert!(
        SELVEDGE_ONE_Q15 == selvedge::kernel::fixed::ONE_Q15
            && SELVEDGE_ONE_Q18 == selvedge::kernel::direction::ONE_Q18
    );
    assert!(SELVEDGE_DIGEST_LENGTH == size_of::<selvedge::Digest>());
};
