//! The sweep: every method at every budget, made, measured and kept.

mod baselines;
mod held_out;
mod methods;
mod swept;

pub(super) use swept::colour_of;

use super::bench::Bench;
use super::store::Store;
use super::{HeldOut, Kind, Line, REVISION, Request};
use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::data::transfer::transfer_of;
use crate::error::Result;
use crate::files;
use crate::measure::baseline::decoder::Locator;
use crate::measure::speed::{self, Adapter};
use crate::measure::verify::open_made;
use crate::methods::sparse_ensemble::encode::{self, prepare};
use crate::progress::Progress;
use baselines::UNCOMPRESSED;
use held_out::HoldOut;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;
use swept::{Made, Memory, Visitor, What, everything};

/// Something that locates directions: a small file of the same sets.
///
/// # Errors
/// If the data cannot be read.
fn finder(data: &Dataset) -> Result<Vec<u8>> {
    let prepared = prepare(vec![data], transfer_of(data, Domain::Log), &|_, _| ())?;
    let options = encode::Options {
        edge: 8,
        criterion: encode::Criterion::Coefficients([1; 3]),
        ..encode::Options::default()
    };
    Ok(encode::encode(&prepared, &prepared.own_ensembles(8), &options, &|_, _| ())?.bytes)
}

fn locator<'a>(file: &'a selvedge::Selvedge<'a>, data: &Dataset) -> Locator<'a> {
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
fn slug(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// Budgets of a dataset in bytes.
fn budgets(data: &Dataset, ratios: &[f64]) -> Vec<u64> {
    ratios.iter().map(|ratio| (data.description().half_bytes() as f64 / ratio) as u64).collect()
}

/// End of the name of the picture of a dataset, after the prefix of all of its names of files.
pub(super) const REFERENCE: &str = "-data";

/// A dataset in the stores: what its lines and files are found by.
struct Keys<'a> {
    request: &'a Request,
    /// Name of the dataset.
    name: String,
    /// Its name, extent and statistics.
    identity: String,
    /// Name of the adapter of the kernel.
    adapter: &'a str,
    /// Cores of the rates of all cores.
    cores: usize,
    /// Keys of all that was asked for.
    asked: RefCell<Asked>,
}

impl<'a> Keys<'a> {
    fn new(request: &'a Request, data: &Dataset, adapter: &'a str) -> Keys<'a> {
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
    fn key(&self, method: &str, budget: u64) -> String {
        let Keys { request, identity, adapter, cores, .. } = self;
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "{identity} | {method} | {budget} | {} | {:?} | {cores} | {adapter} | {version} {REVISION}",
            request.rank, request.every
        )
    }

    /// Whether a line is asked for, which is kept, and not among the known ones.
    fn is_wanted(&self, known: &BTreeSet<String>, method: &str, budget: u64) -> bool {
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
    fn prefix(&self, lines: &Store<Line>) -> String {
        let start = format!("{} | ", self.identity);
        let known = lines.lines.iter().find(|line| line.key.starts_with(&start));
        let prefix = known.and_then(|line| prefix_of(&line.reference)).map(str::to_owned);
        prefix.unwrap_or_else(|| format!("{}-{}", slug(&self.name), short_hash(&self.identity)))
    }
}

/// The prefix of a dataset's names of files, from that of its picture.
pub(super) fn prefix_of(reference: &str) -> Option<&str> {
    reference.strip_suffix(".png")?.strip_suffix(REFERENCE)
}

/// Keys of the lines of a store.
fn known<T: super::store::Keyed>(store: &Store<T>) -> BTreeSet<String> {
    store.lines.iter().map(|line| line.key().to_owned()).collect()
}

/// Measures what a sweep makes of a dataset, and keeps it.
struct Recorder<'a> {
    keys: &'a Keys<'a>,
    bench: &'a Bench<'a>,
    /// Start of the names of files and pictures.
    prefix: &'a str,
    /// The picture of the data.
    reference: &'a str,
    /// The budget that has pictures.
    pictured: u64,
}

