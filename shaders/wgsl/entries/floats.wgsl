// As `trilinear`, with positions and unit vectors as binary32 bits.
@compute @workgroup_size(64)
fn floats(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = query.material;
    let light = locate_light(material, direction_of_bits(query.light));
    let view = locate_view(material, direction_of_bits(query.view));
    let u_q32 = fraction_from_binary32(query.u);
    let v_q32 = fraction_from_binary32(query.v);
    let values = trilinear_values(material, query.level_q16, u_q32, v_q32, light, view);
    answers[id.x] = Answer(radiance(material, values, light), values);
}
