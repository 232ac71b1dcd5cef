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
