//! The colour models of the factorised formats: what three decoded numbers are in linear RGB.

/// What the writers add before a logarithm; a constant of all known readers, stated in no file.
pub const EPSILON: f32 = 1e-5;
/// Red, green and blue from Y, U, V.
const YUV: [[f32; 3]; 3] = [[1.0, 0.0, 1.13983], [1.0, -0.39465, -0.5806], [1.0, 2.03211, 0.0]];
/// Red, green and blue from Y, Co, Cg.
const YCOCG: [[f32; 3]; 3] = [[1.0, 1.0, -1.0], [1.0, 0.0, 1.0], [1.0, -1.0, -1.0]];

/// A colour model, by its number in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// 0: linear RGB.
    Rgb,
    /// 1: YUV.
    Yuv,
    /// 3: principal axes of the colours: the row of three times the matrix, plus the mean.
    Pca {
        /// Row-major.
        matrix: [f32; 9],
        /// Mean colour.
        mean: [f32; 3],
    },
    /// 4: YCoCg.
    YCoCg,
    /// 9: `ln(Y + e)`, U, V.
    LogYUv,
    /// 10: `ln(Y + e)`, and U and V as the sign and `ln(|U| / e)`.
    LogYLogUv,
    /// 11: `ln(Y + e)`, `U / (Y + e)`, `V / (Y + e)`.
    LogYRatioUv,
    /// 12: `ln(x + e)` of each colour; also the logarithm flag of `FMF12FCER`.
    LogRgb,
}

fn times(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn unlog(v: f32) -> f32 {
    v.exp() - EPSILON
}

impl Model {
    /// The model of a number.
    ///
    /// # Errors
    /// What the number means, if such a model is not read.
    pub fn from_number(number: i32, matrix: [f32; 9], mean: [f32; 3]) -> Result<Model, String> {
        Ok(match number {
            0 => Model::Rgb,
            1 => Model::Yuv,
            3 => Model::Pca { matrix, mean },
            4 => Model::YCoCg,
            9 => Model::LogYUv,
            10 => Model::LogYLogUv,
            11 => Model::LogYRatioUv,
            12 => Model::LogRgb,
            2 => return Err("colour model 2 (CIE Lab) is not read: its white point is in no file".into()),
            5 | 6 => {
                return Err(format!(
                    "colour model {number} (spectral) is not read: a material here has three colours"
                ));
            }
            _ => {
                return Err(format!(
                    "colour model {number} is not known; 0, 1, 3, 4, 9, 10, 11 and 12 are read"
                ));
            }
        })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Model::Rgb => "RGB",
            Model::Yuv => "YUV",
            Model::Pca { .. } => "principal axes",
            Model::YCoCg => "YCoCg",
            Model::LogYUv => "log Y, U, V",
            Model::LogYLogUv => "log Y, log U, log V",
            Model::LogYRatioUv => "log Y, U/Y, V/Y",
            Model::LogRgb => "log RGB",
        }
    }

    /// Linear RGB, which may be negative where a factorisation undershoots.
    pub fn to_rgb(self, v: [f32; 3]) -> [f32; 3] {
        match self {
            Model::Rgb => v,
            Model::Yuv => times(&YUV, v),
            Model::Pca { matrix, mean } => std::array::from_fn(|c| {
                v[0] * matrix[c] + v[1] * matrix[3 + c] + v[2] * matrix[6 + c] + mean[c]
            }),
            Model::YCoCg => times(&YCOCG, v),
            Model::LogYUv => times(&YUV, [unlog(v[0]), v[1], v[2]]),
            Model::LogYLogUv => {
                let signed = |u: f32| if u == 0.0 { 0.0 } else { (u.abs().exp() * EPSILON).copysign(u) };
                times(&YUV, [unlog(v[0]), signed(v[1]), signed(v[2])])
            }
            Model::LogYRatioUv => {
                let y = v[0].exp();
                times(&YUV, [y - EPSILON, v[1] * y, v[2] * y])
            }
            Model::LogRgb => v.map(unlog),
        }
    }
}
