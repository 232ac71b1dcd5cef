//! Each C function gives the core's words, reports mistakes as statuses, and may be called from many threads.

#[path = "../common/mod.rs"]
mod common;
mod facts;
mod mistakes;
mod samples;

use selvedge::{Direction, Rgb};
use selvedge_c::*;
use std::ffi::{CStr, c_char};
use std::ptr::null;

const NONE: Rgb = Rgb { r: 0xdead_beef, g: 0xdead_beef, b: 0xdead_beef };
const UP: Direction = Direction { x_q18: 0, y_q18: 0, z_q15: SELVEDGE_ONE_Q15 };

/// What a function wrote, and that it went well.
fn told<T: Default>(call: impl FnOnce(*mut T) -> selvedge_status) -> T {
    let mut out = T::default();
    assert_eq!(call(&mut out), SELVEDGE_OK);
    out
}

/// Calls a function of the interface with pointers into memory that lives on. One place, so one promise.
macro_rules! c {
    ($name:ident($($argument:expr),* $(,)?)) => {
        // SAFETY: every pointer that a test hands over is of live memory of its type, or one that the function
        // has to refuse.
        unsafe { $name($($argument),*) }
    };
}
use c;

fn open_in_c(bytes: &[u8]) -> selvedge_material {
    let mut material = selvedge_material::CLOSED;
    let mut finding = selvedge_finding { rule: 9, ..selvedge_finding::default() };
    assert_eq!(
        c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, null(), &mut material, &mut finding)),
        SELVEDGE_OK
    );
    assert_eq!(finding, selvedge_finding::default(), "no finding");
    material
}

fn string(text: *const c_char) -> String {
    // SAFETY: the interface promises a constant string with a NUL.
    unsafe { CStr::from_ptr(text) }.to_str().expect("texts are ASCII").into()
}
