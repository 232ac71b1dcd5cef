//! Trimming of sparse ensembles: what stays keeps its order, so that lists stay sorted and every sum is formed
//! as before.

use crate::format::renumber::{Renumbering, kept_columns, kept_rows};
use crate::format::texture::Kept;
use crate::methods::sparse_ensemble::model::{AtomModel, EnsembleModel, EnsembleTexture, FactorModel};

/// Leaves channels, levels, layers and rows of directions.
pub fn keep(texture: &mut EnsembleTexture, kept: &Kept<'_>) {
    for (ensemble, keeps) in texture.channels.iter_mut().zip(kept.channels) {
        if !keeps {
            *ensemble = None;
        }
    }
    for ensemble in texture.channels.iter_mut().flatten() {
        ensemble.coefficients.truncate(kept.levels);
        ensemble.coefficients.iter_mut().for_each(|level| level.truncate(kept.layers));
        for dictionary in &mut ensemble.dictionaries {
            keep_rows(&mut dictionary.light, kept.lights);
            keep_rows(&mut dictionary.view, kept.views);
        }
    }
}

fn keep_rows(factor: &mut FactorModel, kept: &[u32]) {
    factor.entries = kept_rows(&factor.entries, factor.columns as usize, kept);
}

/// Leaves out dictionaries that no record uses, atoms that no record uses, and columns that no atom uses.
pub fn drop_unused(ensemble: &mut EnsembleModel) {
    let mut used: Vec<Vec<bool>> = ensemble.atoms.iter().map(|atoms| vec![false; atoms.len()]).collect();
    let mut dictionary_used = vec![false; ensemble.dictionaries.len()];
    let records = || ensemble.coefficients.iter().flatten().flat_map(|coefficients| &coefficients.records);
    for record in records().filter(|record| !record.coefficients.is_empty()) {
        dictionary_used[record.dictionary as usize] = true;
        let used = &mut used[record.dictionary as usize];
        record.coefficients.iter().for_each(|&(position, _)| used[position as usize] = true);
    }
    let positions: Vec<Renumbering> = used.iter().map(|used| Renumbering::new(used, false)).collect();
    let numbers = Renumbering::new(&dictionary_used, true);
    let layers = ensemble.coefficients.iter_mut().flatten();
    for record in layers.flat_map(|coefficients| &mut coefficients.records) {
        let of_k = &positions[record.dictionary as usize];
        record.coefficients.iter_mut().for_each(|(position, _)| *position = of_k.new[*position as usize]);
        record.dictionary =
            if record.coefficients.is_empty() { 0 } else { numbers.new[record.dictionary as usize] };
    }
    let kept = |k: &u32| *k as usize;
    ensemble.atoms = numbers
        .kept
        .iter()
        .map(kept)
        .map(|k| positions[k].kept.iter().map(|&i| ensemble.atoms[k][i as usize]).collect())
        .collect();
    ensemble.dictionaries = numbers.kept.iter().map(kept).map(|k| ensemble.dictionaries[k].clone()).collect();
    for (dictionary, atoms) in ensemble.dictionaries.iter_mut().zip(&mut ensemble.atoms) {
        drop_columns(&mut dictionary.light, atoms, |atom| &mut atom.light);
        drop_columns(&mut dictionary.view, atoms, |atom| &mut atom.view);
        drop_columns(&mut dictionary.x, atoms, |atom| &mut atom.x);
        drop_columns(&mut dictionary.y, atoms, |atom| &mut atom.y);
    }
}

fn drop_columns(factor: &mut FactorModel, atoms: &mut [AtomModel], column: fn(&mut AtomModel) -> &mut u32) {
    let mut used = vec![false; factor.columns as usize];
    atoms.iter_mut().for_each(|atom| used[*column(atom) as usize] = true);
    let columns = Renumbering::new(&used, true);
    atoms.iter_mut().for_each(|atom| *column(atom) = columns.new[*column(atom) as usize]);
    factor.entries = kept_columns(&factor.entries, factor.columns as usize, &columns.kept);
    factor.columns = columns.kept.len() as u32;
}
