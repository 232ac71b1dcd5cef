//! Each kernel module of the core and its WGSL twin say the same: functions in one order with the same
//! parameters and types, structs with the same fields, constants with the same values, and the same
//! sequence of rules in the comments of the code.

use selvedge_shaders::{METHODS, Request, assemble};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Twins by folder: names of WGSL modules and the Rust files that say the same.
fn twins() -> BTreeMap<String, PathBuf> {
    let mut found = BTreeMap::new();
    let core = root().join("decoder-core/src");
    for entry in std::fs::read_dir(core.join("kernel")).expect("a folder").flatten() {
        let name = entry.path().file_stem().expect("a name").to_string_lossy().into_owned();
        if name != "mod" {
            found.insert(name, entry.path());
        }
    }
    for entry in std::fs::read_dir(core.join("method")).expect("a folder").flatten() {
        if entry.path().is_dir() {
            found.insert(entry.file_name().to_string_lossy().into_owned(), entry.path().join("mod.rs"));
        }
    }
    found
}

/// The twin that is written by `dispatch` instead of read from a file.
const DISPATCH: &str = "method";

/// The text of a WGSL module.
fn wgsl_text(module: &str) -> String {
    if module == DISPATCH {
        return selvedge_shaders::dispatch(&METHODS.iter().collect::<Vec<_>>());
    }
    std::fs::read_to_string(root().join(format!("shaders/wgsl/{module}.wgsl"))).expect("source")
}

/// What stands on one side only, and why.
const ONE_SIDED: &[(&str, &str)] = &[
    ("words::Words", "the kernel reads a bound buffer where the core is handed its words"),
    ("words::DICTIONARY_START", "on a GPU both files stand in one buffer; material_at places them"),
    ("material::MATERIAL_WORDS", "a size that only a host needs"),
];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Names with their types, in order.
type Named = Vec<(String, String)>;

/// One side of a module in a common form.
#[derive(Debug, Default, PartialEq)]
struct Side {
    /// Name, parameters and result, in order of the source.
    functions: Vec<(String, Named, String)>,
    structs: BTreeMap<String, Named>,
    constants: BTreeMap<String, i64>,
    rules: Vec<String>,
}

fn is_one_sided(module: &str, name: &str) -> bool {
    ONE_SIDED.iter().any(|(listed, _)| *listed == format!("{module}::{name}"))
}

/// Rule numbers with which comments inside code begin, in order.
fn rules_of(source: &str) -> Vec<String> {
    let comments = source.lines().filter_map(|line| line.trim_start().strip_prefix("// "));
    comments
        .filter_map(|comment| {
            let numbers = comment.split(':').next()?;
            let is_rule = |n: &str| {
                n.contains('.')
                    && n.contains('-')
                    && n.chars().all(|c| c.is_ascii_digit() || c == '.' || c == '-')
            };
            numbers.split(", ").all(is_rule).then(|| numbers.to_owned())
        })
        .collect()
}

