//! Trimming: a file without the layers, levels, channels and directions that its user does not need.
//!
//! Nothing is quantised again. What is left decodes to the bits of the original, decoded with as many
//! layers:
//!
//! - *levels*: filtered samples on kept levels, and samples between levels with `level_q16` up to the last
//!   kept one;
//! - *channels*: the value of every channel that keeps its texture. A channel that keeps its mean has the
//!   value that a channel of state 1 has, and one that keeps nothing has 0. Radiance is the original's if
//!   every channel keeps what it has, or what goes has only zeros in its column of the colour matrix;
//! - *directions*: filtered and texel samples whose light and view lie in their sectors
//!   ([`Sector::contains`]), and point samples of kept directions, under the new number: the place in
//!   [`kept_directions`]. Other queries are answered too, from what is left;
//! - *unused*: every query.
//!
//! The promise is for models as the writer triangulates them. The result has its factors in itself, whether
//! or not the original took them from another file, and optional sections as they were. Stated cost, lengths
//! and checksums are the writer's.

use crate::error::{Result, ToolError};
use crate::format::model::{ChannelModel, MaterialModel, PairTableModel};
use crate::format::renumber::kept_rows;
use crate::format::sector::{Sector, kept_directions};
use crate::format::texture::Kept;

/// What stays of a channel, if it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All that it has.
    #[default]
    Texture,
    /// Its mean for each pair of directions.
    Mean,
    /// Nothing: its values are zero.
    Nothing,
}

/// What is to be left; the default is everything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trim {
    /// The first layers, at least 1.
    pub layers: Option<u32>,
    /// The first levels, at least 1.
    pub levels: Option<u32>,
    /// What stays of each channel.
    pub channels: [Keep; 3],
    /// Leave out what no record uses: atoms, columns, dictionaries.
    pub unused: bool,
    /// Light directions that queries will have.
    pub lights: Option<Sector>,
    /// View directions that queries will have.
    pub views: Option<Sector>,
}

/// The model that is left.
///
/// # Errors
/// [`ToolError::Usage`] for layers or levels that the model does not have, and for angles that are none.
pub fn trim(model: &MaterialModel, options: &Trim) -> Result<MaterialModel> {
    let count = |name: &str, asked: Option<u32>, there: u32| match asked {
        Some(asked) if !(1..=there).contains(&asked) => {
            Err(ToolError::Usage(format!("the file has {there} {name}: keep 1 to {there}, not {asked}")))
        }
        asked => Ok(asked.unwrap_or(there)),
    };
    let layers = count("layers", options.layers, model.layer_count)?;
    let levels = count("levels", options.levels, model.level_count)?;
    options.lights.iter().chain(&options.views).try_for_each(Sector::check)?;

    let mut left = model.clone();
    left.layer_count = layers;
    left.level_count = levels;
    for (channel, keep) in left.channels.iter_mut().zip(options.channels) {
        match keep {
            Keep::Texture => {}
            Keep::Mean => *channel = ChannelModel { mean: channel.mean.take(), ..ChannelModel::default() },
            Keep::Nothing => *channel = ChannelModel::default(),
        }
    }
    let kept = |points: &[[i32; 2]], sector: &Option<Sector>| match sector {
        Some(sector) => kept_directions(points, sector),
        None => (0..points.len() as u32).collect(),
    };
    let (lights, views) = (kept(&model.lights, &options.lights), kept(model.views(), &options.views));
    keep_directions(&mut left, &lights, &views);
    left.texture.keep(&Kept {
        layers: layers as usize,
        levels: levels as usize,
        channels: options.channels.map(|keep| keep == Keep::Texture),
        lights: &lights,
        views: &views,
    });
    if options.unused {
        left.texture.drop_unused();
    }
    Ok(left)
}

/// Leaves out directions, and their rows of every table for pairs.
fn keep_directions(model: &mut MaterialModel, lights: &[u32], views: &[u32]) {
    let light_count = model.lights.len();
    // One set for both stays one set as long as both keep the same of it.
    let new_views = (model.views.is_some() || lights != views).then(|| kept_rows(model.views(), 1, views));
    model.lights = kept_rows(&model.lights, 1, lights);
    model.views = new_views;
    let table = |table: &mut PairTableModel| {
        let entry = |view: u32, light: u32| table.entries[view as usize * light_count + light as usize];
        table.entries =
            views.iter().flat_map(|&view| lights.iter().map(move |&light| entry(view, light))).collect();
    };
    for channel in &mut model.channels {
        channel.mean.iter_mut().chain(&mut channel.scale).for_each(table);
    }
}
