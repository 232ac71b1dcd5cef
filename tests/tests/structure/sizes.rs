//! How long functions, parameter lists and files are.

use crate::{all_files, parse, read, relative};
use proc_macro2::Span;
use syn::spanned::Spanned as _;
use syn::{FnArg, ImplItem, Item, Pat, Signature, TraitItem, Type};

/// Lines of a function, at most.
const LINES: usize = 80;
/// Parameters, at most. The receiver does not count, which in C is the material, and a pointer and its length
/// count once.
const PARAMETERS: usize = 6;
/// Parameters of a kernel function, at most.
const TWIN_PARAMETERS: usize = 5;
/// Lines of a file, at most.
const FILE_LINES: usize = 600;

/// Kernel functions with more: written before there were places and located directions to hand over, and named
/// by specification and shaders. No new one is added.
const LONG_TWINS: &[&str] = &[
    "add_fibre",
    "angular_q15",
    "beyond_hull",
    "block_q20",
    "channel_q20",
    "cross",
    "dot_product",
    "filtered_values",
    "layer_q20",
    "point_values",
    "record_q20",
    "refine",
    "texel_values",
    "texture_q20",
    "trilinear_values",
];

/// Files that are longer, and why.
const LONG_FILES: &[(&str, &str)] = &[];

struct Function {
    name: String,
    lines: usize,
    parameters: usize,
}

fn parameters(signature: &Signature) -> usize {
    let (mut count, mut after_pointer) = (0, false);
    for (n, argument) in signature.inputs.iter().enumerate() {
        let FnArg::Typed(argument) = argument else { continue };
        let name = match &*argument.pat {
            Pat::Ident(name) => name.ident.to_string(),
            _ => String::new(),
        };
        let is_pointer = matches!(&*argument.ty, Type::Ptr(_));
        let is_receiver = n == 0 && is_pointer && name == "material";
        let is_length = after_pointer && ["len", "length", "count"].iter().any(|end| name.ends_with(end));
        count += usize::from(!is_receiver && !is_length);
        after_pointer = is_pointer;
    }
    count
}

fn note(signature: &Signature, end: Span, functions: &mut Vec<Function>) {
    functions.push(Function {
        name: signature.ident.to_string(),
        lines: end.end().line - signature.span().start().line + 1,
        parameters: parameters(signature),
    });
}

fn functions_of(items: &[Item], functions: &mut Vec<Function>) {
    for item in items {
        match item {
            Item::Fn(item) => note(&item.sig, item.block.span(), functions),
            Item::Mod(item) => item.content.iter().for_each(|(_, items)| functions_of(items, functions)),
            Item::Impl(item) => {
                for item in &item.items {
                    if let ImplItem::Fn(item) = item {
                        note(&item.sig, item.block.span(), functions);
                    }
                }
            }
            Item::Trait(item) => {
                for item in &item.items {
                    if let TraitItem::Fn(item) = item {
                        let end = item.default.as_ref().map_or(item.sig.span(), |block| block.span());
                        note(&item.sig, end, functions);
                    }
                }
            }
            _ => {}
        }
    }
}

/// Whether a file holds functions of the kernel, whose dialect has no closures, slices or generics to shorten
/// them with.
fn has_twins(path: &str) -> bool {
    path.starts_with("decoder-core/src/kernel/")
        || path.starts_with("decoder-core/src/method/") && path.ends_with("/mod.rs")
}

#[test]
fn functions_are_short_and_take_few_parameters() {
    let (mut broken, mut count) = (Vec::new(), 0);
    for file in all_files() {
        let path = relative(&file);
        let mut functions = Vec::new();
        functions_of(&parse(&file).items, &mut functions);
        count += functions.len();
        for Function { name, lines, parameters } in functions {
            let twin = has_twins(&path);
            let most = if twin { TWIN_PARAMETERS } else { PARAMETERS };
            let few = parameters <= most || twin && LONG_TWINS.contains(&name.as_str());
            if !few || lines > LINES && !twin {
                broken.push(format!("{path}: {name}: {lines} lines, {parameters} parameters"));
            }
        }
    }
    assert!(broken.is_empty(), "too many lines or parameters:\n{}", broken.join("\n"));
    println!("{count} functions");
    assert!(count > 1500, "{count}");
}

#[test]
fn files_are_short() {
    let mut broken = Vec::new();
    for file in all_files() {
        let (path, lines) = (relative(&file), read(&file).lines().count());
        let excused = LONG_FILES.iter().any(|(long, why)| *long == path && !why.is_empty());
        if lines > FILE_LINES && !excused {
            broken.push(format!("{path}: {lines} lines"));
        }
    }
    assert!(broken.is_empty(), "too long without a reason:\n{}", broken.join("\n"));
}
