//! From radiance to the channels that are coded, in floats: the encoder's side of chapter 7.
//!
//! Channels are an orthonormal mixture of red, green and blue (or of their logarithms). Because the mixture
//! is orthonormal, an error of the channels is an error of the colours of equal size, so that what is spent
//! on one channel can be weighed against what is saved in another.

use crate::data::dataset::Dataset;
use crate::format::model::TransferModel;
use std::f32::consts::LN_2;

/// Red, green, blue from the channels: grey, red against blue, green against both.
const CHANNELS_TO_RGB: [[f64; 3]; 3] = [
    [0.577_350_269_189_625_8, std::f64::consts::FRAC_1_SQRT_2, 0.408_248_290_463_863],
    [0.577_350_269_189_625_8, 0.0, -0.816_496_580_927_726],
    [0.577_350_269_189_625_8, -std::f64::consts::FRAC_1_SQRT_2, 0.408_248_290_463_863],
];

/// The mixture as a file states it, Q13.
pub fn matrix_q13() -> [i16; 9] {
    std::array::from_fn(|i| (CHANNELS_TO_RGB[i / 3][i % 3] * 8192.0).round() as i16)
}

/// Base-two logarithm of a positive normal number, within 3e-7 of magnitudes below 32.
///
/// Written out, so that it is vector code and the same on every machine.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    // The mantissa between sqrt(1/2) and sqrt(2): 0x3504f3 is the fraction of sqrt(2).
    let exponent = (bits.wrapping_sub(0x3f35_04f3) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32));
    // log2(m) = 2 / ln 2 * artanh((m - 1) / (m + 1)), and the quotient is below 0.172.
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = 2.885_39 + s2 * (0.961_796_7 + s2 * (0.577_078 + s2 * (0.412_198_6 + s2 * 0.320_598_9)));
    exponent as f32 + s * series
}

/// Domain in which radiance is decomposed, coded, or judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// `ln(x + e)`, with the dataset's offset `e`.
    Log,
    /// `x` itself.
    Linear,
}

impl Domain {
    /// A radiance in this domain.
    #[inline(always)]
    pub fn forward(self, x: f32, offset: f32) -> f32 {
        if self == Domain::Log { LN_2 * log2(x + offset) } else { x }
    }

    /// Radiance again.
    #[inline(always)]
    pub fn back(self, y: f32, offset: f32) -> f32 {
        (if self == Domain::Log { y.exp() - offset } else { y }).max(0.0)
    }
}

/// The transfer and offset that a domain is coded with.
pub fn transfer_of(data: &Dataset, domain: Domain) -> TransferModel {
    let statistics = data.statistics();
    match domain {
        Domain::Log => TransferModel::Log2 { offset: statistics.coded_offset() },
        // Values below 16, so that a texture is far below its bound.
        Domain::Linear => TransferModel::Linear {
            exponent: (statistics.largest.max(1e-30).log2().ceil() as i32 - 4).clamp(-60, 60),
        },
    }
}

/// Radiance to channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forward {
    /// As the file states it.
    pub transfer: TransferModel,
    /// Channels from colours: the inverse of the matrix of the file.
    from_rgb: [[f32; 3]; 3],
    /// Factor of linear values, a power of two.
    scale: f32,
}

impl Forward {
    /// For a transfer, with the mixture of [`matrix_q13`].
    pub fn new(transfer: TransferModel) -> Forward {
        let q = matrix_q13().map(|m| m as f64 / 8192.0);
        let matrix = glam::DMat3::from_cols_array(&q).transpose().inverse();
        let scale =
            if let TransferModel::Linear { exponent } = transfer { (-exponent as f32).exp2() } else { 1.0 };
        Forward {
            transfer,
            scale,
            from_rgb: std::array::from_fn(|r| std::array::from_fn(|c| matrix.row(r)[c] as f32)),
        }
    }

    /// The mixture alone: channels of values that are logarithms of base two, or radiances, already.
    #[inline(always)]
    pub fn mix(&self, v: [f32; 3]) -> [f32; 3] {
        self.from_rgb.map(|m| (m[0] * v[0] + m[1] * v[1] + m[2] * v[2]) * self.scale)
    }

    /// The three channels of one colour.
    #[inline(always)]
    pub fn channels(&self, rgb: [f32; 3]) -> [f32; 3] {
        let v = match self.transfer {
            TransferModel::Log2 { offset } => rgb.map(|x| log2(x + offset)),
            TransferModel::Linear { .. } => rgb.map(|x| x * self.scale),
        };
        self.from_rgb.map(|m| m[0] * v[0] + m[1] * v[1] + m[2] * v[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_exact_enough_everywhere() {
        for i in 1..200_000u32 {
            let x = f32::from_bits(0x0080_0000 + i * 10_000);
            assert!(
                (log2(x) as f64 - (x as f64).log2()).abs() < 3e-7 * (x as f64).log2().abs().max(1.0),
                "{x}"
            );
        }
        assert_eq!(log2(1.0), 0.0);
        assert_eq!(log2(8.0), 3.0);
    }

    #[test]
    fn channels_come_back_through_the_decoders_arithmetic() {
        for transfer in [TransferModel::Log2 { offset: 1e-3 }, TransferModel::Linear { exponent: 2 }] {
            let forward = Forward::new(transfer);
            for rgb in [[0.5, 0.25, 0.125], [0.001, 0.9, 3.0], [0.0, 1.0, 0.3]] {
                let channels = forward.channels(rgb);
                let q20 = channels.map(|v| (v as f64 * 1_048_576.0).round() as i32);
                let m = matrix_q13().map(i32::from);
                for c in 0..3 {
                    let values = selvedge::Values { c0: q20[0], c1: q20[1], c2: q20[2] };
                    let row =
                        selvedge::kernel::colour::matrix_row(m[3 * c], m[3 * c + 1], m[3 * c + 2], values)
                            as f64
                            / 1_048_576.0;
                    let back = match transfer {
                        TransferModel::Log2 { offset } => row.exp2() - offset as f64,
                        TransferModel::Linear { exponent } => row * (exponent as f64).exp2(),
                    };
                    assert!((back - rgb[c] as f64).abs() < 1e-5, "{rgb:?} {back}");
                }
            }
        }
    }
}
