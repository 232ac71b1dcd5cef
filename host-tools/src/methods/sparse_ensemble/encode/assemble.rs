//! From chosen coefficients to the model of a file: used columns, atoms, records and tables.

use super::candidates::Candidates;
use super::columns::{Tables, Used};
use super::options::{COEFFICIENT_BITS, Options};
use super::prepare::Prepared;
use super::records::{Layering, Places, float_records, rounding, used_columns};
use super::select::Selection;
use crate::data::dataset::Description;
use crate::error::{Result, ToolError};
use crate::format::model::MaterialModel;
use crate::format::texture::Texture;
use crate::format::triangulate::{project, triangulate};
use crate::methods::means::described;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::methods::sparse_ensemble::model::{
    CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, RecordModel,
};
use crate::methods::sparse_ensemble::quantise::{Quantised, quantise};
use selvedge::walk::cost::{Shape, filtered_operations};

/// Most quality layers (3.1).
const LAYER_LIMIT: usize = 8;

/// What the parts of a file are made with.
pub struct Setting<'a> {
    /// The data.
    pub prepared: &'a Prepared<'a>,
    /// How to encode.
    pub options: &'a Options,
    /// Magnitude of the least coefficient that is kept; 0 if that is not how they were chosen.
    pub threshold: f64,
}

/// Operations of a filtered sample beside those of its records (4.2-1).
pub fn fixed_operations(description: &Description) -> u64 {
    let set = |directions: &[glam::DVec3]| {
        triangulate(&directions.iter().map(|&d| project(d)).collect::<Vec<_>>(), None)
    };
    let [light, view] = [set(&description.lights), set(&description.views)];
    let shape = Shape {
        candidates: [light.largest_cell(), view.largest_cell()],
        hull_counts: [light.hull.len() as u32, view.hull.len() as u32],
        means: 3,
        scales: 0,
    };
    filtered_operations(shape, 0) as u64
}

/// The model, and the energy that rounding of the values of level 0 loses.
///
/// # Errors
/// [`ToolError::Unreachable`] if the coefficients are beyond the format.
pub fn material(
    setting: &Setting<'_>,
    ensembles: &[Ensemble; 3],
    candidates: &[[Candidates; 3]],
    selections: &[Selection; 3],
) -> Result<(MaterialModel, f64)> {
    let description = setting.prepared.levels[0].description();
    let mut texture = EnsembleTexture::default();
    let mut rounding = 0.0;
    for c in 0..3 {
        if selections[c].count > 0 {
            let of_channel: Vec<&Candidates> = candidates.iter().map(|level| &level[c]).collect();
            let (ensemble, lost) = channel(
                setting,
                &ensembles[c],
                &of_channel,
                &selections[c],
                setting.options.value_bits.map(|bits| bits[c]),
            )?;
            texture.channels[c] = Some(ensemble);
            rounding += lost;
        }
    }
    // Records that overflow may have given one channel more layers than another.
    let layers = texture
        .full()
        .map(|(_, ensemble)| ensemble.coefficients[0].len())
        .max()
        .unwrap_or(setting.options.layers);
    if layers > LAYER_LIMIT {
        return Err(ToolError::Unreachable {
            goal: "this many coefficients in blocks of this edge".into(),
            least: format!(
                "they need {layers} layers, and {LAYER_LIMIT} are possible: choose a smaller edge"
            ),
        });
    }
    for ensemble in texture.channels.iter_mut().flatten() {
        for coefficients in &mut ensemble.coefficients {
            let empty = CoefficientsModel {
                value_bits: 1,
                records: vec![RecordModel::default(); coefficients[0].records.len()],
            };
            coefficients.resize(layers, empty);
        }
    }
    let texture: Box<dyn Texture> = Box::new(texture);
    let mut model = described(description, setting.prepared.forward.transfer).with_texture(texture);
    model.level_count = setting.prepared.levels.len() as u32;
    model.edge = setting.options.edge as u32;
    model.layer_count = layers as u32;
    for (channel, mean) in model.channels.iter_mut().zip(&setting.prepared.means) {
        channel.mean = Some(mean.clone());
    }
    Ok((model, rounding))
}

