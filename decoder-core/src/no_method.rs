//! A build without any method: it checks headers and directories and refuses every file as unsupported (3.1-8).

use crate::check::Check;
use crate::direction::Taps;
use crate::header::Header;
use crate::material::{Channel, Material};
use crate::position::Axis;
use crate::words::Words;

/// No texture: nothing can be opened that has one.
pub(crate) fn texture_q20(_: Words<'_>, _: &Material, _: Channel, _: u32, _: Axis, _: Axis, _: Taps, _: Taps) -> i32 {
    0
}

/// The sections of a method that is not there.
pub(crate) fn check_method(_: &mut Check<'_, '_>, _: &Header, _: Option<&Header>, _: &mut Material) -> Option<u64> {
    None
}

/// The dictionary of a method that is not there.
pub(crate) fn check_method_dictionary(_: &mut Check<'_, '_>, _: &Header) -> Option<()> {
    None
}
