//! The assembled kernel is valid core WGSL, and its normative part has no float and no division.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use selvedge_shaders::{ENTRIES, METHODS, Method, Request, assemble};

fn parse(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)))
}

/// Every subset of the methods.
fn subsets() -> Vec<Vec<&'static Method>> {
    let all = 0..1usize << METHODS.len();
    all.map(|set| METHODS.iter().enumerate().filter(|(n, _)| set >> n & 1 == 1).map(|(_, m)| m).collect())
        .collect()
}

fn has(module: &naga::Module, name: &str) -> bool {
    module.functions.iter().any(|(_, function)| function.name.as_deref() == Some(name))
}

#[test]
fn every_assembly_is_valid_without_extra_capabilities() {
    for methods in subsets() {
        let entry_sets = std::iter::once(Vec::new())
            .chain(ENTRIES.iter().map(|entry| vec![entry]))
            .chain([ENTRIES.iter().collect()]);
        for entries in entry_sets {
            let request = Request { methods: methods.clone(), entries, levels: false };
            let module = parse(&assemble(&request));
            Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).expect("valid");
            assert_eq!(module.entry_points.len(), request.entries.len());
            // What is not asked for is not there.
            for method in METHODS {
                let textures = format!("{}_textures_q20", method.module.name);
                assert_eq!(has(&module, &textures), methods.contains(&method), "{textures}");
            }
            let needed = request.entries.iter().any(|entry| entry.levels);
            assert_eq!(has(&module, "trilinear_values"), needed);
        }
    }
}

#[test]
fn the_kernel_has_the_core_s_methods() {
    let core: Vec<u32> = selvedge::method::numbers().collect();
    // The core is built here with all of its methods, as the tools have it.
    let kernel: Vec<u32> = METHODS.iter().map(|method| method.number).collect();
    assert_eq!(core, kernel);
    for method in METHODS {
        assert_eq!(method.name.replace('-', "_"), method.module.name, "one name everywhere");
    }
}

#[test]
fn requests_are_of_known_names() {
    assert!(Request::new(&["sparse-tensor"], &["filtered"]).is_ok());
    assert_eq!(
        Request::new(&["tensor"], &[]).map(|_| ()).unwrap_err().to_string(),
        "the kernel has no method `tensor`"
    );
    assert!(Request::new(&[], &["nosuch"]).is_err());
    let material = |method, level_count| selvedge::Material { method, level_count, ..Default::default() };
    let request = Request::for_materials(&[material(2, 1), material(2, 1)], &[]).expect("known");
    assert_eq!((request.methods.len(), request.levels), (1, false));
    assert!(Request::for_materials(&[material(2, 3)], &[]).expect("known").levels);
    assert!(Request::for_materials(&[material(99, 1)], &[]).is_err());
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
    let module = parse(&assemble(&Request::all()));
    assert_eq!(integer_only(&module), Vec::<String>::new());
}

/// The check above can fail: planted offences are found.
#[test]
fn planted_offences_are_found() {
    let source = assemble(&Request::all());
    for planted in [
        "fn bad(a: i32) -> i32 { return a / 3; }",
        "fn bad(a: u32) -> u32 { return a % 3u; }",
        "fn bad(a: u32) -> f32 { return bitcast<f32>(a); }",
    ] {
        let module = parse(&format!("{source}\n{planted}"));
        assert!(!integer_only(&module).is_empty(), "{planted}");
    }
}
