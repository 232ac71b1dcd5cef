//! The sparse tensor to everything that does not care which method it is.

use crate::format::container::RawSection;
use crate::format::texture::{Kept, Texture};
use crate::methods::sparse_tensor::model::{NAME, TensorModel};
use crate::methods::sparse_tensor::{file, trim};
use selvedge::method::sparse_tensor::METHOD_SPARSE_TENSOR;
use selvedge::method::sparse_tensor::cost::layer_operations;
use serde_json::Value;

impl Texture for TensorModel {
    fn method(&self) -> u32 {
        METHOD_SPARSE_TENSOR
    }

    fn name(&self) -> &'static str {
        NAME
    }

    fn channels(&self) -> [bool; 3] {
        self.channels
    }

    fn dictionary_sections(&self) -> Vec<RawSection> {
        file::dictionary_sections(self)
    }

    fn own_sections(&self) -> Vec<RawSection> {
        file::own_sections(self)
    }

    fn operations(&self, _edge: u32, level: usize) -> u64 {
        let of_layer =
            |lists| layer_operations(file::largest_count(lists), self.atoms.len() as u32, self.entries);
        self.lists[level].iter().map(of_layer).sum()
    }

    fn keep(&mut self, kept: &Kept<'_>) {
        trim::keep(self, kept);
    }

    fn drop_unused(&mut self) {
        trim::drop_unused(self);
    }

    fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("plain data")
    }

    fn boxed(&self) -> Box<dyn Texture> {
        Box::new(self.clone())
    }

    fn is_same(&self, other: &dyn Texture) -> bool {
        other.downcast_ref::<TensorModel>() == Some(self)
    }
}
