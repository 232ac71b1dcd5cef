//! What stands before the values of a `.btf`.

use crate::data::dataset::{MOST_DIRECTIONS, MOST_TEXELS};
use crate::error::Result;
use crate::foreign::bytes::{Cursor, Width};
use glam::DVec3;
use serde::Serialize;

/// Signatures, the longest of a family first.
pub(super) const SIGNATURES: [&str; 7] =
    ["!DFMF08FCR", "!FMF12FCER", "!FMF06FCR", "!FMF06FC", "!PVF06FCR", "!PVF06FC", "!BDIF06R2!"];
/// In place of the meta block's length: the older layout of `PVF`.
pub(super) const OLD_VIEWS: u32 = 301_074;
/// Most channels whose names are read.
const MOST_CHANNELS: u32 = 4096;

/// The fields before the values, and the layout of the values in words.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Head {
    /// Which of the formats it is.
    pub signature: &'static str,
    /// Version of the meta block; none in the older layout of `PVF`.
    pub version: Option<u32>,
    /// Name of the measurement setup.
    pub setup: String,
    /// Name of the image sensor.
    pub sensor: String,
    /// Name of the light source.
    pub light_source: String,
    /// Texels in a millimetre, 0 if unknown.
    pub pixels_per_mm: f32,
    /// Scale of the colours as the file states it; no known reader applies it.
    pub rgb_scale: [f32; 3],
    /// Whether the values contain the cosine of the light's angle, if the file states it.
    pub cosine_included: Option<bool>,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Texels along x and y.
    pub size: [usize; 2],
    /// Light directions.
    #[serde(skip)]
    pub lights: Vec<DVec3>,
    /// View directions.
    #[serde(skip)]
    pub views: Vec<DVec3>,
    /// Frames of texels that the file has.
    pub rotations: u32,
    /// Those that are not the identity.
    pub rotated: u32,
    /// Size of the height map.
    pub height_map: Option<[u32; 2]>,
    /// How the values are stored, in words.
    pub layout: String,
    /// Bytes behind the last value.
    pub unread: u64,
}

impl Head {
    pub(super) fn pairs(&self) -> usize {
        self.lights.len() * self.views.len()
    }

    pub(super) fn texels(&self) -> usize {
        self.size[0] * self.size[1]
    }
}

