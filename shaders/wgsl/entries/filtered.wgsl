// Any position and directions at full resolution.
@compute @workgroup_size(64)
fn filtered(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = query.material;
    let light = locate_light(material, direction_of(query.light));
    let view = locate_view(material, direction_of(query.view));
    let values = filtered_values(material, 0u, query.u, query.v, light, view);
    answers[id.x] = Answer(radiance(material, values, light), values);
}
