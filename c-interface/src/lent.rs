//! Memory that callers lend: the only place that follows pointers.
//!
//! What can be seen is checked: NULL, alignment, lengths beyond the address space, overlap, materials that
//! were never opened. What cannot be seen is the caller's promise, spelled out in the header: that memory is
//! there for the stated length, and that the file's bytes outlive the material and do not change.
//!
//! Slices of integers are made only of memory that is initialised: what the caller lends for writing is
//! filled with zeros first, so no result can depend on what it held.

use crate::types::{
    SELVEDGE_ABI_VERSION, SELVEDGE_MISALIGNED, SELVEDGE_NOT_OPEN, SELVEDGE_NULL_POINTER, SELVEDGE_OK,
    SELVEDGE_OVERLAP, SELVEDGE_TOO_LONG, SELVEDGE_TOO_SHORT, selvedge_material, selvedge_status,
};
use core::mem::MaybeUninit;
use selvedge::Selvedge;

/// A value, or the status that says why there is none.
pub type Checked<T> = Result<T, selvedge_status>;

/// The status of a call.
pub(crate) fn status(result: Checked<()>) -> selvedge_status {
    result.err().unwrap_or(SELVEDGE_OK)
}

/// What a [`selvedge_material`] holds. The seals tell it from memory that nobody opened, or that was copied
/// in part.
#[repr(C)]
struct Sealed<'a> {
    front: u64,
    selvedge: MaybeUninit<Selvedge<'a>>,
    back: u64,
}

/// `selvedge`, then the interface's version, and the same turned around: what no memory holds by itself.
const FRONT: u64 = u64::from_le_bytes(*b"selvedge").rotate_left(7) ^ SELVEDGE_ABI_VERSION as u64;
const BACK: u64 = !FRONT.rotate_left(32);

const _: () = assert!(
    size_of::<Sealed<'static>>() <= size_of::<selvedge_material>(),
    "a sealed material fits the caller's words"
);
const _: () = assert!(
    align_of::<Sealed<'static>>() <= align_of::<selvedge_material>(),
    "a sealed material lies well in them"
);

/// Many threads may sample one material, since it is only read.
const fn is_shareable<T: Send + Sync + Copy>() {}
const _: () = is_shareable::<Selvedge<'static>>();

/// A pointer that can be followed, as far as can be seen.
pub(crate) fn check<T>(pointer: *const T) -> Checked<()> {
    if pointer.is_null() {
        return Err(SELVEDGE_NULL_POINTER);
    }
    if !pointer.is_aligned() {
        return Err(SELVEDGE_MISALIGNED);
    }
    Ok(())
}

/// The value behind a pointer.
///
/// # Safety
/// A pointer that is neither NULL nor misaligned points to an initialised `T`.
pub(crate) unsafe fn read<T: Copy>(pointer: *const T) -> Checked<T> {
    check(pointer)?;
    // SAFETY: not NULL and aligned; the rest is the caller's promise.
    Ok(unsafe { pointer.read() })
}

/// Puts a value where a pointer says.
///
/// # Safety
/// A pointer that is neither NULL nor misaligned points to memory of a `T` that nobody else uses during the
/// call.
pub(crate) unsafe fn write<T>(pointer: *mut T, value: T) -> Checked<()> {
    check(pointer)?;
    // SAFETY: not NULL and aligned; the rest is the caller's promise. What was there needs no drop: it is
    // plain data.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Lent elements of which only the place is known so far.
#[derive(Clone, Copy)]
pub(crate) struct Lent<T> {
    pointer: *mut T,
    count: usize,
}

impl<T: Copy> Lent<T> {
    /// `count` elements to be read from `pointer` on. NULL is the pointer of no elements, and of nothing
    /// else.
    pub fn to_read(pointer: *const T, count: usize) -> Checked<Lent<T>> {
        Lent::new(pointer.cast_mut(), count)
    }

    /// `count` elements to be written; of a lent buffer of `lent` elements no more are touched.
    pub fn to_write(pointer: *mut T, lent: usize, count: usize) -> Checked<Lent<T>> {
        if lent < count {
            return Err(SELVEDGE_TOO_SHORT);
        }
        Lent::new(pointer, count)
    }

    fn new(pointer: *mut T, count: usize) -> Checked<Lent<T>> {
        if pointer.is_null() && count == 0 {
            return Ok(Lent { pointer: core::ptr::dangling_mut(), count });
        }
        check(pointer)?;
        let bytes = count.checked_mul(size_of::<T>()).filter(|&bytes| bytes <= isize::MAX as usize);
        let end = bytes.and_then(|bytes| pointer.addr().checked_add(bytes));
        end.map(|_| Lent { pointer, count }).ok_or(SELVEDGE_TOO_LONG)
    }

    /// The addresses.
    pub fn place(self) -> Place {
        // Does not overflow: that was checked when it was made.
        Place {
            start: self.pointer.addr(),
            end: self.pointer.addr().wrapping_add(self.count.wrapping_mul(size_of::<T>())),
        }
    }

    /// The elements.
    ///
    /// # Safety
    /// They are there and initialised, and nobody writes them during `'a`.
    pub unsafe fn as_slice<'a>(self) -> &'a [T] {
        // SAFETY: not NULL, aligned and of a length that a slice may have, by construction; the rest is the
        // caller's promise.
        unsafe { core::slice::from_raw_parts(self.pointer, self.count) }
    }

    /// Copies the bits of these elements to others, which may overlap them.
    ///
    /// # Safety
    /// Both are there, these are initialised, and nobody else uses them during the call.
    pub unsafe fn copy_to<U>(self, out: Lent<U>) {
        let bytes = self.count.wrapping_mul(size_of::<T>()).min(out.count.wrapping_mul(size_of::<U>()));
        // SAFETY: of a length that both have, by construction; the rest is the caller's promise.
        unsafe { core::ptr::copy(self.pointer.cast::<u8>(), out.pointer.cast::<u8>(), bytes) };
    }

    /// The elements, filled with zeros.
    ///
    /// # Safety
    /// They are there, nobody else uses them during `'a`, no other slice of this call overlaps them, and zero
    /// is a value of `T`.
    pub unsafe fn as_zeroed_slice<'a>(self) -> &'a mut [T] {
        // SAFETY: as below.
        unsafe { self.pointer.write_bytes(0, self.count) };
        // SAFETY: initialised by the line above; not NULL, aligned and of a length that a slice may have, by
        // construction; the rest is the caller's promise.
        unsafe { core::slice::from_raw_parts_mut(self.pointer, self.count) }
    }
}

/// A range of addresses.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    start: usize,
    end: usize,
}

