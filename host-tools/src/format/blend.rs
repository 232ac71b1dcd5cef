//! Blends of two materials: `(1 - alpha) a + alpha b` for every value of a channel. For log files radiance
//! moves geometrically.
//!
//! Means and scales blend entry by entry, here; textures as their method blends them
//! ([`Texture::blend`](crate::format::texture::Texture::blend)). With an alpha of 0 or 1 the result is one of
//! the two models as it is.

use crate::error::{Result, ToolError};
use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::format::tables::{quantise_means, quantise_scales};
use crate::format::texture::{Blend, BlendReport, Blended};
use crate::format::units::ONE_Q15;

/// Most layers of a file (3.1-13).
pub const LAYER_LIMIT: u32 = 8;

/// `(1 - alpha) a + alpha b`.
///
/// # Errors
/// [`ToolError::Usage`] if alpha is not 0 to 1, or if the two do not agree in image size, block edge, levels,
/// directions, channel states, transfer and its offset or exponent, cosine flag and colour matrix; in scales,
/// unless they are to be blended apart; or if the result is beyond the format.
pub fn blend(
    a: &MaterialModel,
    b: &MaterialModel,
    alpha: f64,
    options: Blend,
) -> Result<(MaterialModel, BlendReport)> {
    if !(0.0..=1.0).contains(&alpha) {
        return Err(ToolError::Usage(format!("alpha is 0 to 1, not {alpha}")));
    }
    agree(a, b, options)?;
    if alpha == 0.0 || alpha == 1.0 {
        return Ok((if alpha == 0.0 { a } else { b }.clone(), BlendReport::default()));
    }
    let side_by_side = options.exact && a.has_texture();
    let layer_count =
        if side_by_side { a.layer_count + b.layer_count } else { a.layer_count.max(b.layer_count) };
    if layer_count > LAYER_LIMIT {
        let (of_a, of_b) = (a.layer_count, b.layer_count);
        return Err(ToolError::Usage(format!(
            "an exact blend has the layers of both, {of_a} and {of_b}; a file has at most {LAYER_LIMIT}: trim \
             them first"
        )));
    }
    let mut channels: [ChannelModel; 3] = Default::default();
    for (channel, (of_a, of_b)) in channels.iter_mut().zip(a.channels.iter().zip(&b.channels)) {
        if let (Some(of_a), Some(of_b)) = (&of_a.mean, &of_b.mean) {
            channel.mean = Some(blend_tables(of_a, of_b, alpha, quantise_means)?);
        }
        if let (Some(of_a), Some(of_b)) = (&of_a.scale, &of_b.scale) {
            // Q15 in units of 2^shift.
            channel.scale = Some(blend_tables(of_a, of_b, alpha, |q15| {
                quantise_scales(&q15.iter().map(|q| q / ONE_Q15).collect::<Vec<_>>())
            })?);
        }
    }
    let Blended { texture, report } = a.texture.blend(&*b.texture, alpha, options)?;
    let model = MaterialModel {
        layer_count,
        channels,
        texture,
        metadata: blend_metadata(&a.metadata, &b.metadata),
        extras: a.extras.iter().filter(|extra| b.extras.contains(extra)).cloned().collect(),
        ..a.clone()
    };
    Ok((model, report))
}

/// Refuses two materials that have no common space.
fn agree(a: &MaterialModel, b: &MaterialModel, options: Blend) -> Result<()> {
    let kind = |model: &MaterialModel| matches!(model.transfer, TransferModel::Linear { .. });
    let states = |model: &MaterialModel| [0, 1, 2].map(|c| model.state(c));
    let means = |model: &MaterialModel| model.channels.each_ref().map(|channel| channel.mean.is_some());
    let scales = |model: &MaterialModel| model.channels.each_ref().map(|channel| channel.scale.is_some());
    let same_scales = a.channels.iter().zip(&b.channels).all(|(a, b)| a.scale == b.scale);
    let rules = [
        (a.method() == b.method(), "methods: encode both with the same"),
        (a.size == b.size, "image sizes: both must have the same width and height"),
        (a.edge == b.edge, "block edges: encode both with the same"),
        (a.level_count == b.level_count, "numbers of levels: trim the one that has more"),
        (a.lights == b.lights, "light directions: both must have the same, in the same order"),
        (a.views() == b.views(), "view directions: both must have the same, in the same order"),
        (states(a) == states(b), "channel states: trim a texture or a channel that only one has"),
        (means(a) == means(b), "means: only one of them has a table"),
        (kind(a) == kind(b), "transfers: both must be log2 or linear"),
        (a.transfer == b.transfer, "log offsets or exponents: encode both with the same"),
        (
            a.cosine_included == b.cosine_included,
            "cosine flags: both must have the light's cosine in, or both not",
        ),
        (a.matrix_q13 == b.matrix_q13, "colour matrices: encode both with the same channels"),
        (scales(a) == scales(b), "scales: only one of them has a table; encode both with or without"),
        (
            same_scales || options.scales_apart,
            "scales: values do not blend linearly; blend textures and scales apart, or encode both without \
             scales",
        ),
    ];
    match rules.iter().find(|(holds, _)| !holds) {
        Some((_, what)) => Err(ToolError::Usage(format!("the two materials differ in their {what}"))),
        None => Ok(()),
    }
}

fn blend_tables(
    a: &PairTableModel,
    b: &PairTableModel,
    alpha: f64,
    quantise: impl Fn(&[f64]) -> Result<PairTableModel>,
) -> Result<PairTableModel> {
    if a == b {
        return Ok(a.clone());
    }
    let value = |table: &PairTableModel, entry: i16| {
        entry as f64 * 2f64.powi(table.shift as i32) + table.base_q20 as f64
    };
    let blended: Vec<f64> = a
        .entries
        .iter()
        .zip(&b.entries)
        .map(|(&p, &q)| (1.0 - alpha) * value(a, p) + alpha * value(b, q))
        .collect();
    quantise(&blended)
}

/// Texts of both where they differ; numbers where they agree.
fn blend_metadata(a: &MetadataModel, b: &MetadataModel) -> MetadataModel {
    let either = |a: u32, b: u32| if a == b { a } else { 0 };
    MetadataModel {
        texel_nm: std::array::from_fn(|i| either(a.texel_nm[i], b.texel_nm[i])),
        frame: either(a.frame, b.frame),
        image_origin: either(a.image_origin, b.image_origin),
        primaries: either(a.primaries, b.primaries),
        texts: std::array::from_fn(|i| {
            if a.texts[i] == b.texts[i] {
                a.texts[i].clone()
            } else {
                format!("{}; {}", a.texts[i], b.texts[i])
            }
        }),
    }
}
