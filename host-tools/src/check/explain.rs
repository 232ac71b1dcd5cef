//! `explain`: which parts of a file made a texel's sample, and how much each of them gave.
//!
//! Results are the core's, bit for bit. What a single coefficient gives is in floats, since the decoder
//! rounds sums and not single terms; the method reports the difference as rounding.

use crate::format::units::{ONE_Q15, ONE_Q20};
use crate::methods;
use crate::methods::sample::{Explained, SampleAt};
use selvedge::kernel::direction::{Direction, Taps};
use selvedge::kernel::interpolation::{mean_q20, radiance, scale_q15, texel_values};
use selvedge::kernel::material::{CHANNEL_FULL, Channel};
use selvedge::kernel::position::{Place, axis_at_texel, block_count};
use selvedge::kernel::words::word;
use selvedge::{Finding, Selvedge};
use serde::Serialize;

/// One channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelReport {
    /// 0 missing, 1 a mean, 2 full.
    pub state: u32,
    /// Its mean for these directions.
    pub mean: f64,
    /// The factor of its texture; `None` if there is none.
    pub scale: Option<f64>,
    /// The value, as decoded.
    pub value: f64,
    /// The same, Q20.
    pub value_q20: i32,
}

/// A sample taken apart.
#[derive(Debug, Serialize)]
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
    /// The textures, as their method takes them apart; `None` if no channel has one.
    pub texture: Option<Box<dyn Explained>>,
    /// Linear radiance, as decoded.
    pub radiance: [f32; 3],
}

fn tap_list(taps: Taps) -> Vec<(u32, f64)> {
    let all = [(taps.a, taps.weight_a_q15), (taps.b, taps.weight_b_q15), (taps.c, taps.weight_c_q15)];
    all.into_iter()
        .filter(|(_, weight)| *weight != 0)
        .map(|(i, weight)| (i, weight as f64 / ONE_Q15))
        .collect()
}

/// Takes the sample of one texel of level 0 apart.
///
/// # Errors
/// Rule 3.1-8 if the tools do not have the file's method.
pub fn explain(
    opened: &Selvedge<'_>,
    texel: [u32; 2],
    light: Direction,
    view: Direction,
) -> Result<Explanation, Finding> {
    let method = methods::of(opened)?;
    let (material, words) = (opened.material(), opened.words());
    let texel = [texel[0].min(material.width - 1), texel[1].min(material.height - 1)];
    let axis = |at: u32| axis_at_texel(material.edge, material.edge_reciprocal_q18, at);
    let [x, y] = texel.map(axis);
    let (light, view) = (opened.locate_light(light), opened.locate_view(view));
    let at = SampleAt { place: Place { level: 0, x, y }, light, view };
    let values = texel_values(words, material, texel[0], texel[1], &light, &view);
    let channels = material.channels.iter().zip([values.c0, values.c1, values.c2]);
    Ok(Explanation {
        texel,
        block: y.first.block * block_count(material, material.width) + x.first.block,
        in_block: texel.map(|at| at % material.edge),
        light: tap_list(light.taps),
        view: tap_list(view.taps),
        channels: channels.map(|(channel, value)| channel_report(opened, *channel, value, &at)).collect(),
        texture: (material.full_count > 0).then(|| (method.explain)(opened, &at)),
        radiance: radiance(material, values, &light).to_f32(),
    })
}

fn channel_report(opened: &Selvedge<'_>, channel: Channel, value_q20: i32, at: &SampleAt) -> ChannelReport {
    let (material, words) = (opened.material(), opened.words());
    let mean = match channel.mean_start {
        0 => 0.0,
        _ => mean_q20(words, material, channel, at.light.taps, at.view.taps) as f64 / ONE_Q20,
    };
    let scaled = channel.state == CHANNEL_FULL && channel.scale_start != 0;
    let scale = || {
        let unit = 2f64.powi(word(words, channel.scale_start + 1) as i32);
        scale_q15(words, material, channel, at.light.taps, at.view.taps) as f64 / ONE_Q15 * unit
    };
    let (scale, value) = (scaled.then(scale), value_q20 as f64 / ONE_Q20);
    ChannelReport { state: channel.state, mean, scale, value, value_q20 }
}

/// For people, at most `most` terms of a list.
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
        text += &e.texture.as_ref().map_or(String::new(), |texture| texture.channel_text(c, most));
    }
    text + &e.texture.as_ref().map_or(String::new(), |texture| texture.text(most))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::extreme::extreme_of_any_method;
    use crate::format::write::write_material;
    use selvedge::Limits;

    /// Every method is explained, as text and as JSON.
    #[test]
    fn every_method_is_explained() {
        for seed in 0..20 {
            let file = write_material(&extreme_of_any_method(seed));
            let opened = selvedge::open(&file, &Limits::NONE).expect("legal");
            let (light, view) = (opened.light_direction(0), opened.view_direction(0));
            let e = explain(&opened, [0, 0], light, view).expect("a method of these tools");
            assert_eq!(e.texture.is_some(), opened.header().has_texture(), "seed {seed}");
            let json = serde_json::to_value(&e).expect("plain data");
            assert!(json["texture"].is_object() == e.texture.is_some() && text(&e, 3).contains("channel 2"));
        }
    }
}
