//! The sparse tensor (chapter 12; Ruiters and Klein 2009).

pub mod advice;
pub mod count;
pub mod encode;
pub mod example;
pub mod explain;
pub mod extreme;
pub mod file;
pub mod layout;
pub mod model;
pub mod texture;
pub mod trim;

use crate::format::container::level_of_instance;
use crate::methods::method::{Method, SectionName};
use model::TensorModel;
use selvedge::Rule;
use selvedge::method::sparse_tensor::METHOD_SPARSE_TENSOR;
use selvedge::method::sparse_tensor::check::{FIBRES, LIGHT_ATOMS, LISTS};

/// What the tools have of the sparse tensor.
pub static METHOD: Method = Method {
    number: METHOD_SPARSE_TENSOR,
    name: model::NAME,
    title: "sparse tensor",
    paper: "Ruiters and Klein 2009",
    colour: [213, 94, 0],
    sections: &[
        SectionName { kind: LIGHT_ATOMS, name: "light atoms", instance: of_material },
        SectionName { kind: FIBRES, name: "fibres", instance: of_material },
        SectionName { kind: LISTS, name: "lists", instance: of_level },
    ],
    read: |opened| Box::new(file::read(opened)),
    from_json: |value| Ok(Box::new(serde_json::from_value::<TensorModel>(value)?)),
    example: example::example_model,
    extreme: extreme::extreme_model,
    explain: explain::explain,
    count: count::count,
    advice: advice::ADVICE,
    advise: advice::advise,
    hints: &[
        (Rule::ListsEnd, "canonical files have zeros there; write the file again"),
        (Rule::ListSum, "put a part of the coefficients into another layer"),
        (Rule::FibreSum, "halve the values of the ABRDF atom's fibres and take one from its angular shift"),
    ],
};

fn of_material(_instance: u32) -> String {
    String::new()
}

fn of_level(instance: u32) -> String {
    let [level, layer, _] = level_of_instance(instance);
    format!("level {level}, layer {layer}")
}
