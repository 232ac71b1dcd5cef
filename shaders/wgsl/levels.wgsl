// Samples between levels of detail (chapter 9). Twin: decoder-core/src/kernel/levels.rs.

// Part of the way from one value to another (9.2-3).
fn between(from_value: i32, to_value: i32, fraction_q15: i32) -> i32 {
    // 9.2-3: values are within 2^27, so the difference is exact.
    return from_value + multiply_q15(to_value - from_value, fraction_q15);
}

// Values between two levels, the level in Q16 (9.2).
fn trilinear_values(material: u32, level_q16: u32, u_q32: u32, v_q32: u32, light: Located, view: Located) -> Values {
    // 9.2-1: beyond the last level lies the last level.
    let clamped = min(level_q16, (materials[material].level_count - 1u) << 16u);
    let level = clamped >> 16u;
    let fraction_q15 = i32((clamped & 0xffffu) >> 1u);
    var values = filtered_values(material, level, u_q32, v_q32, light, view);
    // 9.2-2: on a level nothing else is read.
    if (fraction_q15 != 0) {
        let coarse = filtered_values(material, level + 1u, u_q32, v_q32, light, view);
        values.c0 = between(values.c0, coarse.c0, fraction_q15);
        values.c1 = between(values.c1, coarse.c1, fraction_q15);
        values.c2 = between(values.c2, coarse.c2, fraction_q15);
    }
    return values;
}
