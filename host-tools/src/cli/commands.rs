//! The commands that make, compare and change files of materials: their options, and what they do with them.

use super::encoding;
use super::{Source as FileSource, parse_angles, print, print_json};
use crate::data::dataset::{Dataset, Sample};
use crate::data::expand::expand;
use crate::data::picture;
use crate::error::{Result, ToolError};
use crate::files;
use crate::foreign::pixels::Colours;
use crate::foreign::{self, ImportOptions, Kind, btf, images, ubo};
use crate::format::blend::blend;
use crate::format::model::MetadataModel;
use crate::format::sector::Sector;
use crate::format::texture::Blend;
use crate::format::trim::{Keep, Trim, trim};
use crate::format::write;
use crate::measure::compare::Place;
use crate::measure::compare::{self, Metrics, Source};
use crate::methods::read;
use crate::methods::sparse_ensemble::dictionary_file::{self, Training};
use crate::methods::sparse_ensemble::train;
use crate::progress::Progress;
use crate::synth::{self, Mesostructure};
use clap::{Args, Subcommand, ValueEnum};
use selvedge::{Direction, Limits, Selvedge};
use std::path::{Path, PathBuf};

/// Commands of this module.
#[derive(Subcommand)]
pub enum Material {
    /// Render a BTF of a modelled mesostructure into a dataset
    Synth(SynthArgs),
    /// Write a dataset or a decoded file in a format of others: folders of EXR or PNG, a zip as UBO2003, a
    /// .btf
    Export(ExportArgs),
    /// Train an ensemble of dictionaries on datasets, once, for materials that are not among them
    Train(TrainArgs),
    /// Encode a dataset for a goal in error, bytes or coefficients
    Encode(Box<encoding::EncodeArgs>),
    /// Compare two materials; exit codes as idiff: 0 same, 1 warning, 2 failure, 3 other sizes, 4 unreadable
    #[command(
        after_help = "Exit codes: 0 within the limits, 1 beyond --warn, 2 beyond --fail, 3 other sizes, 4 unreadable."
    )]
    Compare(CompareArgs),
    /// Leave out what a scene does not need; what is left decodes to the same bits
    Trim(TrimArgs),
    /// A material between two, in the space of their coefficients
    Blend(BlendArgs),
}

fn parse_size(text: &str) -> std::result::Result<[usize; 2], String> {
    let parts: Option<Vec<usize>> =
        text.split('x').map(|n| n.parse().ok().filter(|n| (1..=16_384).contains(n))).collect();
    match parts.as_deref() {
        Some(&[side]) => Ok([side, side]),
        Some(&[width, height]) => Ok([width, height]),
        _ => Err("one number, or two as 128x64, from 1 to 16384".into()),
    }
}

pub fn parse_three<T: std::str::FromStr + Copy>(text: &str) -> std::result::Result<[T; 3], String> {
    let parts: Option<Vec<T>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match parts.as_deref() {
        Some(&[all]) => Ok([all; 3]),
        Some(&[a, b, c]) => Ok([a, b, c]),
        _ => Err("one number, or three as 256,64,64".into()),
    }
}

pub fn parse_counts(text: &str) -> std::result::Result<[usize; 3], String> {
    parse_three::<usize>(text)?
        .map(|n| (1..=32_767).contains(&n).then_some(n))
        .into_iter()
        .collect::<Option<Vec<_>>>()
        .and_then(|v| v.try_into().ok())
        .ok_or_else(|| "1 to 32767".into())
}

pub fn parse_positive(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0).ok_or_else(|| "a positive number".into())
}

/// The path of an EXR.
fn parse_exr(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
        Ok(path)
    } else {
        Err("a path that ends in .exr".into())
    }
}

pub fn parse_bytes(text: &str) -> std::result::Result<u64, String> {
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let unit = match unit {
        "" | "B" => 1.0,
        "k" | "kB" => 1e3,
        "M" | "MB" => 1e6,
        _ => return Err("bytes, as 200000, 200k or 1.5M".into()),
    };
    number
        .parse::<f64>()
        .ok()
        .map(|n| n * unit)
        .filter(|n| (1.0..=4.2e9).contains(n))
        .map(|n| n as u64)
        .ok_or_else(|| "bytes, as 200000, 200k or 1.5M".into())
}

