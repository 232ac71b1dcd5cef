//! What to do about a broken rule.

use crate::methods::METHODS;
use selvedge::Rule;

/// What to do about a finding; empty where the rule itself says it.
pub fn hint(rule: Rule) -> &'static str {
    let of_methods = METHODS.iter().flat_map(|method| method.hints);
    of_methods.into_iter().find(|(of, _)| *of == rule).map_or_else(|| shared_hint(rule), |(_, hint)| hint)
}

/// Hints on the rules of the chapters that methods share.
fn shared_hint(rule: Rule) -> &'static str {
    match rule {
        Rule::HeaderTooShort => "the file is empty or was cut; copy it again",
        Rule::Magic => "this is no Selvedge file, or line ends were translated on the way; copy it as binary",
        Rule::MajorVersion => "a newer decoder is needed",
        Rule::FileLength => "the file was cut or has something behind it; copy it again",
        Rule::SectionCount
        | Rule::SectionOffset
        | Rule::SectionLength
        | Rule::SectionOrder
        | Rule::FileEnd => "the directory was not made by the rules of 3.2",
        Rule::HeaderChecksum | Rule::SectionChecksum => {
            "bytes were changed after the file was made; copy it again"
        }
        Rule::Content => "give a material (content 0); a dictionary goes behind --dictionary",
        Rule::Method | Rule::SectionKind => {
            "this build does not know it; a newer decoder, or one with more features, may"
        }
        Rule::LimitBytes => "raise --max-bytes if the file can be trusted",
        Rule::LimitOperations => {
            "raise --max-operations, or make a cheaper file: selvedge encode --operations"
        }
        Rule::LimitTexels => "raise --max-texels if the file can be trusted",
        Rule::SectionPadding | Rule::HeaderReserved => {
            "canonical files have zeros there; write the file again"
        }
        Rule::SectionMissing => {
            "a part of the material is lost; what was found is its kind and, in the upper half, its instance"
        }
        Rule::SectionForeign => {
            "the header does not call for it; optional sections have kinds from 0x8000 on"
        }
        Rule::MetadataText => "strings are plain UTF-8 without line ends",
        Rule::ExternalMissing => "give the dictionary with --dictionary",
        Rule::ExternalUnwanted => "this file embeds its dictionary; leave --dictionary out",
        Rule::ExternalDigest => "this is another dictionary than that which the material was made with",
        Rule::ExternalFit => "the dictionary was made for other directions, channels or blocks",
        Rule::DirectionPoint => "directions are different points of the unit disc (5.1)",
        Rule::DirectionCosine | Rule::TriangleReciprocal => {
            "derived numbers are computed by the rules, by integers"
        }
        Rule::TriangleOrder | Rule::TriangleShape | Rule::HullConvex | Rule::HullEdge | Rule::Cover => {
            "triangulate the directions again (5.8)"
        }
        Rule::GridStarts | Rule::GridCandidate | Rule::GridComplete => {
            "rebuild the grid from the triangles (5.5)"
        }
        Rule::GridCell => "a finer grid lists fewer triangles in a cell",
        Rule::StatedOperations => "compute the cost by 4.2-1 from the largest records",
        _ => "",
    }
}
