//! `explain`: which block, dictionary and atoms made a texel's sample, and how much each of them gave.
//!
//! Results are the core's, bit for bit. What a single coefficient gives is told in floats, since the decoder
//! rounds sums and not single terms; `rounding` is the difference.

use crate::format::read::{RecordTables, list, record_coefficients};
use selvedge::direction::{Direction, Taps};
use selvedge::ensemble::{blend_column, blend_span, coefficients_start, dequantise, read_record, record_q20};
use selvedge::interpolation::{channel_q20, mean_q20, radiance, scale_q15, texel_values};
use selvedge::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR};
use selvedge::position::{Axis, axis_at_texel, block_count};
use selvedge::tensor::{angular_q15, layer_q20, list_coefficient, lists_start, textures_q20};
use selvedge::words::word;
use selvedge::{Selvedge, colour::Values};
use serde::Serialize;

/// One in Q20.
const ONE_Q20: f64 = 1_048_576.0;

/// One coefficient and what it gave.
#[derive(Clone, Debug, Serialize)]
pub struct Term {
    /// Number of the atom in its dictionary.
    pub atom: u32,
    /// Right shift of its product.
    pub shift: u32,
    /// Columns of light, view, x and y.
    pub columns: [u32; 4],
    /// Value as stored, and the coefficient it stands for.
    pub value: u32,
    /// The coefficient.
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
    /// That, less the sum of its terms: rounding and limits.
    pub rounding: f64,
    /// Its terms, the largest first.
    pub terms: Vec<Term>,
}

/// One channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelReport {
    /// 0 missing, 1 a mean, 2 full.
    pub state: u32,
    /// Its mean for these directions.
    pub mean: f64,
    /// The factor of its texture; `None` if there is none.
    pub scale: Option<f64>,
    /// Records of its block, with coefficients.
    pub records: Vec<RecordReport>,
    /// The value, as decoded.
    pub value: f64,
    /// The same, Q20.
    pub value_q20: i32,
}

/// One ABRDF atom of a sparse tensor and what it gave.
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

/// The list of the texel in one layer of a sparse tensor.
#[derive(Clone, Debug, Serialize)]
pub struct ListReport {
    /// Quality layer.
    pub layer: u32,
    /// Right shift of its totals.
    pub shift: u32,
    /// What it adds to the textures, as decoded, in units of the channel.
    pub adds: [f64; 3],
    /// That, less the sum of its terms: rounding and limits.
    pub rounding: [f64; 3],
    /// Its terms, the largest first.
    pub terms: Vec<AbrdfTerm>,
}

/// A sample taken apart.
#[derive(Clone, Debug, Serialize)]
pub struct Explanation {
    /// The texel.
    pub texel: [u32; 2],
    /// Number of its block, and the texel within it.
    pub block: u32,
    /// Texel within the block.
    pub in_block: [u32; 2],
    /// Sample directions of the light with their weights.
    pub light: Vec<(u32, f64)>,
    /// Sample directions of the view with their weights.
    pub view: Vec<(u32, f64)>,
    /// The channels.
    pub channels: Vec<ChannelReport>,
    /// The texel's lists, of a sparse tensor.
    pub lists: Vec<ListReport>,
    /// Linear radiance, as decoded.
    pub radiance: [f32; 3],
}

fn tap_list(taps: Taps) -> Vec<(u32, f64)> {
    let all = [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)];
    all.into_iter()
        .filter(|(_, weight)| *weight != 0)
        .map(|(i, weight)| (i, weight as f64 / 32768.0))
        .collect()
}

/// Takes the sample of one texel of level 0 apart.
pub fn explain(opened: &Selvedge<'_>, texel: [u32; 2], light: Direction, view: Direction) -> Explanation {
    let (material, words) = (opened.material(), opened.words());
    let texel = [texel[0].min(material.width - 1), texel[1].min(material.height - 1)];
    let axis = |at: u32| axis_at_texel(material.edge, material.edge_reciprocal_q18, at);
    let [x, y] = texel.map(axis);
    let (light, view) = (opened.locate_light(light), opened.locate_view(view));
    let textured = material.method == METHOD_SPARSE_TENSOR && material.full_count > 0;
    let given =
        if textured { textures_q20(words, material, 0, x, y, light, view) } else { Values::default() };
    let given = [given.c0, given.c1, given.c2];
    let channels = material
        .channels
        .iter()
        .zip(given)
        .map(|(channel, given)| channel_report(opened, *channel, given, x, y, light, view))
        .collect();
    let layers = if textured { material.layer_limit } else { 0 };
    let lists = (0..layers).map(|layer| list_report(opened, layer, x, y, light, view)).collect();
    let values: Values = texel_values(words, material, texel[0], texel[1], light, view);
    Explanation {
        texel,
        block: y.first.block * block_count(material, material.width) + x.first.block,
        in_block: texel.map(|at| at % material.edge),
        light: tap_list(light),
        view: tap_list(view),
        channels,
        lists,
        radiance: radiance(material, values, light).to_f32(),
    }
}

