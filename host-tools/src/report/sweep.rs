//! The sweep: every method at every budget, made, measured and kept.

use super::{Bench, HeldOut, Kind, Line, REVISION, Request, Store, Subject, forget_peak, peak_memory};
use crate::data::dataset::{Dataset, Description, Writer};
use crate::data::transfer::Domain;
use crate::encode::goal::Target;
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::baseline::data::Uncompressed;
use crate::measure::baseline::decoder::{Decoder, Locator};
use crate::measure::baseline::pca::components as pca;
use crate::measure::baseline::{clusters, published, tucker};
use crate::measure::speed::{self, Adapter};
use crate::measure::verify::open_made;
use crate::methods::sparse_ensemble::encode::{self, prepare};
use crate::methods::sparse_tensor;
use crate::methods::sparse_tensor::encode::fit;
use crate::progress::Progress;
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

/// Edges of blocks of the sparse ensemble.
const EDGES: [usize; 3] = [2, 4, 8];
/// Numbers of clusters that local PCA is tried with.
const CLUSTERS: [usize; 4] = [2, 4, 8, 16];
/// Every so many-th direction is held out, but for the border of the hemisphere.
const HELD: usize = 7;

/// A method at a budget, made.
struct Made {
    method: String,
    budget: u64,
    setting: String,
    found: String,
    what: What,
    seconds: f64,
}

enum What {
    File(Vec<u8>),
    Baseline(Box<dyn Decoder>),
}

impl What {
    /// As something to be measured, and its bytes.
    fn with<T>(&self, measure: impl FnOnce(Subject<'_>, u64) -> Result<T>) -> Result<T> {
        match self {
            What::File(bytes) => measure(Subject::File(&open_made(bytes, None)?), bytes.len() as u64),
            What::Baseline(decoder) => measure(Subject::Baseline(decoder.as_ref()), decoder.bytes()),
        }
    }
}

/// Receives what was made; asked before, so that nothing is made in vain.
struct Visitor<'v> {
    wanted: &'v dyn Fn(&str, u64) -> bool,
    visit: &'v mut dyn FnMut(Made) -> Result<()>,
    say: &'v dyn Fn(&str),
    memory: &'v Memory,
}

/// Where the largest memory of a method comes from.
#[derive(Default)]
struct Memory {
    /// Whether the system tells the largest since the last beginning.
    is_known: Cell<bool>,
    /// The largest of what methods share.
    shared: Cell<u64>,
}

impl Memory {
    /// The largest of what is shared and of the method, bytes.
    fn peak(&self) -> Option<u64> {
        peak_memory().filter(|_| self.is_known.get()).map(|own| own.max(self.shared.get()))
    }
}

impl Visitor<'_> {
    /// Work begins that the settings of a method share.
    fn begin(&self) {
        self.begin_one(None);
    }

    /// The work of a method begins that shares with others what is made; the largest memory of that.
    fn begin_one(&self, shared: Option<u64>) {
        self.memory.shared.set(shared.unwrap_or(0));
        self.memory.is_known.set(forget_peak());
    }

    /// The budgets that are wanted of a method.
    fn budgets(&self, method: &str, budgets: &[u64]) -> Vec<u64> {
        budgets.iter().copied().filter(|&budget| (self.wanted)(method, budget)).collect()
    }
}

fn name_of(domain: Domain) -> &'static str {
    if domain == Domain::Log { "log" } else { "linear" }
}

