// Entry points: what a host dispatches. Not normative; each calls one sample of chapters 8 and 9.
//
// A renderer that calls the functions from its own shader leaves this module out.

// One question. What the words mean depends on the entry point.
struct Query {
    material: u32,
    // u0.32 position, texel, or binary32 bits of a position.
    u: u32,
    v: u32,
    // Level of detail in Q16.
    level_q16: u32,
    // Q18, Q18, Q15 as signed numbers; sample index and nothing; or binary32 bits of a unit vector.
    light: array<u32, 3>,
    view: array<u32, 3>,
}

// One answer: linear radiance as binary32 bits, and the channel values in Q20.
struct Answer {
    rgb: Rgb,
    values: Values,
}

@group(0) @binding(2) var<storage, read> queries: array<Query>;
@group(0) @binding(3) var<storage, read_write> answers: array<Answer>;

fn direction_of(words: array<u32, 3>) -> Direction {
    return Direction(i32(words[0]), i32(words[1]), i32(words[2]));
}

fn direction_of_bits(words: array<u32, 3>) -> Direction {
    return direction_from_binary32(words[0], words[1], words[2]);
}

// One texel and one pair of sample directions: light[0] and view[0] are their indices.
@compute @workgroup_size(64)
fn texel(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = materials[query.material];
    let values = point_values(material, query.u, query.v, query.light[0], query.view[0]);
    answers[id.x] = Answer(radiance(material, values, single_tap(query.light[0])), values);
}

// Any position and directions at full resolution.
@compute @workgroup_size(64)
fn filtered(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = materials[query.material];
    let light = locate_light(material, direction_of(query.light));
    let view = locate_view(material, direction_of(query.view));
    let values = filtered_values(material, 0u, query.u, query.v, light, view);
    answers[id.x] = Answer(radiance(material, values, light), values);
}

// Any position and directions between two levels.
@compute @workgroup_size(64)
fn trilinear(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = materials[query.material];
    let light = locate_light(material, direction_of(query.light));
    let view = locate_view(material, direction_of(query.view));
    let values = trilinear_values(material, query.level_q16, query.u, query.v, light, view);
    answers[id.x] = Answer(radiance(material, values, light), values);
}

// As `trilinear`, with positions and unit vectors as binary32 bits.
@compute @workgroup_size(64)
fn floats(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = materials[query.material];
    let light = locate_light(material, direction_of_bits(query.light));
    let view = locate_view(material, direction_of_bits(query.view));
    let u_q32 = fraction_from_binary32(query.u);
    let v_q32 = fraction_from_binary32(query.v);
    let values = trilinear_values(material, query.level_q16, u_q32, v_q32, light, view);
    answers[id.x] = Answer(radiance(material, values, light), values);
}

// A whole image: query 0 names material and directions, an invocation is a texel, answers are row by row.
@compute @workgroup_size(8, 8)
fn image(@builtin(global_invocation_id) id: vec3<u32>) {
    let query = queries[0];
    let material = materials[query.material];
    let index = id.y * material.width + id.x;
    if (id.x >= material.width || id.y >= material.height || index >= arrayLength(&answers)) {
        return;
    }
    let light = locate_light(material, direction_of(query.light));
    let view = locate_view(material, direction_of(query.view));
    let values = texel_values(material, id.x, id.y, light, view);
    answers[index] = Answer(radiance(material, values, light), values);
}
