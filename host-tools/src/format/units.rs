//! Ones of the fixed-point formats, for the host's arithmetic in binary64.

/// One in Q13: entries of the colour matrix.
pub const ONE_Q13: f64 = 8_192.0;
/// One in Q14: the radius of the disc of directions.
pub const ONE_Q14: f64 = 16_384.0;
/// One in Q15: factors, weights, cosines, scales.
pub const ONE_Q15: f64 = 32_768.0;
/// One in Q20: values of channels, means.
pub const ONE_Q20: f64 = 1_048_576.0;
/// The largest entry of a 16-bit table; `-ONE_Q15` is in none (8.1-7, 10.1-4).
pub const LARGEST_ENTRY: f64 = 32_767.0;
