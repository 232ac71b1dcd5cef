//! What `import` and `export` share: options that apply to one format, outputs, values of their options.

use crate::error::{Result, ToolError};
use std::path::{Path, PathBuf};

/// Memory budget of an export for images, bytes.
pub const MEMORY: usize = 256 << 20;

/// Refuses an option that would do nothing.
pub fn check_applies(option: &str, is_given: bool, applies: bool, to: &str) -> Result<()> {
    if is_given && !applies { Err(ToolError::Usage(format!("{option} is for {to} alone"))) } else { Ok(()) }
}

/// Refuses an output that could not be written after hours of work, or would take the place of its source.
pub fn check_output(source: &Path, output: &Path, is_folder: bool) -> Result<()> {
    let refuse = |why: &str| Err(ToolError::Usage(format!("{}: {why}", output.display())));
    if !is_folder && output.is_dir() {
        return refuse("this is a folder; a file is written");
    }
    let is_same =
        source == output || source.canonicalize().is_ok_and(|a| output.canonicalize().is_ok_and(|b| a == b));
    if is_same {
        return refuse("this is the source");
    }
    Ok(())
}

/// The path of an EXR.
pub fn exr(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
        Ok(path)
    } else {
        Err("a path that ends in .exr".into())
    }
}

/// Blocks along both sides of an image, as `40x30`.
pub fn blocks(text: &str) -> std::result::Result<[usize; 2], String> {
    let parts: Option<Vec<usize>> =
        text.split('x').map(|n| n.parse().ok().filter(|n| (1..=1638).contains(n))).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or_else(|| "two numbers from 1 to 1638, as 40x30".into())
}