/// Threads of the work that follows; results do not depend on it.
#[derive(Args)]
pub struct Threads {
    /// Threads; all cores if not given. Changes no byte
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Threads {
    pub fn apply(&self) {
        if let Some(threads) = self.threads {
            // Fails only where a pool is there already, which no command makes before.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global();
        }
    }
}

#[derive(Args)]
pub struct SynthArgs {
    /// checker, rings, tissue, cloth, knit or hammered
    kind: String,
    /// The dataset to write, NAME.selvset
    #[arg(short, long)]
    output: PathBuf,
    /// Texels along the sides, as 128 or 128x64
    #[arg(long, default_value = "128", value_parser = parse_size)]
    size: [usize; 2],
    /// Directions of light and of view: 81 or 151
    #[arg(long, default_value_t = 81)]
    directions: usize,
    /// Rays of a texel and view: 1, 4, 9 or 16
    #[arg(long, default_value_t = 4)]
    samples: usize,
    /// Chooses the geometry
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// 32-bit floats instead of binary16
    #[arg(long)]
    float: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Renders a material.
fn synthesise(args: SynthArgs) -> Result<u8> {
    args.threads.apply();
    let kind: Mesostructure = args.kind.parse()?;
    let sample = if args.float { Sample::Float } else { Sample::Half };
    let request = synth::Request {
        kind,
        size: args.size,
        directions: args.directions,
        seed: args.seed,
        samples: args.samples,
        sample,
    };
    let progress = Progress::new();
    synth::synthesise(&request, &args.output, &|done, all| progress.tell("rendering", done, all))?;
    progress.clear();
    Ok(0)
}

/// Formats of others.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ExportFormat {
    /// Folder of EXR with every bit
    Exr,
    /// Folder of PNG: sRGB of 16 bits, values above 1 cut
    Png,
    /// Zip archive of JPEG, named as those of UBO2003
    Ubo2003,
    /// Factorisation of Bonn, FMF06FC
    Btf,
}

#[derive(Args)]
pub struct ExportArgs {
    /// A dataset, or a Selvedge file, which is decoded at its own directions
    source: PathBuf,
    /// The folder for images and dataset.json, or the file to write
    #[arg(short, long)]
    output: PathBuf,
    /// What to write
    #[arg(long, value_enum, default_value = "exr")]
    format: ExportFormat,
    /// Components of a .btf, its mean among them
    ///
    /// 100 if not given
    #[arg(long, value_parser = clap::value_parser!(u16).range(2..=4096))]
    components: Option<u16>,
    /// Quality of a JPEG, 1 to 100; 95 if not given
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: Option<u8>,
    /// Factor of the values in a JPEG; 1 if not given
    #[arg(long, value_parser = super::parse_exposure)]
    exposure: Option<f32>,
    /// External dictionary of a file
    #[arg(long)]
    dictionary: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

fn export(args: ExportArgs) -> Result<u8> {
    args.threads.apply();
    let is = |format| args.format == format;
    check_applies("--components", args.components.is_some(), is(ExportFormat::Btf), "a .btf")?;
    check_applies("--quality", args.quality.is_some(), is(ExportFormat::Ubo2003), "an archive of JPEGs")?;
    check_applies("--exposure", args.exposure.is_some(), is(ExportFormat::Ubo2003), "an archive of JPEGs")?;
    check_output(&args.source, &args.output, matches!(args.format, ExportFormat::Exr | ExportFormat::Png))?;
    let progress = Progress::new();
    // A file is expanded beside the result, on disk.
    let place;
    let dataset = match Given::open(&args.source, args.dictionary.as_deref())? {
        Given::Data(dataset) => dataset,
        given @ Given::File(..) => {
            let folder = files::folder_of(&args.output);
            place = tempfile::Builder::new()
                .prefix(".selvedge-")
                .tempdir_in(folder)
                .map_err(ToolError::io(folder))?;
            let opened = given.opened(&args.source, &Limits::NONE)?;
            let file = opened.as_ref().ok_or_else(|| {
                ToolError::Usage(format!("{}: not a file to decode", args.source.display()))
            })?;
            expand(file, &place.path().join("all.selvset"), MEMORY, &|done, all| {
                progress.tell("decoding", done, all)
            })?
        }
    };
    let writing = |done, all| progress.tell("writing", done, all);
    let mut notes = Vec::new();
    let mut count_cut = |cut: u64| {
        if cut > 0 {
            notes.push(format!("{cut} values above 1 were cut"));
        }
    };
    match args.format {
        ExportFormat::Exr => {
            count_cut(images::export(&dataset, &args.output, images::Format::Exr, MEMORY, &writing)?)
        }
        ExportFormat::Png => {
            count_cut(images::export(&dataset, &args.output, images::Format::Png, MEMORY, &writing)?)
        }
        ExportFormat::Ubo2003 => {
            let options = ubo::Options {
                quality: args.quality.unwrap_or(95),
                exposure: args.exposure.unwrap_or(1.0),
                memory: MEMORY,
            };
            let exported = ubo::export(&dataset, &args.output, &options, &writing)?;
            count_cut(exported.cut);
            if let (count @ 1.., worst) = exported.moved {
                notes.push(format!(
                    "{count} directions are not of whole degrees: the names are up to {worst:.2} degrees off"
                ));
            }
        }
        ExportFormat::Btf => {
            let rms = btf::write::export(&dataset, &args.output, args.components.unwrap_or(100) as usize)?;
            if dataset.description().lights.len() != dataset.description().views.len() {
                notes.push(
                    "there are not as many lights as views, which readers made with btf.hh refuse".into(),
                );
            }
            notes.push(format!("the components leave an RMS error of {rms:.3e} of linear radiance"));
        }
    }
    progress.clear();
    notes.iter().for_each(|note| eprintln!("{note}"));
    Ok(0)
}

/// Bytes of images held at once.
const MEMORY: usize = 256 << 20;

/// Refuses an option that would do nothing.
pub fn check_applies(option: &str, is_given: bool, applies: bool, to: &str) -> Result<()> {
    if is_given && !applies { Err(ToolError::Usage(format!("{option} is for {to} alone"))) } else { Ok(()) }
}

/// Refuses an output that could not be written after hours of work, or would take the place of its source.
fn check_output(source: &Path, output: &Path, is_folder: bool) -> Result<()> {
    let refuse = |why: &str| Err(ToolError::Usage(format!("{}: {why}", output.display())));
    if !is_folder && output.is_dir() {
        return refuse("this is a folder; a file is written");
    }
    let is_same =
        source == output || source.canonicalize().is_ok_and(|a| output.canonicalize().is_ok_and(|b| a == b));
    if is_same {
        return refuse("this is the source");
    }
    Ok(())
}

/// Whether the light's cosine is in values.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Cosine {
    /// Values contain it, as radiance does
    Included,
    /// Values do not contain it
    Excluded,
}

/// Options of importing what becomes a dataset.
#[derive(Args)]
pub struct DataArgs {
    /// Keep 32-bit floats instead of binary16
    #[arg(long)]
    float: bool,
    /// Whether values contain the cosine of the light's angle; if not given, as the data say, and if they do
    /// not, included
    #[arg(long, value_enum)]
    cosine: Option<Cosine>,
    /// Name of the material; that of the file or folder if not given
    #[arg(long)]
    name: Option<String>,
    /// Where the data are from
    #[arg(long, default_value = "")]
    origin: String,
    /// Licence of the data
    #[arg(long, default_value = "")]
    licence: String,
    /// What three numbers of an image are, auto if not given: channels X, Y, Z of an EXR are CIE XYZ
    #[arg(long, value_enum)]
    colours: Option<Colours>,
    /// Bytes for images that are held at once, in MB; a larger single image is refused
    ///
    /// The more, the longer the runs that are written: 1000 if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    memory: Option<u32>,
    /// Write the height map of a .btf, its numbers as they are, as .exr
    #[arg(long, value_parser = parse_exr)]
    height_map: Option<PathBuf>,
    /// Tell how long each step took
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    threads: Threads,
}

impl DataArgs {
    /// What a folder of SparseBTF does not take: its files become a finished file as they are.
    pub fn check_unused(&self) -> Result<()> {
        let given = [
            ("--float", self.float),
            ("--cosine", self.cosine.is_some()),
            ("--name", self.name.is_some()),
            ("--origin", !self.origin.is_empty()),
            ("--licence", !self.licence.is_empty()),
            ("--colours", self.colours.is_some()),
            ("--memory", self.memory.is_some()),
            ("--height-map", self.height_map.is_some()),
            ("--times", self.times),
        ];
        given.into_iter().try_for_each(|(option, is_given)| {
            check_applies(option, is_given, false, "what becomes a dataset")
        })
    }
}

/// Makes a dataset of what others have.
pub fn import_data(from: &Path, kind: Kind, output: &Path, args: DataArgs) -> Result<()> {
    args.threads.apply();
    let is_btf = kind == Kind::Btf;
    check_applies("--height-map", args.height_map.is_some(), is_btf, "a .btf")?;
    check_applies("--colours", args.colours.is_some(), !is_btf, "pictures")?;
    check_applies("--memory", args.memory.is_some(), !is_btf, "pictures")?;
    check_output(from, output, false)?;
    let texts = [
        ("--name", args.name.as_deref().unwrap_or_default()),
        ("--origin", &args.origin),
        ("--licence", &args.licence),
    ];
    if let Some((option, _)) =
        texts.iter().find(|(_, text)| text.chars().any(selvedge::metadata::is_invisible))
    {
        return Err(ToolError::Usage(format!(
            "{option}: a character that is not seen, which no file may have"
        )));
    }
    let of_path =
        || from.file_stem().map_or_else(String::new, |name| foreign::clean(&name.to_string_lossy()));
    let mut options = ImportOptions {
        sample: if args.float { Sample::Float } else { Sample::Half },
        cosine_included: args.cosine.map(|cosine| cosine == Cosine::Included),
        name: args.name.unwrap_or_default(),
        origin: args.origin,
        licence: args.licence,
        memory: args.memory.map_or(ImportOptions::default().memory, |mb| mb as usize * 1_000_000),
        colours: args.colours.unwrap_or_default(),
    };
    let progress = Progress::new();
    let tell = |done, all| progress.tell("reading", done, all);
    let imported = match kind {
        Kind::Btf => {
            let btf = btf::Btf::open(from)?;
            // Before the long work, as far as it can fail.
            let read_heights =
                |path| check_output(output, path, false).and_then(|()| Ok((path, btf.height_map()?)));
            let heights = args.height_map.as_deref().map(read_heights).transpose()?;
            if options.name.is_empty() {
                options.name = of_path();
            }
            let imported = foreign::import_btf(&btf, output, &options, &tell)?;
            if let Some((path, heights)) = heights {
                let [width, height] = btf.head().height_map.unwrap_or_default().map(|n| n as usize);
                picture::Picture::from_fn(width, height, |x, y| [heights[y * width + x]; 3]).save(path)?;
            }
            imported
        }
        _ => {
            let set = images::ImageSet::open(from, options.memory)?;
            if options.name.is_empty() && set.description().texts[0].is_empty() {
                options.name = of_path();
            }
            set.import(output, &options, &tell)?
        }
    };
    progress.clear();
    if args.times {
        eprintln!("{}", progress.times("statistics"));
    }
    imported.notes.iter().for_each(|note| eprintln!("{note}"));
    Ok(())
}

#[derive(Args)]
pub struct TrainArgs {
    /// Datasets with the same directions
    #[arg(required = true)]
    datasets: Vec<PathBuf>,
    /// The dictionary to write, NAME.selvdict
    #[arg(short, long)]
    output: PathBuf,
    /// Dictionaries of each channel, 1 to 256
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    dictionaries: u16,
    /// Coefficients of a block in each channel while training
    #[arg(long, default_value = "256,32,32", value_parser = parse_counts)]
    sparsity: [usize; 3],
    /// Texels along the side of a block, 1 to 16
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=16))]
    edge: u16,
    /// Columns of light and view that are trained
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u16).range(1..=1024))]
    subspace: u16,
    /// Blocks to train on, of all datasets together
    #[arg(long, default_value_t = 2880, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    blocks: u32,
    /// Most iterations of each channel
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    iterations: u32,
    /// Chooses the blocks
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Say nothing of the objective
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Trains; what an interrupted run has done is kept beside the output and continued.
fn train_dictionary(args: TrainArgs) -> Result<u8> {
    args.threads.apply();
    let datasets: Vec<Dataset> =
        args.datasets.iter().map(|path| Dataset::open(path)).collect::<Result<_>>()?;
    let options = train::Options {
        dictionaries: args.dictionaries as usize,
        sparsity: args.sparsity,
        edge: args.edge as usize,
        subspace: args.subspace as usize,
        blocks: args.blocks as usize,
        iterations: args.iterations as usize,
        seed: args.seed,
        ..train::Options::default()
    };
    let mut state = args.output.clone().into_os_string();
    state.push(".training");
    let state = PathBuf::from(state);
    if state.exists() && !args.quiet {
        eprintln!("continuing {}", state.display());
    }
    let begun = std::time::Instant::now();
    let mut steps = 0u32;
    let mut tell = |step: train::Step| {
        steps += 1;
        if !args.quiet {
            let passed = begun.elapsed().as_secs_f64();
            let left = ((3 - step.channel) * options.iterations).saturating_sub(step.iteration + 1);
            let revived = if step.revived > 0 {
                format!(", {} dictionaries begin anew", step.revived)
            } else {
                String::new()
            };
            let most = passed / steps as f64 * left as f64;
            eprintln!(
                "channel {} iteration {:2}: error {:.6} of the energy{revived}; at most {most:.0} s left",
                step.channel, step.iteration, step.objective
            );
        }
        true
    };
    let references: Vec<&Dataset> = datasets.iter().collect();
    let Some(trained) = train::train(&references, &options, Some(&state), &mut tell)? else { return Ok(0) };
    let description = datasets[0].description();
    let materials: Vec<String> = datasets.iter().map(|d| d.description().texts[0].clone()).collect();
    let name = args.output.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let metadata = MetadataModel {
        texts: [name, format!("trained on {}", materials.join(", ")), licences(&datasets)],
        ..MetadataModel::default()
    };
    let training = Training {
        lights: description.lights.clone(),
        views: description.views.clone(),
        options,
        materials,
        objectives: trained.objectives.clone(),
        members: trained.members.clone(),
    };
    files::write(&args.output, &dictionary_file::to_bytes(&trained, &training, metadata))?;
    Ok(0)
}

