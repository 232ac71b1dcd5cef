//! The header says what the source does: the same functions, types, layouts and constants.

mod common;

use common::{compile_well, has_program, here, text, work_folder};
use quote::ToTokens;
use selvedge_c::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::mem::{offset_of, size_of};
use std::process::Command;

/// A function's result and parameters, as C spells their types.
type Signature = (String, Vec<String>);

/// The items of all sources.
fn items() -> Vec<syn::Item> {
    let folder = std::fs::read_dir(here().join("src")).expect("the sources are there");
    let sources = folder.map(|entry| {
        std::fs::read_to_string(entry.expect("entries can be read").path()).expect("sources are text")
    });
    sources.flat_map(|source| syn::parse_file(&source).expect("sources are Rust").items).collect()
}

/// A type as C spells it.
fn c_type(rust: &syn::Type) -> String {
    if let syn::Type::Ptr(pointer) = rust {
        let of = c_type(&pointer.elem);
        return if matches!(pointer.mutability, syn::PointerMutability::Mut(_)) {
            format!("{of} *")
        } else {
            format!("const {of} *")
        };
    }
    let name = rust.to_token_stream().to_string().replace(' ', "");
    let name = match &name[..] {
        "u8" => "uint8_t",
        "u32" => "uint32_t",
        "i32" => "int32_t",
        "usize" => "size_t",
        "f32" => "float",
        "c_char" => "char",
        "c_void" => "void",
        "Option<selvedge_report>" => "selvedge_report",
        own if own.starts_with("selvedge_") => own,
        other => panic!("no C type is known for {other}"),
    };
    name.into()
}

/// Every function that the library exports, from its source.
fn source_functions() -> BTreeMap<String, Signature> {
    let functions = items()
        .into_iter()
        .filter_map(|item| if let syn::Item::Fn(function) = item { Some(function) } else { None });
    let exported = functions.filter(|function| function.sig.abi.is_some());
    let signature = |function: syn::ItemFn| {
        let tokens = function.attrs.iter().map(|a| a.to_token_stream().to_string()).collect::<String>();
        assert!(tokens.contains("no_mangle"), "{} is exported by its name", function.sig.ident);
        let syn::ReturnType::Type(_, result) = &function.sig.output else {
            panic!("every function has a result")
        };
        let parameters = function.sig.inputs.iter().map(|input| {
            let syn::FnArg::Typed(typed) = input else { panic!("no function has a self") };
            c_type(&typed.ty)
        });
        (function.sig.ident.to_string(), (c_type(result), parameters.collect()))
    };
    exported.map(signature).collect()
}

