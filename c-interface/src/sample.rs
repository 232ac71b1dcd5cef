//! Directions, single samples, and the decode digest.
//!
//! Floats come and go by pointer alone: their bits then pass no register that could change them, and machines
//! with another convention for floats agree with this library all the same.

use crate::lent::{Checked, read, read_material, status, write};
use crate::types::{
    SELVEDGE_DIGEST_LENGTH, selvedge_direction, selvedge_located, selvedge_material, selvedge_query,
    selvedge_rgb, selvedge_status, selvedge_values,
};
use selvedge::kernel::direction::direction_from_binary32;
use selvedge::kernel::interpolation::{radiance, texel_values};
use selvedge::kernel::levels::trilinear_values;
use selvedge::kernel::position::fraction_from_binary32;
use selvedge::{Direction, FilteredQuery, Located, Selvedge};

/// Reads an open material, computes, and writes one result.
///
/// # Safety
/// As `read_material` for `material` and `write` for `out`.
unsafe fn answer<T>(
    material: *const selvedge_material,
    out: *mut T,
    compute: impl FnOnce(&Selvedge<'_>) -> Checked<T>,
) -> selvedge_status {
    // SAFETY: the caller's promise.
    let result = unsafe { read_material(material) }.and_then(|selvedge| compute(&selvedge));
    // SAFETY: the caller's promise.
    status(result.and_then(|value| unsafe { write(out, value) }))
}

/// Two values to be read.
///
/// # Safety
/// As `read` for both.
unsafe fn read_both<T: Copy>(light: *const T, view: *const T) -> Checked<(T, T)> {
    // SAFETY: the caller's promise.
    let light = unsafe { read(light) }?;
    // SAFETY: the caller's promise.
    let view = unsafe { read(view) }?;
    Ok((light, view))
}

/// A direction from a unit vector of three floats: [`Direction::from_unit_vector`].
///
/// # Safety
/// As the header says of pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_direction_from_vector(
    vector: *const f32,
    out: *mut selvedge_direction,
) -> selvedge_status {
    // SAFETY: three floats, by the caller's promise; an array is aligned as its elements.
    let direction = unsafe { read(vector.cast::<[f32; 3]>()) }.map(Direction::from_unit_vector);
    // SAFETY: the caller's promise is that of `write`.
    status(direction.and_then(|direction| unsafe { write(out, direction) }))
}

/// The same from the bits of three floats, for machines that have none.
///
/// # Safety
/// As the header says of pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_direction_from_bits(
    x_bits: u32,
    y_bits: u32,
    z_bits: u32,
    out: *mut selvedge_direction,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `write`.
    status(unsafe { write(out, direction_from_binary32(x_bits, y_bits, z_bits)) })
}

/// A position of any magnitude, as the bits of a float, to its u0.32 fraction:
/// [`selvedge::position_from_f32`].
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_position_from_bits(position_bits: u32) -> u32 {
    fraction_from_binary32(position_bits)
}

/// A query from two floats of position and two unit vectors: [`FilteredQuery::from_f32`].
///
/// # Safety
/// As the header says of pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_query_from_floats(
    position: *const f32,
    light: *const f32,
    view: *const f32,
    out: *mut selvedge_query,
) -> selvedge_status {
    let query = || {
        // SAFETY: two floats, by the caller's promise.
        let position = unsafe { read(position.cast::<[f32; 2]>()) }?;
        // SAFETY: three floats each, by the caller's promise.
        let (light, view) = unsafe { read_both(light.cast::<[f32; 3]>(), view.cast::<[f32; 3]>()) }?;
        // SAFETY: the caller's promise is that of `write`.
        unsafe { write(out, FilteredQuery::from_f32(position, light, view).into()) }
    };
    status(query())
}

/// A sample direction of the light as a query: [`Selvedge::light_direction`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_light_direction(
    material: *const selvedge_material,
    index: u32,
    out: *mut selvedge_direction,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, |selvedge| Ok(selvedge.light_direction(index))) }
}

/// A sample direction of the view as a query: [`Selvedge::view_direction`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_view_direction(
    material: *const selvedge_material,
    index: u32,
    out: *mut selvedge_direction,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, |selvedge| Ok(selvedge.view_direction(index))) }
}

