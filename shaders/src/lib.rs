//! The Selvedge decoder as WGSL: module by module the twin of the core, assembled from what is needed.
//!
//! A shader is the concatenation of its modules; declarations need no order. The kernel uses 32-bit
//! integers alone: no float, no division, no extra capability of the device.
//!
//! # Bindings, all in group 0
//!
//! | binding | type | holds |
//! |---|---|---|
//! | 0 | `storage, read` `array<u32>` | the files, and external dictionaries, each from a word of its own on |
//! | 1 | `storage, read` `array<Material>` | a record of 51 words for each material: `Selvedge::material_at`, then `Material::to_words` |
//! | 2 | `storage, read` `array<Query>` | 10 words for each question (entry points only) |
//! | 3 | `storage, read_write` `array<Answer>` | 6 words for each answer (entry points only) |
//!
//! Files above the device's largest storage binding (WebGPU promises 128 MiB) go into several bindings
//! and dispatches, one set of materials each.
//!
//! ```
//! use selvedge_shaders::{Method, Request, assemble};
//!
//! let wgsl = assemble(&Request { methods: &[Method::SparseEnsemble], entries: true });
//! assert!(wgsl.contains("fn filtered("));
//! ```

/// A method of the format; each is one module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Chapter 10.
    SparseEnsemble,
    /// Chapter 12.
    SparseTensor,
}

/// All methods of this version.
pub const METHODS: [Method; 2] = [Method::SparseEnsemble, Method::SparseTensor];

/// What a shader is wanted for.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The methods of the files that it will decode.
    pub methods: &'a [Method],
    /// With the entry points, to be dispatched as it is; without, to be called from another shader.
    pub entries: bool,
}

/// One source file.
#[derive(Clone, Copy, Debug)]
pub struct Module {
    /// Name without `.wgsl`; that of the core's module.
    pub name: &'static str,
    /// The text.
    pub source: &'static str,
}

macro_rules! module {
    ($name:literal) => {
        Module { name: $name, source: include_str!(concat!("../wgsl/", $name, ".wgsl")) }
    };
}

/// Modules that every method needs, in the order of the chapters.
pub const SHARED: &[Module] = &[
    module!("words"),
    module!("material"),
    module!("fixed"),
    module!("direction"),
    module!("position"),
    module!("colour"),
    module!("interpolation"),
];

/// The module of the sparse ensemble.
pub const ENSEMBLE: Module = module!("ensemble");

/// The module of the sparse tensor.
pub const TENSOR: Module = module!("tensor");

/// What stands in for a method that a shader leaves out.
pub const LEFT_OUT: [Module; 2] = [module!("no_ensemble"), module!("no_tensor")];

/// The entry points.
pub const ENTRIES: Module = module!("entries");

/// Words of a query.
pub const QUERY_WORDS: usize = 10;
/// Words of an answer.
pub const ANSWER_WORDS: usize = 6;
/// Names of the entry points: four for lists of queries in groups of 64, then `image` in groups of 8 x 8.
pub const ENTRY_POINTS: [&str; 5] = ["texel", "filtered", "trilinear", "floats", "image"];

/// The modules of a shader, in order.
pub fn modules(request: &Request<'_>) -> Vec<Module> {
    let methods = METHODS.iter().zip([ENSEMBLE, TENSOR]).zip(LEFT_OUT);
    let methods = methods
        .map(|((method, there), left_out)| if request.methods.contains(method) { there } else { left_out });
    SHARED.iter().copied().chain(methods).chain(request.entries.then_some(ENTRIES)).collect()
}

/// The text of a shader.
pub fn assemble(request: &Request<'_>) -> String {
    modules(request).iter().map(|module| module.source).collect::<Vec<_>>().join("\n")
}
