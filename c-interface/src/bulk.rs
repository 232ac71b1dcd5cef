//! Whole images and batches of queries, and their results as floats.

use crate::lent::{Checked, Lent, Place, check, read, read_material, status, write};
use crate::types::{
    SELVEDGE_BATCH_LIMIT, SELVEDGE_TOO_LONG, SELVEDGE_TOO_SHORT, selvedge_direction, selvedge_material,
    selvedge_query, selvedge_rgb, selvedge_status,
};
use selvedge::{FilteredQuery, Selvedge};

/// Texels of a level: [`Selvedge::image_size`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_image_size(
    material: *const selvedge_material,
    level: u32,
    out_width: *mut u32,
    out_height: *mut u32,
) -> selvedge_status {
    let size = || {
        // SAFETY: the caller's promise is that of `read_material`.
        let [width, height] = unsafe { read_material(material) }?.image_size(level);
        // Both or none.
        check(out_height)?;
        // SAFETY: the caller's promise is that of `write`.
        unsafe { write(out_width, width) }?;
        // SAFETY: the same.
        unsafe { write(out_height, height) }
    };
    status(size())
}

/// Elements of scratch that an image needs: [`Selvedge::image_scratch_len`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_image_scratch_length(
    material: *const selvedge_material,
    out: *mut usize,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `read_material`.
    let length = unsafe { read_material(material) }.map(|selvedge| selvedge.image_scratch_len());
    // SAFETY: the caller's promise is that of `write`.
    status(length.and_then(|length| unsafe { write(out, length) }))
}

/// Two lent buffers, filled with zeros, each apart from the other, from both files and from what else the
/// call names.
///
/// # Safety
/// Both are there, and nobody else uses them during `'a`.
unsafe fn buffers<'a, T: Copy>(
    selvedge: &Selvedge<'_>,
    scratch: Lent<i32>,
    out: Lent<T>,
    others: &[Place],
) -> Checked<(&'a mut [i32], &'a mut [T])> {
    let words = selvedge.words();
    let files = [Place::of(words.file), Place::of(words.dictionary)];
    for place in [scratch.place(), out.place()] {
        place.apart_from(&files)?;
        place.apart_from(others)?;
    }
    out.place().apart_from(&[scratch.place()])?;
    // SAFETY: the caller's promise, and apart from the rest by the lines above.
    let scratch = unsafe { scratch.as_zeroed_slice() };
    // SAFETY: the same.
    let out = unsafe { out.as_zeroed_slice() };
    Ok((scratch, out))
}

/// What both decoders of images do: reads, lends, decodes.
///
/// # Safety
/// As `read_material`, `read` and `buffers` for what they get.
unsafe fn image<T: Copy>(
    material: *const selvedge_material,
    level: u32,
    directions: [*const selvedge_direction; 2],
    (scratch, scratch_length): (*mut i32, usize),
    (out, out_length): (*mut T, usize),
    decode: impl FnOnce(
        &Selvedge<'_>,
        [selvedge_direction; 2],
        &mut [i32],
        &mut [T],
    ) -> Result<(), selvedge::BufferTooSmall>,
) -> selvedge_status {
    let image = || {
        // SAFETY: the caller's promise.
        let selvedge = unsafe { read_material(material) }?;
        let [light, view] = directions;
        // SAFETY: the caller's promise.
        let light = unsafe { read(light) }?;
        // SAFETY: the caller's promise.
        let view = unsafe { read(view) }?;
        let [width, height] = selvedge.image_size(level);
        let texels = (width as usize).checked_mul(height as usize).ok_or(SELVEDGE_TOO_LONG)?;
        let scratch = Lent::to_write(scratch, scratch_length, selvedge.image_scratch_len())?;
        let out = Lent::to_write(out, out_length, texels)?;
        // Directions and material were copied, but whoever draws over them has made a mistake.
        let others = [Place::of_one(material), Place::of_one(directions[0]), Place::of_one(directions[1])];
        // SAFETY: the caller's promise.
        let (scratch, out) = unsafe { buffers(&selvedge, scratch, out, &others) }?;
        decode(&selvedge, [light, view], scratch, out).map_err(|_| SELVEDGE_TOO_SHORT)
    };
    status(image())
}

