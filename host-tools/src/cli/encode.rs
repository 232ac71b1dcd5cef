//! The command that encodes: its options, which method each is of, and the choice between methods.

use super::common::{Threads, print_json};
use super::parse;
use crate::data::dataset::{Dataset, Description};
use crate::data::pyramid;
use crate::encode::parse::{counts, positive, three};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::model::TransferModel;
use crate::measure::baseline::pca;
use crate::measure::compare::Metrics;
use crate::methods::sparse_ensemble::dictionary::Ensemble;
use crate::methods::sparse_ensemble::dictionary_file;
use crate::methods::sparse_ensemble::encode::driver::{
    EDGES, Event, Verified, Wish, encode_verified, verify,
};
use crate::methods::sparse_ensemble::encode::{Options, Prepared, prepare};
use crate::methods::sparse_ensemble::train;
use crate::methods::sparse_tensor;
use crate::progress::Progress;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
enum Domain {
    /// ln(x + a thousandth of the mean)
    Log,
    /// Linear radiance
    Linear,
}

impl Domain {
    fn of_components(self) -> pca::Domain {
        if self == Domain::Log { pca::Domain::Log } else { pca::Domain::Linear }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
enum Method {
    /// Blocks of a few products of four columns (SparseBTF 2023)
    SparseEnsemble,
    /// Texels of a few ABRDF atoms, these of a few light atoms (Ruiters and Klein 2009)
    SparseTensor,
    /// All of them, in both domains; the best for --prefer is written
    Auto,
}

/// What the best of several files is.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Preference {
    /// Fewest bytes
    Bytes,
    /// Least error, of --domain
    Error,
    /// Fewest stated operations of a sample
    Operations,
}

#[derive(Args)]
pub struct Arguments {
    /// The dataset
    dataset: PathBuf,
    /// The file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Goal: root mean squared error, in the domain of --domain
    #[arg(long, value_parser = positive, group = "goal")]
    rmse: Option<f64>,
    /// Goal: peak signal to noise ratio of linear radiance against the largest value, decibels
    #[arg(long, value_parser = positive, group = "goal")]
    psnr: Option<f64>,
    /// Goal: bytes of the file, as 200000, 200k or 1.5M
    #[arg(long, value_parser = parse::bytes, group = "goal")]
    size: Option<u64>,
    /// Goal: coefficients of a block in each channel, as 256,64,64
    #[arg(long, value_parser = counts, group = "goal")]
    coefficients: Option<[usize; 3]>,
    /// What --rmse is an error of
    #[arg(long, value_enum, default_value = "log")]
    domain: Domain,
    /// Cap: operations of a filtered sample that the file may state
    #[arg(long)]
    operations: Option<u32>,
    /// Texels along the side of a block, 1 to 16; chosen among 2, 4 and 8 if not given
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=16))]
    edge: Option<u16>,
    /// A trained dictionary; without it the material's own columns
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Name the dictionary instead of carrying its columns
    #[arg(long, requires = "dictionary")]
    external: bool,
    /// Train this many dictionaries on the material itself
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256), conflicts_with = "dictionary")]
    own_dictionaries: Option<u16>,
    /// Quality layers, 1 to 8
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=8))]
    layers: u16,
    /// Levels of detail, 1 to 15
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=15))]
    levels: u16,
    /// Bits of a value in each channel; chosen if not given
    #[arg(long, value_parser = three::<u32>)]
    value_bits: Option<[u32; 3]>,
    /// Domain that is coded; log if not given, both with --method auto
    #[arg(long, value_enum)]
    transfer: Option<Domain>,
    /// Offset of the logarithm; a thousandth of the mean if not given
    #[arg(long, value_parser = positive)]
    offset: Option<f64>,
    /// How the material is stored
    #[arg(long, value_enum, default_value = "sparse-ensemble")]
    method: Method,
    /// What --method auto chooses by, among files that reach the goal; error if the goal is a size, bytes if
    /// it is an error
    #[arg(long, value_enum)]
    prefer: Option<Preference>,
    /// Sparse tensor: light atoms, ABRDF atoms, entries of a fibre and coefficients of a texel, as
    /// 64,128,8,10; chosen if not given
    #[arg(long, value_parser = parse_shape)]
    shape: Option<[usize; 4]>,
    /// Sparse tensor: components that training works in; memory grows with them times the texels
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u16).range(1..=2048))]
    rank: u16,
    /// Sparse tensor: memory of its decomposition, in MB; the less, the fewer parts at once, and then the
    /// fewer components
    #[arg(long, default_value_t = 4000, value_parser = clap::value_parser!(u32).range(16..=1_000_000))]
    memory: u32,
    /// Tell what was reached, as JSON, to stdout
    #[arg(long)]
    json: bool,
    /// Tell how long each step took
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Four numbers in the ranges of chapter 12.
fn parse_shape(text: &str) -> std::result::Result<[usize; 4], String> {
    let numbers: Vec<usize> = text
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| format!("`{n}` is no number")))
        .collect::<std::result::Result<_, _>>()?;
    let shape: [usize; 4] = numbers
        .try_into()
        .map_err(|_| "four numbers: light atoms, ABRDF atoms, entries, coefficients".to_owned())?;
    let most = [256, 1024, 32, 63];
    if shape.iter().zip(most).all(|(n, most)| (1..=most).contains(n)) {
        Ok(shape)
    } else {
        Err(format!("1 to {most:?}"))
    }
}

