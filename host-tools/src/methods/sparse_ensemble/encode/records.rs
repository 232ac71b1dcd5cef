//! From candidates that were kept to records in floats, and what rounding of their values loses.

use super::candidates::Candidates;
use super::columns::{Tables, Used};
use super::select::Selection;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::methods::sparse_ensemble::model::{AtomModel, CoefficientsModel};
use crate::methods::sparse_ensemble::quantise::FloatRecord;
use selvedge::method::sparse_ensemble::dequantise;

/// Entries are Q15 and the largest is 32,767, four times.
const TABLE_GAIN: f64 =
    (32_768.0f64 / 32_767.0) * (32_768.0 / 32_767.0) * (32_768.0 / 32_767.0) * (32_768.0 / 32_767.0);

/// Positions in the tensor of coefficients of a block, `[y][x][view][light]`.
pub(super) struct Places {
    light: usize,
    view: usize,
    edge: usize,
}

impl Places {
    pub(super) fn of(ensemble: &Ensemble) -> Places {
        Places { light: ensemble.light.columns, view: ensemble.view.columns, edge: ensemble.edge() }
    }

    /// Columns of light, view, x and y.
    fn split(&self, place: u32) -> [usize; 4] {
        let (place, cl, cv, edge) = (place as usize, self.light, self.view, self.edge);
        [place % cl, place / cl % cv, place / cl / cv % edge, place / cl / cv / edge]
    }
}

/// Which columns of light, view, x and y each dictionary uses.
pub(super) fn used_columns(
    ensemble: &Ensemble,
    candidates: &[&Candidates],
    selection: &Selection,
) -> Vec<[Vec<bool>; 4]> {
    let places = Places::of(ensemble);
    let [cl, cv, edge] = [places.light, places.view, places.edge];
    let mut used =
        vec![[vec![false; cl], vec![false; cv], vec![false; edge], vec![false; edge]]; ensemble.turns.len()];
    for (candidates, kept) in candidates.iter().zip(&selection.kept) {
        for (list, &k) in kept.iter().zip(&candidates.dictionaries) {
            for &i in list {
                let columns = places.split(candidates.places[i as usize]);
                for (flags, column) in used[k as usize].iter_mut().zip(columns) {
                    flags[column] = true;
                }
            }
        }
    }
    used
}

/// How coefficients are spread over quality layers.
pub(super) struct Layering {
    /// Layers that are asked for.
    pub(super) layers: usize,
    /// Magnitude of the least coefficient that is kept.
    pub(super) threshold: f64,
}

/// Smallest threshold that layers are counted from.
const LEAST_THRESHOLD: f64 = 1e-9;

impl Layering {
    /// A layer has what is at least twice as large as what the next one has; the last has the rest.
    fn layer_of(&self, value: f32) -> usize {
        let above = (value.abs() as f64 / self.threshold.max(LEAST_THRESHOLD)).log2().max(0.0) as usize;
        (self.layers - 1).saturating_sub(above)
    }
}

/// The records of all levels, `[level][layer][block]`, with as many layers at each.
pub(super) fn float_records(
    places: &Places,
    tables: &Tables,
    candidates: &[&Candidates],
    selection: &Selection,
    layering: &Layering,
) -> Vec<Vec<Vec<FloatRecord>>> {
    let mut records: Vec<Vec<Vec<FloatRecord>>> = Vec::new();
    for (candidates, kept) in candidates.iter().zip(&selection.kept) {
        let blocks = candidates.dictionaries.len();
        let mut of_layers: Vec<Vec<FloatRecord>> = vec![Vec::with_capacity(blocks); layering.layers];
        for (block, list) in kept.iter().enumerate() {
            let number = tables.numbers[candidates.dictionaries[block] as usize];
            let mut lists: Vec<Vec<(AtomModel, f64)>> = vec![Vec::new(); layering.layers];
            for &i in list {
                let columns = places.split(candidates.places[i as usize]);
                let (atom, scale) = scaled_atom(&tables.parts[number], columns);
                let value = candidates.values[i as usize];
                lists[layering.layer_of(value)].push((atom, value as f64 * scale * TABLE_GAIN));
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
    let layers = records.iter().map(Vec::len).max().unwrap_or(layering.layers);
    for (records, candidates) in records.iter_mut().zip(candidates) {
        records.resize(layers, vec![(0, Vec::new()); candidates.dictionaries.len()]);
    }
    records
}

/// The atom of four columns of the bases, and the product of the largest entries of these.
fn scaled_atom(parts: &[Used; 4], [light, view, x, y]: [usize; 4]) -> (AtomModel, f64) {
    let [of_light, of_view, of_x, of_y] = parts;
    let atom = AtomModel {
        light: of_light.number[light],
        view: of_view.number[view],
        x: of_x.number[x],
        y: of_y.number[y],
        ..AtomModel::default()
    };
    (atom, scale_of(parts, &atom))
}

/// The product of the largest entries of an atom's columns.
fn scale_of([light, view, x, y]: &[Used; 4], atom: &AtomModel) -> f64 {
    light.scale[atom.light as usize]
        * view.scale[atom.view as usize]
        * x.scale[atom.x as usize]
        * y.scale[atom.y as usize]
}

/// Magnitudes that a record may state, with a margin for rounding (10.7-7 at a shift of zero).
const RECORD_SUM: f64 = 2000.0;

/// Most coefficients of a record: their count has at most 15 bits (10.3-3).
const RECORD_COUNT: usize = 32_767;

/// Moves what does not fit into a record to the next layer, the smallest first, and adds layers where they
/// run out.
fn spill(lists: &mut Vec<Vec<(AtomModel, f64)>>) {
    // A magnitude is rounded up to whole units, of which there are 32 in one.
    let share = |c: &(AtomModel, f64)| c.1.abs() + 1.0 / 32.0;
    let mut layer = 0;
    while layer < lists.len() {
        if lists[layer].len() > RECORD_COUNT || lists[layer].iter().map(share).sum::<f64>() > RECORD_SUM {
            let list = &mut lists[layer];
            list.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.word().cmp(&b.0.word())));
            let mut sum = 0.0;
            let fitting = list.iter().take_while(|c| {
                sum += share(c);
                sum <= RECORD_SUM
            });
            let kept = fitting.take(RECORD_COUNT).count().max(1);
            let rest = list.split_off(kept);
            if layer + 1 == lists.len() {
                lists.push(Vec::new());
            }
            lists[layer + 1].extend(rest);
        }
        layer += 1;
    }
}

/// Energy that the rounding of values loses in a layer, for orthonormal columns.
pub(super) fn rounding(
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
            let scale = scale_of(&tables[*number], &atom);
            let decoded = dequantise(atom.quantiser(), quantised as u32, coefficients.value_bits) as f64
                / unit
                / 2f64.powi(atom.shift as i32);
            lost += ((decoded - value) / scale).powi(2);
        }
    }
    lost
}
