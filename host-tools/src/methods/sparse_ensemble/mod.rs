//! The sparse ensemble (chapter 10; SparseBTF, Kavoosighafi et al. 2023).

pub mod advice;
pub mod basis;
pub mod blend;
pub mod blocks;
pub mod count;
pub mod dictionary;
pub mod dictionary_file;
pub mod encode;
pub mod example;
pub mod explain;
pub mod extreme;
pub mod file;
pub mod layout;
pub mod model;
pub mod quantise;
pub mod sparsebtf;
pub mod texture;
pub mod train;
pub mod trim;

use crate::format::container::level_of_instance;
use crate::methods::method::{Method, SectionName};
use model::EnsembleTexture;
use selvedge::Rule;
use selvedge::method::sparse_ensemble::METHOD_SPARSE_ENSEMBLE;
use selvedge::method::sparse_ensemble::check::{ANGULAR, ATOMS, COEFFICIENTS, SPATIAL};

/// What the tools have of the sparse ensemble.
pub static METHOD: Method = Method {
    number: METHOD_SPARSE_ENSEMBLE,
    name: model::NAME,
    title: "sparse ensemble",
    paper: "SparseBTF, Kavoosighafi et al. 2023",
    colour: [0, 114, 178],
    sections: &[
        SectionName { kind: ANGULAR, name: "angular factors", instance: of_channel },
        SectionName { kind: SPATIAL, name: "spatial factors", instance: of_channel },
        SectionName { kind: ATOMS, name: "atoms", instance: of_channel },
        SectionName { kind: COEFFICIENTS, name: "coefficients", instance: of_level },
    ],
    read: |opened| Box::new(file::read(opened)),
    from_json: |value| Ok(Box::new(serde_json::from_value::<EnsembleTexture>(value)?)),
    example: example::example_model,
    extreme: extreme::extreme_model,
    explain: explain::explain,
    count: count::count,
    advice: advice::ADVICE,
    advise: advice::advise,
    hints: &[
        (Rule::StreamEnd, "canonical files have zeros there; write the file again"),
        (Rule::RecordSum, "put a part of the coefficients into another layer"),
        (Rule::RecordZeros, "write positions with more low bits"),
    ],
};

fn of_channel(instance: u32) -> String {
    format!("channel {instance}")
}

fn of_level(instance: u32) -> String {
    let [level, layer, channel] = level_of_instance(instance);
    format!("level {level}, layer {layer}, channel {channel}")
}