impl Place {
    /// Where lent bytes lie, before anything is known of them. Nothing lies at NULL, whatever its length
    /// says.
    pub fn of_bytes(pointer: *const u8, length: usize) -> Place {
        let length = if pointer.is_null() { 0 } else { length };
        Place { start: pointer.addr(), end: pointer.addr().saturating_add(length) }
    }

    /// Where a value lies that may be absent.
    pub fn of_optional<T>(pointer: *const T) -> Place {
        if pointer.is_null() { Place { start: 0, end: 0 } } else { Place::of_one(pointer) }
    }

    /// Where a slice lies.
    pub fn of<T>(slice: &[T]) -> Place {
        let range = slice.as_ptr_range();
        Place { start: range.start.addr(), end: range.end.addr() }
    }

    /// Where one value lies.
    pub fn of_one<T>(pointer: *const T) -> Place {
        Place { start: pointer.addr(), end: pointer.addr().saturating_add(size_of::<T>()) }
    }

    fn meets(self, other: Place) -> bool {
        self.start < other.end && other.start < self.end && self.start < self.end && other.start < other.end
    }

    /// Holds if this place, which is written, overlaps none of the others.
    pub fn apart_from(self, others: &[Place]) -> Checked<()> {
        if others.iter().any(|other| self.meets(*other)) { Err(SELVEDGE_OVERLAP) } else { Ok(()) }
    }
}

/// The open material behind a pointer, as a copy: no reference into the caller's memory is left.
///
/// # Safety
/// As [`read`] for the words of a [`selvedge_material`]; one that was opened still has its bytes.
pub(crate) unsafe fn read_material<'a>(pointer: *const selvedge_material) -> Checked<Selvedge<'a>> {
    check(pointer)?;
    let sealed: *const Sealed<'a> = pointer.cast();
    // SAFETY: the assertions above say that the field lies in the caller's words, aligned. Any bits are a
    // number.
    let front = unsafe { (*sealed).front };
    // SAFETY: the same.
    let back = unsafe { (*sealed).back };
    if front != FRONT || back != BACK {
        return Err(SELVEDGE_NOT_OPEN);
    }
    // SAFETY: in the caller's words, aligned; `MaybeUninit` takes any bits.
    let selvedge = unsafe { (*sealed).selvedge };
    // SAFETY: both seals are there, which `write_material` alone sets, after it has written the value.
    Ok(unsafe { selvedge.assume_init() })
}

/// Seals an open material into the caller's words.
///
/// # Safety
/// As [`write`].
pub(crate) unsafe fn write_material(pointer: *mut selvedge_material, selvedge: Selvedge<'_>) -> Checked<()> {
    // The spare words are zero, so that nothing goes with a material that lay there before.
    // SAFETY: the caller's promise is the same.
    unsafe { close_material(pointer) }?;
    let sealed = Sealed { front: FRONT, selvedge: MaybeUninit::new(selvedge), back: BACK };
    // SAFETY: checked by the line above; the assertions say that it fits, and alignment is that of the words.
    unsafe { pointer.cast::<Sealed<'_>>().write(sealed) };
    Ok(())
}

/// Makes the caller's words a material that is not open.
///
/// # Safety
/// As [`write`].
pub(crate) unsafe fn close_material(pointer: *mut selvedge_material) -> Checked<()> {
    // SAFETY: the caller's promise is the same.
    unsafe { write(pointer, selvedge_material::CLOSED) }
}
