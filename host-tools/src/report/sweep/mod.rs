//! The sweep: every method at every budget, made, measured and kept.

mod baselines;
mod groups;
mod held_out;
mod keys;
mod methods;
mod swept;

pub(super) use groups::colour_of;
pub use keys::Asked;
pub(super) use keys::prefix_of;

use super::bench::Bench;
use super::line::{HeldOut, Kind, Line, Request};
use super::store::Store;
use crate::data::dataset::Dataset;
use crate::error::Result;
use crate::files;
use crate::measure::speed::{self, Adapter};
use crate::measure::verify::open_made;
use crate::progress::Progress;
use baselines::UNCOMPRESSED;
use groups::everything;
use held_out::HoldOut;
use keys::{Keys, REFERENCE, finder, known, locator, slug};
use std::path::Path;
use std::time::Instant;
use swept::{Made, Memory, Visitor, What};

/// Budgets of a dataset in bytes.
fn budgets(data: &Dataset, ratios: &[f64]) -> Vec<u64> {
    ratios.iter().map(|ratio| (data.description().half_bytes() as f64 / ratio) as u64).collect()
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
