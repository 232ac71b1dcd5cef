//! What the lines and files of a dataset are found by, and what locates its directions.

use crate::data::dataset::Dataset;
use crate::data::transfer::{Domain, transfer_of};
use crate::error::Result;
use crate::measure::baseline::decoder::Locator;
use crate::methods::sparse_ensemble::encode::{self, prepare};
use crate::report::line::{Line, REVISION, Request};
use crate::report::store::Store;
use std::cell::RefCell;
use std::collections::BTreeSet;

/// Something that locates directions: a small file of the same sets.
///
/// # Errors
/// If the data cannot be read.
pub(super) fn finder(data: &Dataset) -> Result<Vec<u8>> {
    let prepared = prepare(vec![data], transfer_of(data, Domain::Log), &|_, _| ())?;
    let options = encode::Options {
        edge: 8,
        criterion: encode::Criterion::Coefficients([1; 3]),
        ..encode::Options::default()
    };
    Ok(encode::encode(&prepared, &prepared.own_ensembles(8), &options, &|_, _| ())?.bytes)
}

pub(super) fn locator<'a>(file: &'a selvedge::Selvedge<'a>, data: &Dataset) -> Locator<'a> {
    let description = data.description();
    Locator {
        file,
        size: description.size,
        lights: description.lights.clone(),
        views: description.views.clone(),
    }
}

/// Methods and budgets that were asked for, by their keys: what a page shows.
pub type Asked = BTreeSet<String>;

/// The first 16 hexadecimal digits of the SHA-256 of a text, for names of files.
fn short_hash(text: &str) -> String {
    selvedge::sha256(text.as_bytes())[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A name that can be a file's.
pub(super) fn slug(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// End of the name of the picture of a dataset, after the prefix of all of its names of files.
pub(in crate::report) const REFERENCE: &str = "-data";

/// A dataset in the stores: what its lines and files are found by.
pub(super) struct Keys<'a> {
    pub(super) request: &'a Request,
    /// Name of the dataset.
    pub(super) name: String,
    /// Its name, extent and statistics.
    pub(super) identity: String,
    /// Name of the adapter of the kernel.
    pub(super) adapter: &'a str,
    /// Cores of the rates of all cores.
    pub(super) cores: usize,
    /// Keys of all that was asked for.
    pub(super) asked: RefCell<Asked>,
}

impl<'a> Keys<'a> {
    pub(super) fn new(request: &'a Request, data: &Dataset, adapter: &'a str) -> Keys<'a> {
        let (description, statistics) = (data.description(), data.statistics());
        let name = data.path().file_stem().map_or("data".into(), |name| name.to_string_lossy().into_owned());
        let [width, height] = description.size;
        let mean = statistics.mean.map(f64::to_bits);
        let largest = statistics.largest.to_bits();
        let identity = format!(
            "{name} {width}x{height}x{}x{} {mean:x?} {largest:x}",
            description.lights.len(),
            description.views.len()
        );
        let cores = rayon::current_num_threads();
        Keys { request, name, identity, adapter, cores, asked: RefCell::default() }
    }

    /// The key of a line.
    pub(super) fn key(&self, method: &str, budget: u64) -> String {
        let Keys { request, identity, adapter, cores, .. } = self;
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "{identity} | {method} | {budget} | {} | {:?} | {cores} | {adapter} | {version} {REVISION}",
            request.rank, request.every
        )
    }

    /// Whether a line is asked for, which is kept, and not among the known ones.
    pub(super) fn is_wanted(&self, known: &BTreeSet<String>, method: &str, budget: u64) -> bool {
        let methods = &self.request.methods;
        if !methods.is_empty() && !methods.iter().any(|part| method.contains(part.as_str())) {
            return false;
        }
        let key = self.key(method, budget);
        let is_new = !known.contains(&key);
        self.asked.borrow_mut().insert(key);
        is_new
    }

    /// Start of the names of files and pictures: readable, and of this dataset alone. A folder that has the
    /// dataset keeps what it began with, so that its lines stay together.
    pub(super) fn prefix(&self, lines: &Store<Line>) -> String {
        let start = format!("{} | ", self.identity);
        let known = lines.lines.iter().find(|line| line.key.starts_with(&start));
        let prefix = known.and_then(|line| prefix_of(&line.reference)).map(str::to_owned);
        prefix.unwrap_or_else(|| format!("{}-{}", slug(&self.name), short_hash(&self.identity)))
    }
}

/// The prefix of a dataset's names of files, from that of its picture.
pub(in crate::report) fn prefix_of(reference: &str) -> Option<&str> {
    reference.strip_suffix(".png")?.strip_suffix(REFERENCE)
}

/// Keys of the lines of a store.
pub(super) fn known<T: crate::report::store::Keyed>(store: &Store<T>) -> BTreeSet<String> {
    store.lines.iter().map(|line| line.key().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_do_not_depend_on_the_compiler() {
        // SHA-256 of "abc", FIPS 180-4.
        assert_eq!(short_hash("abc"), "ba7816bf8f01cfea");
        assert_eq!(
            prefix_of(&format!("cloth-{}{REFERENCE}.png", short_hash("abc"))),
            Some("cloth-ba7816bf8f01cfea")
        );
        assert_eq!(prefix_of("cloth.png"), None);
    }
}
