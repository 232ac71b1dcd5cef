//! Proof at link time that no public entry of the decoder can panic: the panic handler calls a function that does not exist.
//!
//! If a panic can be reached from what is called here, the linker does not find `a_panic_can_be_reached`. Every argument is read
//! through a volatile read, slices with their lengths, so the compiler knows nothing of it and nothing is folded away: what holds
//! here holds for every file, every buffer and every number. Nothing allocates either: there is no allocator to link.
//!
//! Every `pub fn` of the core is called, by its module's name or as a method: the kernel's in `proof/kernel.rs`, each
//! method's in a file of `proof/methods`. `tests/tests/proof_list.rs` compares the two lists.
#![no_std]
#![no_main]

#[path = "proof/kernel.rs"]
mod kernel;
mod machine;
// A module for each file of `proof/methods`, and a function that calls them all.
include!(concat!(env!("OUT_DIR"), "/methods.rs"));

use core::fmt::Write;
use core::hint::black_box;
use machine::end;
use selvedge::kernel::words::Words;
use selvedge::{Direction, Finding, First, Limits, Located, Part, Rgb, Rule, Selvedge, Sha256, Sink};

/// A value that the compiler knows nothing of.
#[inline(always)]
fn any<T: Copy>(value: T) -> T {
    // SAFETY: a reference to an initialised local.
    unsafe { core::ptr::read_volatile(&value) }
}

/// Any number.
fn n() -> u32 {
    any(77)
}

/// Any signed number.
fn i() -> i32 {
    any(-77)
}

/// Any bytes, of any length.
fn bytes() -> &'static [u8] {
    any(&[])
}

/// Room of any length for results.
#[cfg(feature = "batch")]
fn room<T: Copy>(mut nothing: [T; 0]) -> &'static mut [T] {
    let empty: *mut [T] = &mut nothing;
    // SAFETY: an empty slice may be anywhere; that it is empty only this line knows.
    unsafe { &mut *any(empty) }
}

/// Text goes nowhere.
struct Nowhere;

impl Write for Nowhere {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        black_box(text);
        Ok(())
    }
}

pub fn start() -> ! {
    let files = any(Words { file: &[], dictionary: &[] });
    containers();
    kernel::call(files);
    call_methods(files);
    #[cfg(feature = "planted")]
    black_box([1, 2, 3][any(5usize)]);
    end(true)
}

/// Opening, checking, and what an open material answers.
fn containers() {
    let (file, dictionary) = (bytes(), any(Some(bytes())));
    let limits = any(Limits::default());
    let mut count = 0u32;
    let mut sink = |finding: Finding| {
        count ^= finding.found;
        tell(finding);
        any(true)
    };
    black_box(selvedge::validate(file, dictionary, &limits, &mut sink));
    black_box(selvedge::open_reporting(file, dictionary, &limits, &mut sink).is_some());
    let mut first = First::default();
    black_box(first.report(any(Finding { rule: Rule::Magic, part: Part::File, offset: 0, found: 0 })));
    black_box(selvedge::validate(file, dictionary, &limits, &mut first));
    for opened in [selvedge::open(file, &limits), selvedge::open_with(file, dictionary, &limits)] {
        match opened {
            Ok(material) => answers(material.with_layers(n())),
            Err(finding) => tell(finding),
        }
    }
    let header = selvedge::Header::read(|at| at ^ n());
    black_box((header.is_full(n()), header.has_texture()));
    let mut hash = any(Sha256Parts(bytes(), bytes())).hash();
    hash.update(bytes());
    black_box((hash.finish(), selvedge::sha256(bytes()), selvedge::crc32(n(), bytes()), count));
}

/// A hash that has taken in something.
#[derive(Clone, Copy)]
struct Sha256Parts(&'static [u8], &'static [u8]);

impl Sha256Parts {
    fn hash(self) -> Sha256 {
        let mut hash = Sha256::default();
        hash.update(self.0);
        hash.update(self.1);
        hash
    }
}

/// What a finding can be asked for, and its text.
fn tell(finding: Finding) {
    let rule = finding.rule;
    black_box((rule.id(), rule.name(), rule.title(), rule.family()));
    black_box(write!(Nowhere, "{finding}").is_ok());
}

fn any_direction() -> Direction {
    any(Direction::default())
}

fn answers(material: Selvedge<'_>) {
    black_box((*material.header(), *material.material(), material.words(), material.metadata()));
    material.sections().for_each(|section| _ = black_box(section));
    black_box((
        material.material_at(n(), n()).to_words(),
        material.light_direction(n()),
        material.view_direction(n()),
    ));
    let (light, view) = (any_direction(), any_direction());
    black_box((material.locate_light(light), material.locate_view(view)));
    // Located where no set of directions has it, too.
    let located = any(Located::default());
    black_box((material.point(n(), n(), n(), n()), material.point_values(n(), n(), n(), n())));
    black_box((
        material.filtered(n(), n(), light, view).to_words(),
        material.filtered_values(n(), n(), &located, &located),
    ));
    black_box((material.trilinear(n(), n(), n(), light, view).to_f32(), material.decode_digest()));
    #[cfg(feature = "batch")]
    {
        let (scratch, out, values) = (room([0i32; 0]), room([Rgb::default(); 0]), room([0i32; 0]));
        black_box((
            material.image_size(n()),
            material.image_scratch_len(),
            material.batch_scratch_len(any(1)),
        ));
        let told = [
            material.decode_channel(any(1), n(), light, view, scratch, values),
            material.decode_image(n(), light, view, scratch, out),
            material.sample_batch(any(&[]), scratch, out),
        ];
        for lack in told.into_iter().filter_map(Result::err) {
            black_box(write!(Nowhere, "{lack}").is_ok());
        }
        black_box(selvedge::FilteredQuery::from_f32(any([0.0; 2]), any([0.0; 3]), any([0.0; 3])));
    }
}

#[cfg(feature = "proof")]
unsafe extern "C" {
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(feature = "proof")]
    // SAFETY: never called, for it does not exist: that is what the linker finds out.
    unsafe {
        a_panic_can_be_reached()
    }
    #[cfg(not(feature = "proof"))]
    end(false)
}
