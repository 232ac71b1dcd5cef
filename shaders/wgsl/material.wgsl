// What the kernel knows of an open material (chapter 1). Twin: decoder-core/src/kernel/materials[material].rs.
//
// One 32-bit word a field, in the order of the Rust struct, so that the host copies its records here.

// A channel that is not in the file: its value is zero.
const CHANNEL_MISSING: u32 = 0u;
// A channel that is a mean for every pair of directions, without texture.
const CHANNEL_MEAN: u32 = 1u;
// A channel with texture.
const CHANNEL_FULL: u32 = 2u;
// Channels are base-two logarithms of radiance plus an offset.
const TRANSFER_LOG2: u32 = 0u;
// Channels are linear.
const TRANSFER_LINEAR: u32 = 1u;

// What every method has of a channel. Offsets are word numbers; 0 for what a channel does not have.
struct Channel {
    state: u32,
    mean_start: u32,
    scale_start: u32,
    full_rank: u32,
}

// Everything that decoding needs beside the words of the file. Offsets are word numbers.
struct Material {
    file_start: u32,
    width: u32,
    height: u32,
    level_count: u32,
    light_count: u32,
    view_count: u32,
    light_start: u32,
    view_start: u32,
    transfer: u32,
    cosine_included: u32,
    offset_mantissa_q31: u32,
    exponent: i32,
    matrix_q13: array<i32, 9>,
    edge: u32,
    edge_reciprocal_q18: u32,
    layer_count: u32,
    layer_limit: u32,
    full_count: u32,
    method: u32,
    parts: array<u32, 12>,
    channels: array<Channel, 3>,
}

// Functions are handed the number of a material in this table, never its words.
@group(0) @binding(1) var<storage, read> materials: array<Material>;

// Word number of part `index` of the method, 0 for none (1.4).
fn part(material: u32, index: u32) -> u32 {
    // An index is a constant of the method, and a channel below three.
    return materials[material].parts[min(index, 11u)];
}

// What every method has of channel `number`; beyond the last, the last (8.3).
fn channel_of(material: u32, number: u32) -> Channel {
    // 8.3-4: no index is out of range.
    return materials[material].channels[min(number, 2u)];
}

// Texels along an axis of `size` texels at `level`: its share of the size, rounded up (9.1-1).
fn level_size(size: u32, level: u32) -> u32 {
    // 9.1-1: never zero, since sizes are at least one.
    return (size + ((1u << level) - 1u)) >> level;
}
