//! Decodes the conformance suite from the program's own memory; ends well if every answer is the stated one.
//!
//! On Cortex-M it also measures the stack and, under an emulator that counts instructions as time, instructions.
#![no_std]
#![no_main]

mod machine;

use machine::{end, tell, write};
use selvedge::{Finding, First, Limits, Part, validate};

/// What a vector must give.
enum Answer {
    Digest([u8; 32]),
    Legal,
    Broken(&'static str, bool, u32, u32),
}

struct Vector {
    file: &'static [u8],
    dictionary: Option<&'static [u8]>,
    limits: Option<[u32; 3]>,
    answer: Answer,
}

static VECTORS: &[Vector] = include!(concat!(env!("OUT_DIR"), "/table.rs"));

fn is_stated(finding: Finding, rule: &str, in_dictionary: bool, offset: u32, found: u32) -> bool {
    finding.rule.id() == rule
        && (finding.part == Part::Dictionary) == in_dictionary
        && (finding.offset, finding.found) == (offset, found)
}

fn is_right(vector: &Vector) -> bool {
    let or_none = |n: u32| if n == 0 { u32::MAX } else { n };
    let limits = vector.limits.map_or(Limits::NONE, |[bytes, operations, texels]| Limits {
        bytes: or_none(bytes),
        operations: or_none(operations),
        texels: or_none(texels),
    });
    // A dictionary is checked, a material opened.
    let is_dictionary = vector.file.get(16) == Some(&1);
    let mut first = First::default();
    let opened = if is_dictionary {
        validate(vector.file, vector.dictionary, &limits, &mut first);
        first.0.map_or(Ok(None), Err)
    } else {
        selvedge::open_with(vector.file, vector.dictionary, &limits).map(Some)
    };
    match (opened, &vector.answer) {
        (Ok(Some(material)), Answer::Digest(digest)) => material.decode_digest() == *digest,
        (Ok(None), Answer::Legal) => true,
        (Err(finding), Answer::Broken(rule, in_dictionary, offset, found)) => {
            is_stated(finding, rule, *in_dictionary, *offset, *found)
        }
        _ => false,
    }
}

pub fn start() -> ! {
    let (mut right, mut digests) = (0, 0);
    for (number, vector) in (0u32..).zip(VECTORS) {
        if is_right(vector) {
            right += 1;
            digests += matches!(vector.answer, Answer::Digest(_)) as u32;
        } else {
            tell(b"WRONG ", number);
        }
    }
    tell(b"vectors ", VECTORS.len() as u32);
    tell(b"right ", right);
    tell(b"of them digests ", digests);
    #[cfg(all(target_arch = "arm", target_endian = "little"))]
    measure::measure();
    let all = right == VECTORS.len() as u32 && digests > 20;
    write(if all { b"all right\n" } else { b"NOT ALL RIGHT\n" });
    end(all)
}

#[cfg(all(target_arch = "arm", target_endian = "little"))]
mod measure {
    use super::machine::tell;
    use selvedge::{Direction, Limits, Selvedge};

    static MATERIAL: &[u8] = include_bytes!("../../spec/vectors/valid/example.selv");
    static LARGER: &[u8] = include_bytes!("../../decoder-core/tests/data/carpet07-excerpt.selv");

    const LENGTH: usize = 16 * 1024;
    const MARK: u8 = 0xa5;

    /// Bytes of the stack that `work` used below this function's frame.
    #[inline(never)]
    fn depth(work: &mut dyn FnMut()) -> u32 {
        let here = core::ptr::addr_of!(work) as usize & !3;
        let low = here - LENGTH;
        // SAFETY: below the stack pointer is the free part of a memory of four megabytes; a margin keeps this frame.
        unsafe { (low..here - 256).for_each(|at| (at as *mut u8).write_volatile(MARK)) };
        work();
        // SAFETY: as above.
        let untouched =
            (low..here).take_while(|&at| unsafe { (at as *const u8).read_volatile() } == MARK).count();
        (LENGTH - untouched) as u32
    }

    const TIMER: *mut u32 = 0xe000_e010 as *mut u32;

    /// Ticks of the system timer that `work` takes; under `-icount shift=8` an instruction takes 256 ns and a tick 40.
    #[inline(never)]
    fn ticks(work: &mut dyn FnMut()) -> u32 {
        // SAFETY: the registers of the system timer: reload value, current value, control.
        unsafe {
            TIMER.add(1).write_volatile(0xff_ffff);
            TIMER.add(2).write_volatile(0);
            TIMER.write_volatile(5);
            let before = TIMER.add(2).read_volatile();
            work();
            before.wrapping_sub(TIMER.add(2).read_volatile()) & 0xff_ffff
        }
    }

    fn sample(material: &Selvedge<'_>, i: u32) -> u32 {
        let part = |n: u32| (i.wrapping_mul(n) & 0x3ffff) as i32 - 0x20000;
        let light = Direction { x_q18: part(40_503), y_q18: part(30_011), z_q15: 20_000 };
        let view = Direction { x_q18: part(7_919), y_q18: part(65_537), z_q15: 20_000 };
        material.filtered(i.wrapping_mul(2_654_435_761), i.wrapping_mul(40_503_001), light, view).to_words()
            [0]
    }

    pub fn measure() {
        for (name, file) in [(&b"example"[..], MATERIAL), (b"excerpt", LARGER)] {
            let open = || selvedge::open(core::hint::black_box(file), &Limits::NONE);
            super::write(name);
            tell(
                b": stack of open ",
                depth(&mut || {
                    let _ = core::hint::black_box(open());
                }),
            );
            let Ok(material) = open() else { continue };
            let mut sum = 0;
            tell(
                b"  stack of a filtered sample ",
                depth(&mut || sum ^= sample(core::hint::black_box(&material), 3)),
            );
            tell(b"  stack of the decode digest ", depth(&mut || sum ^= material.decode_digest()[0] as u32));
            let mut total = 0u32;
            for i in 0..64 {
                total += ticks(&mut || sum ^= sample(core::hint::black_box(&material), i)) / 8;
            }
            core::hint::black_box(sum);
            // Eighths of ticks of 40 ns in instructions of 256 ns, over 64 samples.
            tell(b"  instructions a filtered sample ", total / 64 * 8 * 40 / 256);
        }
    }
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    write(b"PANIC\n");
    end(false)
}
