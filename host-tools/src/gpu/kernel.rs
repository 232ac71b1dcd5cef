//! The kernel in the languages of other renderers, by naga: WGSL, SPIR-V, MSL, HLSL, GLSL.

use crate::error::{Result, ToolError};
use naga::back;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use selvedge_shaders::{ENTRIES, Request, assemble};

/// A file name and its content.
pub type KernelFile = (String, Vec<u8>);

fn fail(what: impl std::fmt::Debug) -> ToolError {
    ToolError::Kernel(format!("{what:?}"))
}

fn validated(source: &str) -> Result<(naga::Module, ModuleInfo)> {
    let module = naga::front::wgsl::parse_str(source)
        .map_err(|error| ToolError::Kernel(error.emit_to_string(source)))?;
    let info =
        Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).map_err(fail)?;
    Ok((module, info))
}

/// The kernel of some methods with all entry points, as WGSL.
///
/// # Errors
/// [`ToolError::Usage`] if there is no method of a name.
pub fn source(methods: &[&str]) -> Result<String> {
    let entries: Vec<&str> = ENTRIES.iter().map(|entry| entry.name).collect();
    Ok(assemble(&request(methods, &entries)?))
}

fn request(methods: &[&str], entries: &[&str]) -> Result<Request> {
    Request::new(methods, entries).map_err(|unknown| ToolError::Usage(unknown.to_string()))
}

/// Names of all methods.
pub fn method_names() -> Vec<&'static str> {
    selvedge_shaders::METHODS.iter().map(|method| method.name).collect()
}

/// Every translation: `selvedge.wgsl` (with entry points), `selvedge_functions.wgsl` (without),
/// `selvedge.spv`, `selvedge.metal`, `selvedge.hlsl`, and one `selvedge_NAME.comp` in GLSL ES 3.1 for each
/// entry point.
///
/// # Errors
/// [`ToolError::Usage`] if there is no method of a name; [`ToolError::Kernel`] if naga refuses the text.
pub fn translate(methods: &[&str]) -> Result<Vec<KernelFile>> {
    let source = source(methods)?;
    let functions = assemble(&request(methods, &[])?);
    validated(&functions)?;
    let (module, info) = validated(&source)?;
    let mut files = vec![
        ("selvedge.wgsl".to_owned(), source.into_bytes()),
        ("selvedge_functions.wgsl".to_owned(), functions.into_bytes()),
    ];

    let options = back::spv::Options { lang_version: (1, 3), ..Default::default() };
    let words = back::spv::write_vec(&module, &info, &options, None).map_err(fail)?;
    files.push(("selvedge.spv".into(), words.iter().flat_map(|word| word.to_le_bytes()).collect()));

    let options =
        back::msl::Options { lang_version: (2, 1), fake_missing_bindings: true, ..Default::default() };
    let (text, _) = back::msl::write_string(&module, &info, &options, &back::msl::PipelineOptions::default())
        .map_err(fail)?;
    files.push(("selvedge.metal".into(), text.into_bytes()));

    let mut text = String::new();
    let options = back::hlsl::Options { fake_missing_bindings: true, ..Default::default() };
    let pipeline = back::hlsl::PipelineOptions::default();
    back::hlsl::Writer::new(&mut text, &options, &pipeline).write(&module, &info, None).map_err(fail)?;
    files.push(("selvedge.hlsl".into(), text.into_bytes()));

    for entry in ENTRIES.iter().map(|entry| entry.name) {
        let mut text = String::new();
        let options = back::glsl::Options {
            version: back::glsl::Version::Embedded { version: 310, is_webgl: false },
            ..Default::default()
        };
        let pipeline = back::glsl::PipelineOptions {
            shader_stage: naga::ShaderStage::Compute,
            entry_point: entry.into(),
            multiview: None,
        };
        let policies = naga::proc::BoundsCheckPolicies::default();
        back::glsl::Writer::new(&mut text, &module, &info, &options, &pipeline, policies)
            .map_err(fail)?
            .write()
            .map_err(fail)?;
        files.push((format!("selvedge_{entry}.comp"), text.into_bytes()));
    }
    files.push(("README.txt".into(), BINDINGS.into()));
    Ok(files)
}

/// What a host has to bind.
pub const BINDINGS: &str = "\
Bindings of the Selvedge kernel, all in group (set, space) 0:

  0  read-only storage  array<u32>       the files, one behind the other, each from a word on; 4 words of zero at the end
  1  read-only storage  array<Material>  51 words a material: Selvedge::material_at, then Material::to_words
  2  read-only storage  array<Query>     10 words a question: material, u, v, level (Q16), light[3], view[3]
  3  storage            array<Answer>    6 words an answer: binary32 bits of R, G, B, then three channel values in Q20

Entry points texel, filtered, trilinear and floats answer query i in invocation i, in groups of 64.
texel:      u, v are a texel; light[0], view[0] are numbers of sample directions.
filtered:   u, v are u0.32 fractions; light and view are x and y in Q18 of the disc and the cosine in Q15.
trilinear:  the same between two levels of detail.
floats:     u, v, light and view are binary32 bits: positions and unit vectors.
image:      query 0 names material and directions; an invocation in groups of 8 x 8 is a texel.

Files above the device's largest storage binding go into several buffers and dispatches.
selvedge_functions.wgsl has bindings 0 and 1 alone, for shaders of your own.
";