fn licences(datasets: &[Dataset]) -> String {
    let mut all: Vec<&str> = datasets.iter().map(|d| d.description().texts[2].as_str()).collect();
    all.sort_unstable();
    all.dedup();
    all.join("; ")
}

/// A material given by its path: a dataset or a file.
enum Given {
    Data(Dataset),
    File(Vec<u8>, Option<Vec<u8>>),
}

impl Given {
    fn open(path: &Path, dictionary: Option<&Path>) -> Result<Given> {
        if Dataset::is_one(path) {
            return Ok(Given::Data(Dataset::open(path)?));
        }
        Ok(Given::File(files::read(path)?, dictionary.map(files::read).transpose()?))
    }

    fn opened<'a>(&'a self, path: &Path, limits: &Limits) -> Result<Option<Selvedge<'a>>> {
        match self {
            Given::Data(_) => Ok(None),
            Given::File(bytes, dictionary) => selvedge::open_with(bytes, dictionary.as_deref(), limits)
                .map(Some)
                .map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding }),
        }
    }
}

/// Metrics that a limit can be of.
#[derive(Clone, Copy, ValueEnum)]
enum Limited {
    LogRms,
    LinearRms,
    RelativeL2,
    Largest,
}

#[derive(Args)]
pub struct CompareArgs {
    /// The reference: a dataset or a file
    reference: PathBuf,
    /// What is compared with it: a dataset or a file
    other: PathBuf,
    /// External dictionary of the files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// What --warn and --fail are limits of
    #[arg(long, value_enum, default_value = "largest")]
    by: Limited,
    /// Warn above
    #[arg(long, default_value_t = 1e-6)]
    warn: f64,
    /// Fail above
    #[arg(long, default_value_t = 1e-6)]
    fail: f64,
    /// Peak of the PSNR; the largest value of the reference if not given
    #[arg(long, value_parser = parse_positive)]
    peak: Option<f64>,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Write a picture: other, reference and the error in false colour, side by side
    #[arg(long)]
    picture: Option<PathBuf>,
    /// Light of the picture: angle from the normal and azimuth, degrees; the nearest direction of the
    /// reference is taken
    #[arg(long, default_value = "30,0", value_parser = parse_angles, allow_hyphen_values = true)]
    light: Direction,
    /// View of the picture
    #[arg(long, default_value = "0,0", value_parser = parse_angles, allow_hyphen_values = true)]
    view: Direction,
    /// Error that is white in the picture, of ln(x + offset)
    #[arg(long, default_value_t = 1.0, value_parser = parse_positive)]
    white: f64,
    /// Factor of the picture's radiance
    #[arg(long, default_value_t = 1.0, value_parser = parse_positive)]
    exposure: f64,
    #[command(flatten)]
    threads: Threads,
}