/// Budgets that a method cannot meet are logged and skipped.
fn kept<T>(result: Result<T>, what: &str, visitor: &Visitor<'_>) -> Result<Option<T>> {
    match result {
        Ok(made) => Ok(Some(made)),
        Err(error @ ToolError::Unreachable { .. }) => {
            (visitor.say)(&format!("{what}: left out, {error}"));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn ensembles(
    data: &Dataset,
    domain: Domain,
    edges: &[usize],
    budgets: &[u64],
    visitor: &mut Visitor<'_>,
) -> Result<()> {
    let method = |edge: usize| format!("ensemble {edge}, {}", name_of(domain));
    if edges.iter().all(|&edge| visitor.budgets(&method(edge), budgets).is_empty()) {
        return Ok(());
    }
    visitor.begin();
    let begun = Instant::now();
    let prepared = prepare(vec![data], sparse_tensor::encode::transfer_of(data, domain), &|_, _| ())?;
    let shared = begun.elapsed().as_secs_f64();
    for &edge in edges {
        let bases = prepared.own_ensembles(edge);
        for budget in visitor.budgets(&method(edge), budgets) {
            (visitor.say)(&format!("{} at {budget} bytes", method(edge)));
            let begun = Instant::now();
            let options = encode::Options {
                edge,
                criterion: encode::Criterion::Bytes(budget),
                ..encode::Options::default()
            };
            let Some(encoded) =
                kept(encode::encode(&prepared, &bases, &options, &|_, _| ()), &method(edge), visitor)?
            else {
                continue;
            };
            let coefficients: usize = encoded.coefficients.iter().sum();
            (visitor.visit)(Made {
                method: method(edge),
                budget,
                setting: format!("blocks of {edge} x {edge}, {coefficients} coefficients"),
                found: String::new(),
                seconds: shared + begun.elapsed().as_secs_f64(),
                what: What::File(encoded.bytes),
            })?;
        }
    }
    Ok(())
}

/// The sparse tensor, and the baselines that begin with the same components.
fn components(
    data: &Dataset,
    domain: Domain,
    rank: usize,
    budgets: &[u64],
    visitor: &mut Visitor<'_>,
) -> Result<()> {
    let name = |method: &str| format!("{method}, {}", name_of(domain));
    let [of_tensor, of_pca, of_clusters, of_tucker] = ["tensor", "PCA", "local PCA", "Tucker"].map(name);
    let all = [&of_tensor, &of_pca, &of_clusters, &of_tucker];
    if all.iter().all(|method| visitor.budgets(method, budgets).is_empty()) {
        return Ok(());
    }
    visitor.begin();
    (visitor.say)(&format!("{rank} components, {}", name_of(domain)));
    let begun = Instant::now();
    let mut whole = pca(data, domain, rank)?;
    let shared = begun.elapsed().as_secs_f64();
    let shared_peak = visitor.memory.peak();

    for budget in visitor.budgets(&of_pca, budgets) {
        (visitor.say)(&format!("{of_pca} at {budget} bytes"));
        let begun = Instant::now();
        let Some(choice) = whole.best_at(budget)? else {
            (visitor.say)(&format!("{of_pca}: left out, {budget} bytes are fewer than the mean takes"));
            continue;
        };
        (visitor.visit)(Made {
            method: of_pca.clone(),
            budget,
            setting: format!("{} components, {} bits", choice.rank, choice.bits),
            found: if choice.rank == whole.rank() {
                "all components that were made".into()
            } else {
                String::new()
            },
            seconds: shared + begun.elapsed().as_secs_f64(),
            what: What::Baseline(Box::new(whole.decoder(choice.rank, choice.bits))),
        })?;
    }

    let wanted = visitor.budgets(&of_tensor, budgets);
    if !wanted.is_empty() {
        visitor.begin_one(shared_peak);
        (visitor.say)(&format!("{of_tensor}: trial dictionaries"));
        let begun = Instant::now();
        let training = fit::Training::default();
        let trials = sparse_tensor::encode::ShapeSearch::new(&whole, training, |_, _, _| ());
        let shared = shared + begun.elapsed().as_secs_f64();
        for budget in wanted {
            (visitor.say)(&format!("{of_tensor} at {budget} bytes"));
            let begun = Instant::now();
            let target = Target::Bytes(budget);
            let Some((shape, _, encoded)) =
                kept(trials.encode(&[], target, None, training, |_, _, _| ()), &of_tensor, visitor)?
            else {
                continue;
            };
            (visitor.visit)(Made {
                method: of_tensor.clone(),
                budget,
                setting: format!(
                    "{} light atoms, {} ABRDF atoms, {} entries, {:.1} coefficients a texel",
                    shape.light_atoms,
                    shape.abrdf_atoms,
                    shape.entries,
                    encoded.coefficients as f64 / data.description().texels() as f64
                ),
                found: encoded.found(),
                seconds: shared + begun.elapsed().as_secs_f64(),
                what: What::File(encoded.bytes),
            })?;
        }
    }

    visitor.begin_one(shared_peak);
    for budget in visitor.budgets(&of_clusters, budgets) {
        (visitor.say)(&format!("{of_clusters} at {budget} bytes"));
        let begun = Instant::now();
        let mut best: Option<(f64, clusters::Clusters<'_, '_>)> = None;
        for count in CLUSTERS {
            // The most components that fit, by the cost of one.
            let none = clusters::bytes(data, count, 0, 8);
            let each = clusters::bytes(data, count, 1, 8) - none;
            if none + each > budget {
                break;
            }
            let made = clusters::clusters(&whole, count, ((budget - none) / each) as usize);
            let row = made.measure(8)?;
            let error = whole.error(&row);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, made));
            }
        }
        let Some((_, made)) = best else {
            (visitor.say)(&format!("{of_clusters}: left out, {budget} bytes are too few for two clusters"));
            continue;
        };
        (visitor.visit)(Made {
            method: of_clusters.clone(),
            budget,
            setting: made.describe(),
            found: String::new(),
            seconds: shared + begun.elapsed().as_secs_f64(),
            what: What::Baseline(Box::new(made.decoder(8))),
        })?;
    }

    visitor.begin_one(shared_peak);
    let wanted = visitor.budgets(&of_tucker, budgets);
    if let Some(&most) = wanted.iter().max() {
        (visitor.say)(&format!("{of_tucker}: all modes"));
        let begun = Instant::now();
        let [width, height] = data.description().size.map(|n| n.div_ceil(2) as u64);
        // Columns of view and light whose product fits: light has colour, so it gets more.
        let columns = |budget: u64| {
            let description = data.description();
            let product = (budget as f64 / (width * height) as f64).max(2.0);
            let views = ((product / 3.0).sqrt().max(1.0) as usize).min(description.views.len());
            [
                views,
                ((product / views as f64) as usize)
                    .min(3 * description.lights.len())
                    .min(tucker::MOST_COLUMNS),
            ]
        };
        let [views, lights] = columns(most);
        let decomposed = tucker::tucker(&whole, views.max(1), lights.max(1))?;
        let shared = shared + begun.elapsed().as_secs_f64();
        for budget in wanted {
            let begun = Instant::now();
            let [mut views, mut lights] = columns(budget);
            // What the mean and the matrices take is given back column by column.
            while lights > 1 && decomposed.bytes(views, lights, 8) > budget {
                if lights > 3 * views || views == 1 { lights -= 1 } else { views -= 1 }
            }
            if decomposed.bytes(views, lights, 8) > budget {
                (visitor.say)(&format!("{of_tucker}: left out, {budget} bytes are too few"));
                continue;
            }
            (visitor.say)(&format!("{of_tucker} at {budget} bytes"));
            (visitor.visit)(Made {
                method: of_tucker.clone(),
                budget,
                setting: format!(
                    "{width} x {height} spatial, {views} view and {lights} light columns, 8 bits"
                ),
                found: String::new(),
                seconds: shared + begun.elapsed().as_secs_f64(),
                what: What::Baseline(Box::new(decomposed.decoder(views, lights, 8))),
            })?;
        }
    }
    Ok(())
}