/// A file that reached the goal.
struct Attempt {
    bytes: Vec<u8>,
    told: Told,
}

/// What is told of it.
#[derive(Clone, Debug, serde::Serialize)]
struct Told {
    method: Method,
    transfer: Domain,
    bytes: usize,
    ratio_to_binary16: f64,
    operations: u32,
    predicted_rms: f64,
    metrics: Metrics,
    /// Of a sparse ensemble.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    ensemble: Option<OfEnsemble>,
    /// Of a sparse tensor.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    tensor: Option<OfTensor>,
    /// What was tried beside it, with the method auto.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tried: Vec<Told>,
}

#[derive(Clone, Debug, serde::Serialize)]
struct OfEnsemble {
    edge: usize,
    coefficients: [usize; 3],
}

#[derive(Clone, Debug, serde::Serialize)]
struct OfTensor {
    shape: [usize; 4],
    /// Components that training worked in.
    components: usize,
    list_coefficients: usize,
    /// Coefficients that were limited to the range of their atom.
    limited: usize,
    trained: sparse_tensor::encode::fit::Trained,
}

impl Told {
    fn line(&self) -> String {
        let setting = match (&self.ensemble, &self.tensor) {
            (Some(e), _) => format!("edge {}", e.edge),
            (_, Some(t)) => format!("shape {}", t.shape.map(|n| n.to_string()).join(",")),
            _ => String::new(),
        };
        format!(
            "{:?}, {:?}, {setting}: {} bytes, RMS log {:.4}, linear {:.5}, {} operations",
            self.method,
            self.transfer,
            self.bytes,
            self.metrics.log_rms,
            self.metrics.linear_rms,
            self.operations
        )
    }
}

impl Arguments {
    /// Refuses options that do not go together, before any data are read.
    fn check(&self) -> Result<()> {
        let usage = |text: &str| Err(ToolError::Usage(text.into()));
        let of_ensemble = self.dictionary.is_some()
            || self.own_dictionaries.is_some()
            || self.edge.is_some()
            || self.coefficients.is_some();
        if self.method != Method::SparseEnsemble && (of_ensemble || self.layers > 1 || self.offset.is_some())
        {
            return usage(
                "--dictionary, --own-dictionaries, --edge, --coefficients, --layers and --offset are of --method sparse-ensemble",
            );
        }
        if self.method == Method::SparseTensor && self.operations.is_some() {
            return usage("--operations is of --method sparse-ensemble and auto");
        }
        if self.method != Method::SparseTensor && self.shape.is_some() {
            return usage("--shape is of --method sparse-tensor");
        }
        if self.method != Method::Auto && self.prefer.is_some() {
            return usage("--prefer is of --method auto");
        }
        let bits = if self.method == Method::SparseTensor { 1..=15 } else { 1..=16 };
        if self.value_bits.is_some_and(|all| all.iter().any(|b| !bits.contains(b))) {
            return Err(ToolError::Usage(format!("--value-bits: {} to {}", bits.start(), bits.end())));
        }
        if self.offset.is_some_and(|offset| !(1.2e-38..=1.0).contains(&offset)) {
            return usage("--offset: a normal number up to 1");
        }
        let goal = self.rmse.is_some() || self.psnr.is_some() || self.size.is_some();
        if !goal
            && self.coefficients.is_none()
            && !(self.method == Method::SparseTensor && self.shape.is_some())
        {
            return usage(
                "a goal is missing: --rmse, --psnr, --size, --coefficients of a sparse ensemble, or --shape of a sparse tensor alone",
            );
        }
        Ok(())
    }

