//! Values of options: sizes, bytes, angles, texels.

use selvedge::Direction;

type Parsed<T> = std::result::Result<T, String>;

/// One or two sides of an image, as `128` or `128x64`.
pub fn size(text: &str) -> Parsed<[usize; 2]> {
    let parts: Option<Vec<usize>> =
        text.split('x').map(|n| n.parse().ok().filter(|n| (1..=16_384).contains(n))).collect();
    match parts.as_deref() {
        Some(&[side]) => Ok([side, side]),
        Some(&[width, height]) => Ok([width, height]),
        _ => Err("one number, or two as 128x64, from 1 to 16384".into()),
    }
}

/// Bytes, as `200000`, `200k` or `1.5M`.
pub fn bytes(text: &str) -> Parsed<u64> {
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let unit = match unit {
        "" | "B" => 1.0,
        "k" | "kB" => 1e3,
        "M" | "MB" => 1e6,
        _ => return Err("bytes, as 200000, 200k or 1.5M".into()),
    };
    number
        .parse::<f64>()
        .ok()
        .map(|n| n * unit)
        .filter(|n| (1.0..=4.2e9).contains(n))
        .map(|n| n as u64)
        .ok_or_else(|| "bytes, as 200000, 200k or 1.5M".into())
}

/// Angle from the normal and azimuth in degrees, as `30,90`.
pub fn angles(text: &str) -> Parsed<Direction> {
    let parts: Option<Vec<f64>> =
        text.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    let Some(Ok([polar, azimuth])) = parts.map(<[f64; 2]>::try_from) else {
        return Err("two numbers, as 30,90".into());
    };
    if !(0.0..=90.0).contains(&polar) {
        return Err("the angle from the normal is 0 to 90 degrees".into());
    }
    let (polar, azimuth) = (polar.to_radians(), azimuth.to_radians());
    Ok(Direction::from_unit_vector([
        (polar.sin() * azimuth.cos()) as f32,
        (polar.sin() * azimuth.sin()) as f32,
        polar.cos() as f32,
    ]))
}

/// A texel, as `10,20`.
pub fn texel(text: &str) -> Parsed<[u32; 2]> {
    let parts: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or_else(|| "two numbers, as 10,20".into())
}

/// A positive number.
pub fn exposure(text: &str) -> Parsed<f32> {
    text.parse().ok().filter(|f: &f32| f.is_finite() && *f > 0.0).ok_or_else(|| "a positive number".into())
}