fn sparsebtf(data: &Dataset, budgets: &[u64], visitor: &mut Visitor<'_>) -> Result<()> {
    const METHOD: &str = "SparseBTF as published";
    let wanted = visitor.budgets(METHOD, budgets);
    let Some(&most) = wanted.iter().max() else { return Ok(()) };
    visitor.begin();
    (visitor.say)(METHOD);
    let begun = Instant::now();
    let source = published::Published::new(data)?;
    let own = source.own_ensembles()?;
    let Some(layout) = kept(source.layout(&own, most), METHOD, visitor)? else { return Ok(()) };
    let shared = begun.elapsed().as_secs_f64();
    for budget in wanted {
        let fixed = source.bytes(0);
        let Some(rest) = budget.checked_sub(fixed) else {
            (visitor.say)(&format!("{METHOD}: left out, its tables alone have {fixed} bytes"));
            continue;
        };
        let coefficients = ((rest / (source.bytes(1) - fixed)) as usize).min(layout.most());
        (visitor.visit)(Made {
            method: METHOD.into(),
            budget,
            setting: format!(
                "{coefficients} coefficients a block; its dictionaries ({} bytes) are not counted",
                layout.dictionary_bytes()
            ),
            found: String::new(),
            seconds: shared,
            what: What::Baseline(Box::new(layout.decoder(coefficients))),
        })?;
    }
    Ok(())
}

fn uncompressed(data: &Dataset, visitor: &mut Visitor<'_>) -> Result<()> {
    const METHOD: &str = "uncompressed";
    let bytes = data.description().half_bytes();
    if visitor.budgets(METHOD, &[bytes]).is_empty() {
        return Ok(());
    }
    visitor.begin();
    (visitor.say)(METHOD);
    let begun = Instant::now();
    let decoder = Uncompressed::new(data)?;
    (visitor.visit)(Made {
        method: METHOD.into(),
        budget: bytes,
        setting: "binary16, four texels and nine pairs".into(),
        found: String::new(),
        seconds: begun.elapsed().as_secs_f64(),
        what: What::Baseline(Box::new(decoder)),
    })
}