/// The exit code of `compare`, which is that of idiff.
fn compare_code(result: Result<u8>) -> Result<u8> {
    match result {
        Err(ToolError::Different(what)) => {
            eprintln!("selvedge: {what}");
            Ok(3)
        }
        Err(error @ (ToolError::Io { .. } | ToolError::Foreign { .. } | ToolError::Invalid { .. })) => {
            eprintln!("selvedge: {error}");
            Ok(4)
        }
        other => other,
    }
}

fn compare(args: CompareArgs) -> Result<u8> {
    args.threads.apply();
    let limits = Limits::NONE;
    let [a, b] = [&args.reference, &args.other].map(|path| Given::open(path, args.dictionary.as_deref()));
    let (a, b) = (a?, b?);
    let (file_a, file_b) = (a.opened(&args.reference, &limits)?, b.opened(&args.other, &limits)?);
    fn source<'a>(given: &'a Given, file: &'a Option<Selvedge<'a>>) -> Source<'a> {
        match (given, file) {
            (Given::Data(data), _) => Source::Data(data),
            (_, Some(file)) => Source::File(file, 0),
            (Given::File(..), None) => unreachable!("a file is opened or refused"),
        }
    }
    let (reference, other) = (source(&a, &file_a), source(&b, &file_b));
    let (description, offset) = match (&a, &file_a) {
        (_, Some(file)) => (compare::describe(file), compare::log_offset(file)),
        (Given::Data(data), _) => (data.description().clone(), data.statistics().log_offset()),
        (Given::File(..), None) => unreachable!("a file is opened or refused"),
    };
    let progress = Progress::new();
    let metrics = compare::compare(reference, other, &description, offset, args.peak, &|done, all| {
        progress.tell("comparing", done, all)
    })?;
    progress.clear();
    if args.json {
        print_json(&metrics)?;
    } else {
        print(&text(&metrics))?;
    }
    if let Some(path) = &args.picture {
        let [light, view] = [(&description.lights, args.light), (&description.views, args.view)]
            .map(|(set, asked)| compare::nearest(set, asked));
        let [a, b] = [reference, other].map(|source| compare::image(source, &description, light, view));
        picture::beside_error(&b?, &a?, description.size, offset, args.white as f32, args.exposure as f32)
            .save(path)?;
    }
    let value = match args.by {
        Limited::LogRms => metrics.log_rms,
        Limited::LinearRms => metrics.linear_rms,
        Limited::RelativeL2 => metrics.relative_l2,
        Limited::Largest => metrics.largest.difference as f64,
    };
    Ok(if value > args.fail || value.is_nan() {
        2
    } else if value > args.warn {
        1
    } else {
        0
    })
}

