//! Single images of measured materials, read as linear RGB: EXR, PNG, JPEG and Radiance pictures,
//! detected by content.
//!
//! | kind | read |
//! |---|---|
//! | EXR | first layer; R, G, B, or X, Y, Z, or Y; 16 or 32-bit floats, linear; the data window is the image |
//! | PNG | 8 or 16 bits, grey or RGB, as sRGB whatever its profile; alpha is ignored, palettes are refused |
//! | JPEG | 8 bits, grey or colour, as sRGB |
//! | Radiance | RGBE or XYZE, divided by its `EXPOSURE`; rows from the top (`-Y h +X w`), the bottom (`+Y h +X w`), or as ATRIUM |
//!
//! A Radiance picture of the ATRIUM archives says `+X 256 -Y 256`, which by Radiance's own rules would be
//! columns. Its data are rows from the bottom, by the one reader that was written against the archives
//! (2-propanol/BTF_extractor), and so they are read. Where the two numbers differ the picture is refused.

use crate::data::dataset::MOST_TEXELS;
use exr::prelude::{ReadChannels as _, ReadLayers as _, ReadSpecificChannel as _, Vec2};
use image::ImageDecoder as _;
use std::io::{BufRead, Read, Seek, SeekFrom};
use std::sync::LazyLock;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};

/// Most channels of a layer of an EXR.
const MOST_CHANNELS: usize = 1024;
/// Bytes that a pixel takes while its image is decoded: three numbers, and beside them what decoding needs.
pub const PIXEL_BYTES: usize = 12 + 12;

/// Linear sRGB of XYZ under D65 (IEC 61966-2-1, inverse of the primaries' matrix).
const XYZ: [[f32; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266, 1.876_010_8, 0.041_556],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// What the three numbers of an image are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Colours {
    /// As the image says: XYZ where its channels are called so, else RGB.
    #[default]
    Auto,
    /// RGB.
    Rgb,
    /// CIE XYZ, white D65.
    Xyz,
}

/// A place that an image is read from.
pub trait Stream: BufRead + Seek {}
impl<T: BufRead + Seek> Stream for T {}

/// An image whose head is read and whose pixels are not.
pub struct Opened<'a> {
    body: Body<'a>,
    /// Width and height.
    pub size: [usize; 2],
    is_xyz: bool,
}

enum Body<'a> {
    Exr(Box<exr::block::reader::Reader<Box<dyn Stream + Send + 'a>>>),
    Png(Box<png::Reader<Box<dyn Stream + Send + 'a>>>),
    Jpeg(Box<JpegDecoder<ZCursor<Vec<u8>>>>, usize),
    Radiance { stream: Box<dyn Stream + Send + 'a>, exposure: f32, from_bottom: bool },
}

/// Names of the kinds that are read, for errors.
const KINDS: &str = "EXR, PNG, JPEG and Radiance pictures are read";

/// Opens an image by its content and checks all of it that costs no memory. `memory` is how many bytes its
/// decoding may take.
///
/// # Errors
/// What is wrong with it, without a place.
pub fn open<'a>(mut stream: Box<dyn Stream + Send + 'a>, memory: usize) -> Result<Opened<'a>, String> {
    let mut magic = [0; 4];
    stream.read_exact(&mut magic).map_err(|_| format!("this is no image; {KINDS}"))?;
    stream.seek(SeekFrom::Start(0)).map_err(|error| error.to_string())?;
    let opened = match magic {
        [0x76, 0x2f, 0x31, 0x01] => open_exr(stream, memory)?,
        [0x89, b'P', b'N', b'G'] => open_png(stream, memory)?,
        [0xff, 0xd8, 0xff, _] => open_jpeg(stream, memory)?,
        [b'#', b'?', _, _] => open_radiance(stream)?,
        _ => return Err(format!("this is no image; {KINDS}")),
    };
    let [width, height] = opened.size;
    if opened.size.iter().any(|n| !(1..=MOST_TEXELS).contains(n)) {
        return Err(format!("{width} x {height} pixels; 1 to {MOST_TEXELS} along an axis are possible"));
    }
    let needed = width as u64 * height as u64 * PIXEL_BYTES as u64;
    if needed > memory as u64 {
        return Err(format!(
            "{width} x {height} pixels need {needed} bytes to decode; {memory} are allowed (--memory)"
        ));
    }
    Ok(opened)
}