fn everything(data: &Dataset, rank: usize, budgets: &[u64], visitor: &mut Visitor<'_>) -> Result<()> {
    ensembles(data, Domain::Log, &EDGES, budgets, visitor)?;
    ensembles(data, Domain::Linear, &[4], budgets, visitor)?;
    components(data, Domain::Log, rank, budgets, visitor)?;
    components(data, Domain::Linear, rank, budgets, visitor)?;
    sparsebtf(data, budgets, visitor)?;
    uncompressed(data, visitor)
}

/// Some directions of a dataset, as a dataset.
fn subset(data: &Dataset, lights: &[usize], views: &[usize], path: &Path) -> Result<Dataset> {
    let description = data.description();
    let pick = |set: &[glam::DVec3], which: &[usize]| which.iter().map(|&i| set[i]).collect();
    let own = Description {
        lights: pick(&description.lights, lights),
        views: pick(&description.views, views),
        ..description.clone()
    };
    let writer = Writer::create(path, own)?;
    let (mut bytes, mut texel) = (Vec::new(), vec![0.0; description.texel_len()]);
    for i in 0..description.texels() {
        data.read(i, 1, &mut bytes, &mut texel)?;
        let pair = |view: usize, light: usize| (view * description.lights.len() + light) * 3;
        let values: Vec<f32> = views
            .iter()
            .flat_map(|&v| lights.iter().map(move |&l| (v, l)))
            .flat_map(|(v, l)| texel[pair(v, l)..][..3].to_vec())
            .collect();
        writer.put(i, 0, &values)?;
    }
    writer.finish()?;
    Dataset::open(path)
}

/// Directions that are held out: every seventh of those well inside the hemisphere, and the others.
fn split(set: &[glam::DVec3]) -> [Vec<usize>; 2] {
    let mut inside = 0;
    let (mut held, mut rest) = (Vec::new(), Vec::new());
    for (i, direction) in set.iter().enumerate() {
        if direction.z > 0.45 {
            inside += 1;
        }
        if direction.z > 0.45 && inside % HELD == HELD / 2 { held.push(i) } else { rest.push(i) }
    }
    [held, rest]
}

/// Something that finds directions: a small file of the same sets.
fn finder(data: &Dataset) -> Result<Vec<u8>> {
    let prepared = prepare(vec![data], sparse_tensor::encode::transfer_of(data, Domain::Log), &|_, _| ())?;
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

/// A short number of a text, for names of files.
fn short_hash(text: &str) -> u32 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish() as u32
}

/// What a dataset is known by in the store: its name, extent and statistics.
fn identity(data: &Dataset) -> (String, String) {
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
    (name, identity)
}