/// The header without comments and directives, words apart by one blank.
fn header_code() -> String {
    let mut rest = &header_text()[..];
    let mut code = String::new();
    while let Some((before, after)) = rest.split_once("/*") {
        code += before;
        rest = after.split_once("*/").expect("comments end").1;
    }
    code += rest;
    let lines = code.lines().filter(|line| !line.starts_with('#'));
    lines.collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn header_text() -> String {
    std::fs::read_to_string(here().join("include/selvedge.h")).expect("the header is there")
}

/// `const char *text` to its type and its name.
fn split_declaration(declaration: &str) -> (String, String) {
    let declaration = declaration.trim();
    let at = declaration.rfind([' ', '*']).expect("a declaration has a type and a name") + 1;
    (declaration[..at].trim().into(), declaration[at..].into())
}

/// Every function of the header.
fn header_functions() -> BTreeMap<String, Signature> {
    let code = header_code();
    let statements =
        code.split(';').filter(|statement| statement.contains('(') && !statement.contains("typedef"));
    let signature = |statement: &str| {
        // The first one stands behind the opening of `extern "C"`.
        let statement = statement.rsplit('{').next().unwrap_or(statement);
        let (head, parameters) = statement.split_once('(').expect("filtered above");
        let (result, name) = split_declaration(head);
        let parameters = parameters
            .trim()
            .strip_suffix(')')
            .expect("parameters end")
            .split(',')
            .filter(|parameter| parameter.trim() != "void");
        (name, (result, parameters.map(|parameter| split_declaration(parameter).0).collect()))
    };
    statements.map(signature).collect()
}

#[test]
fn functions_are_those_of_the_source() {
    let (source, header) = (source_functions(), header_functions());
    assert!(source.len() > 35, "the sources were read");
    for (name, signature) in &source {
        let declared = header.get(name).unwrap_or_else(|| panic!("{name} is in the header"));
        assert_eq!(signature, declared, "{name} has the types of the source");
    }
    for name in header.keys() {
        assert!(source.contains_key(name), "{name} of the header is in the source");
    }
}

/// Every number that the header defines.
fn header_constants() -> BTreeSet<String> {
    let text = header_text();
    let defined = text.lines().filter_map(|line| line.strip_prefix("#define "));
    defined.filter_map(|rest| rest.split_once(' ')).map(|(name, _)| name.into()).collect()
}

/// Every constant of the source, with its value.
fn source_constants() -> BTreeMap<String, i64> {
    let constants = items()
        .into_iter()
        .filter_map(|item| if let syn::Item::Const(constant) = item { Some(constant) } else { None });
    let public = constants.filter(|constant| matches!(constant.vis, syn::Visibility::Public(_)));
    let value = |constant: syn::ItemConst| {
        let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Int(number), .. }) = &*constant.expr else {
            panic!("{} is a plain number", constant.ident)
        };
        (constant.ident.to_string(), number.base10_parse().expect("constants are small"))
    };
    public.map(value).collect()
}

/// Lines `TYPE FIELD OFFSET SIZE` and `TYPE SIZE` of structures, as Rust lays them out.
macro_rules! layouts {
    ($($name:ident { $($field:ident)* })*) => {{
        let mut lines = BTreeSet::new();
        $(
            lines.insert(format!("{} {}", stringify!($name), size_of::<$name>()));
            $({
                let size = field_size(|value: &$name| &raw const value.$field);
                lines.insert(format!("{} {} {} {size}", stringify!($name), stringify!($field), offset_of!($name, $field)));
            })*
        )*
        let fields = [$((stringify!($name), vec![$(stringify!($field)),*])),*];
        (lines, BTreeMap::from(fields))
    }};
}

/// The size of what a closure points to.
fn field_size<T, F>(_field: impl Fn(&T) -> *const F) -> usize {
    size_of::<F>()
}

/// All structures but the material, whose one field is not public.
fn rust_layouts() -> (BTreeSet<String>, BTreeMap<&'static str, Vec<&'static str>>) {
    layouts! {
        selvedge_limits { bytes operations texels }
        selvedge_finding { rule part offset found }
        selvedge_header {
            minor_version file_length content method section_count operations width height light_count view_count level_count edge layer_count
            states transfer cosine_included transfer_parameter matrix_q13
        }
        selvedge_text { text length }
        selvedge_metadata { texel_width_nm texel_height_nm frame image_origin primaries name origin licence }
        selvedge_direction { x_q18 y_q18 z_q15 }
        selvedge_taps { a b c weight_a_q15 weight_b_q15 weight_c_q15 cosine_q15 }
        selvedge_located { direction clamped_x_q18 clamped_y_q18 taps }
        selvedge_values { c0 c1 c2 }
        selvedge_rgb { r g b }
        selvedge_query { u_q32 v_q32 light view }
    }
}

/// The structures of the header and their fields, in order.
fn header_structures() -> BTreeMap<String, Vec<String>> {
    let code = header_code();
    let bodies =
        code.split("typedef struct ").skip(1).map(|rest| rest.split_once('}').expect("structures end").0);
    let structure = |body: &str| {
        let (name, fields) = body.split_once('{').expect("structures begin");
        let fields = fields.split(';').filter(|field| !field.trim().is_empty());
        let fields = fields.map(|field| split_declaration(field.split('[').next().unwrap_or(field)).1);
        (name.trim().into(), fields.collect())
    };
    bodies.map(structure).collect()
}