fn channel(
    setting: &Setting<'_>,
    ensemble: &Ensemble,
    candidates: &[&Candidates],
    selection: &Selection,
    bits: Option<u32>,
) -> Result<(EnsembleModel, f64)> {
    let (dictionaries, tables) = tables(setting, ensemble, &used_columns(ensemble, candidates, selection));
    let layering = Layering { layers: setting.options.layers, threshold: setting.threshold };
    let records = float_records(&Places::of(ensemble), &tables, candidates, selection, &layering);
    let layers = records[0].len();
    let quantised = |bits: u32| -> Result<(Quantised, f64)> {
        let (atoms, coefficients) =
            quantise(&records, dictionaries.len(), &vec![vec![bits; layers]; candidates.len()])
                .map_err(beyond_format)?;
        let lost = records[0]
            .iter()
            .zip(&coefficients[0])
            .map(|(records, coefficients)| rounding(records, coefficients, &atoms, &tables.parts))
            .sum();
        Ok(((atoms, coefficients), lost))
    };
    let (mut chosen, mut lost) = quantised(bits.unwrap_or(FIRST_BITS))?;
    // A bit more for every value costs its price, and takes three quarters of the rounding away.
    let price = setting.threshold.powi(2) / COEFFICIENT_BITS * selection.count as f64;
    let loss = |bits: u32| lost * 4f64.powi(FIRST_BITS as i32 - bits as i32) + price * bits as f64;
    let best = VALUE_BITS.min_by(|&a, &b| loss(a).total_cmp(&loss(b))).unwrap_or(FIRST_BITS);
    if bits.is_none() && best != FIRST_BITS {
        (chosen, lost) = quantised(best)?;
    }
    let (atoms, coefficients) = chosen;
    Ok((EnsembleModel { dictionaries, atoms, coefficients }, lost))
}

/// Coefficients that the format cannot hold are a matter of the settings: others may give smaller ones.
fn beyond_format(error: ToolError) -> ToolError {
    match error {
        ToolError::Usage(why) => {
            ToolError::Unreachable { goal: "a file of these settings".into(), least: why }
        }
        error => error,
    }
}

/// Dictionaries of the columns that are used, and how records refer to them.
fn tables(
    setting: &Setting<'_>,
    ensemble: &Ensemble,
    used: &[[Vec<bool>; 4]],
) -> (Vec<DictionaryModel>, Tables) {
    let mut dictionaries = Vec::new();
    let mut tables = Tables { numbers: vec![usize::MAX; ensemble.turns.len()], parts: Vec::new() };
    // A dictionary of its own file keeps all its columns and its position.
    let external = ensemble.tables.as_ref().filter(|_| setting.options.external.is_some());
    let all = vec![true; ensemble.edge()];
    for (k, flags) in
        used.iter().enumerate().filter(|(_, flags)| external.is_some() || flags[0].contains(&true))
    {
        tables.numbers[k] = dictionaries.len();
        let turn = &ensemble.turns[k];
        let parts = match external.map(|tables| &tables[k]) {
            Some(table) if table.x.columns as usize == ensemble.edge() => {
                [&table.light, &table.view, &table.x, &table.y].map(Used::whole)
            }
            Some(table) => [
                Used::whole(&table.light),
                Used::whole(&table.view),
                Used::new(&turn.x, &all),
                Used::new(&turn.y, &all),
            ],
            None => {
                let [light, view] = ensemble.angular(k);
                [
                    Used::new(&light, &flags[0]),
                    Used::new(&view, &flags[1]),
                    Used::new(&turn.x, &flags[2]),
                    Used::new(&turn.y, &flags[3]),
                ]
            }
        };
        let [light, view, x, y] = parts.each_ref().map(|part| part.factor.clone());
        dictionaries.push(DictionaryModel { light, view, x, y });
        tables.parts.push(parts);
    }
    (dictionaries, tables)
}

/// Bits of a value to begin with.
const FIRST_BITS: u32 = 7;
/// Bits of a value that are weighed.
const VALUE_BITS: std::ops::RangeInclusive<u32> = 3..=14;
