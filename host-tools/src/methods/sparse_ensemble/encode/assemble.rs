//! From chosen coefficients to the model of a file: used columns, atoms, records and tables.

use super::candidates::Candidates;
use super::select::Selection;
use super::{COEFFICIENT_BITS, Options, Prepared};
use crate::data::dataset::Description;
use crate::error::{Result, ToolError};
use crate::format::model::MaterialModel;
use crate::format::texture::Texture;
use crate::format::triangulate::{project, triangulate};
use crate::math::linear::Basis;
use crate::methods::means::described;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::methods::sparse_ensemble::model::{
    AtomModel, CoefficientsModel, DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel, RecordModel,
};
use crate::methods::sparse_ensemble::quantise::{FloatRecord, Quantised, quantise};
use selvedge::cost::{Shape, filtered_operations};
use selvedge::ensemble::dequantise;

/// Most quality layers (3.1).
const LAYER_LIMIT: usize = 8;

/// What the parts of a file are made with.
pub struct Setting<'a> {
    /// The data.
    pub prepared: &'a Prepared<'a>,
    /// The wish.
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

/// Columns of a basis that are used, each scaled to its largest entry.
pub(crate) struct Used {
    pub(crate) factor: FactorModel,
    /// New number of each column.
    number: Vec<u32>,
    /// Largest entry of each new column.
    scale: Vec<f64>,
}

/// Marks a column that is not used.
const UNUSED: u32 = u32::MAX;

impl Used {
    /// All columns of a table as they are.
    fn whole(factor: &FactorModel) -> Used {
        let columns = factor.columns as usize;
        let squares = |c: usize| {
            factor.entries.iter().skip(c).step_by(columns).map(|&e| (e as f64).powi(2)).sum::<f64>()
        };
        // The entry that stands for one, over the length of the column: entries are those of a unit vector
        // over this.
        let scale = (0..columns).map(|c| 32_767.0 / squares(c).sqrt().max(1e-9)).collect();
        Used { factor: factor.clone(), number: (0..factor.columns).collect(), scale }
    }

