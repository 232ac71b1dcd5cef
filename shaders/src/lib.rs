//! The Selvedge decoder as WGSL: module by module the twin of the core, assembled from what is needed.
//!
//! A shader is the concatenation of its modules; declarations need no order. The kernel uses 32-bit
//! integers alone: no float, no division, no extra capability of the device. Functions are handed the number
//! of a material in the bound table, never its words.
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
//! use selvedge_shaders::{Request, assemble};
//!
//! // One method, one entry point: what a compiler does not see it does not compile.
//! let request = Request::new(&["sparse-tensor"], &["filtered"]).expect("known names");
//! let wgsl = assemble(&request);
//! assert!(wgsl.contains("fn filtered(") && !wgsl.contains("fn trilinear("));
//! ```

use std::fmt;

/// One source file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// A method of the format: one module, with `METHOD_<NAME>` and `<name>_textures_q20`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// Number in the header.
    pub number: u32,
    /// The name that a user types.
    pub name: &'static str,
    /// Its functions.
    pub module: Module,
}

/// All methods of this version.
pub const METHODS: &[Method] = &[
    Method { number: 1, name: "sparse-ensemble", module: module!("sparse_ensemble") },
    Method { number: 2, name: "sparse-tensor", module: module!("sparse_tensor") },
];

/// An entry point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name of the function.
    pub name: &'static str,
    /// Invocations of a workgroup along x and y: lists of queries are 64 by 1.
    pub workgroup: [u32; 2],
    /// Whether it samples between levels of detail (chapter 9).
    pub levels: bool,
    /// Its text.
    pub module: Module,
}

/// All entry points.
pub const ENTRIES: &[Entry] = &[
    Entry { name: "texel", workgroup: [64, 1], levels: false, module: module!("entries/texel") },
    Entry { name: "filtered", workgroup: [64, 1], levels: false, module: module!("entries/filtered") },
    Entry { name: "trilinear", workgroup: [64, 1], levels: true, module: module!("entries/trilinear") },
    Entry { name: "floats", workgroup: [64, 1], levels: true, module: module!("entries/floats") },
    Entry { name: "image", workgroup: [8, 8], levels: false, module: module!("entries/image") },
];

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

/// Samples between levels of detail.
pub const LEVELS: Module = module!("levels");

/// What the entry points share.
pub const ENTRIES_SHARED: Module = module!("entries/shared");

/// Words of a query.
pub const QUERY_WORDS: usize = 10;
/// Words of an answer.
pub const ANSWER_WORDS: usize = 6;

/// What a shader is wanted for.
#[derive(Clone, Debug)]
pub struct Request {
    /// The methods of the files that it will decode.
    pub methods: Vec<&'static Method>,
    /// Entry points; none for text that another shader calls.
    pub entries: Vec<&'static Entry>,
    /// With the functions between levels of detail; entry points that need them bring them anyway.
    pub levels: bool,
}

/// A name or number that no method or entry point has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown(pub String);

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the kernel has no {}", self.0)
    }
}

impl std::error::Error for Unknown {}

impl Request {
    /// Every method and every entry point.
    pub fn all() -> Request {
        Request { methods: METHODS.iter().collect(), entries: ENTRIES.iter().collect(), levels: true }
    }

    /// Methods and entry points by name; without entry points, with the functions between levels.
    ///
    /// # Errors
    /// If there is none of a name.
    pub fn new(methods: &[&str], entries: &[&str]) -> Result<Request, Unknown> {
        let method = |name: &&str| {
            METHODS
                .iter()
                .find(|method| method.name == *name)
                .ok_or_else(|| Unknown(format!("method `{name}`")))
        };
        let entry = |name: &&str| {
            ENTRIES
                .iter()
                .find(|entry| entry.name == *name)
                .ok_or_else(|| Unknown(format!("entry point `{name}`")))
        };
        Ok(Request {
            methods: methods.iter().map(method).collect::<Result<_, _>>()?,
            entries: entries.iter().map(entry).collect::<Result<_, _>>()?,
            levels: entries.is_empty(),
        })
    }

    /// Only the methods that some open materials have, for entry points by name.
    ///
    /// # Errors
    /// If a material has a method that the kernel has not, or there is no entry point of a name.
    pub fn for_materials(materials: &[selvedge::Material], entries: &[&str]) -> Result<Request, Unknown> {
        let mut request = Request::new(&[], entries)?;
        for number in materials.iter().map(|material| material.method) {
            let method = METHODS.iter().find(|method| method.number == number);
            let method = method.ok_or_else(|| Unknown(format!("method of number {number}")))?;
            if !request.methods.contains(&method) {
                request.methods.push(method);
            }
        }
        request.levels &= materials.iter().any(|material| material.level_count > 1);
        Ok(request)
    }
}

/// The dispatch between the methods of a request: twin of `kernel::method::textures_q20`.
pub fn dispatch(methods: &[&Method]) -> String {
    let mut text = String::from(
        "// Which method answers (chapter 8.3). Twin: decoder-core/src/kernel/method.rs.\n\n\
         // The textures of all channels by the material's method, Q20 (8.3-3).\n\
         fn textures_q20(material: u32, place: Place, light: Located, view: Located) -> Values {\n\
         \x20   switch materials[material].method {\n",
    );
    for method in methods {
        let module = method.module.name;
        text += &format!("        case METHOD_{}: {{\n", module.to_uppercase());
        text +=
            &format!("            return {module}_textures_q20(material, place, light, view);\n        }}\n");
    }
    text += "        default: {\n            return Values(0, 0, 0);\n        }\n    }\n}\n";
    text
}

/// The source files of a shader, in order; [`dispatch`] is the one text beside them.
pub fn modules(request: &Request) -> Vec<Module> {
    let mut modules = SHARED.to_vec();
    if request.levels || request.entries.iter().any(|entry| entry.levels) {
        modules.push(LEVELS);
    }
    modules.extend(request.methods.iter().map(|method| method.module));
    if !request.entries.is_empty() {
        modules.push(ENTRIES_SHARED);
    }
    modules.extend(request.entries.iter().map(|entry| entry.module));
    modules
}

/// The text of a shader.
pub fn assemble(request: &Request) -> String {
    let mut texts: Vec<String> = modules(request).iter().map(|module| module.source.to_owned()).collect();
    texts.push(dispatch(&request.methods));
    texts.join("\n")
}