impl Recorder<'_> {
    /// # Errors
    /// If data cannot be read or results not be written.
    fn record(&self, made: Made, peak_memory: Option<u64>, lines: &mut Store<Line>) -> Result<()> {
        let Recorder { keys, bench, .. } = *self;
        let own = format!("{}-{}-{}", self.prefix, slug(&made.method), made.budget);
        let mut open_seconds = None;
        if let What::File(bytes) = &made.what {
            open_seconds = Some(speed::open_seconds(bytes, None));
            files::write(&keys.request.out.join("files").join(format!("{own}.selv")), bytes)?;
        }
        made.what.with(|subject, bytes| {
            let [ssim, flip] = bench.similarity(&subject)?;
            let shown = made.budget == self.pictured || made.method == UNCOMPRESSED;
            let picture = shown.then(|| bench.picture(Some(&subject), &own)).transpose()?;
            lines.add(Line {
                key: keys.key(&made.method, made.budget),
                dataset: keys.name.clone(),
                reference: self.reference.to_owned(),
                adapter: keys.adapter.to_owned(),
                cores: keys.cores,
                kind: if open_seconds.is_some() { Kind::File } else { Kind::Baseline },
                bytes,
                every: bench.every,
                metrics: bench.metrics(&subject)?,
                ssim,
                flip,
                operations: subject.operations(bench.locator),
                speed: subject.speed(bench.locator, bench.adapter),
                encode_seconds: made.seconds,
                open_seconds,
                peak_memory,
                found: made.found.clone(),
                picture,
                method: made.method.clone(),
                setting: made.setting.clone(),
            })
        })
    }
}

/// Measures a dataset; what the stores have already is left as it is. Gives the keys of all that was asked
/// for.
///
/// # Errors
/// If data cannot be read or results not be written.
pub fn measure(
    request: &Request,
    path: &Path,
    adapter: &Adapter,
    lines: &mut Store<Line>,
    held: &mut Store<HeldOut>,
    log: &dyn Fn(&str),
) -> Result<Asked> {
    let data = Dataset::open(path)?;
    let keys = Keys::new(request, &data, &adapter.name);
    let budgets = budgets(&data, &request.ratios);
    let pictured = budgets[budgets.len() / 2];
    let prefix = keys.prefix(lines);
    let finder_bytes = finder(&data)?;
    let finder_file = open_made(&finder_bytes, None)?;
    let finds = locator(&finder_file, &data);
    let bench = Bench::new(&data, &finds, adapter, request.every, &request.out)?;
    let reference = bench.picture(None, &format!("{prefix}{REFERENCE}"))?;
    let recorder = Recorder { keys: &keys, bench: &bench, prefix: &prefix, reference: &reference, pictured };
    let memory = Memory::default();
    let known_lines = known(lines);
    let mut visit = |made: Made| recorder.record(made, memory.peak(), lines);
    let log = |text: &str| log(&format!("{}: {text}", keys.name));
    let mut visitor = Visitor {
        wanted: &|method, budget| keys.is_wanted(&known_lines, method, budget),
        visit: &mut visit,
        log: &log,
        memory: &memory,
    };
    everything(&data, request.rank, &budgets, &mut visitor)?;
    if request.held_out {
        HoldOut { keys: &keys, data: &data, budget: pictured, every: bench.every }.run(held, &log)?;
    }
    Ok(keys.asked.into_inner())
}

/// A log on the terminal, a line each with the seconds since the start.
pub fn teller(quiet: bool) -> impl Fn(&str) {
    let progress = Progress::new();
    let start = Instant::now();
    move |text: &str| {
        progress.clear();
        if !quiet {
            eprintln!("{:6.0} s  {text}", start.elapsed().as_secs_f64());
        }
    }
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