/// Radiance of every texel of a level: [`Selvedge::decode_image`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_decode_image(
    material: *const selvedge_material,
    level: u32,
    light: *const selvedge_direction,
    view: *const selvedge_direction,
    scratch: *mut i32,
    scratch_length: usize,
    out: *mut selvedge_rgb,
    out_length: usize,
) -> selvedge_status {
    let decode = |selvedge: &Selvedge<'_>, [light, view]: [_; 2], scratch: &mut [_], out: &mut [_]| {
        selvedge.decode_image(level, light, view, scratch, out)
    };
    // SAFETY: the caller's promise is that of `image`.
    unsafe { image(material, level, [light, view], (scratch, scratch_length), (out, out_length), decode) }
}

/// Values of one channel of every texel of a level: [`Selvedge::decode_channel`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_decode_channel(
    material: *const selvedge_material,
    channel: u32,
    level: u32,
    light: *const selvedge_direction,
    view: *const selvedge_direction,
    scratch: *mut i32,
    scratch_length: usize,
    out: *mut i32,
    out_length: usize,
) -> selvedge_status {
    // Before it becomes an index, so that no narrow machine makes another channel of it.
    let channel = channel.min(2) as usize;
    let decode = |selvedge: &Selvedge<'_>, [light, view]: [_; 2], scratch: &mut [_], out: &mut [_]| {
        selvedge.decode_channel(channel, level, light, view, scratch, out)
    };
    // SAFETY: the caller's promise is that of `image`.
    unsafe { image(material, level, [light, view], (scratch, scratch_length), (out, out_length), decode) }
}

/// Elements of scratch that a batch needs: [`Selvedge::batch_scratch_len`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_batch_scratch_length(
    material: *const selvedge_material,
    count: usize,
    out: *mut usize,
) -> selvedge_status {
    let length = || {
        // SAFETY: the caller's promise is that of `read_material`.
        let selvedge = unsafe { read_material(material) }?;
        if count > SELVEDGE_BATCH_LIMIT {
            return Err(SELVEDGE_TOO_LONG);
        }
        // SAFETY: the caller's promise is that of `write`.
        unsafe { write(out, selvedge.batch_scratch_len(count)) }
    };
    status(length())
}

/// Many filtered samples: [`Selvedge::sample_batch`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_sample_batch(
    material: *const selvedge_material,
    queries: *const selvedge_query,
    count: usize,
    scratch: *mut i32,
    scratch_length: usize,
    out: *mut selvedge_rgb,
    out_length: usize,
) -> selvedge_status {
    let batch = || {
        // SAFETY: the caller's promise is that of `read_material`.
        let selvedge = unsafe { read_material(material) }?;
        if count > SELVEDGE_BATCH_LIMIT {
            return Err(SELVEDGE_TOO_LONG);
        }
        // The assertions beside `selvedge_query` say that both types are laid out alike.
        let queries = Lent::to_read(queries.cast::<FilteredQuery>(), count)?;
        let scratch = Lent::to_write(scratch, scratch_length, selvedge.batch_scratch_len(count))?;
        let out = Lent::to_write(out, out_length, count)?;
        // SAFETY: the caller's promise.
        let (scratch, out) =
            unsafe { buffers(&selvedge, scratch, out, &[Place::of_one(material), queries.place()]) }?;
        // SAFETY: the caller's promise; `buffers` has checked that nothing written overlaps them.
        let queries = unsafe { queries.as_slice() };
        selvedge.sample_batch(queries, scratch, out).map_err(|_| SELVEDGE_TOO_SHORT)
    };
    status(batch())
}

/// Radiances as floats, three for each: their bits, copied. Both may be the same memory.
///
/// # Safety
/// As the header says of pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_to_floats(
    texels: *const selvedge_rgb,
    count: usize,
    out: *mut f32,
    out_length: usize,
) -> selvedge_status {
    let copy = || {
        let texels = Lent::to_read(texels, count)?;
        let floats = count.checked_mul(3).ok_or(SELVEDGE_TOO_LONG)?;
        let out = Lent::to_write(out, out_length, floats)?;
        // SAFETY: the caller's promise; a float has the size of a word.
        unsafe { texels.copy_to(out) };
        Ok(())
    };
    status(copy())
}