/// A name that can be a file's.
fn slug(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// Budgets of a dataset in bytes.
pub fn budgets(data: &Dataset, ratios: &[f64]) -> Vec<u64> {
    ratios.iter().map(|ratio| (data.description().half_bytes() as f64 / ratio) as u64).collect()
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
    say: &dyn Fn(&str),
) -> Result<Asked> {
    let data = Dataset::open(path)?;
    let (name, identity) = identity(&data);
    let budgets = budgets(&data, &request.ratios);
    let version = env!("CARGO_PKG_VERSION");
    let cores = rayon::current_num_threads();
    let key = |method: &str, budget: u64| {
        format!(
            "{identity} | {method} | {budget} | {} | {:?} | {cores} | {} | {version} {REVISION}",
            request.rank, request.every, adapter.name
        )
    };
    // Names of files and pictures: readable, and of this dataset alone.
    let prefix = format!("{}-{:08x}", slug(&name), short_hash(&identity));
    let all_asked = RefCell::new(Asked::new());
    let memory = Memory::default();
    let pictured = budgets[budgets.len() / 2];

    let known: BTreeSet<String> = lines.lines.iter().map(|line| line.key.clone()).collect();
    let asked = |method: &str| {
        request.methods.is_empty() || request.methods.iter().any(|m| method.contains(m.as_str()))
    };
    let is_wanted = |known: &BTreeSet<String>, method: &str, budget: u64| {
        let key = key(method, budget);
        let wanted = asked(method) && !known.contains(&key);
        if asked(method) {
            all_asked.borrow_mut().insert(key);
        }
        wanted
    };
    let wanted = |method: &str, budget: u64| is_wanted(&known, method, budget);
    let finder_bytes = finder(&data)?;
    let finder_file = open_made(&finder_bytes, None)?;
    let finds = locator(&finder_file, &data);
    let bench = Bench::new(&data, &finds, adapter, request.every, &request.out)?;
    let reference = bench.picture(None, &format!("{prefix}-data"))?;
    let mut visit = |made: Made| -> Result<()> {
        let peak = memory.peak();
        let own = format!("{prefix}-{}-{}", slug(&made.method), made.budget);
        let mut open_seconds = None;
        if let What::File(bytes) = &made.what {
            open_seconds = Some(speed::open_seconds(bytes, None));
            files::write(&request.out.join("files").join(format!("{own}.selv")), bytes)?;
        }
        made.what.with(|subject, bytes| {
            let [ssim, flip] = bench.similarity(&subject)?;
            let shown = made.budget == pictured || made.method == "uncompressed";
            let picture = shown.then(|| bench.picture(Some(&subject), &own)).transpose()?;
            lines.add(Line {
                key: key(&made.method, made.budget),
                dataset: name.clone(),
                reference: reference.clone(),
                adapter: adapter.name.clone(),
                cores,
                kind: if open_seconds.is_some() { Kind::File } else { Kind::Baseline },
                bytes,
                every: bench.every,
                metrics: bench.metrics(&subject)?,
                ssim,
                flip,
                operations: subject.operations(&finds),
                speed: subject.speed(&finds, adapter),
                encode_seconds: made.seconds,
                open_seconds,
                peak_memory: peak,
                found: made.found.clone(),
                picture,
                method: made.method.clone(),
                setting: made.setting.clone(),
            })
        })
    };
    let say_name = |text: &str| say(&format!("{name}: {text}"));
    everything(
        &data,
        request.rank,
        &budgets,
        &mut Visitor { wanted: &wanted, visit: &mut visit, say: &say_name, memory: &memory },
    )?;
    if request.held_out {
        let known: BTreeSet<String> = held.lines.iter().map(|line| line.key.clone()).collect();
        let wanted = |method: &str, budget: u64| is_wanted(&known, method, budget);
        hold_out(request, &data, &name, pictured, bench.every, &wanted, &key, held, &say_name)?;
    }
    Ok(all_asked.into_inner())
}

/// The middle budget again, on data without some directions, measured at those.
#[allow(clippy::too_many_arguments)]
fn hold_out(
    request: &Request,
    data: &Dataset,
    name: &str,
    budget: u64,
    every: usize,
    wanted: &dyn Fn(&str, u64) -> bool,
    key: &dyn Fn(&str, u64) -> String,
    held: &mut Store<HeldOut>,
    say: &dyn Fn(&str),
) -> Result<()> {
    let description = data.description();
    let ([held_lights, lights], [held_views, views]) =
        (split(&description.lights), split(&description.views));
    if held_lights.is_empty() || held_views.is_empty() || lights.len() < 3 || views.len() < 3 {
        say("too few directions to hold some out");
        return Ok(());
    }
    let temporary = tempfile::Builder::new()
        .prefix(".selvedge-")
        .tempdir_in(&request.out)
        .map_err(ToolError::io(&request.out))?;
    let seen = subset(data, &lights, &views, &temporary.path().join("seen.selvset"))?;
    let unseen = subset(data, &held_lights, &held_views, &temporary.path().join("unseen.selvset"))?;
    let finder_bytes = finder(&seen)?;
    let finder_file = open_made(&finder_bytes, None)?;
    let finds = locator(&finder_file, &seen);
    // One setting of each method: the uncompressed data are asked for by their own bytes.
    let whole = seen.description().half_bytes();
    let offset = data.statistics().log_offset();
    let wanted = |method: &str, asked: u64| wanted(method, if asked == whole { whole } else { budget });
    let mut visit = |made: Made| -> Result<()> {
        made.what.with(|subject, bytes| {
            let of = |part: &Dataset, every: usize| {
                subject.metrics(&finds, part, every, offset, data.statistics().largest)
            };
            held.add(HeldOut {
                key: key(&made.method, made.budget),
                dataset: name.to_owned(),
                method: made.method.clone(),
                bytes,
                seen: of(&seen, every)?,
                unseen: of(&unseen, 1)?,
            })
        })
    };
    let say = |text: &str| {
        say(&format!("{} lights and {} views held out: {text}", held_lights.len(), held_views.len()))
    };
    everything(
        &seen,
        request.rank,
        &[budget],
        &mut Visitor { wanted: &wanted, visit: &mut visit, say: &say, memory: &Memory::default() },
    )
}

/// Progress on a terminal, a line each elsewhere.
pub fn teller(quiet: bool) -> impl Fn(&str) {
    let progress = Progress::new();
    let begun = Instant::now();
    move |text: &str| {
        progress.clear();
        if !quiet {
            eprintln!("{:6.0} s  {text}", begun.elapsed().as_secs_f64());
        }
    }
}