impl Opened<'_> {
    /// Whether its numbers are read as XYZ.
    fn is_xyz(&self, colours: Colours) -> bool {
        match colours {
            Colours::Auto => self.is_xyz,
            Colours::Rgb => false,
            Colours::Xyz => true,
        }
    }

    /// The linear RGB pixels, row by row from the top. Those of XYZ may be negative; none is checked.
    ///
    /// # Errors
    /// What is wrong with the image.
    pub fn pixels(self, colours: Colours) -> Result<Vec<[f32; 3]>, String> {
        let is_xyz = self.is_xyz(colours);
        let mut pixels = match self.body {
            Body::Exr(reader) => exr_pixels(*reader, self.size).map_err(|error| error.to_string())?,
            Body::Png(reader) => png_pixels(*reader).map_err(|error| error.to_string())?,
            Body::Jpeg(decoder, samples) => jpeg_pixels(*decoder, samples)?,
            Body::Radiance { stream, exposure, from_bottom } => {
                radiance_pixels(stream, self.size, exposure, from_bottom)?
            }
        };
        if is_xyz {
            pixels.iter_mut().for_each(|v| *v = XYZ.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]));
        }
        Ok(pixels)
    }
}

fn open_exr(stream: Box<dyn Stream + Send + '_>, memory: usize) -> Result<Opened<'_>, String> {
    let reader = exr::block::read(stream, false).map_err(|error| error.to_string())?;
    let Some(layer) = reader.headers().first().filter(|layer| !layer.deep) else {
        return Err("the first layer is deep data".into());
    };
    let found = |name: &str| layer.channels.list.iter().find(|channel| channel.name == *name);
    let named = |names: [&str; 3]| names.map(found).into_iter().collect::<Option<Vec<_>>>();
    let is_xyz = named(["R", "G", "B"]).is_none() && named(["X", "Y", "Z"]).is_some();
    let Some(colours) =
        named(["R", "G", "B"]).or_else(|| named(["X", "Y", "Z"])).or_else(|| Some(vec![found("Y")?]))
    else {
        let names: Vec<String> =
            layer.channels.list.iter().take(4).map(|channel| channel.name.to_string()).collect();
        return Err(format!(
            "the first layer has the {} channels {}, ..., and neither R, G, B nor X, Y, Z nor Y",
            layer.channels.list.len(),
            names.join(", ")
        ));
    };
    if colours
        .iter()
        .any(|c| c.sampling != Vec2(1, 1) || c.sample_type == exr::meta::attribute::SampleType::U32)
    {
        return Err("the channels are subsampled or not floats".into());
    }
    // Sizes are products of fields, which the library does not check.
    let is_large = |size: Vec2<usize>| size.width() > MOST_TEXELS || size.height() > MOST_TEXELS;
    let is_sound = |header: &exr::meta::header::Header| match header.blocks {
        exr::meta::BlockDescription::Tiles(tiles) => !is_large(tiles.tile_size) && !is_large(header.layer_size),
        exr::meta::BlockDescription::ScanLines => !is_large(header.layer_size),
    } && header.channels.list.len() <= MOST_CHANNELS;
    if !reader.headers().iter().all(is_sound) {
        return Err(format!(
            "a layer of more than {MOST_TEXELS} pixels along an axis, or of more than {MOST_CHANNELS} channels"
        ));
    }
    // Blocks of all layers are read, also those that nobody wants.
    let blocks =
        reader.headers().iter().map(exr::meta::header::Header::max_block_byte_size).max().unwrap_or(0);
    if blocks > memory {
        return Err(format!("a block of {blocks} bytes; {memory} are allowed (--memory)"));
    }
    let size = [layer.layer_size.width(), layer.layer_size.height()];
    Ok(Opened { body: Body::Exr(Box::new(reader)), size, is_xyz })
}

fn exr_pixels(
    reader: exr::block::reader::Reader<Box<dyn Stream + Send + '_>>,
    [width, height]: [usize; 2],
) -> exr::error::Result<Vec<[f32; 3]>> {
    let has = |names: [&str; 3]| {
        names
            .iter()
            .all(|name| reader.headers()[0].channels.list.iter().any(|channel| channel.name == **name))
    };
    let (has_rgb, has_xyz) = (has(["R", "G", "B"]), has(["X", "Y", "Z"]));
    // Pixels that no chunk of the file covers stay NaN, and are refused as such.
    let create = move |_: Vec2<usize>, _: &_| vec![[f32::NAN; 3]; width * height];
    let set = move |pixels: &mut Vec<[f32; 3]>,
                    at: Vec2<usize>,
                    (r, g, b, x, y, z): (f32, f32, f32, f32, f32, f32)| {
        if let Some(pixel) = pixels.get_mut(at.y() * width + at.x()) {
            *pixel = if has_rgb {
                [r, g, b]
            } else if has_xyz {
                [x, y, z]
            } else {
                [y; 3]
            };
        }
    };
    let channels = exr::image::read::read().no_deep_data().largest_resolution_level().specific_channels();
    let channels = channels.optional("R", 0.0f32).optional("G", 0.0f32).optional("B", 0.0f32);
    let channels = channels
        .optional("X", 0.0f32)
        .optional("Y", 0.0f32)
        .optional("Z", 0.0f32)
        .collect_pixels(create, set);
    // Images are decoded side by side, which is parallel enough.
    let image = channels.first_valid_layer().all_attributes().non_parallel().from_chunks(reader)?;
    Ok(image.layer_data.channel_data.pixels)
}

fn open_png(stream: Box<dyn Stream + Send + '_>, memory: usize) -> Result<Opened<'_>, String> {
    let mut decoder = png::Decoder::new_with_limits(stream, png::Limits { bytes: memory });
    decoder.set_transformations(png::Transformations::IDENTITY);
    let reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (colour, depth) = reader.output_color_type();
    if colour == png::ColorType::Indexed || !matches!(depth, png::BitDepth::Eight | png::BitDepth::Sixteen) {
        return Err(format!("{colour:?} of {} bits; grey or RGB of 8 or 16 bits are read", depth as u8));
    }
    let size = [reader.info().width as usize, reader.info().height as usize];
    Ok(Opened { body: Body::Png(Box::new(reader)), size, is_xyz: false })
}

fn png_pixels(
    mut reader: png::Reader<Box<dyn Stream + Send + '_>>,
) -> Result<Vec<[f32; 3]>, png::DecodingError> {
    let (colour, depth) = reader.output_color_type();
    let mut bytes = vec![0; reader.output_buffer_size().ok_or(png::DecodingError::LimitsExceeded)?];
    reader.next_frame(&mut bytes)?;
    // 8 bits are the 16 of the byte twice: n / 255 is 257 n / 65535.
    let wide = depth == png::BitDepth::Sixteen;
    let number = |at: usize| {
        LINEAR[usize::from(if wide {
            u16::from_be_bytes([bytes[2 * at], bytes[2 * at + 1]])
        } else {
            257 * u16::from(bytes[at])
        })]
    };
    let samples = colour.samples();
    let grey = samples < 3;
    let pixels = bytes.len() / (samples * (1 + usize::from(wide)));
    Ok((0..pixels).map(|i| std::array::from_fn(|c| number(i * samples + if grey { 0 } else { c }))).collect())
}

fn open_jpeg(stream: Box<dyn Stream + Send + '_>, memory: usize) -> Result<Opened<'_>, String> {
    let mut bytes = Vec::new();
    stream.take(memory as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() > memory {
        return Err(format!("more than {memory} bytes, which are allowed (--memory)"));
    }
    // Lenient readers fill what is missing with grey.
    let options = DecoderOptions::new_safe()
        .set_strict_mode(true)
        .set_max_width(MOST_TEXELS)
        .set_max_height(MOST_TEXELS);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| error.to_string())?;
    let colour = decoder.input_colorspace().unwrap_or(ColorSpace::Unknown);
    let to = match colour {
        ColorSpace::Luma => ColorSpace::Luma,
        ColorSpace::YCbCr | ColorSpace::RGB => ColorSpace::RGB,
        _ => return Err(format!("a JPEG of {colour:?}; grey and colour of 8 bits are read")),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(to));
    let (width, height) = decoder.dimensions().unwrap_or_default();
    Ok(Opened {
        size: [width, height],
        body: Body::Jpeg(Box::new(decoder), to.num_components()),
        is_xyz: false,
    })
}

fn jpeg_pixels(mut decoder: JpegDecoder<ZCursor<Vec<u8>>>, samples: usize) -> Result<Vec<[f32; 3]>, String> {
    let bytes = decoder.decode().map_err(|error| error.to_string())?;
    let linear = |byte: u8| LINEAR[257 * usize::from(byte)];
    Ok(bytes
        .chunks_exact(samples)
        .map(|pixel| if samples == 1 { [linear(pixel[0]); 3] } else { [0, 1, 2].map(|c| linear(pixel[c])) })
        .collect())
}

/// Most bytes of a Radiance header, which is text.
const MOST_HEADER: u64 = 1 << 16;

fn open_radiance(mut stream: Box<dyn Stream + Send + '_>) -> Result<Opened<'_>, String> {
    let mut exposure = 1.0f32;
    let mut is_xyz = false;
    let mut read = 0;
    let mut line = || -> Result<String, String> {
        let mut bytes = Vec::new();
        let taken = stream
            .as_mut()
            .take(MOST_HEADER - read)
            .read_until(b'\n', &mut bytes)
            .map_err(|error| error.to_string())?;
        read += taken as u64;
        match bytes.pop() {
            Some(b'\n') => Ok(String::from_utf8_lossy(&bytes).trim_end().to_owned()),
            _ => Err("the header of a Radiance picture has no end".into()),
        }
    };
    line()?;
    loop {
        let text = line()?;
        if text.is_empty() {
            break;
        }
        if let Some(format) = text.strip_prefix("FORMAT=") {
            is_xyz = match format.trim() {
                "32-bit_rle_rgbe" => false,
                "32-bit_rle_xyze" => true,
                other => {
                    return Err(format!(
                        "a Radiance picture of format {other:?}; 32-bit_rle_rgbe and 32-bit_rle_xyze are read"
                    ));
                }
            };
        } else if let Some(factor) = text.strip_prefix("EXPOSURE=") {
            // Several lines multiply.
            let product = factor.trim().parse::<f32>().ok().map(|factor| exposure * factor);
            exposure = product
                .filter(|f| f.is_normal() && *f > 0.0)
                .ok_or_else(|| format!("the exposure {factor:?}"))?;
        } else if text.starts_with("COLORCORR=") {
            return Err(
                "a Radiance picture with COLORCORR is not read: its colours are scaled one by one".into()
            );
        }
    }
    let text = line()?;
    let words: Vec<&str> = text.split_whitespace().collect();
    let number = |word: &str| word.parse::<usize>().map_err(|_| format!("the resolution {text:?}"));
    let (size, from_bottom) = match words[..] {
        ["-Y", height, "+X", width] => ([number(width)?, number(height)?], false),
        ["+Y", height, "+X", width] => ([number(width)?, number(height)?], true),
        ["+X", first, "-Y", second] if first == second => ([number(first)?; 2], true),
        _ => {
            return Err(format!(
                "the resolution {text:?} is not read; -Y h +X w, +Y h +X w, and +X n -Y n of the ATRIUM archives are"
            ));
        }
    };
    Ok(Opened { body: Body::Radiance { stream, exposure, from_bottom }, size, is_xyz })
}

fn radiance_pixels(
    stream: Box<dyn Stream + Send + '_>,
    [width, height]: [usize; 2],
    exposure: f32,
    from_bottom: bool,
) -> Result<Vec<[f32; 3]>, String> {
    // The library reads rows from the top alone; it is shown a header that says so.
    let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
    let decoder = image::codecs::hdr::HdrDecoder::new(std::io::Cursor::new(header).chain(stream))
        .map_err(|error| error.to_string())?;
    let mut bytes = vec![0; width * height * 12];
    decoder.read_image(&mut bytes).map_err(|error| error.to_string())?;
    let mut pixels: Vec<[f32; 3]> = bytes
        .as_chunks::<12>()
        .0
        .iter()
        .map(|b| [0, 4, 8].map(|i| f32::from_ne_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]) / exposure))
        .collect();
    if from_bottom {
        for y in 0..height / 2 {
            let (above, below) = pixels.split_at_mut((height - 1 - y) * width);
            above[y * width..][..width].swap_with_slice(&mut below[..width]);
        }
    }
    Ok(pixels)
}

/// Linear values of all 16-bit sRGB values (IEC 61966-2-1).
static LINEAR: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let linear = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    (0..=u16::MAX).map(|n| linear(f64::from(n) / 65_535.0) as f32).collect()
});

/// The linear value of a 16-bit sRGB one.
pub fn from_srgb16(value: u16) -> f32 {
    LINEAR[usize::from(value)]
}

/// The sRGB encoding of a linear value from 0 to 1, from 0 to 1.
pub fn to_srgb(linear: f32) -> f64 {
    let c = f64::from(linear);
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}