#[test]
fn names_of_constants_and_fields_are_those_of_the_source() {
    assert_eq!(header_constants(), source_constants().into_keys().collect(), "both define the same numbers");
    let mut header = header_structures();
    assert_eq!(header.remove("selvedge_material"), Some(vec!["opaque".into()]), "a material is closed");
    let rust = rust_layouts()
        .1
        .into_iter()
        .map(|(name, fields)| (name.to_string(), fields.into_iter().map(String::from).collect()));
    assert_eq!(header, rust.collect(), "both have the same structures");
}

#[test]
fn a_c_compiler_agrees() {
    if !has_program(&common::c_compiler(), "layouts, constants and types by a C compiler") {
        return;
    }
    let (mut expected, structures) = rust_layouts();
    let mut program = String::from("#include \"selvedge.h\"\n#include <stdio.h>\n\nint main(void)\n{\n");
    let put =
        |program: &mut String, line: String| writeln!(program, "    {line}").expect("a string takes all");
    // The C compiler holds the header's declarations to the types of the source, and the linker the names to
    // the library.
    for (name, (result, parameters)) in source_functions() {
        let parameters = if parameters.is_empty() { "void".into() } else { parameters.join(", ") };
        put(&mut program, format!("{result} (*at_{name})({parameters}) = {name};"));
    }
    for name in source_functions().keys() {
        put(&mut program, format!("if (at_{name} == NULL) return 1;"));
    }
    for (name, fields) in structures {
        put(&mut program, format!("printf(\"{name} %ld\\n\", (long)sizeof({name}));"));
        for field in fields {
            let numbers = format!("(long)offsetof({name}, {field}), (long)sizeof((({name} *)0)->{field})");
            put(&mut program, format!("printf(\"{name} {field} %ld %ld\\n\", {numbers});"));
        }
    }
    expected.insert(format!("selvedge_material {}", size_of::<selvedge_material>()));
    put(&mut program, "printf(\"selvedge_material %ld\\n\", (long)sizeof(selvedge_material));".into());
    expected.insert(format!("alignment {}", align_of::<selvedge_material>()));
    put(&mut program, "{ struct with { char c; selvedge_material m; }; printf(\"alignment %ld\\n\", (long)offsetof(struct with, m)); }".into());
    for (name, value) in source_constants() {
        expected.insert(format!("{name} {value}"));
        put(&mut program, format!("printf(\"{name} %ld\\n\", (long){name});"));
    }
    program += "    return 0;\n}\n";

    let folder = work_folder("header");
    let (source, built) = (folder.join("layout.c"), folder.join("layout"));
    std::fs::write(&source, program).expect("the work folder can be written");
    compile_well(&source, &built, &[]);
    let output = Command::new(built).output().expect("the program runs");
    assert!(output.status.success(), "every function is there");
    let told: BTreeSet<String> = text(&output.stdout).lines().map(String::from).collect();
    assert_eq!(told, expected, "C and Rust agree");
    assert_eq!(selvedge_material_size(), size_of::<selvedge_material>());
    assert_eq!(selvedge_material_alignment(), align_of::<selvedge_material>());
}

#[test]
fn a_cpp_compiler_takes_the_header() {
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    if !has_program(&compiler, "the header in C++") {
        return;
    }
    let source = work_folder("cpp").join("header.cpp");
    std::fs::write(
        &source,
        "#include \"selvedge.h\"\nint main() { selvedge_material m = {{0}}; return m.opaque[0] != 0; }\n",
    )
    .expect("the folder can be written");
    let mut command = Command::new(compiler);
    command
        .args(["-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "-I"])
        .arg(here().join("include"));
    let output = command.arg(source).output().expect("the compiler runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
}