fn text(metrics: &Metrics) -> String {
    let Place { difference, texel, light, view } = metrics.largest;
    format!(
        "log RMS     {:.6}  of ln(x + {:e})\nlinear RMS  {:.6}\nrelative L2 {:.6}\nPSNR        {:.2} dB  against {}\nlargest     {difference} at texel ({}, {}), light {light}, view {view}\ndifferent   {} of {}\n",
        metrics.log_rms,
        metrics.log_offset,
        metrics.linear_rms,
        metrics.relative_l2,
        metrics.psnr_db,
        metrics.peak,
        texel[0],
        texel[1],
        metrics.different,
        metrics.count
    )
}

fn parse_channels(text: &str) -> std::result::Result<[Keep; 3], String> {
    let keep = |word: &str| match word.trim() {
        "texture" => Ok(Keep::Texture),
        "mean" => Ok(Keep::Mean),
        "nothing" => Ok(Keep::Nothing),
        _ => Err("texture, mean or nothing for each channel, as texture,mean,mean".to_owned()),
    };
    let parts: Vec<Keep> = text.split(',').map(keep).collect::<std::result::Result<_, _>>()?;
    parts.try_into().map_err(|_| "three words, as texture,mean,mean".to_owned())
}

#[derive(Args)]
pub struct TrimArgs {
    #[command(flatten)]
    source: FileSource,
    /// The file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Keep this many quality layers
    #[arg(long)]
    layers: Option<u32>,
    /// Keep this many levels of detail, from the finest on
    #[arg(long)]
    levels: Option<u32>,
    /// What to keep of each channel, as texture,mean,mean
    #[arg(long, value_parser = parse_channels)]
    channels: Option<[Keep; 3]>,
    /// Drop dictionaries, atoms and columns that nothing uses
    #[arg(long)]
    unused: bool,
    /// Keep lights up to this angle from the normal, and if given between two azimuths: 60 or 60,350,10
    #[arg(long, value_parser = parse_sector)]
    lights: Option<Sector>,
    /// Keep views, likewise
    #[arg(long, value_parser = parse_sector)]
    views: Option<Sector>,
    /// Let a file whose triangles are not those of this tool be triangulated anew, which changes results
    /// between directions
    #[arg(long)]
    retriangulate: bool,
}

