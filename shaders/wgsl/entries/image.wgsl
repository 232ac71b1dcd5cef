// A whole image: query 0 names material and directions, an invocation is a texel, answers are row by row.
@compute @workgroup_size(8, 8)
fn image(@builtin(global_invocation_id) id: vec3<u32>) {
    let query = queries[0];
    let material = query.material;
    let index = id.y * materials[material].width + id.x;
    if (id.x >= materials[material].width || id.y >= materials[material].height || index >= arrayLength(&answers)) {
        return;
    }
    let light = locate_light(material, direction_of(query.light));
    let view = locate_view(material, direction_of(query.view));
    let values = texel_values(material, id.x, id.y, light, view);
    answers[index] = Answer(radiance(material, values, light), values);
}
