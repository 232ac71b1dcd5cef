//! Proof at link time that no public entry of the decoder can panic: the panic handler calls a function that does not exist.
//!
//! If a panic can be reached from what is called here, the linker does not find `a_panic_can_be_reached`. Every argument comes from
//! memory that the compiler may not look into, so nothing is folded away. Nothing allocates either: there is no allocator to link.
#![no_std]
#![no_main]

mod machine;

use core::hint::black_box;
use machine::end;
use selvedge::{Direction, Finding, First, Limits, Sha256, crc32, open, open_telling, open_with, position_from_f32, sha256, validate};
#[cfg(feature = "batch")]
use selvedge::{FilteredQuery, Rgb};

static BYTES: [u8; 4096] = [7; 4096];

fn direction(bytes: &[u8]) -> Direction {
    let word = |i: usize| bytes.get(i).map_or(0, |&b| i32::from(b) << 20);
    Direction { x_q18: word(0), y_q18: word(1), z_q15: word(2) }
}

pub fn start() -> ! {
    let bytes: &[u8] = black_box(&BYTES);
    let number = || black_box(77u32);
    let limits = Limits { bytes: number(), operations: number(), texels: number() };
    let mut sum = 0u32;
    let mut sink = |finding: Finding| {
        sum ^= finding.offset ^ finding.found ^ finding.rule.id().len() as u32 ^ finding.rule.name().len() as u32;
        sum ^= finding.rule.title().len() as u32 ^ finding.rule.family() as u32 ^ finding.part as u32;
        black_box(true)
    };
    validate(bytes, black_box(Some(bytes)), &limits, &mut sink);
    black_box(open_telling(bytes, black_box(None), &limits, &mut sink).is_some());
    let mut first = First::default();
    validate(bytes, black_box(None), &limits, &mut first);
    black_box(first.0);
    black_box(open_with(bytes, black_box(Some(bytes)), &limits).is_ok());
    if let Ok(material) = open(bytes, &limits) {
        let material = material.with_layers(number());
        let (header, metadata) = (material.header(), material.metadata());
        black_box((header.is_full(number()), metadata.name, metadata.origin, metadata.licence));
        black_box((material.material().width, material.words().file.len()));
        material.sections().for_each(|section| sum ^= section.offset ^ section.length);
        black_box(material.material_at(number(), number()).file_start);
        let (light, view) = (direction(bytes), direction(bytes));
        let (light_taps, view_taps) = (material.locate_light(light), material.locate_view(view));
        black_box((material.light_direction(number()), material.view_direction(number())));
        black_box(material.point(number(), number(), number(), number()));
        black_box(material.point_values(number(), number(), number(), number()));
        black_box(material.filtered(number(), number(), light, view).to_words());
        black_box(material.filtered_values(number(), number(), light_taps, view_taps));
        black_box(material.trilinear(number(), number(), number(), light, view).to_f32());
        black_box(material.decode_digest());
        let unit = black_box([0.5f32, f32::NAN, 1e30]);
        black_box((Direction::from_unit_vector(unit), position_from_f32(unit[0])));
        #[cfg(feature = "batch")]
        {
            let mut scratch = [0i32; 512];
            let scratch = scratch.get_mut(..black_box(512).min(512)).unwrap_or(&mut []);
            let mut rgb = [Rgb::default(); 16];
            let mut values = [0i32; 16];
            black_box((material.image_size(number()), material.image_scratch_len()));
            black_box(material.decode_channel(number() as usize, number(), light, view, scratch, &mut values).is_ok());
            black_box(material.decode_image(number(), light, view, scratch, &mut rgb).is_ok());
            let queries = [FilteredQuery::from_f32([unit[0], unit[1]], unit, unit); 16];
            black_box(material.batch_scratch_len(number() as usize));
            black_box(material.sample_batch(black_box(&queries), scratch, &mut rgb).is_ok());
            black_box((rgb, values));
        }
    }
    let mut hasher = Sha256::default();
    hasher.update(bytes);
    black_box((hasher.finish(), sha256(bytes), crc32(number(), bytes), sum));
    #[cfg(feature = "planted")]
    black_box(BYTES[black_box(5usize)]);
    end(true)
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
