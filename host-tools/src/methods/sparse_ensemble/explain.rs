//! The records of a texel, taken apart: dictionary, atoms, and what each coefficient adds.

use crate::format::units::{ONE_Q15, ONE_Q20};
use crate::methods::sample::{Explained, SampleAt};
use crate::methods::sparse_ensemble::file::record_coefficients;
use crate::methods::sparse_ensemble::layout::{RecordTables, atom_columns, atom_of_list, atom_shift};
use selvedge::Selvedge;
use selvedge::kernel::material::{CHANNEL_FULL, channel_of, level_size};
use selvedge::kernel::position::block_count;
use selvedge::method::sparse_ensemble::{
    Record, blend_column, blend_span, coefficients_start, dequantise, read_record, record_q20,
};
use selvedge::method::sparse_ensemble::{Tables, tables_of};
use serde::Serialize;
use serde_json::Value;

/// One coefficient and what it gave.
#[derive(Clone, Debug, Serialize)]
pub struct Term {
    /// Number of the atom in its dictionary.
    pub atom: u32,
    /// Right shift of its product.
    pub shift: u32,
    /// Columns of light, view, x and y.
    pub columns: [u32; 4],
    /// Value as stored.
    pub value: u32,
    /// The coefficient that it stands for.
    pub coefficient: i32,
    /// Blended columns, Q15: light, view, x, y.
    pub factors_q15: [i32; 4],
    /// What it adds to the texture, in units of the channel.
    pub adds: f64,
}

/// One record.
#[derive(Clone, Debug, Serialize)]
pub struct RecordReport {
    /// Quality layer.
    pub layer: u32,
    /// Its dictionary.
    pub dictionary: u32,
    /// Its right shift.
    pub shift: u32,
    /// Its coefficients.
    pub count: u32,
    /// What it adds to the texture, as decoded, in units of the channel.
    pub adds: f64,
    /// That, less the sum of its terms: rounding and clamping.
    pub rounding: f64,
    /// Its terms, the largest first.
    pub terms: Vec<Term>,
}

/// The records of a texel's block, with coefficients.
#[derive(Clone, Debug, Serialize)]
pub struct EnsembleReport {
    /// Those of each channel.
    pub channels: [Vec<RecordReport>; 3],
}

/// Takes the textures of a texel apart.
pub fn explain(opened: &Selvedge<'_>, at: &SampleAt) -> Box<dyn Explained> {
    let material = opened.material();
    let channels = [0, 1, 2].map(|number| {
        let full = channel_of(material, number).state == CHANNEL_FULL;
        let layers = if full { material.layer_limit } else { 0 };
        let tables = tables_of(material, number);
        (0..layers).filter_map(|layer| record_report(opened, tables, layer, at)).collect()
    });
    Box::new(EnsembleReport { channels })
}

fn record_report(opened: &Selvedge<'_>, tables: Tables, layer: u32, at: &SampleAt) -> Option<RecordReport> {
    let (material, words) = (opened.material(), opened.words());
    let (x, y) = (at.place.x.first, at.place.y.first);
    let block = y.block * block_count(material, level_size(material.width, at.place.level)) + x.block;
    let start = coefficients_start(words, material, tables.full_rank, at.place.level, layer);
    let record = read_record(words, start, block);
    if record.count == 0 {
        return None;
    }
    let mut terms = terms(opened, tables, record, at);
    let adds = record_q20(words, tables, record, x, y, at.light.taps, at.view.taps) as f64 / ONE_Q20;
    let rounding = adds - terms.iter().map(|term| term.adds).sum::<f64>();
    terms.sort_by(|a, b| b.adds.abs().total_cmp(&a.adds.abs()).then(a.atom.cmp(&b.atom)));
    let Record { dictionary, shift, count, .. } = record;
    Some(RecordReport { layer, dictionary, shift, count, adds, rounding, terms })
}

