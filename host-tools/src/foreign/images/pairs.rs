//! The directions of a set of images, and which image is of which pair of them.

use super::listing::{Entry, LISTING, SAME_DEGREES, bad};
use super::names::in_name;
use crate::data::dataset::MOST_DIRECTIONS;
use crate::data::directions::{from_degrees, grid, to_degrees};
use crate::error::Result;
use glam::DVec3;
use std::collections::HashMap;
use std::path::Path;

/// The angle between two directions; NaN if one has no length.
pub fn degrees_between(a: DVec3, b: DVec3) -> f64 {
    // The chord, which is precise where the arc's cosine is not, and the arc wherever it matters here.
    (a.normalize() - b.normalize()).length().to_degrees()
}

/// The set of directions: the listed one, or the images' own, sorted, or the known grid that they are.
pub(super) fn set_of(
    what: &str,
    folder: &Path,
    listed: Vec<DVec3>,
    angles: impl Iterator<Item = [f64; 2]>,
) -> Result<Vec<DVec3>> {
    let too_many = || bad(folder, format!("more than {MOST_DIRECTIONS} {what} directions"));
    if !listed.is_empty() {
        return if listed.len() > MOST_DIRECTIONS { Err(too_many()) } else { Ok(listed) };
    }
    let mut angles: Vec<[f64; 2]> = angles.collect();
    angles.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    angles.dedup();
    let mut set: Vec<DVec3> = Vec::new();
    for [polar, azimuth] in angles {
        let direction = from_degrees(polar, azimuth);
        if !set.iter().any(|&other| degrees_between(other, direction) < SAME_DEGREES) {
            if set.len() == MOST_DIRECTIONS {
                return Err(too_many());
            }
            set.push(direction);
        }
    }
    let is_grid = |grid: &Vec<DVec3>| {
        grid.iter().all(|&g| set.iter().filter(|&&d| degrees_between(d, g) < SAME_DEGREES).count() == 1)
    };
    Ok(grid(set.len()).filter(is_grid).unwrap_or(set))
}

/// The file of every pair in the dataset's order.
pub(super) fn arrange<'a>(
    folder: &Path,
    entries: &'a [Entry],
    lights: &[DVec3],
    views: &[DVec3],
) -> Result<Vec<&'a Path>> {
    let nearest = |set: &[DVec3], [polar, azimuth]: [f64; 2]| {
        let asked = from_degrees(polar, azimuth);
        let distances = set.iter().map(|&other| degrees_between(other, asked)).enumerate();
        // An image's direction may be this far from the one that stands for it, and that one as far from a
        // grid's.
        distances
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|&(_, distance)| distance <= 2.0 * SAME_DEGREES)
            .map(|(i, _)| i)
    };
    // The same angles come in thousands of names.
    let mut known: [HashMap<[u64; 2], Option<usize>>; 2] = Default::default();
    let mut find = |entry: &Entry, side: usize| {
        let (what, set, angles) =
            if side == 0 { ("light", lights, entry.light) } else { ("view", views, entry.view) };
        let index = *known[side].entry(angles.map(f64::to_bits)).or_insert_with(|| nearest(set, angles));
        index.ok_or_else(|| {
            bad(
                &folder.join(&entry.file),
                format!(
                    "{what} at ({}, {}) degrees is none of those that {LISTING} has",
                    angles[0], angles[1]
                ),
            )
        })
    };
    let mut files: Vec<Option<&Path>> = vec![None; lights.len() * views.len()];
    for entry in entries {
        let light = find(entry, 0)?;
        let view = find(entry, 1)?;
        if let Some(other) = files[view * lights.len() + light].replace(&entry.file) {
            return Err(bad(
                &folder.join(&entry.file),
                format!("the same pair of directions as {}", other.display()),
            ));
        }
    }
    if let Some(pair) = files.iter().position(Option::is_none) {
        let missing = files.iter().filter(|file| file.is_none()).count();
        let [[tl, pl], [tv, pv]] =
            [lights[pair % lights.len()], views[pair / lights.len()]].map(|d| to_degrees(d).map(in_name));
        let what = format!(
            "{missing} of {} pairs of directions are missing, the first of them tl{tl}_pl{pl}_tv{tv}_pv{pv}",
            files.len()
        );
        return Err(bad(folder, what));
    }
    Ok(files.into_iter().flatten().collect())
}
