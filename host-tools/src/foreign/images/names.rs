//! The images of a folder or an archive, listed or by their names, and the angles in names.

use super::listing::{Entry, LISTING, bad};
use crate::error::Result;
use crate::foreign::archive::Archive;
use std::path::{Component, Path};

/// Endings of names that are images.
const ENDINGS: [&str; 5] = ["exr", "png", "jpg", "jpeg", "hdr"];

/// Whether a name ends as that of an image does.
fn is_image(path: &Path) -> bool {
    path.extension().is_some_and(|found| ENDINGS.iter().any(|ending| found.eq_ignore_ascii_case(ending)))
}

/// The images of the listing, or of the archive in the order of their names, with sound angles.
pub(super) fn find(archive: &Archive, below: &Path, listed: Option<Vec<Entry>>) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    if let Some(listed) = listed {
        for mut entry in listed {
            // A listing from elsewhere reads nothing outside its folder.
            if entry.file.components().any(|part| !matches!(part, Component::Normal(_))) {
                return Err(bad(
                    &archive.describe(Path::new(LISTING)),
                    format!("{}: not a path inside the folder", entry.file.display()),
                ));
            }
            entry.file = below.join(&entry.file);
            // Before hours of reading the others.
            if !archive.has(&entry.file) {
                return Err(bad(&archive.describe(&entry.file), "there is no such file"));
            }
            entries.push(entry);
        }
    } else {
        for file in archive.names()?.into_iter().filter(|name| is_image(name)) {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
            let Some([light, view]) = angles_of(&stem) else {
                return Err(bad(
                    &archive.describe(&file),
                    format!(
                        "the name does not end in tl<n>pl<n>tv<n>pv<n>, and no {LISTING} lists the images"
                    ),
                ));
            };
            entries.push(Entry { file, light, view });
        }
    }
    for entry in &mut entries {
        for (what, angles) in [("light", &mut entry.light), ("view", &mut entry.view)] {
            let [polar, azimuth] = *angles;
            if !(0.0..=90.0).contains(&polar) || !azimuth.is_finite() {
                return Err(bad(
                    &archive.describe(&entry.file),
                    format!("{what} at ({polar}, {azimuth}) degrees; the polar angle is from 0 to 90"),
                ));
            }
            // A remainder of minus a trifle rounds to 360.
            let turned = azimuth.rem_euclid(360.0);
            // At the normal every azimuth is the same, and minus zero is zero.
            *angles =
                if polar < 1e-9 { [0.0; 2] } else { [polar, if turned >= 360.0 { 0.0 } else { turned }] };
        }
    }
    if entries.is_empty() {
        Err(bad(archive.path(), "there are no images: no EXR, PNG, JPEG or Radiance pictures"))
    } else {
        Ok(entries)
    }
}

/// The angles that a stem ends in, light before view or view before light, from the first tag after which all
/// is as it should be.
pub(super) fn angles_of(stem: &str) -> Option<[[f64; 2]; 2]> {
    let after = |tags: [&str; 4]| {
        stem.match_indices(tags[0]).find_map(|(at, _)| {
            let mut rest = &stem[at..];
            let mut next = |tag: &str| {
                let after =
                    rest.trim_start_matches(|c: char| !c.is_ascii_alphanumeric()).strip_prefix(tag)?;
                let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
                let sign = usize::from(after.starts_with('-'));
                let whole = sign + digits(&after[sign..]);
                // A point is part of the number only before a digit; else it separates.
                let part = after[whole..].strip_prefix('.').map_or(0, digits);
                let (number, behind) = after.split_at(if part > 0 { whole + 1 + part } else { whole });
                rest = behind;
                number.parse::<f64>().ok()
            };
            let angles = [[next(tags[0])?, next(tags[1])?], [next(tags[2])?, next(tags[3])?]];
            rest.is_empty().then_some(angles)
        })
    };
    after(["tl", "pl", "tv", "pv"])
        .or_else(|| after(["tv", "pv", "tl", "pl"]).map(|[view, light]| [light, view]))
}

/// An angle in a name: three digits, and up to three decimals.
pub(super) fn in_name(angle: f64) -> String {
    let text = format!("{angle:07.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "360" { "000".into() } else { text.into() }
}
