//! The smallest useful decoder: opens a material and answers filtered samples. Its size is what a firmware pays.
#![no_std]
#![no_main]

mod machine;

use core::hint::black_box;
use machine::end;
use selvedge::{Direction, Limits, Selvedge, open};

static BYTES: [u8; 16] = [7; 16];

/// Opens and samples apart, so that the size of each can be read from the program's symbols.
#[inline(never)]
fn open_material(bytes: &'static [u8], limits: &Limits) -> Option<Selvedge<'static>> {
    open(bytes, limits).ok()
}

#[inline(never)]
fn sample_material(material: &Selvedge<'_>, u: u32, v: u32, light: Direction, view: Direction) -> [u32; 3] {
    material.filtered(u, v, light, view).to_words()
}

pub fn start() -> ! {
    let limits =
        Limits { bytes: black_box(1 << 20), operations: black_box(1 << 20), texels: black_box(1 << 20) };
    if let Some(material) = open_material(black_box(&BYTES), &limits) {
        let direction = || Direction { x_q18: black_box(1), y_q18: black_box(2), z_q15: black_box(3) };
        black_box(sample_material(
            black_box(&material),
            black_box(1),
            black_box(2),
            direction(),
            direction(),
        ));
    }
    end(true)
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    end(false)
}