    fn wish(&self) -> Wish {
        match (self.rmse, self.psnr, self.size, self.coefficients) {
            (Some(rms), ..) if self.domain == Domain::Log => Wish::LogRms(rms),
            (Some(rms), ..) => Wish::LinearRms(rms),
            (_, Some(db), ..) => Wish::Psnr(db),
            (_, _, Some(bytes), _) => Wish::Size(bytes),
            (_, _, _, counts) => Wish::Coefficients(counts.unwrap_or_default()),
        }
    }

    /// The goal of a sparse tensor, whose errors are those of the domain that it codes.
    fn goal(&self, transfer: Domain, data: &Dataset) -> Result<sparse_tensor::encode::Goal> {
        match (self.rmse, self.psnr, self.size) {
            (Some(rms), ..) if self.domain == transfer => Ok(sparse_tensor::encode::Goal::Rms(rms)),
            (Some(_), ..) => Err(ToolError::Usage(
                "--rmse needs --domain and --transfer to be the same with --method sparse-tensor".into(),
            )),
            (_, Some(db), _) if transfer == Domain::Linear => {
                Ok(sparse_tensor::encode::Goal::Rms(data.statistics().largest as f64 / 10f64.powf(db / 20.0)))
            }
            (_, Some(_), _) => {
                Err(ToolError::Usage("--psnr needs --transfer linear with --method sparse-tensor".into()))
            }
            (_, _, Some(bytes)) => Ok(sparse_tensor::encode::Goal::Size(bytes)),
            _ => Ok(sparse_tensor::encode::Goal::All),
        }
    }
}

/// Encodes, verifies and writes.
///
/// # Errors
/// If options do not fit, data cannot be read, or the goal not be reached.
pub fn run(args: &Arguments) -> Result<u8> {
    args.check()?;
    args.threads.apply();
    let data = Dataset::open(&args.dataset)?;
    let beside = files::folder_of(&args.output);
    let temporary =
        tempfile::Builder::new().prefix(".selvedge-").tempdir_in(beside).map_err(ToolError::io(beside))?;
    let progress = Progress::new();
    let coarser = pyramid::levels(&data, args.levels as usize, temporary.path())?;
    progress.report("coarser levels", 1, 1);
    let transfer = args.transfer.unwrap_or(Domain::Log);
    let best = match args.method {
        Method::SparseEnsemble => {
            let edge = args.edge.map_or(0, usize::from);
            by_ensemble(args, &data, &coarser, transfer, &[edge], &progress)?.pop().transpose()?
        }
        Method::SparseTensor => Some(by_tensor(args, &data, &coarser, transfer, &progress)?),
        Method::Auto => Some(choose(args, &data, &coarser, &progress)?),
    };
    let Some(best) = best else { return Err(ToolError::Usage("no file reaches the goal".into())) };
    progress.clear();
    if args.times {
        eprintln!("{}", progress.times("the rest"));
    }
    files::write(&args.output, &best.bytes)?;
    for told in &best.told.tried {
        eprintln!("tried {}", told.line());
    }
    if !best.told.tried.is_empty() {
        eprintln!("wrote {}", best.told.line());
    }
    if args.json {
        print_json(&best.told)?;
    }
    Ok(0)
}

