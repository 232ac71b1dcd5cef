//! What encoders of every method begin with: the description of a dataset as a model, and its means.

use crate::data::dataset::Description;
use crate::data::transfer::matrix_q13;
use crate::error::Result;
use crate::format::model::{MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::format::tables::quantise_means;
use crate::format::triangulate::project;
use crate::format::units::ONE_Q20;
use glam::DVec3;

/// Means over the smallest range of 16 bits that holds them, and as the decoder reads them.
///
/// # Errors
/// [`crate::error::ToolError::Usage`] if they are beyond the format.
pub fn mean_tables(means: &[Vec<f64>; 3]) -> Result<([PairTableModel; 3], [Vec<f32>; 3])> {
    let mut tables: [PairTableModel; 3] = Default::default();
    let mut decoded: [Vec<f32>; 3] = Default::default();
    for c in 0..3 {
        tables[c] = quantise_means(&means[c].iter().map(|m| m * ONE_Q20).collect::<Vec<_>>())?;
        let (base, gain) = (tables[c].base_q20 as f64, 2f64.powi(tables[c].shift as i32));
        decoded[c] = tables[c].entries.iter().map(|&e| ((base + e as f64 * gain) / ONE_Q20) as f32).collect();
    }
    Ok((tables, decoded))
}

/// What a dataset says of its material, without tables and texture: one level, one layer, blocks of one
/// texel.
pub fn described(description: &Description, transfer: TransferModel) -> MaterialModel<()> {
    let points = |directions: &[DVec3]| directions.iter().map(|&d| project(d)).collect();
    MaterialModel {
        size: description.size.map(|n| n as u32),
        level_count: 1,
        edge: 1,
        layer_count: 1,
        transfer,
        cosine_included: description.cosine_included,
        matrix_q13: matrix_q13(),
        metadata: MetadataModel {
            texel_nm: description.texel_nm,
            frame: 0,
            image_origin: 0,
            primaries: 0,
            texts: description.texts.clone(),
        },
        lights: points(&description.lights),
        views: (description.lights != description.views).then(|| points(&description.views)),
        channels: Default::default(),
        texture: (),
        extras: Vec::new(),
    }
}
