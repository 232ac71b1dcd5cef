//! What a file of an earlier draft of the format gets: the name of the format that these tools read, and the
//! way out.

use selvedge::{Family, Rule};

/// The format that these tools read and write. A change that refuses or alters files of before renames it.
pub const FORMAT: &str = "format version 1, draft of December 2026";

/// Whether a file that breaks a rule may be of an earlier draft: its bytes are those that were written, by
/// lengths and checksums, and mean something that this draft does not say.
pub fn may_be_of_a_draft(rule: Rule) -> bool {
    let is_damage = matches!(
        rule,
        Rule::HeaderTooShort
            | Rule::Magic
            | Rule::MajorVersion
            | Rule::FileLength
            | Rule::SectionCount
            | Rule::HeaderChecksum
            | Rule::SectionChecksum
            | Rule::Content
    );
    rule.family() == Family::Invalid && !is_damage && !rule.id().starts_with("3.5-")
}

/// The line for people.
pub fn note() -> String {
    format!(
        "these tools read {FORMAT}; a file of an earlier draft is made again from its dataset or the data it was \
         imported from, with `selvedge encode` or `selvedge import`"
    )
}

#[cfg(test)]
mod tests {
    use super::may_be_of_a_draft;
    use selvedge::Rule;

    #[test]
    fn damage_limits_and_dictionaries_are_no_drafts() {
        for rule in [Rule::HeaderChecksum, Rule::LimitBytes, Rule::ExternalMissing, Rule::Method] {
            assert!(!may_be_of_a_draft(rule), "{rule:?}");
        }
        for rule in [Rule::SectionForeign, Rule::TriangleShape] {
            assert!(may_be_of_a_draft(rule), "{rule:?}");
        }
    }
}