/// The coefficients of a record in their order.
fn terms(opened: &Selvedge<'_>, tables: Tables, record: Record, at: &SampleAt) -> Vec<Term> {
    let words = opened.words();
    let of_record = RecordTables::of(words, tables, record.dictionary);
    let mut terms = Vec::new();
    record_coefficients(words, record, |position, value| {
        let [atom, quantiser] = atom_of_list(words, of_record.atoms, position);
        let columns = atom_columns(atom);
        let factors_q15 = [
            blend_column(words, of_record.light.0, of_record.light.1, at.light.taps, columns[0]),
            blend_column(words, of_record.view.0, of_record.view.1, at.view.taps, columns[1]),
            blend_span(words, of_record.x.0, of_record.x.1, at.place.x.first, columns[2]),
            blend_span(words, of_record.y.0, of_record.y.1, at.place.y.first, columns[3]),
        ];
        let coefficient = dequantise(quantiser, value, record.value_bits);
        // 10.7 without its roundings: the angular product in Q15, then the atom's and the record's shift, to
        // Q20.
        let product: f64 = factors_q15.iter().map(|&u| u as f64 / ONE_Q15).product();
        let shift = atom_shift(atom);
        let adds =
            coefficient as f64 * product * ONE_Q15 / 2f64.powi((shift + record.shift) as i32) / ONE_Q20;
        terms.push(Term { atom: position, shift, columns, value, coefficient, factors_q15, adds });
    });
    terms
}

impl Explained for EnsembleReport {
    fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("plain data")
    }

    fn channel_text(&self, channel: usize, most: usize) -> String {
        self.channels[channel].iter().map(|record| record_text(record, most)).collect()
    }
}

fn record_text(record: &RecordReport, most: usize) -> String {
    let RecordReport { layer, dictionary, count, adds, rounding, terms, .. } = record;
    let mut text = format!(
        "  layer {layer}, dictionary {dictionary}: {count} coefficients add {adds:+.6}, {rounding:+.1e} of it \
         by rounding\n"
    );
    for term in terms.iter().take(most) {
        let [light, view, x, y] = term.columns;
        text += &format!(
            "    {:+.6}  atom {} (light {light}, view {view}, x {x}, y {y}), coefficient {}\n",
            term.adds, term.atom, term.coefficient
        );
    }
    if terms.len() > most {
        let rest: f64 = terms.iter().skip(most).map(|term| term.adds).sum();
        text += &format!("    {rest:+.6}  of {} more\n", terms.len() - most);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::write::write_material;
    use crate::math::random::Random;
    use crate::methods::reach::Reach;
    use crate::methods::sparse_ensemble::example::example_model;
    use crate::methods::sparse_ensemble::extreme::extreme_model;
    use selvedge::Limits;
    use selvedge::kernel::position::axis_at_texel;

    /// Each of the 16 x 16 spatial sums rounds once or twice before the record's shift, each term once, and
    /// its angular product by half a unit in Q15.
    fn rounding_bound(record: &RecordReport) -> f64 {
        let unit = 2f64.powi(-(record.shift as i32)) / ONE_Q20;
        let half = |t: &Term| t.coefficient.abs() as f64 / 2.0 / 2f64.powi(t.shift as i32);
        let angular: f64 = record.terms.iter().map(half).sum();
        (record.count as f64 * 2.0 + 600.0 + angular) * unit + 1.0 / ONE_Q20
    }

    /// Terms sum to what is decoded.
    #[test]
    fn terms_sum_to_the_sample() {
        let mut random = Random::new(8);
        let mut terms = 0;
        for seed in 0..40 {
            let any = || extreme_model(&mut Random::new(seed), Reach::FULL);
            let file = write_material(&if seed == 0 { example_model() } else { any() });
            let opened = selvedge::open(&file, &Limits::NONE).expect("legal");
            let (header, material) = (opened.header(), opened.material());
            for _ in 0..20 {
                let mut axis = |size: u32| {
                    let texel = random.range(0, size as i64 - 1) as u32;
                    axis_at_texel(material.edge, material.edge_reciprocal_q18, texel)
                };
                let (x, y) = (axis(header.width), axis(header.height));
                let light = opened.light_direction(random.word() % header.light_count);
                let view = opened.view_direction(random.word() % header.view_count);
                let (light, view) = (opened.locate_light(light), opened.locate_view(view));
                let at =
                    SampleAt { place: selvedge::kernel::position::Place { level: 0, x, y }, light, view };
                let records = (0..3).flat_map(|number| {
                    let full = channel_of(material, number).state == CHANNEL_FULL;
                    let layers = if full { material.layer_limit } else { 0 };
                    (0..layers).map(move |layer| (tables_of(material, number), layer))
                });
                for (tables, layer) in records {
                    let Some(record) = record_report(&opened, tables, layer, &at) else { continue };
                    terms += record.terms.len();
                    assert_eq!(record.terms.len(), record.count as usize);
                    assert!(
                        record.rounding.abs() <= rounding_bound(&record) || record.adds.abs() >= 31.99,
                        "seed {seed}: {} of {}",
                        record.rounding,
                        record.adds
                    );
                }
            }
        }
        assert!(terms > 1000, "{terms}");
    }
}
