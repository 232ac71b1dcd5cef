//! What is legal but unwise: bytes that nobody needs, directions that nearly fall together, prices that one
//! block sets.

use crate::format::read::{list, record_coefficients};
use rayon::prelude::*;
use selvedge::Selvedge;
use selvedge::cost::record_operations;
use selvedge::direction::point;
use selvedge::directory::{COEFFICIENTS, EXTERNAL, METADATA};
use selvedge::ensemble::{coefficients_start, read_record};
use selvedge::material::{CHANNEL_FULL, Channel, METHOD_SPARSE_TENSOR, level_size};
use selvedge::tensor::lists_start;
use selvedge::words::{Words, high_i16, low_i16, word};

/// Something that a file had better not have.
#[derive(Debug, PartialEq, Eq)]
pub struct Advice {
    /// Number, W1 and on; stable.
    pub id: &'static str,
    /// Name.
    pub name: &'static str,
    /// What a wise file has.
    pub expected: &'static str,
    /// What to do about it.
    pub hint: &'static str,
}

/// All of them. Offsets: the first atom, dictionary or direction it is about, else the section; found: how
/// many, or as said.
pub const ADVICE: [Advice; 6] = [
    Advice {
        id: "W1",
        name: "UnusedAtoms",
        expected: "every atom is in a record or list",
        hint: "selvedge trim removes them; found is their number",
    },
    Advice {
        id: "W2",
        name: "UnusedDictionaries",
        expected: "every own dictionary is in a record",
        hint: "selvedge trim removes them; found is their number",
    },
    Advice {
        id: "W3",
        name: "NearDirections",
        expected: "directions are at least a twentieth of a degree apart",
        hint: "triangles between them are slivers; found is the number of the nearer one",
    },
    Advice {
        id: "W4",
        name: "UnreachedValues",
        expected: "an atom's values use more than a quarter of its range",
        hint: "a smaller step would make its values finer; found is the number of such atoms",
    },
    Advice {
        id: "W5",
        name: "PriceOfOneRecord",
        expected: "the largest record costs at most 16 times the mean",
        hint: "one block sets the stated price of all; found is its count",
    },
    Advice {
        id: "W6",
        name: "NoLicence",
        expected: "the metadata name a licence",
        hint: "without one nobody may pass the file on",
    },
];

/// Two directions are nearly one below this distance, Q14: a twentieth of a degree at the centre of the disc.
const NEAR_Q14: i64 = 7;
/// Coefficients of an atom from which on their range says something.
const ENOUGH: u32 = 32;
/// How much dearer than the mean the largest record may be.
const DEAR: u64 = 16;

/// What was seen of an atom.
#[derive(Clone, Copy)]
struct Use {
    count: u32,
    least: u32,
    most: u32,
}

/// Walks a legal material.
pub fn walk(opened: &Selvedge<'_>, tell: &mut dyn FnMut(&Advice, u32, u32)) {
    let (material, words) = (opened.material(), opened.words());
    let [unused_atoms, unused_dictionaries, near, unreached, dear, no_licence] = &ADVICE;
    directions(words, material.light_start, near, tell);
    if material.view_start != material.light_start {
        directions(words, material.view_start, near, tell);
    }
    let own_dictionary = !opened.sections().any(|section| section.kind == EXTERNAL);
    let is_tensor = material.method == METHOD_SPARSE_TENSOR;
    if is_tensor && material.full_count > 0 && own_dictionary {
        let used = uses_of_tensor(opened);
        let mut unused = (0u32..)
            .zip(&used)
            .filter(|(_, used)| !**used)
            .map(|(atom, _)| (material.fibres_start + 2 + atom) * 4);
        if let Some(first) = unused.next() {
            tell(unused_atoms, first, 1 + unused.count() as u32);
        }
    }
    let full: Vec<Channel> = material
        .channels
        .iter()
        .copied()
        .filter(|channel| channel.state == CHANNEL_FULL && !is_tensor)
        .collect();
    let seen: Vec<_> = full.par_iter().map(|channel| uses(opened, *channel)).collect();
    for (channel, (atoms, dictionaries)) in full.iter().zip(seen) {
        // Atoms are always in the material's own file, so a word's number is a fourth of its byte offset.
        let lists =
            |k: usize| (channel.atoms_start + word(words, channel.atoms_start + 3 + k as u32 * 2)) * 4;
        let all = || {
            atoms.iter().enumerate().flat_map(|(k, list)| {
                list.iter().enumerate().map(move |(i, used)| (lists(k) + i as u32 * 8, used))
            })
        };
        let mut count_of = |advice: &Advice, found: &mut dyn Iterator<Item = u32>| {
            if let Some(first) = found.next() {
                tell(advice, first, 1 + found.count() as u32);
            }
        };
        count_of(unused_atoms, &mut all().filter(|(_, used)| used.count == 0).map(|(at, _)| at));
        let narrow = |used: &Use| used.count >= ENOUGH && (used.most - used.least + 1) * 4 <= 1 << 16;
        count_of(unreached, &mut all().filter(|(_, used)| narrow(used)).map(|(at, _)| at));
        if own_dictionary {
            let heads = |k: usize| (channel.angular_start + 2 + k as u32 * 4) * 4;
            count_of(
                unused_dictionaries,
                &mut dictionaries.iter().enumerate().filter(|(_, used)| !**used).map(|(k, _)| heads(k)),
            );
        }
    }
    prices(opened, dear, tell);
    if opened.metadata().licence.is_empty() {
        let offset =
            opened.sections().find(|section| section.kind == METADATA).map_or(0, |section| section.offset);
        tell(no_licence, offset, 0);
    }
}

