//! Values of an encoder's options in text.

type Parsed<T> = std::result::Result<T, String>;

/// One number for all three channels, or three, as `256,64,64`.
///
/// # Errors
/// What is expected, in words.
pub fn three<T: std::str::FromStr + Copy>(text: &str) -> Parsed<[T; 3]> {
    let parts: Option<Vec<T>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match parts.as_deref() {
        Some(&[all]) => Ok([all; 3]),
        Some(&[a, b, c]) => Ok([a, b, c]),
        _ => Err("one number, or three as 256,64,64".into()),
    }
}

/// Coefficients of a block in each channel, 1 to 32,767.
///
/// # Errors
/// What is expected, in words.
pub fn counts(text: &str) -> Parsed<[usize; 3]> {
    three::<usize>(text)?
        .map(|n| (1..=32_767).contains(&n).then_some(n))
        .into_iter()
        .collect::<Option<Vec<_>>>()
        .and_then(|v| v.try_into().ok())
        .ok_or_else(|| "1 to 32767".into())
}

/// A positive number.
///
/// # Errors
/// What is expected, in words.
pub fn positive(text: &str) -> Parsed<f64> {
    text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0).ok_or_else(|| "a positive number".into())
}
