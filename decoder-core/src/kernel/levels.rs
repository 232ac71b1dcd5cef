//! Samples between levels of detail (chapter 9). Twin: `shaders/wgsl/levels.wgsl`.

use crate::kernel::colour::Values;
use crate::kernel::direction::Located;
use crate::kernel::fixed::multiply_q15;
use crate::kernel::interpolation::filtered_values;
use crate::kernel::material::Material;
use crate::kernel::words::Words;

/// Part of the way from one value to another (9.2-3).
pub fn between(from_value: i32, to_value: i32, fraction_q15: i32) -> i32 {
    // 9.2-3: values are within 2^27, so the difference is exact.
    from_value.wrapping_add(multiply_q15(to_value.wrapping_sub(from_value), fraction_q15))
}

/// Values between two levels, the level in Q16 (9.2).
pub fn trilinear_values(
    words: Words<'_>,
    material: &Material,
    level_q16: u32,
    u_q32: u32,
    v_q32: u32,
    light: &Located,
    view: &Located,
) -> Values {
    // 9.2-1: beyond the last level lies the last level.
    let clamped = level_q16.min(material.level_count.wrapping_sub(1) << 16);
    let level = clamped >> 16;
    let fraction_q15 = ((clamped & 0xffff) >> 1) as i32;
    let mut values = filtered_values(words, material, level, u_q32, v_q32, light, view);
    // 9.2-2: on a level nothing else is read.
    if fraction_q15 != 0 {
        let coarse = filtered_values(words, material, level.wrapping_add(1), u_q32, v_q32, light, view);
        values.c0 = between(values.c0, coarse.c0, fraction_q15);
        values.c1 = between(values.c1, coarse.c1, fraction_q15);
        values.c2 = between(values.c2, coarse.c2, fraction_q15);
    }
    values
}