/// Every method in the domains that are asked for; the best for the user's preference among those that reach
/// the goal.
fn choose(args: &Arguments, data: &Dataset, coarser: &[Dataset], progress: &Progress) -> Result<Attempt> {
    let transfers = args.transfer.map_or(vec![Domain::Log, Domain::Linear], |one| vec![one]);
    let mut reached = Vec::new();
    let mut failed = Vec::new();
    for transfer in transfers {
        let mut all = by_ensemble(args, data, coarser, transfer, &EDGES, progress)?;
        all.push(by_tensor(args, data, coarser, transfer, progress));
        for attempt in all {
            match attempt {
                Ok(attempt) => reached.push(attempt),
                // A goal that one method cannot reach is another's to reach.
                Err(ToolError::Usage(why)) => failed.push(why),
                Err(error) => return Err(error),
            }
        }
    }
    if let Some(most) = args.operations {
        let least = reached.iter().map(|a| a.told.operations).min();
        reached.retain(|a| a.told.operations <= most);
        if let (true, Some(least)) = (reached.is_empty(), least) {
            failed.push(format!("the fewest operations of those that do otherwise are {least}"));
        }
    }
    let preference =
        args.prefer.unwrap_or(if args.size.is_some() { Preference::Error } else { Preference::Bytes });
    let worth = |a: &Attempt| match preference {
        Preference::Bytes => a.told.bytes as f64,
        Preference::Operations => a.told.operations as f64,
        Preference::Error if args.domain == Domain::Log => a.told.metrics.log_rms,
        Preference::Error => a.told.metrics.linear_rms,
    };
    reached.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
    let mut reached = reached.into_iter();
    let Some(mut best) = reached.next() else {
        return Err(ToolError::Usage(format!("no method reaches the goal: {}", failed.join("; "))));
    };
    best.told.tried = reached.map(|a| a.told).collect();
    Ok(best)
}

fn by_tensor(
    args: &Arguments,
    data: &Dataset,
    coarser: &[Dataset],
    transfer: Domain,
    progress: &Progress,
) -> Result<Attempt> {
    let goal = args.goal(transfer, data)?;
    let tell = |what: &str, done, all| progress.report(what, done, all);
    tell("components", 0, 1);
    let components = pca::pca_within(
        data,
        transfer.of_components(),
        args.rank as usize,
        args.memory as usize * 1_000_000,
    )?;
    let training = sparse_tensor::encode::fit::Training::default();
    let coarser: Vec<&Dataset> = coarser.iter().collect();
    let value_bits = args.value_bits.map(|bits| bits[0]);
    let (shape, fitted, mut first) = match args.shape {
        Some([light_atoms, abrdf_atoms, entries, coefficients]) => {
            let shape = sparse_tensor::encode::fit::Shape { light_atoms, abrdf_atoms, entries, coefficients };
            (shape, sparse_tensor::encode::fit::fit(&components, shape, training, tell), None)
        }
        None => {
            let (shape, fitted, encoded) = sparse_tensor::encode::Trials::new(&components, training, tell)
                .encode(&coarser, goal, value_bits, training, tell)?;
            (shape, fitted, Some(encoded))
        }
    };
    // The prediction is within a few parts in a hundred; a goal is met by what is decoded.
    let mut goal = goal;
    let most = if let sparse_tensor::encode::Goal::Rms(rms) = goal { rms } else { f64::INFINITY };
    let mut tries = 0;
    let (encoded, operations, metrics) = loop {
        let encoded = match first.take() {
            Some(encoded) => encoded,
            None => sparse_tensor::encode::encode_fit(
                &components,
                &fitted,
                &coarser,
                &sparse_tensor::encode::Options { shape, goal, value_bits, training },
            )?,
        };
        let (metrics, operations) =
            verify(data, &encoded.bytes, None, 1, &|done, all| tell("verifying", done, all))?;
        let found = if transfer == Domain::Log { metrics.log_rms } else { metrics.linear_rms };
        if found <= most {
            break (encoded, operations, metrics);
        }
        tries += 1;
        if tries == 4 {
            return Err(ToolError::Usage(format!(
                "a sparse tensor of this shape reaches {found:.6}, not {most}"
            )));
        }
        if let sparse_tensor::encode::Goal::Rms(rms) = &mut goal {
            *rms *= most / found * 0.998;
        }
    };
    if encoded.is_stiff() {
        progress.clear();
        eprintln!("sparse tensor, {transfer:?}: {}", encoded.found());
    }
    let told = Told {
        method: Method::SparseTensor,
        transfer,
        bytes: encoded.bytes.len(),
        ratio_to_binary16: data.description().half_bytes() as f64 / encoded.bytes.len() as f64,
        operations,
        predicted_rms: encoded.predicted_rms,
        metrics,
        ensemble: None,
        tensor: Some(OfTensor {
            components: components.rank(),
            shape: [shape.light_atoms, shape.abrdf_atoms, shape.entries, shape.coefficients],
            list_coefficients: encoded.coefficients,
            limited: encoded.limited,
            trained: encoded.trained,
        }),
        tried: Vec::new(),
    };
    Ok(Attempt { bytes: encoded.bytes, told })
}