fn parse_sector(text: &str) -> std::result::Result<Sector, String> {
    let parts: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let sector = match parts.as_deref() {
        Some(&[polar]) => Sector::new(polar, None),
        Some(&[polar, from, to]) => Sector::new(polar, Some([from, to])),
        _ => return Err("an angle, or an angle and two azimuths, as 60,350,10".into()),
    };
    sector.map_err(|error| error.to_string())
}

fn warn_of_triangles(path: &Path, file: &Selvedge<'_>) {
    if !read::same_triangles(file) {
        eprintln!(
            "warning: {}: its directions are triangulated in another way than this tool does it; decoded bits between them may change",
            path.display()
        );
    }
}

fn trim_file(args: TrimArgs) -> Result<u8> {
    let model = super::with_material(&args.source, |file| {
        // 10.8-3: what is left has the results of the original.
        if !args.retriangulate && !read::same_triangles(&file) {
            let why = "its directions are triangulated in another way than this tool does it, so results between them would change";
            return Err(ToolError::Usage(format!(
                "{}: {why}; --retriangulate allows it",
                args.source.file.display()
            )));
        }
        read::model_of(&file).map_err(super::invalid(&args.source))
    })?;
    let channels = args.channels.unwrap_or(Trim::default().channels);
    let options = Trim {
        layers: args.layers,
        levels: args.levels,
        channels,
        unused: args.unused,
        lights: args.lights,
        views: args.views,
    };
    let trimmed = trim(&model, &options)?;
    files::write(&args.output, &write::write_material(&trimmed))?;
    Ok(0)
}

