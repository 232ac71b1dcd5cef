// One texel and one pair of sample directions: light[0] and view[0] are their indices.
@compute @workgroup_size(64)
fn texel(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= arrayLength(&queries)) {
        return;
    }
    let query = queries[id.x];
    let material = query.material;
    let values = point_values(material, query.u, query.v, query.light[0], query.view[0]);
    answers[id.x] = Answer(radiance(material, values, light_sample(material, query.light[0])), values);
}
