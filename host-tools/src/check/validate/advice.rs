//! What is legal but wasteful: bytes that nobody needs, directions that nearly fall together, costs that one
//! block sets. What is about textures is their method's.

use crate::methods::advice::{Advice, Advise};
use crate::methods::{self, METHODS};
use selvedge::container::directory::METADATA;
use selvedge::kernel::direction::point;
use selvedge::kernel::words::{Words, high_i16, low_i16, word};
use selvedge::{Finding, Selvedge};
use std::sync::LazyLock;

static NEAR_DIRECTIONS: Advice = Advice {
    id: "W3",
    name: "NearDirections",
    expected: "directions are at least a twentieth of a degree apart",
    hint: "triangles between them are slivers; found is the number of the nearer one",
};

static NO_LICENCE: Advice = Advice {
    id: "W6",
    name: "NoLicence",
    expected: "the metadata name a licence",
    hint: "without one nobody may pass the file on",
};

/// All advice, shared and of every method, by number. Offsets: the first atom, dictionary or direction it is
/// about, else the section; found: how many, or as its hint says.
pub static ADVICE: LazyLock<Vec<&'static Advice>> = LazyLock::new(|| {
    let of_methods = METHODS.iter().flat_map(|method| method.advice.iter().copied());
    let mut all: Vec<&Advice> = [&NEAR_DIRECTIONS, &NO_LICENCE].into_iter().chain(of_methods).collect();
    all.sort_by_key(|advice| (advice.id.len(), advice.id));
    all.dedup();
    all
});

/// Two directions are nearly one below this distance, Q14: a twentieth of a degree at the centre of the disc.
const NEAR_Q14: i64 = 7;
/// Words in front of the points of a section of directions, and words of a point (5.3).
const DIRECTIONS_WORDS: u32 = 8;
const POINT_WORDS: u32 = 2;

/// Walks a legal material.
///
/// # Errors
/// Rule 3.1-8 if the tools do not have its method.
pub fn walk(opened: &Selvedge<'_>, advise: &mut Advise<'_>) -> Result<(), Finding> {
    let method = methods::of(opened)?;
    let (material, words) = (opened.material(), opened.words());
    directions(words, material.light_start, advise);
    if material.view_start != material.light_start {
        directions(words, material.view_start, advise);
    }
    (method.advise)(opened, advise);
    if opened.metadata().licence.is_empty() {
        let offset =
            opened.sections().find(|section| section.kind == METADATA).map_or(0, |section| section.offset);
        advise(&NO_LICENCE, offset, 0);
    }
    Ok(())
}

/// The first direction before each that is nearer to it than the least distance.
fn directions(words: Words<'_>, start: u32, advise: &mut Advise<'_>) {
    let points: Vec<(i64, i64)> = (0..word(words, start))
        .map(|i| {
            let pair = point(words, start, i);
            (low_i16(pair) as i64, high_i16(pair) as i64)
        })
        .collect();
    for (i, &(x, y)) in points.iter().enumerate() {
        let close =
            points[..i].iter().position(|&(a, b)| (x - a).pow(2) + (y - b).pow(2) < NEAR_Q14 * NEAR_Q14);
        if let Some(other) = close {
            let at = start + DIRECTIONS_WORDS + i as u32 * POINT_WORDS;
            advise(&NEAR_DIRECTIONS, at * 4, other as u32);
        }
    }
}