fn channel_report(
    opened: &Selvedge<'_>,
    channel: Channel,
    given: i32,
    x: Axis,
    y: Axis,
    light: Taps,
    view: Taps,
) -> ChannelReport {
    let (material, words) = (opened.material(), opened.words());
    let value_q20 = channel_q20(words, material, channel, given, 0, x, y, light, view);
    let mean = if channel.state == CHANNEL_MISSING {
        0.0
    } else {
        mean_q20(words, material, channel, light, view) as f64 / ONE_Q20
    };
    let scaled = channel.state == CHANNEL_FULL && channel.scale_start != 0;
    let gain =
        |scale_q15: i32| scale_q15 as f64 / 32768.0 * 2f64.powi(word(words, channel.scale_start + 1) as i32);
    let records = if channel.state == CHANNEL_FULL && material.method != METHOD_SPARSE_TENSOR {
        (0..material.layer_limit)
            .filter_map(|layer| record_report(opened, channel, layer, x, y, light, view))
            .collect()
    } else {
        Vec::new()
    };
    ChannelReport {
        state: channel.state,
        mean,
        scale: scaled.then(|| gain(scale_q15(words, material, channel, light, view))),
        records,
        value: value_q20 as f64 / ONE_Q20,
        value_q20,
    }
}

fn record_report(
    opened: &Selvedge<'_>,
    channel: Channel,
    layer: u32,
    x: Axis,
    y: Axis,
    light: Taps,
    view: Taps,
) -> Option<RecordReport> {
    let (material, words) = (opened.material(), opened.words());
    let block = y.first.block * block_count(material, material.width) + x.first.block;
    let record = read_record(words, coefficients_start(words, material, channel, 0, layer), block);
    if record.count == 0 {
        return None;
    }
    let RecordTables { light: light_table, view: view_table, x: x_table, y: y_table, atoms } =
        RecordTables::of(words, channel, record.dictionary);
    let mut terms = Vec::new();
    record_coefficients(words, record, |position, value| {
        let (atom, quantiser) = (word(words, atoms + position * 2), word(words, atoms + position * 2 + 1));
        let columns = [atom >> 14 & 0x3ff, atom >> 4 & 0x3ff, atom >> 24 & 0xf, atom >> 28];
        let factors_q15 = [
            blend_column(words, light_table.0, light_table.1, light, columns[0]),
            blend_column(words, view_table.0, view_table.1, view, columns[1]),
            blend_span(words, x_table.0, x_table.1, x.first, columns[2]),
            blend_span(words, y_table.0, y_table.1, y.first, columns[3]),
        ];
        let coefficient = dequantise(quantiser, value, record.value_bits);
        // 10.7 without its roundings: the angular product in Q15, then the atom's and the record's shift, to
        // Q20.
        let product: f64 = factors_q15.iter().map(|&u| u as f64 / 32768.0).product();
        let adds = coefficient as f64 * product * 32768.0
            / 2f64.powi((atom & 0xf) as i32 + record.shift as i32)
            / ONE_Q20;
        terms.push(Term {
            atom: position,
            shift: atom & 0xf,
            columns,
            value,
            coefficient,
            factors_q15,
            adds,
        });
    });
    let adds = record_q20(words, channel, record, x.first, y.first, light, view) as f64 / ONE_Q20;
    let rounding = adds - terms.iter().map(|term| term.adds).sum::<f64>();
    terms.sort_by(|a, b| b.adds.abs().total_cmp(&a.adds.abs()).then(a.atom.cmp(&b.atom)));
    Some(RecordReport {
        layer,
        dictionary: record.dictionary,
        shift: record.shift,
        count: record.count,
        adds,
        rounding,
        terms,
    })
}

fn list_report(opened: &Selvedge<'_>, layer: u32, x: Axis, y: Axis, light: Taps, view: Taps) -> ListReport {
    let (material, words) = (opened.material(), opened.words());
    let start = lists_start(words, material, 0, layer);
    let (value_bits, shift) = (word(words, start) & 0xff, word(words, start) >> 24);
    let texel = y.first.block * material.width + x.first.block;
    let term = |(atom, value): (u32, u16)| {
        let shifts = word(words, material.fibres_start + 2 + atom);
        let angular = angular_q15(words, material, atom, shifts & 31, light, view);
        let (angular_q15, gain_shift) = ([angular.c0, angular.c1, angular.c2], shifts >> 5 & 31);
        let coefficient = list_coefficient(value as u32, value_bits);
        // 12.5 without its roundings: Q15 times Q15, then both shifts, to Q20.
        let unit = 2f64.powi(-((gain_shift + shift) as i32)) / ONE_Q20;
        AbrdfTerm {
            atom,
            gain_shift,
            coefficient,
            angular_q15,
            adds: angular_q15.map(|u| coefficient as f64 * u as f64 * unit),
        }
    };
    let mut terms: Vec<AbrdfTerm> =
        list(words, start, word(words, material.fibres_start), texel).into_iter().map(term).collect();
    let decoded = layer_q20(words, material, 0, layer, x, y, light, view);
    let adds = [decoded.c0, decoded.c1, decoded.c2].map(|q20| q20 as f64 / ONE_Q20);
    let rounding = std::array::from_fn(|c| adds[c] - terms.iter().map(|term| term.adds[c]).sum::<f64>());
    let size = |term: &AbrdfTerm| term.adds.iter().map(|a| a.abs()).sum::<f64>();
    terms.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.atom.cmp(&b.atom)));
    ListReport { layer, shift, adds, rounding, terms }
}

