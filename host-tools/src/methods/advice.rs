//! Advice on legal files: what methods share of it.

use selvedge::Selvedge;
use selvedge::container::directory::EXTERNAL;

/// Something that a file had better not have.
#[derive(Debug, PartialEq, Eq)]
pub struct Advice {
    /// Number, W1 and on; stable.
    pub id: &'static str,
    /// Name.
    pub name: &'static str,
    /// What a good file has.
    pub expected: &'static str,
    /// What to do about it.
    pub hint: &'static str,
}

/// Takes an advice, the byte offset that it is about, and what was found there.
pub type Advise<'a> = dyn FnMut(&'static Advice, u32, u32) + 'a;

/// Of every method with atoms: some are in no list.
pub static UNUSED_ATOMS: Advice = Advice {
    id: "W1",
    name: "UnusedAtoms",
    expected: "every atom is in a record or list",
    hint: "selvedge trim removes them; found is their number",
};

/// Whether dictionaries are in the material's own file.
pub fn has_own_dictionary(opened: &Selvedge<'_>) -> bool {
    !opened.sections().any(|section| section.kind == EXTERNAL)
}

/// Reports offsets as one advice: the first, and how many there are; none if there are none.
pub fn report_count(
    advice: &'static Advice,
    offsets: &mut dyn Iterator<Item = u32>,
    advise: &mut Advise<'_>,
) {
    if let Some(first) = offsets.next() {
        advise(advice, first, 1 + offsets.count() as u32);
    }
}