fn rust_type(ty: &syn::Type) -> String {
    match ty {
        syn::Type::Reference(reference) => rust_type(&reference.elem),
        syn::Type::Array(array) => {
            let len = &array.len;
            format!("array<{},{}>", rust_type(&array.elem), quote::quote!(#len))
        }
        syn::Type::Path(path) => path.path.segments.last().expect("a type has a name").ident.to_string(),
        other => panic!("a type that WGSL cannot say: {}", quote::quote!(#other)),
    }
}

fn literal(expression: &syn::Expr) -> i64 {
    match expression {
        syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Int(value), .. }) => {
            value.base10_parse().expect("an integer")
        }
        syn::Expr::Unary(syn::ExprUnary { op: syn::UnOp::Neg(_), expr, .. }) => -literal(expr),
        other => panic!("a constant of a twin is a literal, not {}", quote::quote!(#other)),
    }
}

fn rust_side(module: &str, path: &Path) -> Side {
    let text = std::fs::read_to_string(path).expect("source");
    // The dispatch stands in a macro that makes the list of methods too; its function is read alone.
    let text = if module == DISPATCH { dispatch_function(&text) } else { text };
    let text = text.split("#[cfg(test)]\nmod tests").next().expect("split gives one").to_owned();
    let mut side = Side { rules: rules_of(&text), ..Side::default() };
    for item in syn::parse_file(&text).expect("Rust").items {
        match item {
            syn::Item::Fn(function) => {
                let parameters = function.sig.inputs.iter().filter_map(|input| {
                    let syn::FnArg::Typed(typed) = input else { panic!("a twin is no method") };
                    let pattern = &typed.pat;
                    let name = quote::quote!(#pattern).to_string();
                    // The kernel is handed the number of a material in the bound table.
                    let ty = rust_type(&typed.ty);
                    let ty = if ty == "Material" { "u32".to_owned() } else { ty };
                    (name.trim_start_matches('_') != "words" || ty != "Words").then_some((name, ty))
                });
                let parameters = parameters.collect();
                let syn::ReturnType::Type(_, result) = &function.sig.output else {
                    panic!("a twin has a result")
                };
                side.functions.push((function.sig.ident.to_string(), parameters, rust_type(result)));
            }
            syn::Item::Struct(item) if !is_one_sided(module, &item.ident.to_string()) => {
                let fields = item
                    .fields
                    .iter()
                    .map(|field| (field.ident.as_ref().expect("named").to_string(), rust_type(&field.ty)));
                side.structs.insert(item.ident.to_string(), fields.collect());
            }
            syn::Item::Const(item) if item.ident != "_" && !is_one_sided(module, &item.ident.to_string()) => {
                side.constants.insert(item.ident.to_string(), literal(&item.expr));
            }
            _ => {}
        }
    }
    side
}

/// The function of the dispatch, without the arms that name methods.
fn dispatch_function(text: &str) -> String {
    let from = text.find("pub fn textures_q20").expect("the dispatch");
    let to = text.find("            match material.method").expect("its arms");
    format!("/// Q20 (8.3-3).\n{} unimplemented!() }}", &text[from..to])
}

fn wgsl_type(module: &naga::Module, handle: naga::Handle<naga::Type>) -> String {
    let ty = &module.types[handle];
    match &ty.inner {
        naga::TypeInner::Scalar(scalar) => match scalar.kind {
            naga::ScalarKind::Sint => "i32".into(),
            naga::ScalarKind::Uint => "u32".into(),
            naga::ScalarKind::Bool => "bool".into(),
            other => panic!("{other:?}"),
        },
        naga::TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. } => {
            format!("array<{},{n}>", wgsl_type(module, *base))
        }
        _ => ty.name.clone().expect("named"),
    }
}

/// Names that a keyword begins a line with, in order.
fn names(text: &str, keyword: &str) -> Vec<String> {
    let declared = text.lines().filter_map(|line| line.strip_prefix(keyword));
    declared.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()).collect()
}

fn wgsl_side(whole: &naga::Module, module: &str) -> Side {
    let text = wgsl_text(module);
    let mut side = Side { rules: rules_of(&text), ..Side::default() };
    for name in names(&text, "fn ") {
        let (_, function) =
            whole.functions.iter().find(|(_, f)| f.name.as_deref() == Some(&name)).expect("declared");
        let parameters = function
            .arguments
            .iter()
            .map(|a| (a.name.clone().expect("named"), wgsl_type(whole, a.ty)))
            .collect();
        let result = wgsl_type(whole, function.result.as_ref().expect("a result").ty);
        side.functions.push((name, parameters, result));
    }
    for name in names(&text, "struct ") {
        let (_, ty) = whole.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(&name)).expect("declared");
        let naga::TypeInner::Struct { members, .. } = &ty.inner else { panic!("{name} is a struct") };
        side.structs.insert(
            name,
            members.iter().map(|m| (m.name.clone().expect("named"), wgsl_type(whole, m.ty))).collect(),
        );
    }
    for name in names(&text, "const ") {
        let (_, constant) =
            whole.constants.iter().find(|(_, c)| c.name.as_deref() == Some(&name)).expect("declared");
        let value = match whole.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::I32(value)) => value as i64,
            naga::Expression::Literal(naga::Literal::U32(value)) => value as i64,
            ref other => panic!("{name} is {other:?}"),
        };
        side.constants.insert(name, value);
    }
    side
}

#[test]
fn twins_say_the_same() {
    let whole = naga::front::wgsl::parse_str(&assemble(&Request::all())).expect("WGSL");
    let mut functions = 0;
    for (module, path) in &twins() {
        let (rust, wgsl) = (rust_side(module, path), wgsl_side(&whole, module));
        assert_eq!(rust.functions, wgsl.functions, "functions of {module}");
        assert_eq!(rust.structs, wgsl.structs, "structs of {module}");
        assert_eq!(rust.constants, wgsl.constants, "constants of {module}");
        assert_eq!(rust.rules, wgsl.rules, "rules in the comments of {module}");
        functions += rust.functions.len();
    }
    // The comparison saw something.
    assert!(functions > 90, "{functions}");
}

#[test]
fn every_module_of_the_kernel_has_a_twin_or_is_an_entry() {
    let modules = selvedge_shaders::modules(&Request::all());
    let kernel: BTreeSet<&str> =
        modules.iter().map(|module| module.name).filter(|name| !name.starts_with("entries/")).collect();
    let twins = twins();
    let core: BTreeSet<&str> = twins.keys().map(String::as_str).filter(|name| *name != DISPATCH).collect();
    assert_eq!(kernel, core);
    // No file of the folder is left out.
    let files = std::fs::read_dir(root().join("shaders/wgsl")).expect("a folder").flatten();
    let files = files.filter(|entry| entry.path().is_file()).count();
    assert_eq!(files, kernel.len());
    let entries = std::fs::read_dir(root().join("shaders/wgsl/entries")).expect("a folder").count();
    assert_eq!(entries, selvedge_shaders::ENTRIES.len() + 1);
}

#[test]
fn what_is_listed_as_one_sided_is() {
    for (path, reason) in ONE_SIDED {
        let (module, name) = path.split_once("::").expect("module::name");
        let rust = std::fs::read_to_string(&twins()[module]).expect("source");
        let wgsl = wgsl_text(module);
        assert!(rust.contains(&format!(" {name}")) && !wgsl.contains(name) && !reason.is_empty(), "{path}");
    }
}