/// A light direction, located: [`Selvedge::locate_light`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_locate_light(
    material: *const selvedge_material,
    direction: *const selvedge_direction,
    out: *mut selvedge_located,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        unsafe { read(direction) }.map(|direction| selvedge.locate_light(direction))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// A view direction, located: [`Selvedge::locate_view`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_locate_view(
    material: *const selvedge_material,
    direction: *const selvedge_direction,
    out: *mut selvedge_located,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `read`.
    let compute =
        |selvedge: &Selvedge<'_>| unsafe { read(direction) }.map(|direction| selvedge.locate_view(direction));
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Radiance of a texel for a pair of sample directions: [`Selvedge::point`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_sample_point(
    material: *const selvedge_material,
    texel_x: u32,
    texel_y: u32,
    light_index: u32,
    view_index: u32,
    out: *mut selvedge_rgb,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, |selvedge| Ok(selvedge.point(texel_x, texel_y, light_index, view_index))) }
}

/// Channel values of the same: [`Selvedge::point_values`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_point_values(
    material: *const selvedge_material,
    texel_x: u32,
    texel_y: u32,
    light_index: u32,
    view_index: u32,
    out: *mut selvedge_values,
) -> selvedge_status {
    // SAFETY: the caller's promise is that of `answer`.
    unsafe {
        answer(material, out, |selvedge| Ok(selvedge.point_values(texel_x, texel_y, light_index, view_index)))
    }
}

/// Channel values of a texel for located directions: [`texel_values`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_texel_values(
    material: *const selvedge_material,
    texel_x: u32,
    texel_y: u32,
    light: *const selvedge_located,
    view: *const selvedge_located,
    out: *mut selvedge_values,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        Ok(texel_values(selvedge.words(), selvedge.material(), texel_x, texel_y, &light, &view))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Radiance of a texel for any directions.
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_sample_texel(
    material: *const selvedge_material,
    texel_x: u32,
    texel_y: u32,
    light: *const selvedge_direction,
    view: *const selvedge_direction,
    out: *mut selvedge_rgb,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        let (light, view) = (selvedge.locate_light(light), selvedge.locate_view(view));
        let values = texel_values(selvedge.words(), selvedge.material(), texel_x, texel_y, &light, &view);
        Ok(radiance(selvedge.material(), values, &light))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Radiance at any position and for any directions: [`Selvedge::filtered`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_sample_filtered(
    material: *const selvedge_material,
    u_q32: u32,
    v_q32: u32,
    light: *const selvedge_direction,
    view: *const selvedge_direction,
    out: *mut selvedge_rgb,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        Ok(selvedge.filtered(u_q32, v_q32, light, view))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Channel values at any position for located directions: [`Selvedge::filtered_values`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_filtered_values(
    material: *const selvedge_material,
    u_q32: u32,
    v_q32: u32,
    light: *const selvedge_located,
    view: *const selvedge_located,
    out: *mut selvedge_values,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        Ok(selvedge.filtered_values(u_q32, v_q32, &light, &view))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Radiance between two levels: [`Selvedge::trilinear`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_sample_trilinear(
    material: *const selvedge_material,
    level_q16: u32,
    u_q32: u32,
    v_q32: u32,
    light: *const selvedge_direction,
    view: *const selvedge_direction,
    out: *mut selvedge_rgb,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        Ok(selvedge.trilinear(level_q16, u_q32, v_q32, light, view))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Channel values between two levels for located directions: [`trilinear_values`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_trilinear_values(
    material: *const selvedge_material,
    level_q16: u32,
    u_q32: u32,
    v_q32: u32,
    light: *const selvedge_located,
    view: *const selvedge_located,
    out: *mut selvedge_values,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let (light, view) = unsafe { read_both(light, view) }?;
        Ok(trilinear_values(selvedge.words(), selvedge.material(), level_q16, u_q32, v_q32, &light, &view))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Channel values to radiance under a located light: [`radiance`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_radiance(
    material: *const selvedge_material,
    values: *const selvedge_values,
    light: *const selvedge_located,
    out: *mut selvedge_rgb,
) -> selvedge_status {
    let compute = |selvedge: &Selvedge<'_>| {
        // SAFETY: the caller's promise is that of `read`.
        let values = unsafe { read(values) }?;
        // SAFETY: the same.
        let light: Located = unsafe { read(light) }?;
        Ok(radiance(selvedge.material(), values, &light))
    };
    // SAFETY: the caller's promise is that of `answer`.
    unsafe { answer(material, out, compute) }
}

/// Digest of what a fixed sequence of queries decodes to: [`Selvedge::decode_digest`].
///
/// # Safety
/// As the header says of pointers and of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_decode_digest(
    material: *const selvedge_material,
    out: *mut u8,
) -> selvedge_status {
    // SAFETY: 32 bytes, by the caller's promise; the rest is that of `answer`.
    unsafe {
        answer(material, out.cast::<[u8; SELVEDGE_DIGEST_LENGTH]>(), |selvedge| Ok(selvedge.decode_digest()))
    }
}
