//! The lists of a texel, taken apart: ABRDF atoms, and what each coefficient adds.

use crate::format::units::ONE_Q20;
use crate::methods::sample::{Explained, SampleAt};
use crate::methods::sparse_tensor::file::list;
use crate::methods::sparse_tensor::layout::{atom_count, atom_shifts, value_bits_and_shift};
use selvedge::kernel::material::level_size;
use selvedge::kernel::words::word;
use selvedge::method::sparse_tensor::{angular_q15, layer_q20, list_coefficient, lists_start};
use selvedge::{Selvedge, Values};
use serde::Serialize;
use serde_json::Value;

/// One ABRDF atom and what it gave.
#[derive(Clone, Debug, Serialize)]
pub struct AbrdfTerm {
    /// Its number.
    pub atom: u32,
    /// Right shift of its products.
    pub gain_shift: u32,
    /// The coefficient, Q15.
    pub coefficient: i32,
    /// The atom for these directions, Q15, in each channel.
    pub angular_q15: [i32; 3],
    /// What it adds to each texture, in units of the channel.
    pub adds: [f64; 3],
}

/// The list of the texel in one layer.
#[derive(Clone, Debug, Serialize)]
pub struct ListReport {
    /// Quality layer.
    pub layer: u32,
    /// Right shift of its totals.
    pub shift: u32,
    /// What it adds to the textures, as decoded, in units of the channel.
    pub adds: [f64; 3],
    /// That, less the sum of its terms: rounding and clamping.
    pub rounding: [f64; 3],
    /// Its terms, the largest first.
    pub terms: Vec<AbrdfTerm>,
}

/// The texel's lists.
#[derive(Clone, Debug, Serialize)]
pub struct TensorReport {
    /// Those of each layer.
    pub lists: Vec<ListReport>,
}

/// Takes the textures of a texel apart.
pub fn explain(opened: &Selvedge<'_>, at: &SampleAt) -> Box<dyn Explained> {
    let layers = 0..opened.material().layer_limit;
    Box::new(TensorReport { lists: layers.map(|layer| list_report(opened, layer, at)).collect() })
}

fn array(values: Values) -> [i32; 3] {
    [values.c0, values.c1, values.c2]
}

fn list_report(opened: &Selvedge<'_>, layer: u32, at: &SampleAt) -> ListReport {
    let (material, words) = (opened.material(), opened.words());
    let start = lists_start(words, material, at.place.level, layer);
    let [value_bits, shift] = value_bits_and_shift(word(words, start));
    let texel = at.place.y.first.block * level_size(material.width, at.place.level) + at.place.x.first.block;
    let term = |(atom, value): (u32, u16)| {
        let [angular_shift, gain_shift] = atom_shifts(words, material, atom);
        let angular_q15 =
            array(angular_q15(words, material, atom, angular_shift, at.light.taps, at.view.taps));
        let coefficient = list_coefficient(value as u32, value_bits);
        // 12.5 without its roundings: Q15 times Q15, then both shifts, to Q20.
        let unit = 2f64.powi(-((gain_shift + shift) as i32)) / ONE_Q20;
        let adds = angular_q15.map(|u| coefficient as f64 * u as f64 * unit);
        AbrdfTerm { atom, gain_shift, coefficient, angular_q15, adds }
    };
    let list = list(words, start, atom_count(words, material), texel);
    let mut terms: Vec<AbrdfTerm> = list.into_iter().map(term).collect();
    let decoded = layer_q20(words, material, layer, &at.place, at.light.taps, at.view.taps);
    let adds = array(decoded).map(|q20| q20 as f64 / ONE_Q20);
    let rounding = std::array::from_fn(|c| adds[c] - terms.iter().map(|term| term.adds[c]).sum::<f64>());
    let size = |term: &AbrdfTerm| term.adds.iter().map(|a| a.abs()).sum::<f64>();
    terms.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.atom.cmp(&b.atom)));
    ListReport { layer, shift, adds, rounding, terms }
}

impl Explained for TensorReport {
    fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("plain data")
    }

    fn text(&self, most: usize) -> String {
        let three = |values: [f64; 3]| values.map(|value| format!("{value:+.6}")).join(" ");
        let mut text = String::new();
        for ListReport { layer, adds, terms, .. } in &self.lists {
            text += &format!("layer {layer}: {} ABRDF atoms add {}\n", terms.len(), three(*adds));
            for AbrdfTerm { atom, coefficient, adds, .. } in terms.iter().take(most) {
                text += &format!("    {}  atom {atom}, coefficient {coefficient}\n", three(*adds));
            }
            if terms.len() > most {
                text += &format!("    and {} more\n", terms.len() - most);
            }
        }
        text
    }
}