/// How atoms are used, by dictionary, values in parts of 65,536; and which dictionaries are.
fn uses(opened: &Selvedge<'_>, channel: Channel) -> (Vec<Vec<Use>>, Vec<bool>) {
    let words = opened.words();
    let count = word(words, channel.atoms_start);
    let fresh = Use { count: 0, least: u32::MAX, most: 0 };
    let mut atoms: Vec<Vec<Use>> =
        (0..count).map(|k| vec![fresh; word(words, channel.atoms_start + 2 + k * 2) as usize]).collect();
    let mut dictionaries = vec![false; count as usize];
    each_record(opened, channel, |start, block| {
        let record = read_record(words, start, block);
        if record.count > 0 {
            let k = record.dictionary as usize;
            dictionaries[k] = true;
            record_coefficients(words, record, |position, value| {
                let (used, value) = (&mut atoms[k][position as usize], value << (16 - record.value_bits));
                *used =
                    Use { count: used.count + 1, least: used.least.min(value), most: used.most.max(value) };
            });
        }
    });
    (atoms, dictionaries)
}

/// Which ABRDF atoms of a sparse tensor are in a list.
fn uses_of_tensor(opened: &Selvedge<'_>) -> Vec<bool> {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let mut used = vec![false; word(words, material.fibres_start) as usize];
    for level in 0..header.level_count {
        let texels: u32 = [header.width, header.height].iter().map(|&size| level_size(size, level)).product();
        for layer in 0..header.layer_count {
            let start = lists_start(words, material, level, layer);
            for texel in 0..texels {
                list(words, start, used.len() as u32, texel)
                    .iter()
                    .for_each(|&(atom, _)| used[atom as usize] = true);
            }
        }
    }
    used
}

/// First word of the section and number of each block, over levels and layers.
fn each_record(opened: &Selvedge<'_>, channel: Channel, mut walk: impl FnMut(u32, u32)) {
    let (header, material) = (opened.header(), opened.material());
    for level in 0..header.level_count {
        let blocks: u32 = [header.width, header.height]
            .iter()
            .map(|&size| level_size(size, level).div_ceil(header.edge))
            .product();
        for layer in 0..header.layer_count {
            let start = coefficients_start(opened.words(), material, channel, level, layer);
            (0..blocks).for_each(|block| walk(start, block));
        }
    }
}

/// The nearest neighbour below each direction, by a grid of the least distance.
fn directions(words: Words<'_>, start: u32, near: &Advice, tell: &mut dyn FnMut(&Advice, u32, u32)) {
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
            tell(near, (start + 8 + i as u32 * 2) * 4, other as u32);
        }
    }
}

/// One record much larger than the mean of its section.
fn prices(opened: &Selvedge<'_>, dear: &Advice, tell: &mut dyn FnMut(&Advice, u32, u32)) {
    let (header, words) = (opened.header(), opened.words());
    for section in opened.sections().filter(|section| section.kind == COEFFICIENTS) {
        let start = section.offset / 4;
        let (blocks, largest) = (word(words, start + 1), word(words, start + 3));
        if blocks < 16 || largest < 64 {
            continue;
        }
        let sum: u64 = (0..blocks)
            .map(|block| record_operations(read_record(words, start, block).count, header.edge))
            .sum();
        if record_operations(largest, header.edge) * blocks as u64 > DEAR * sum {
            tell(dear, section.offset, largest);
        }
    }
}
