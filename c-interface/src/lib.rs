//! C interface of the Selvedge decoder. `include/selvedge.h` documents it for callers; a test holds that
//! header to this source.
//!
//! Each function checks what it was handed and calls the core, and decides nothing itself. There is no state,
//! no allocation and nothing to initialise: the caller lends all memory, the open material included.
//!
//! | module | what it holds |
//! |---|---|
//! | [`types`] | structures and constants of the header |
//! | [`lent`] | the only place that follows pointers |
//! | [`open`] | opening, validating, rules, header, metadata |
//! | [`sample`] | directions, single samples, the digest |
//! | [`bulk`] | whole images and batches |
//!
//! # Panics
//! The core has none, and neither has this crate. Should a compiler's mistake bring one about nevertheless,
//! it ends the program: with `std` it unwinds to the border of an `extern "C"` function, which aborts;
//! without, it reaches the handler below. So no unwinding ever enters a caller's frames.

#![no_std]
#![allow(non_camel_case_types, reason = "types have their names of the header")]

#[cfg(feature = "std")]
extern crate std;

pub mod bulk;
pub mod lent;
pub mod open;
pub mod sample;
pub mod types;

pub use bulk::*;
pub use open::*;
pub use sample::*;
pub use types::*;

/// A static library without `std` has to bring a panic handler. Nothing calls it; firmware that got here by a
/// broken memory stands still until its watchdog acts.
#[cfg(not(feature = "std"))]
#[panic_handler]
fn stand_still(_info: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