/// One file for each edge; an edge of zero lets the driver choose.
fn by_ensemble(
    args: &Arguments,
    data: &Dataset,
    coarser: &[Dataset],
    transfer: Domain,
    edges: &[usize],
    progress: &Progress,
) -> Result<Vec<Result<Attempt>>> {
    let model = match (transfer, args.offset) {
        (Domain::Log, Some(offset)) => TransferModel::Log2 { offset: offset as f32 },
        _ => sparse_tensor::encode::transfer_of(data, transfer.of_components()),
    };
    let levels: Vec<&Dataset> = std::iter::once(data).chain(coarser).collect();
    let prepared = prepare(levels, model, &|done, all| progress.report("means and bases", done, all))?;
    let dictionary = args
        .dictionary
        .as_deref()
        .map(|path| dictionary_file::from_bytes(path, files::read(path)?))
        .transpose()?;
    if let Some(dictionary) = &dictionary {
        same_directions(dictionary, data.description())?;
    }
    let mut all = Vec::new();
    for &edge in edges {
        let mut options = Options {
            edge,
            layers: args.layers as usize,
            operations: args.operations,
            value_bits: args.value_bits,
            ..Options::default()
        };
        let mut trained = None;
        if let Some(count) = args.own_dictionaries {
            options.edge = if edge == 0 { 4 } else { edge };
            trained = own_dictionaries(data, count as usize, options.edge)?;
        }
        if let Some(dictionary) = &dictionary {
            if args.external {
                options.external = Some(dictionary.bytes.as_slice().into());
            }
            // The trained spatial bases are worth more than another edge.
            if options.edge == 0 {
                options.edge = dictionary.training.options.edge;
            }
        }
        let ensembles = |edge: usize| -> [Ensemble; 3] {
            match (&dictionary, &trained) {
                (Some(dictionary), _) => dictionary.ensembles.each_ref().map(|e| e.with_edge(edge)),
                (_, Some(trained)) => trained.ensembles.each_ref().map(|e| e.with_edge(edge)),
                _ => prepared.own_ensembles(edge),
            }
        };
        let verified = encode_verified(&prepared, &ensembles, args.wish(), &options, &|event| match event {
            Event::Pass(what, done, all) => progress.report(what, done, all),
            Event::Attempt(..) => progress.clear(),
        });
        all.push(verified.map(|verified| of_ensemble(verified, transfer, &prepared)));
    }
    Ok(all)
}

fn of_ensemble(verified: Verified, transfer: Domain, prepared: &Prepared<'_>) -> Attempt {
    let Verified { encoded, edge, metrics, operations } = verified;
    let told = Told {
        method: Method::SparseEnsemble,
        transfer,
        bytes: encoded.bytes.len(),
        ratio_to_binary16: prepared.levels[0].description().half_bytes() as f64 / encoded.bytes.len() as f64,
        operations,
        predicted_rms: encoded.predicted_rms,
        metrics,
        ensemble: Some(OfEnsemble { edge, coefficients: encoded.coefficients }),
        tensor: None,
        tried: Vec::new(),
    };
    Attempt { bytes: encoded.bytes, told }
}

/// An ensemble trained on the material that is encoded, at a sparsity near what its blocks will have.
fn own_dictionaries(data: &Dataset, count: usize, edge: usize) -> Result<Option<train::Trained>> {
    let texels = edge * edge;
    let options = train::Options {
        dictionaries: count,
        sparsity: [4 * texels, texels.div_ceil(2), texels.div_ceil(2)],
        edge,
        blocks: (200_000 / texels).max(64),
        iterations: 12,
        ..train::Options::default()
    };
    train::train(&[data], &options, None, &mut |_| true)
}

fn same_directions(dictionary: &dictionary_file::DictionaryFile, description: &Description) -> Result<()> {
    let near = |a: &[glam::DVec3], b: &[glam::DVec3]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (*a - *b).length() < 2e-4)
    };
    let training = &dictionary.training;
    if near(&training.lights, &description.lights) && near(&training.views, &description.views) {
        return Ok(());
    }
    Err(ToolError::Usage("the dictionary was trained for other directions than those of the dataset".into()))
}
