//! Pictures: linear radiance to PNG and EXR, false colour, and tiles side by side. Presentation only.

use crate::error::{Result, ToolError};
use crate::files;
use std::path::Path;

/// Linear RGB, row by row.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Width.
    pub width: usize,
    /// Height.
    pub height: usize,
    /// Linear radiance, or display values for false colour.
    pub pixels: Vec<[f32; 3]>,
}

/// The sRGB transfer, to 8 bits.
#[cfg(feature = "png")]
fn to_srgb8(linear: f32) -> u8 {
    let c = linear.clamp(0.0, 1.0);
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0 + 0.5) as u8
}

/// Black, blue, magenta, orange, white for 0 to 1: monotonic in lightness.
pub fn false_colour(value: f32) -> [f32; 3] {
    const STOPS: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.02], [0.02, 0.04, 0.35], [0.45, 0.02, 0.35], [0.95, 0.4, 0.03], [1.0, 0.98, 0.85]];
    let at = value.clamp(0.0, 1.0) * 4.0;
    let low = (at as usize).min(3);
    let part = at - low as f32;
    std::array::from_fn(|c| STOPS[low][c] * (1.0 - part) + STOPS[low + 1][c] * part)
}

/// The error of `ln(x + offset)` over the three colours in false colour; `white` is the error that is white.
pub fn log_error(
    decoded: &[[f32; 3]],
    reference: &[[f32; 3]],
    [width, height]: [usize; 2],
    offset: f32,
    white: f32,
) -> Picture {
    Picture::from_fn(width, height, |x, y| {
        let (a, b) = (decoded[y * width + x], reference[y * width + x]);
        let square: f32 = a.iter().zip(b).map(|(a, b)| ((a + offset).ln() - (b + offset).ln()).powi(2)).sum();
        false_colour((square / 3.0).sqrt() / white)
    })
}

/// A decoded image, its reference and the error of `ln(x + offset)` in false colour, side by side; `white` is
/// the error that is white.
pub fn beside_error(
    decoded: &[[f32; 3]],
    reference: &[[f32; 3]],
    [width, height]: [usize; 2],
    offset: f32,
    white: f32,
    exposure: f32,
) -> Picture {
    let shown = |image: &[[f32; 3]]| Picture { width, height, pixels: image.to_vec() }.exposed(exposure);
    let error = log_error(decoded, reference, [width, height], offset, white);
    // Enlarged, so that a small tile can be looked at.
    let factor = (256 / width.max(height)).max(1);
    Picture::beside(&[shown(decoded), shown(reference), error].map(|tile| tile.enlarged(factor)), 8)
}

impl Picture {
    /// From a function of the pixel.
    pub fn from_fn(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [f32; 3]) -> Picture {
        Picture { width, height, pixels: (0..width * height).map(|i| pixel(i % width, i / width)).collect() }
    }

    /// Every pixel as a square of `factor` pixels.
    pub fn enlarged(&self, factor: usize) -> Picture {
        Picture::from_fn(self.width * factor, self.height * factor, |x, y| {
            self.pixels[y / factor * self.width + x / factor]
        })
    }

    /// Times a factor.
    pub fn exposed(mut self, factor: f32) -> Picture {
        self.pixels.iter_mut().flatten().for_each(|c| *c *= factor);
        self
    }

    /// Several of one height side by side, with a gap.
    pub fn beside(tiles: &[Picture], gap: usize) -> Picture {
        let width = tiles.iter().map(|tile| tile.width).sum::<usize>() + gap * tiles.len().saturating_sub(1);
        let height = tiles.iter().map(|tile| tile.height).max().unwrap_or(0);
        let mut all = Picture::from_fn(width, height, |_, _| [1.0; 3]);
        let mut left = 0;
        for tile in tiles {
            for y in 0..tile.height {
                let at = y * width + left;
                all.pixels[at..at + tile.width]
                    .copy_from_slice(&tile.pixels[y * tile.width..(y + 1) * tile.width]);
            }
            left += tile.width + gap;
        }
        all
    }

    /// Bytes of an 8-bit sRGB PNG.
    #[cfg(feature = "png")]
    pub fn to_png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
        let data: Vec<u8> = self.pixels.iter().flatten().map(|&c| to_srgb8(c)).collect();
        let mut writer = encoder.write_header().expect("writing to memory");
        writer.write_image_data(&data).expect("the size is that of the header");
        writer.finish().expect("writing to memory");
        bytes
    }

    /// Bytes of an EXR with 32-bit floats: the decoder's bits, unchanged.
    #[cfg(feature = "import")]
    pub fn to_exr(&self) -> Vec<u8> {
        use exr::prelude::{Image, SpecificChannels, WritableImage as _};
        let pixel = |at: exr::math::Vec2<usize>| {
            let [r, g, b] = self.pixels[at.y() * self.width + at.x()];
            (r, g, b)
        };
        let image = Image::from_channels((self.width, self.height), SpecificChannels::rgb(pixel));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes).expect("writing to memory");
        bytes.into_inner()
    }

    /// Writes a PNG or an EXR, by the name's ending.
    ///
    /// # Errors
    /// [`ToolError::Usage`] for any other ending; [`ToolError::Feature`] in a build without the feature
    /// `import`; on I/O.
    pub fn save(&self, path: &Path) -> Result<()> {
        files::write(path, &self.encoded(path)?)
    }

    fn encoded(&self, path: &Path) -> Result<Vec<u8>> {
        match path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
            #[cfg(feature = "png")]
            Some("png") => Ok(self.to_png()),
            #[cfg(feature = "import")]
            Some("exr") => Ok(self.to_exr()),
            #[cfg(not(feature = "png"))]
            Some("png") => Err(ToolError::lacking(&path.display().to_string(), "import")),
            #[cfg(not(feature = "import"))]
            Some("exr") => Err(ToolError::lacking(&path.display().to_string(), "import")),
            _ => Err(ToolError::Usage(format!("{}: pictures end in .png or .exr", path.display()))),
        }
    }
}