    /// Those columns of a basis that are used.
    pub(crate) fn new(basis: &Basis, used: &[bool]) -> Used {
        let mut number = vec![UNUSED; basis.columns];
        let mut scales = Vec::new();
        let mut columns = Vec::new();
        for column in (0..basis.columns).filter(|&column| used[column]) {
            number[column] = columns.len() as u32;
            // An orthonormal column has an entry that is not zero.
            let largest = (0..basis.rows)
                .fold(1e-30f64, |largest, row| largest.max((basis.at(row, column) as f64).abs()));
            columns.push(
                (0..basis.rows)
                    .map(|row| (basis.at(row, column) as f64 * 32_767.0 / largest).round() as i16)
                    .collect::<Vec<_>>(),
            );
            scales.push(largest);
        }
        let entries = (0..basis.rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        Used { factor: FactorModel { columns: columns.len() as u32, entries }, number, scale: scales }
    }
}

/// Entries are Q15 and the largest is 32,767, four times.
const TABLE_GAIN: f64 =
    (32_768.0f64 / 32_767.0) * (32_768.0 / 32_767.0) * (32_768.0 / 32_767.0) * (32_768.0 / 32_767.0);

/// The model, and the energy that rounding of the values of level 0 loses.
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
        let hint = "choose a smaller edge of blocks";
        return Err(ToolError::Usage(format!(
            "blocks of this edge need {layers} layers for this many coefficients, and {LAYER_LIMIT} are possible: {hint}"
        )));
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
    let (edge, cl, cv) = (ensemble.edge(), ensemble.light.columns, ensemble.view.columns);
    let split = |place: u32| {
        let place = place as usize;
        // [y][x][view][light]
        [place % cl, place / cl % cv, place / cl / cv % edge, place / cl / cv / edge]
    };
    let mut used =
        vec![[vec![false; cl], vec![false; cv], vec![false; edge], vec![false; edge]]; ensemble.turns.len()];
    let each = |level: usize| {
        let candidates = candidates[level];
        selection.kept[level].iter().enumerate().flat_map(move |(block, list)| {
            list.iter().map(move |&i| (candidates.dictionaries[block] as usize, i as usize))
        })
    };
    for (level, candidates) in candidates.iter().enumerate() {
        for (k, i) in each(level) {
            for (flags, column) in used[k].iter_mut().zip(split(candidates.places[i])) {
                flags[column] = true;
            }
        }
    }
    let mut numbers = vec![usize::MAX; ensemble.turns.len()];
    let mut dictionaries = Vec::new();
    let mut tables: Vec<[Used; 4]> = Vec::new();
    // A dictionary of its own file keeps all its columns and its place.
    let external = ensemble.tables.as_ref().filter(|_| setting.options.external.is_some());
    for (k, flags) in
        used.iter().enumerate().filter(|(_, flags)| external.is_some() || flags[0].contains(&true))
    {
        numbers[k] = dictionaries.len();
        let turn = &ensemble.turns[k];
        let all = vec![true; edge];
        let parts = match external.map(|tables| &tables[k]) {
            Some(table) if table.x.columns as usize == edge => {
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
        tables.push(parts);
    }
    let wished = setting.options.layers;
    // A layer has what is at least twice as large as what the next one has; the last has the rest.
    let layer_of = |value: f32| {
        let above = (value.abs() as f64 / setting.threshold.max(1e-9)).log2().max(0.0) as usize;
        (wished - 1).saturating_sub(above)
    };
    let mut records: Vec<Vec<Vec<FloatRecord>>> = Vec::new();
    for (level, candidates) in candidates.iter().enumerate() {
        let blocks = candidates.dictionaries.len();
        let mut of_layers: Vec<Vec<FloatRecord>> = vec![Vec::with_capacity(blocks); wished];
        for (block, list) in selection.kept[level].iter().enumerate() {
            let k = candidates.dictionaries[block] as usize;
            let number = numbers[k];
            let mut lists: Vec<Vec<(AtomModel, f64)>> = vec![Vec::new(); wished];
            for &i in list {
                let [light, view, x, y] = split(candidates.places[i as usize]);
                let [of_light, of_view, of_x, of_y] = &tables[number];
                let atom = AtomModel {
                    light: of_light.number[light],
                    view: of_view.number[view],
                    x: of_x.number[x],
                    y: of_y.number[y],
                    ..AtomModel::default()
                };
                let scale = of_light.scale[atom.light as usize]
                    * of_view.scale[atom.view as usize]
                    * of_x.scale[atom.x as usize]
                    * of_y.scale[atom.y as usize];
                let value = candidates.values[i as usize];
                lists[layer_of(value)].push((atom, value as f64 * scale * TABLE_GAIN));
            }
            spill(&mut lists);
            if lists.len() > of_layers.len() {
                of_layers.resize(lists.len(), vec![(0, Vec::new()); block]);
            }
            lists.resize(of_layers.len(), Vec::new());
            for (records, list) in of_layers.iter_mut().zip(lists) {
                records.push((if list.is_empty() { 0 } else { number }, list));
            }
        }
        records.push(of_layers);
    }
    let layers = records.iter().map(Vec::len).max().unwrap_or(wished);
    for (records, candidates) in records.iter_mut().zip(candidates) {
        records.resize(layers, vec![(0, Vec::new()); candidates.dictionaries.len()]);
    }
    let quantised = |bits: u32| -> Result<(Quantised, f64)> {
        let (atoms, coefficients) =
            quantise(&records, dictionaries.len(), &vec![vec![bits; layers]; candidates.len()])?;
        let lost = records[0]
            .iter()
            .zip(&coefficients[0])
            .map(|(records, coefficients)| rounding(records, coefficients, &atoms, &tables))
            .sum();
        Ok(((atoms, coefficients), lost))
    };
    let (mut chosen, mut lost) = quantised(bits.unwrap_or(FIRST_BITS))?;
    // A bit more for every value costs its price, and takes three quarters of the rounding away.
    let price = setting.threshold.powi(2) / COEFFICIENT_BITS * selection.count as f64;
    let loss = |bits: u32| lost * 4f64.powi(FIRST_BITS as i32 - bits as i32) + price * bits as f64;
    let best = (3..=14).min_by(|&a, &b| loss(a).total_cmp(&loss(b))).unwrap_or(FIRST_BITS);
    if bits.is_none() && best != FIRST_BITS {
        (chosen, lost) = quantised(best)?;
    }
    let (atoms, coefficients) = chosen;
    Ok((EnsembleModel { dictionaries, atoms, coefficients }, lost))
}

/// Magnitudes that a record may state, with room for rounding (10.7-7 at a shift of zero).
const RECORD_SUM: f64 = 2000.0;

/// Most coefficients of a record: their count has at most 15 bits (10.3-3).
const RECORD_COUNT: usize = 32_767;

/// Moves what a record has no room for to the next layer, the smallest first, and adds layers where they run
/// out.
fn spill(lists: &mut Vec<Vec<(AtomModel, f64)>>) {
    // A magnitude is rounded up to whole units, of which there are 32 in one.
    let share = |c: &(AtomModel, f64)| c.1.abs() + 1.0 / 32.0;
    let mut layer = 0;
    while layer < lists.len() {
        if lists[layer].len() > RECORD_COUNT || lists[layer].iter().map(share).sum::<f64>() > RECORD_SUM {
            let list = &mut lists[layer];
            list.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.word().cmp(&b.0.word())));
            let mut sum = 0.0;
            let room = list.iter().take_while(|c| {
                sum += share(c);
                sum <= RECORD_SUM
            });
            let kept = room.take(RECORD_COUNT).count().max(1);
            let rest = list.split_off(kept);
            if layer + 1 == lists.len() {
                lists.push(Vec::new());
            }
            lists[layer + 1].extend(rest);
        }
        layer += 1;
    }
}

/// Bits of a value to begin with.
const FIRST_BITS: u32 = 7;

/// Energy that the rounding of values loses in a layer, for orthonormal columns.
fn rounding(
    records: &[FloatRecord],
    coefficients: &CoefficientsModel,
    atoms: &[Vec<AtomModel>],
    tables: &[[Used; 4]],
) -> f64 {
    let mut lost = 0.0;
    let mut wanted: Vec<(u32, f64)> = Vec::new();
    for ((number, floats), record) in records.iter().zip(&coefficients.records) {
        wanted.clear();
        wanted.extend(floats.iter().map(|(atom, value)| (atom.word(), *value)));
        wanted.sort_unstable_by_key(|entry| entry.0);
        let unit = 2f64.powi(record.shift as i32 + 5);
        for (&(_, value), &(place, quantised)) in wanted.iter().zip(&record.coefficients) {
            let atom = atoms[*number][place as usize];
            let [light, view, x, y] = &tables[*number];
            let scale = light.scale[atom.light as usize]
                * view.scale[atom.view as usize]
                * x.scale[atom.x as usize]
                * y.scale[atom.y as usize];
            let decoded = dequantise(atom.quantiser(), quantised as u32, coefficients.value_bits) as f64
                / unit
                / 2f64.powi(atom.shift as i32);
            lost += ((decoded - value) / scale).powi(2);
        }
    }
    lost
}