pub(super) fn read_meta(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<()> {
    let start = cursor.at;
    let length = cursor.u32("length of the meta block")?;
    let version = cursor.u32("version of the meta block")?;
    if !(1..=4).contains(&version) {
        return cursor.fail(4, format!("version {version} of the meta block; 1 to 4 are known"));
    }
    head.version = Some(version);
    head.setup = cursor.text(80, "measurement setup")?;
    head.sensor = cursor.text(80, "image sensor")?;
    head.light_source = cursor.text(80, "light source")?;
    head.pixels_per_mm = cursor.f32("pixels per mm")?;
    head.rgb_scale = cursor.floats("scale of the colours")?;
    if version > 1 {
        head.cosine_included = Some(cursor.u32("cosine flag")? != 0);
    }
    if version > 2 {
        let length = cursor.u32("length of the XML text")?;
        cursor.skip(length as u64, "XML text")?;
    }
    head.channels = ["R", "G", "B"].map(String::from).to_vec();
    if version > 3 {
        let count = cursor.u32("channels")?;
        if count == 0 || count > MOST_CHANNELS {
            return cursor.fail(4, format!("{count} channels"));
        }
        head.channels.clear();
        for _ in 0..count {
            let length = cursor.u32("length of a channel's name")?;
            head.channels.push(cursor.text(length, "name of a channel")?);
        }
    }
    if cursor.at != start + length as u64 {
        return cursor
            .bytes
            .fail(start, format!("a meta block of {length} bytes; its fields take {}", cursor.at - start));
    }
    let is_rgb = head.channels.iter().map(|name| name.to_ascii_uppercase()).eq(["R", "G", "B"]);
    if head.channels.len() != 1 && !is_rgb {
        let shown: Vec<&str> = head.channels.iter().map(String::as_str).take(4).collect();
        return cursor.bytes.fail(
            start,
            format!(
                "the {} channels {}{} are not read; R, G, B and a single one are",
                head.channels.len(),
                shown.join(", "),
                if head.channels.len() > 4 { ", ..." } else { "" }
            ),
        );
    }
    Ok(())
}

pub(super) fn read_directions(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<()> {
    let limited = |cursor: &mut Cursor<'_>, what: &str| -> Result<u32> {
        let count = cursor.u32(what)?;
        if count == 0 || count as usize > MOST_DIRECTIONS {
            return cursor.fail(4, format!("{count} {what}; 1 to {MOST_DIRECTIONS} are possible"));
        }
        Ok(count)
    };
    let views = limited(cursor, "view directions")?;
    for view in 0..views {
        head.views.push(read_direction(cursor, "view")?);
        let lights = limited(cursor, "light directions")?;
        if view == 0 {
            for _ in 0..lights {
                head.lights.push(read_direction(cursor, "light")?);
            }
        } else if lights as usize != head.lights.len() {
            return cursor
                .fail(4, format!("{lights} light directions of view {view} where view 0 has {}: sets that differ by view are not read", head.lights.len()));
        } else {
            cursor.skip(lights as u64 * 8, "light directions")?;
        }
    }
    Ok(())
}

fn read_direction(cursor: &mut Cursor<'_>, what: &str) -> Result<DVec3> {
    let [polar, azimuth] = cursor.floats::<2>("direction")?.map(f64::from);
    let (sin, cos) = polar.sin_cos();
    // A right angle in binary32 is a little more than one.
    if polar.abs() > 7.0 || cos < -1e-4 {
        return cursor
            .fail(8, format!("a {what} direction {polar} radians from the normal is below the surface"));
    }
    let direction = DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos.max(0.0));
    Ok(direction.normalize())
}

pub(super) fn read_size(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<()> {
    let size = [cursor.u32("width")?, cursor.u32("height")?];
    if size.iter().any(|n| !(1..=MOST_TEXELS as u32).contains(n)) {
        return cursor.fail(
            8,
            format!("{} x {} texels; 1 to {MOST_TEXELS} along an axis are possible", size[0], size[1]),
        );
    }
    head.size = size.map(|n| n as usize);
    Ok(())
}

/// Frames of texels; whether they are the identity is all that is kept of them.
pub(super) fn read_rotations(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<()> {
    head.rotations = cursor.u32("rotations")?;
    let start = cursor.table(head.rotations as u64, 9, Width::Single, "rotations")?;
    const PART: u32 = 1024;
    for first in (0..head.rotations).step_by(PART as usize) {
        let count = PART.min(head.rotations - first);
        let numbers = cursor.bytes.numbers(start + first as u64 * 36, count as u64 * 9, Width::Single)?;
        let is_identity = |frame: &[f32]| {
            frame.iter().enumerate().all(|(i, n)| (n - if i % 4 == 0 { 1.0 } else { 0.0 }).abs() < 1e-4)
        };
        head.rotated += numbers.chunks(9).filter(|frame| !is_identity(frame)).count() as u32;
    }
    Ok(())
}

/// The fields that `FMF12FCER` has before its factorisation; whether the values are logarithms.
pub(super) fn read_extension(cursor: &mut Cursor<'_>, head: &mut Head, heights: &mut u64) -> Result<bool> {
    let version = cursor.u8("version of the extension")?;
    if version > 2 {
        return cursor
            .fail(1, format!("version {version} of the extension of FMF12FCER; 0, 1 and 2 are known"));
    }
    let is_log = version >= 1 && cursor.u32("reduction of the dynamic range")? != 0;
    if version >= 2 {
        let size = [cursor.u32("width of the height map")?, cursor.u32("height of the height map")?];
        if size[0] != 0 && size[1] != 0 {
            *heights = cursor.table(size[0] as u64, size[1] as u64, Width::Half, "height map")?;
            head.height_map = Some(size);
        }
    }
    Ok(is_log)
}
