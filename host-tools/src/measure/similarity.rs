//! How alike two pictures look: SSIM (Wang, Bovik, Sheikh, Simoncelli 2004) and FLIP (Andersson, Nilsson,
//! Akenine-Moeller, Oskarsson, Aastrom, Fairchild 2020).
//!
//! Both are of pictures as they are shown: linear RGB between zero and one, which a caller has exposed.
//! Pixels beyond the border are those of the border.

use std::f32::consts::PI;

/// Pixels of a degree of the visual field that FLIP assumes: a 0.7 m wide monitor of 3840 pixels, 0.7 m away.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

type Rgb = [f32; 3];

fn encoded(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// One number for each pixel.
#[derive(Clone)]
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Plane {
    fn of(image: &[Rgb], width: usize, value: impl Fn(Rgb) -> f32) -> Plane {
        Plane { width, height: image.len() / width, values: image.iter().map(|&rgb| value(rgb)).collect() }
    }

    fn map2(&self, other: &Plane, value: impl Fn(f32, f32) -> f32) -> Plane {
        Plane { values: self.values.iter().zip(&other.values).map(|(&a, &b)| value(a, b)).collect(), ..*self }
    }

    /// Rows by one kernel, columns by another, both of odd length.
    fn filtered(&self, along_x: &[f32], along_y: &[f32]) -> Plane {
        let tap = |at: usize, k: usize, kernel: &[f32], size: usize| {
            (at + k).saturating_sub(kernel.len() / 2).min(size - 1)
        };
        let mut rows = vec![0.0; self.values.len()];
        for (i, out) in rows.iter_mut().enumerate() {
            let (x, row) = (i % self.width, &self.values[i / self.width * self.width..][..self.width]);
            *out = along_x
                .iter()
                .enumerate()
                .map(|(k, weight)| weight * row[tap(x, k, along_x, self.width)])
                .sum();
        }
        let mut values = vec![0.0f32; rows.len()];
        for (y, out) in values.chunks_mut(self.width).enumerate() {
            for (k, weight) in along_y.iter().enumerate() {
                let row = &rows[tap(y, k, along_y, self.height) * self.width..][..self.width];
                out.iter_mut().zip(row).for_each(|(out, v)| *out += weight * v);
            }
        }
        Plane { values, ..*self }
    }
}

/// A Gaussian of a deviation in pixels, whose weights sum to one.
fn gaussian(deviation: f32, radius: usize) -> Vec<f32> {
    let at = |k: usize| (-((k as f32 - radius as f32).powi(2)) / (2.0 * deviation * deviation)).exp();
    let sum: f32 = (0..=2 * radius).map(at).sum();
    (0..=2 * radius).map(|k| at(k) / sum).collect()
}

/// Mean structural similarity of the sRGB-encoded luma (Rec. 709), windows of 11 x 11 with a deviation of
/// 1.5; one for equal pictures.
pub fn ssim(reference: &[Rgb], other: &[Rgb], width: usize) -> f64 {
    let luma = |[r, g, b]: Rgb| 0.2126 * encoded(r) + 0.7152 * encoded(g) + 0.0722 * encoded(b);
    let (a, b) = (Plane::of(reference, width, luma), Plane::of(other, width, luma));
    let kernel = gaussian(1.5, 5);
    let mean = |plane: &Plane| plane.filtered(&kernel, &kernel);
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let [aa, bb, ab] = [(&a, &a), (&b, &b), (&a, &b)].map(|(a, b)| mean(&a.map2(b, |a, b| a * b)));
    let (c1, c2) = (0.01f64.powi(2), 0.03f64.powi(2));
    let at = |i: usize| {
        let [ma, mb, aa, bb, ab] = [&mean_a, &mean_b, &aa, &bb, &ab].map(|plane| plane.values[i] as f64);
        let (va, vb, cov) = ((aa - ma * ma).max(0.0), (bb - mb * mb).max(0.0), ab - ma * mb);
        ((2.0 * ma * mb + c1) * (2.0 * cov + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    };
    (0..a.values.len()).map(at).sum::<f64>() / a.values.len() as f64
}

/// Linear RGB (Rec. 709) to XYZ.
const TO_XYZ: [Rgb; 3] = [
    [0.412_390_8, 0.357_584_33, 0.180_480_8],
    [0.212_639, 0.715_168_65, 0.072_192_32],
    [0.019_330_82, 0.119_194_78, 0.950_532_14],
];
/// XYZ to linear RGB.
const FROM_XYZ: [Rgb; 3] = [
    [3.240_97, -1.537_383_2, -0.498_610_8],
    [-0.969_243_65, 1.875_967_5, 0.041_555_06],
    [0.055_630_08, -0.203_976_96, 1.056_971_5],
];

fn times(m: &[Rgb; 3], v: Rgb) -> Rgb {
    m.each_ref().map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The white that colours are relative to: linear RGB one.
fn white() -> Rgb {
    times(&TO_XYZ, [1.0; 3])
}

fn to_opponent(rgb: Rgb) -> Rgb {
    let [x, y, z] = [0, 1, 2].map(|i| times(&TO_XYZ, rgb)[i] / white()[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([y, cx, cz]: Rgb) -> Rgb {
    let y = (y + 16.0) / 116.0;
    let relative = [y + cx / 500.0, y, y - cz / 200.0];
    times(&FROM_XYZ, [0, 1, 2].map(|i| relative[i] * white()[i]))
}

/// L*a*b* with the chroma scaled by lightness (Hunt's effect).
fn hunt_lab(rgb: Rgb) -> Rgb {
    let bend = |t: f32| if t > 0.008_856_452 { t.cbrt() } else { 7.787_037 * t + 16.0 / 116.0 };
    let xyz = times(&TO_XYZ, rgb);
    let [x, y, z] = [0, 1, 2].map(|i| bend(xyz[i] / white()[i]));
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// Distance of lightness plus distance of chroma.
fn hyab(a: Rgb, b: Rgb) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// The colours that an observer makes out: an image filtered by the contrast sensitivity of its three
/// opponent channels.
fn seen(image: &[Rgb], width: usize) -> Vec<Rgb> {
    // Sums of Gaussians in the frequency domain, as amplitude and falloff (table 1 of the paper).
    const SENSITIVITY: [[[f32; 2]; 2]; 3] =
        [[[1.0, 0.0047], [0.0, 1e-5]], [[1.0, 0.0053], [0.0, 1e-5]], [[34.1, 0.04], [13.5, 0.025]]];
    let step = 1.0 / PIXELS_PER_DEGREE;
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
    let channels: [Plane; 3] = std::array::from_fn(|c| {
        let plane = Plane::of(image, width, |rgb| to_opponent(rgb)[c]);
        // A Gaussian with a frequency falloff b is one of the place with pi^2 / b, which is a product of one
        // along x and one along y.
        let parts = SENSITIVITY[c].map(|[amplitude, falloff]| {
            let at = |k: usize| (-PI * PI / falloff * ((k as f32 - radius as f32) * step).powi(2)).exp();
            let kernel: Vec<f32> = (0..=2 * radius).map(at).collect();
            (amplitude * PI / falloff, kernel)
        });
        let total: f32 =
            parts.iter().map(|(amplitude, kernel)| amplitude * kernel.iter().sum::<f32>().powi(2)).sum();
        let mut out = Plane { values: vec![0.0; plane.values.len()], ..plane };
        for (amplitude, kernel) in parts.iter().filter(|part| part.0 > 0.0) {
            let filtered = plane.filtered(kernel, kernel);
            out = out.map2(&filtered, |sum, v| sum + v * amplitude / total);
        }
        out
    });
    let clamped =
        |i: usize| from_opponent([0, 1, 2].map(|c: usize| channels[c].values[i])).map(|v| v.clamp(0.0, 1.0));
    (0..image.len()).map(clamped).collect()
}

/// Magnitudes of edges and of points in the lightness of an image.
fn features(image: &[Rgb], width: usize) -> [Plane; 2] {
    let lightness = Plane::of(image, width, |rgb| (to_opponent(rgb)[0] + 16.0) / 116.0);
    let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as usize;
    let blur: Vec<f32> = (0..=2 * radius)
        .map(|k| (-((k as f32 - radius as f32).powi(2)) / (2.0 * deviation * deviation)).exp())
        .collect();
    // Positive weights sum to one, negative ones to minus one.
    let balanced = |mut kernel: Vec<f32>, blur: &[f32]| {
        let across: f32 = blur.iter().sum();
        let positive: f32 = kernel.iter().filter(|w| **w > 0.0).sum::<f32>() * across;
        let negative: f32 = -kernel.iter().filter(|w| **w < 0.0).sum::<f32>() * across;
        kernel.iter_mut().for_each(|w| *w /= if *w > 0.0 { positive } else { negative });
        kernel
    };
    let at = |k: usize| k as f32 - radius as f32;
    let edge = balanced(blur.iter().enumerate().map(|(k, w)| -at(k) * w).collect(), &blur);
    let point = balanced(
        blur.iter().enumerate().map(|(k, w)| (at(k).powi(2) / (deviation * deviation) - 1.0) * w).collect(),
        &blur,
    );
    [edge, point].map(|kernel| {
        let (x, y) = (lightness.filtered(&kernel, &blur), lightness.filtered(&blur, &kernel));
        x.map2(&y, f32::hypot)
    })
}

/// Mean FLIP error of two pictures at [`PIXELS_PER_DEGREE`]; zero for equal ones, at most one.
pub fn flip(reference: &[Rgb], other: &[Rgb], width: usize) -> f64 {
    let shown = |image: &[Rgb]| image.iter().map(|rgb| rgb.map(|c| c.clamp(0.0, 1.0))).collect::<Vec<_>>();
    let (reference, other) = (shown(reference), shown(other));
    const EXPONENT: f32 = 0.7;
    // The largest distance there is, green from blue, and where the scale bends.
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(EXPONENT);
    let (bend_at, bend_to) = (0.4 * largest, 0.95);
    let (seen_a, seen_b) = (seen(&reference, width), seen(&other, width));
    let ([edges_a, points_a], [edges_b, points_b]) = (features(&reference, width), features(&other, width));
    let at = |i: usize| {
        let distance = hyab(hunt_lab(seen_a[i]), hunt_lab(seen_b[i])).powf(EXPONENT);
        let colour = if distance < bend_at {
            distance * bend_to / bend_at
        } else {
            bend_to + (distance - bend_at) / (largest - bend_at) * (1.0 - bend_to)
        };
        let difference = |a: &Plane, b: &Plane| (a.values[i] - b.values[i]).abs();
        let feature =
            (difference(&edges_a, &edges_b).max(difference(&points_a, &points_b)) / 2f32.sqrt()).sqrt();
        (colour.powf(1.0 - feature)) as f64
    };
    (0..reference.len()).map(at).sum::<f64>() / reference.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn noise(seed: u64, amount: f32) -> Vec<Rgb> {
        let (mut base, mut random) = (Random::new(1), Random::new(seed));
        (0..32 * 24)
            .map(|_| {
                std::array::from_fn(|_| {
                    base.range(200, 800) as f32 / 1000.0 + amount * random.range(-100, 100) as f32 / 1000.0
                })
            })
            .collect()
    }

    #[test]
    fn equal_pictures_are_alike_and_more_noise_is_less_alike() {
        let clean = noise(2, 0.0);
        assert!((ssim(&clean, &clean, 32) - 1.0).abs() < 1e-9);
        assert_eq!(flip(&clean, &clean, 32), 0.0);
        let worse: Vec<(f64, f64)> = [0.2, 0.5, 1.0]
            .iter()
            .map(|&amount| (ssim(&clean, &noise(3, amount), 32), flip(&clean, &noise(3, amount), 32)))
            .collect();
        assert!(worse.windows(2).all(|pair| pair[1].0 < pair[0].0 && pair[1].1 > pair[0].1), "{worse:?}");
    }

    /// Constant pictures have no structure: SSIM is its luminance term, FLIP its colour term.
    #[test]
    fn constant_pictures_have_the_values_of_the_formulas() {
        let (a, b) = (vec![[0.5; 3]; 144], vec![[0.2; 3]; 144]);
        let (x, y) = (encoded(0.5) as f64, encoded(0.2) as f64);
        let wanted = (2.0 * x * y + 1e-4) / (x * x + y * y + 1e-4);
        assert!((ssim(&a, &b, 12) - wanted).abs() < 1e-4, "{} {wanted}", ssim(&a, &b, 12));
        // Black against white: the distance is that of lightness alone, 100.
        let (black, white) = (vec![[0.0; 3]; 144], vec![[1.0; 3]; 144]);
        let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(0.7);
        let distance = 100f32.powf(0.7);
        let colour = 0.95 + (distance - 0.4 * largest) / (0.6 * largest) * 0.05;
        assert!(
            (flip(&black, &white, 12) - colour as f64).abs() < 2e-3,
            "{} {colour}",
            flip(&black, &white, 12)
        );
    }

    #[test]
    fn opponent_colours_go_back() {
        for rgb in [[0.1, 0.5, 0.9], [1.0, 1.0, 1.0], [0.0, 0.2, 0.0]] {
            let back = from_opponent(to_opponent(rgb));
            assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-4), "{rgb:?} {back:?}");
        }
    }
}
