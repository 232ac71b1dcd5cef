//! Advice on sparse tensors: ABRDF atoms that no list has.

use crate::methods::advice::{Advice, Advise, UNUSED_ATOMS, has_own_dictionary, report_count};
use crate::methods::sparse_tensor::file::{list, texels_of_level};
use crate::methods::sparse_tensor::layout::{atom_count, shifts_at};
use selvedge::Selvedge;
use selvedge::method::sparse_tensor::lists_start;

/// All of them.
pub const ADVICE: &[&Advice] = &[&UNUSED_ATOMS];

/// Walks the lists of a legal material.
pub fn advise(opened: &Selvedge<'_>, advise: &mut Advise<'_>) {
    let material = opened.material();
    if material.full_count > 0 && has_own_dictionary(opened) {
        let used = uses(opened);
        let unused = (0u32..).zip(&used).filter(|(_, used)| !**used);
        let mut offsets = unused.map(|(atom, _)| shifts_at(material, atom) * 4);
        report_count(&UNUSED_ATOMS, &mut offsets, advise);
    }
}

/// Which ABRDF atoms are in a list.
fn uses(opened: &Selvedge<'_>) -> Vec<bool> {
    let (header, material, words) = (opened.header(), opened.material(), opened.words());
    let mut used = vec![false; atom_count(words, material) as usize];
    for level in 0..header.level_count {
        for layer in 0..header.layer_count {
            let start = lists_start(words, material, level, layer);
            for texel in 0..texels_of_level(opened, level) {
                let list = list(words, start, used.len() as u32, texel);
                list.iter().for_each(|&(atom, _)| used[atom as usize] = true);
            }
        }
    }
    used
}