/// For people, at most `most` terms of a record.
pub fn text(e: &Explanation, most: usize) -> String {
    let taps = |taps: &[(u32, f64)]| {
        taps.iter().map(|(i, weight)| format!("{i} x {weight:.4}")).collect::<Vec<_>>().join(", ")
    };
    let [r, g, b] = e.radiance;
    let mut text = format!(
        "texel {}, {}: block {}, texel {}, {} of it\n  light  {}\n  view   {}\n  radiance {r} {g} {b}\n",
        e.texel[0],
        e.texel[1],
        e.block,
        e.in_block[0],
        e.in_block[1],
        taps(&e.light),
        taps(&e.view)
    );
    for (c, channel) in e.channels.iter().enumerate() {
        let scale = channel.scale.map_or(String::new(), |scale| format!(", texture times {scale:.6}"));
        text += &format!("channel {c}: {:.6} (mean {:.6}{scale})\n", channel.value, channel.mean);
        for record in &channel.records {
            let (layer, dictionary, count) = (record.layer, record.dictionary, record.count);
            text += &format!(
                "  layer {layer}, dictionary {dictionary}: {count} coefficients add {:+.6}, {:+.1e} of it by rounding\n",
                record.adds, record.rounding
            );
            for term in record.terms.iter().take(most) {
                let [light, view, x, y] = term.columns;
                text += &format!(
                    "    {:+.6}  atom {} (light {light}, view {view}, x {x}, y {y}), coefficient {}\n",
                    term.adds, term.atom, term.coefficient
                );
            }
            let rest: f64 = record.terms.iter().skip(most).map(|term| term.adds).sum();
            if record.terms.len() > most {
                text += &format!("    {rest:+.6}  of {} more\n", record.terms.len() - most);
            }
        }
    }
    let three = |values: [f64; 3]| values.map(|value| format!("{value:+.6}")).join(" ");
    for list in &e.lists {
        text += &format!("layer {}: {} ABRDF atoms add {}\n", list.layer, list.terms.len(), three(list.adds));
        for term in list.terms.iter().take(most) {
            text +=
                &format!("    {}  atom {}, coefficient {}\n", three(term.adds), term.atom, term.coefficient);
        }
        if list.terms.len() > most {
            text += &format!("    and {} more\n", list.terms.len() - most);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::example::example_model;
    use crate::check::extreme::extreme_of_any_method;
    use crate::format::write::write_material;
    use crate::math::random::Random;
    use selvedge::Limits;

    /// Terms sum to what is decoded, and the values are the core's.
    #[test]
    fn terms_sum_to_the_sample() {
        let mut random = Random::new(8);
        let mut terms = 0;
        for seed in 0..40 {
            let file = write_material(&if seed == 0 { example_model() } else { extreme_of_any_method(seed) });
            let opened = selvedge::open(&file, &Limits::NONE).expect("legal");
            let header = opened.header();
            for _ in 0..20 {
                let texel = [
                    random.range(0, header.width as i64 - 1) as u32,
                    random.range(0, header.height as i64 - 1) as u32,
                ];
                let lights = opened.light_direction(random.word() % header.light_count);
                let views = opened.view_direction(random.word() % header.view_count);
                let e = explain(&opened, texel, lights, views);
                for record in e.channels.iter().flat_map(|c| &c.records) {
                    terms += record.terms.len();
                    assert_eq!(record.terms.len(), record.count as usize);
                    // Each of the 16 x 16 spatial sums rounds once or twice before the record's shift, each
                    // term once, and its angular product by half a unit in Q15.
                    let unit = 2f64.powi(-(record.shift as i32)) / ONE_Q20;
                    let angular: f64 = record
                        .terms
                        .iter()
                        .map(|t| t.coefficient.abs() as f64 / 2.0 / 2f64.powi(t.shift as i32))
                        .sum();
                    let bound = (record.count as f64 * 2.0 + 600.0 + angular) * unit + 1.0 / ONE_Q20;
                    assert!(
                        record.rounding.abs() <= bound || record.adds.abs() >= 31.99,
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
