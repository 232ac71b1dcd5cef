//! The sparse ensemble to everything that does not care which method it is.

use crate::error::{Result, ToolError};
use crate::format::container::RawSection;
use crate::format::texture::{Blend, Blended, Kept, Texture};
use crate::methods::sparse_ensemble::model::{EnsembleTexture, NAME};
use crate::methods::sparse_ensemble::{blend, file, trim};
use selvedge::method::sparse_ensemble::METHOD_SPARSE_ENSEMBLE;
use selvedge::method::sparse_ensemble::cost::record_operations;
use serde_json::Value;

/// Most blocks that a filtered sample meets (6.2).
const CORNERS: u64 = 4;

impl Texture for EnsembleTexture {
    fn method(&self) -> u32 {
        METHOD_SPARSE_ENSEMBLE
    }

    fn name(&self) -> &'static str {
        NAME
    }

    fn channels(&self) -> [bool; 3] {
        self.channels.each_ref().map(Option::is_some)
    }

    fn dictionary_sections(&self) -> Vec<RawSection> {
        file::dictionary_sections(self)
    }

    fn own_sections(&self) -> Vec<RawSection> {
        file::own_sections(self)
    }

    fn operations(&self, edge: u32, level: usize) -> u64 {
        let layers = self.full().flat_map(|(_, ensemble)| &ensemble.coefficients[level]);
        layers.map(|layer| CORNERS * record_operations(file::largest_count(layer), edge)).sum()
    }

    fn keep(&mut self, kept: &Kept<'_>) {
        trim::keep(self, kept);
    }

    fn drop_unused(&mut self) {
        self.channels.iter_mut().flatten().for_each(trim::drop_unused);
    }

    fn blend(&self, other: &dyn Texture, alpha: f64, options: Blend) -> Result<Blended> {
        let other = other.downcast_ref::<EnsembleTexture>().ok_or_else(|| {
            ToolError::Usage(format!("{NAME} and {} have no common coefficients", other.name()))
        })?;
        let (texture, report) = blend::blend(self, other, alpha, options)?;
        Ok(Blended { texture: Box::new(texture), report })
    }

    fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("plain data")
    }

    fn boxed(&self) -> Box<dyn Texture> {
        Box::new(self.clone())
    }

    fn is_same(&self, other: &dyn Texture) -> bool {
        other.downcast_ref::<EnsembleTexture>() == Some(self)
    }
}
