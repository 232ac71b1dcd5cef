//! The decoder as a module of WebAssembly: a host writes two files into its memory and asks what they are.
//!
//! `place()` is where the files go, one behind the other; `answer(bytes, dictionary_bytes, limits...)` gives 0 for a material, 1 for a legal
//! dictionary, 2 for a broken file; `result()` is where 32 bytes of digest are, or rule (its number in `Rule::ALL`), part, offset and found.
#![no_std]

use core::cell::UnsafeCell;
use selvedge::{First, Limits, Part, Rule, open_with, validate};

const ROOM: usize = 1 << 20;

/// Memory that the host writes to.
#[repr(align(16))]
struct Shared<const N: usize>(UnsafeCell<[u8; N]>);
// SAFETY: a module has one thread.
unsafe impl<const N: usize> Sync for Shared<N> {}

static FILES: Shared<ROOM> = Shared(UnsafeCell::new([0; ROOM]));
static RESULT: Shared<32> = Shared(UnsafeCell::new([0; 32]));

#[unsafe(no_mangle)]
pub extern "C" fn place() -> *mut u8 {
    FILES.0.get().cast()
}

#[unsafe(no_mangle)]
pub extern "C" fn result() -> *const u8 {
    RESULT.0.get().cast()
}

/// `dictionary_bytes` of `u32::MAX` stand for no dictionary.
#[unsafe(no_mangle)]
pub extern "C" fn answer(
    bytes: u32,
    dictionary_bytes: u32,
    max_bytes: u32,
    max_operations: u32,
    max_texels: u32,
) -> u32 {
    // SAFETY: the host does not write while this runs, and nothing else has these references.
    let (files, result): (&[u8; ROOM], &mut [u8; 32]) = unsafe { (&*FILES.0.get(), &mut *RESULT.0.get()) };
    let file = files.get(..bytes as usize).unwrap_or(&[]);
    let dictionary = (dictionary_bytes != u32::MAX).then(|| {
        files.get(bytes as usize..).and_then(|rest| rest.get(..dictionary_bytes as usize)).unwrap_or(&[])
    });
    let limits = Limits { bytes: max_bytes, operations: max_operations, texels: max_texels };
    let finding = if file.get(16) == Some(&1) {
        let mut first = First::default();
        validate(file, dictionary, &limits, &mut first);
        match first.0 {
            None => return 1,
            Some(finding) => finding,
        }
    } else {
        match open_with(file, dictionary, &limits) {
            Ok(material) => {
                *result = material.decode_digest();
                return 0;
            }
            Err(finding) => finding,
        }
    };
    let number = Rule::ALL.iter().position(|rule| *rule == finding.rule).unwrap_or(0);
    let words = [number as u32, u32::from(finding.part == Part::Dictionary), finding.offset, finding.found];
    for (slot, word) in result.chunks_exact_mut(4).zip(words) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
    2
}

/// Rule numbers of the specification, by their number in `Rule::ALL`: pointer and length in the halves of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn rule(number: u32) -> u64 {
    let id = Rule::ALL.get(number as usize).map_or("", |rule| rule.id());
    (id.as_ptr() as usize as u64) << 32 | id.len() as u64
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