#[derive(Args)]
pub struct BlendArgs {
    /// The material at 0
    a: PathBuf,
    /// The material at 1
    b: PathBuf,
    /// The file to write
    #[arg(short, long)]
    output: PathBuf,
    /// Where between them, 0 to 1
    #[arg(long, default_value_t = 0.5)]
    alpha: f64,
    /// External dictionary of both
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Put both side by side instead of changing a basis: nothing is lost, a sample costs both
    #[arg(long)]
    exact: bool,
    /// Most coefficients of a block; those of both together if not given
    #[arg(long)]
    most: Option<u32>,
    /// Blend textures under scales that differ
    #[arg(long)]
    scales_apart: bool,
}

fn blend_files(args: BlendArgs) -> Result<u8> {
    let dictionary = args.dictionary.as_deref().map(files::read).transpose()?;
    let open = |path: &Path| -> Result<_> {
        let bytes = files::read(path)?;
        let file = selvedge::open_with(&bytes, dictionary.as_deref(), &Limits::NONE);
        let file = file.map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding })?;
        warn_of_triangles(path, &file);
        read::model_of(&file).map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding })
    };
    let options =
        Blend { exact: args.exact, most: args.most, scales_apart: args.scales_apart, ..Blend::default() };
    let (model, report) = blend(&open(&args.a)?, &open(&args.b)?, args.alpha, options)?;
    if report.outside > 0.0 && report.energy > 0.0 {
        eprintln!(
            "{:.4} % of the energy was outside of the span of the dictionaries",
            100.0 * report.outside / report.energy
        );
    }
    files::write(&args.output, &write::write_material(&model))?;
    Ok(0)
}

/// Runs a command.
pub fn run(command: Material) -> Result<u8> {
    match command {
        Material::Synth(args) => synthesise(args),
        Material::Export(args) => export(args),
        Material::Train(args) => train_dictionary(args),
        Material::Encode(args) => encoding::encode(&args),
        Material::Compare(args) => compare_code(compare(args)),
        Material::Trim(args) => trim_file(args),
        Material::Blend(args) => blend_files(args),
    }
}
