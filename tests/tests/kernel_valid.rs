//! The assembled kernel is valid core WGSL, and its normative part has no float and no division.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use selvedge_shaders::{METHODS, Method, Request, assemble};

const ALL: &[Method] = &METHODS;

fn parse(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)))
}

#[test]
fn every_assembly_is_valid_without_extra_capabilities() {
    for (entries, methods) in [false, true]
        .into_iter()
        .flat_map(|entries| [&[], &ALL[..1], &ALL[1..], ALL].map(|methods| (entries, methods)))
    {
        let module = parse(&assemble(&Request { methods, entries }));
        Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).expect("valid");
        assert_eq!(module.entry_points.len(), if entries { 5 } else { 0 });
        // What is not asked for is not there.
        let has =
            |name: &str| module.functions.iter().any(|(_, function)| function.name.as_deref() == Some(name));
        assert_eq!(
            (has("record_q20"), has("layer_q20")),
            (methods.contains(&Method::SparseEnsemble), methods.contains(&Method::SparseTensor))
        );
    }
}

/// What stands against the rules of chapter 2 in one function.
fn offences(function: &naga::Function) -> Vec<String> {
    let name = function.name.clone().unwrap_or_default();
    let bad = function.expressions.iter().filter_map(|(_, expression)| match expression {
        naga::Expression::Binary {
            op: naga::BinaryOperator::Divide | naga::BinaryOperator::Modulo, ..
        } => Some("divides"),
        naga::Expression::Literal(
            naga::Literal::F32(_)
            | naga::Literal::F64(_)
            | naga::Literal::F16(_)
            | naga::Literal::AbstractFloat(_),
        ) => Some("has a float"),
        naga::Expression::As { kind: naga::ScalarKind::Float, .. } => Some("converts to float"),
        _ => None,
    });
    bad.map(|what| format!("{name} {what}")).collect()
}

fn integer_only(module: &naga::Module) -> Vec<String> {
    let mut found: Vec<String> =
        module.functions.iter().flat_map(|(_, function)| offences(function)).collect();
    found.extend(module.entry_points.iter().flat_map(|entry| offences(&entry.function)));
    for (_, ty) in module.types.iter() {
        let scalar = match ty.inner {
            naga::TypeInner::Scalar(scalar)
            | naga::TypeInner::Vector { scalar, .. }
            | naga::TypeInner::Matrix { scalar, .. } => scalar,
            _ => continue,
        };
        if scalar.kind == naga::ScalarKind::Float {
            found.push(format!("type {ty:?}"));
        }
    }
    found
}

#[test]
fn the_kernel_has_no_float_and_no_division() {
    let module = parse(&assemble(&Request { methods: ALL, entries: true }));
    assert_eq!(integer_only(&module), Vec::<String>::new());
}

/// The check above can fail: planted offences are found.
#[test]
fn planted_offences_are_found() {
    let source = assemble(&Request { methods: ALL, entries: true });
    for planted in [
        "fn bad(a: i32) -> i32 { return a / 3; }",
        "fn bad(a: u32) -> u32 { return a % 3u; }",
        "fn bad(a: u32) -> f32 { return bitcast<f32>(a); }",
    ] {
        let module = parse(&format!("{source}\n{planted}"));
        assert!(!integer_only(&module).is_empty(), "{planted}");
    }
}
