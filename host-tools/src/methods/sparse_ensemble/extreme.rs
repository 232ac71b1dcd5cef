//! Sparse ensembles at the ends of what is legal.

use crate::format::model::MaterialModel;
use crate::format::texture::Texture;
use crate::math::random::Random;
use crate::methods::reach::{Extent, Reach, extreme_frame};
use crate::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel, RecordModel,
};
use selvedge::method::sparse_ensemble::check::SUM_LIMIT;
use selvedge::method::sparse_ensemble::dequantise;

/// A legal material by random numbers.
pub fn extreme_model(r: &mut Random, reach: Reach) -> MaterialModel {
    let mut texture = EnsembleTexture::default();
    let frame = extreme_frame(r, reach, |r, channel, extent| {
        texture.channels[channel] = Some(extreme_ensemble(r, extent));
    });
    let texture: Box<dyn Texture> = Box::new(texture);
    frame.with_texture(texture)
}

/// The ensemble of a channel.
fn extreme_ensemble(r: &mut Random, extent: &Extent) -> EnsembleModel {
    let Extent { edge, lights, views, layers, reach, .. } = *extent;
    let dictionaries: Vec<DictionaryModel> = (0..r.range(1, 4))
        .map(|_| {
            let most = r.pick(&[3, 20, 60]).min(reach.columns);
            DictionaryModel {
                light: extreme_factor(r, lights, most),
                view: extreme_factor(r, views, most),
                x: extreme_factor(r, edge as usize, (edge as i64).min(reach.columns)),
                y: extreme_factor(r, edge as usize, (edge as i64).min(reach.columns)),
            }
        })
        .collect();
    let atoms: Vec<Vec<AtomModel>> = dictionaries.iter().map(|d| extreme_atoms(r, d, reach)).collect();
    let value_bits = r.pick(&[1, 8, 16, r.clone().range(1, 16) as u32]);
    let coefficients = extent
        .blocks(edge)
        .iter()
        .map(|&count| {
            (0..layers)
                .map(|_| CoefficientsModel {
                    value_bits,
                    records: (0..count).map(|_| extreme_record(r, &atoms, value_bits)).collect(),
                })
                .collect()
        })
        .collect();
    EnsembleModel { dictionaries, atoms, coefficients }
}

fn extreme_factor(r: &mut Random, rows: usize, most_columns: i64) -> FactorModel {
    let columns = r.range(1, most_columns) as u32;
    let constant = r.once_in(4).then(|| r.pick(&[i16::MAX, -i16::MAX]));
    FactorModel {
        columns,
        entries: (0..rows * columns as usize).map(|_| constant.unwrap_or_else(|| r.entry())).collect(),
    }
}

fn extreme_atoms(r: &mut Random, d: &DictionaryModel, reach: Reach) -> Vec<AtomModel> {
    let mut of_key = std::collections::BTreeMap::new();
    for _ in 0..r.pick(&[1, 5, 60, 400]).min(reach.atoms) {
        let mut column = |factor: &FactorModel| r.range(0, factor.columns as i64 - 1) as u32;
        let (light, view, x, y) = (column(&d.light), column(&d.view), column(&d.x), column(&d.y));
        let base = r.entry();
        let room = i16::MAX as i64 - base as i64;
        let step = r.pick(&[0, room, r.clone().range(0, room)]) as u16;
        let atom = AtomModel {
            light,
            view,
            x,
            y,
            shift: r.pick(&[0, 15, r.clone().range(0, 15) as u32]),
            base,
            step,
        };
        of_key.insert(atom.word() >> 4, atom);
    }
    of_key.into_values().collect()
}

fn extreme_record(r: &mut Random, atoms: &[Vec<AtomModel>], value_bits: u32) -> RecordModel {
    let dictionary = r.range(0, atoms.len() as i64 - 1) as u32;
    let list = &atoms[dictionary as usize];
    if r.once_in(6) || list.is_empty() {
        return RecordModel::default();
    }
    let keep = r.pick(&[1, 1, 2, 9]);
    let most = (1u32 << value_bits) - 1;
    let mut sum = 0;
    let mut coefficients = Vec::new();
    for (position, atom) in (0u32..).zip(list) {
        let value = r.pick(&[0, most, r.clone().range(0, most as i64) as u32]) as u16;
        let part =
            dequantise(atom.quantiser(), value as u32, value_bits).unsigned_abs().div_ceil(1 << atom.shift);
        if r.once_in(keep) && sum + part <= SUM_LIMIT {
            sum += part;
            coefficients.push((position, value));
        }
    }
    if coefficients.is_empty() {
        return RecordModel::default();
    }
    RecordModel { dictionary, shift: r.pick(&[0, 31, r.clone().range(0, 31) as u32]), coefficients }
}
