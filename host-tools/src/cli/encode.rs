//! `encode`: a dataset becomes a file for a goal, by one method or the best of all.

use super::common::{Threads, print_json};
use super::parse;
use crate::data::dataset::Dataset;
use crate::data::pyramid;
use crate::data::transfer::Domain;
use crate::encode::ENCODERS;
use crate::encode::auto::{self, Preference};
use crate::encode::encoder::{Common, Encoded, Encoder, Levels, Settings, encode};
use crate::encode::goal::{Goal, domain_name};
use crate::encode::parse::{positive, three};
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::compare::Metrics;
use crate::progress::Progress;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches, ValueEnum};
use std::path::PathBuf;

/// The name that stands for all methods.
const AUTO: &str = "auto";

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum DomainName {
    /// ln(x + a thousandth of the mean)
    Log,
    /// Linear radiance
    Linear,
}

impl From<DomainName> for Domain {
    fn from(name: DomainName) -> Domain {
        if name == DomainName::Log { Domain::Log } else { Domain::Linear }
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Prefer {
    /// Fewest bytes
    Bytes,
    /// Least error, of --domain
    Error,
    /// Fewest stated operations of a sample
    Operations,
}

/// Options that no method owns.
#[derive(Args)]
struct Shared {
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
    /// Error domain of --rmse
    #[arg(long, value_enum, default_value = "log")]
    domain: DomainName,
    /// Encoding method
    #[arg(long, value_parser = methods(), default_value = ENCODERS[0].method())]
    method: String,
    /// Objective of --method auto among files that reach the goal; error if the goal is a size, bytes if it
    /// is an error
    #[arg(long, value_enum)]
    prefer: Option<Prefer>,
    /// Budget: operations of a filtered sample that the file may state
    #[arg(long)]
    operations: Option<u32>,
    /// Domain that is encoded; log if not given, both with --method auto
    #[arg(long, value_enum)]
    transfer: Option<DomainName>,
    /// Offset of the logarithm; a thousandth of the mean if not given
    #[arg(long, value_parser = positive)]
    offset: Option<f64>,
    /// Bits of a value in each channel; chosen if not given
    #[arg(long, value_parser = three::<u32>)]
    value_bits: Option<[u32; 3]>,
    /// Quality layers, 1 to 8
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=8))]
    layers: u16,
    /// Levels of detail, 1 to 15
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=15))]
    levels: u16,
    /// Report what was reached, as JSON, to stdout
    #[arg(long)]
    json: bool,
    /// Report how long each step took
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Names of the methods and of the choice between them.
fn methods() -> PossibleValuesParser {
    let of = |encoder: &&dyn Encoder| PossibleValue::new(encoder.method()).help(encoder.about());
    let auto = PossibleValue::new(AUTO).help("All of them, in both domains; writes the best by --prefer");
    PossibleValuesParser::new(ENCODERS.iter().map(of).chain([auto]))
}

/// Options of the command: shared ones, and those of each method under its own heading.
pub struct Arguments {
    shared: Shared,
    matches: ArgMatches,
}

impl Args for Arguments {
    fn augment_args(command: Command) -> Command {
        ENCODERS.iter().fold(Shared::augment_args(command), |command, encoder| encoder.arguments(command))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Arguments::augment_args(command)
    }
}

impl FromArgMatches for Arguments {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Arguments, clap::Error> {
        Ok(Arguments { shared: Shared::from_arg_matches(matches)?, matches: matches.clone() })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Arguments::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Arguments {
    fn goal(&self) -> Goal {
        match (self.shared.rmse, self.shared.psnr, self.shared.size) {
            (Some(rms), ..) => Goal::Error(self.shared.domain.into(), rms),
            (_, Some(db), _) => Goal::Psnr(db),
            (_, _, Some(bytes)) => Goal::Bytes(bytes),
            _ => Goal::AsGiven,
        }
    }

    /// Options for each domain that is coded.
    fn commons(&self) -> Vec<Common> {
        let shared = &self.shared;
        let transfers = match shared.transfer {
            Some(one) => vec![one.into()],
            None if shared.method == AUTO => vec![Domain::Log, Domain::Linear],
            None => vec![Domain::Log],
        };
        let common = |transfer| Common {
            transfer,
            offset: shared.offset,
            operations: shared.operations,
            layers: shared.layers.into(),
            value_bits: shared.value_bits,
        };
        transfers.into_iter().map(common).collect()
    }

    fn preference(&self) -> Preference {
        match (self.shared.prefer, self.shared.size) {
            (Some(Prefer::Bytes), _) | (None, None) => Preference::Bytes,
            (Some(Prefer::Operations), _) => Preference::Operations,
            (Some(Prefer::Error), _) | (None, Some(_)) => Preference::Error(self.shared.domain.into()),
        }
    }

    /// Refuses options of methods that are not asked for.
    fn check_owners(&self) -> Result<()> {
        let method = self.shared.method.as_str();
        if method != AUTO && self.shared.prefer.is_some() {
            return Err(ToolError::Usage(format!("--prefer is of --method {AUTO}")));
        }
        for encoder in ENCODERS.iter().filter(|encoder| ![AUTO, encoder.method()].contains(&method)) {
            let own = encoder.arguments(Command::new("own"));
            let is_given = |id: &str| self.matches.value_source(id) == Some(ValueSource::CommandLine);
            if let Some(argument) = own.get_arguments().find(|argument| is_given(argument.get_id().as_str()))
            {
                let name = argument.get_long().unwrap_or_default();
                return Err(ToolError::Usage(format!("--{name} is of --method {}", encoder.method())));
            }
        }
        Ok(())
    }
}

/// The report of a file, for machines.
#[derive(serde::Serialize)]
struct Report<'a> {
    method: &'static str,
    transfer: &'static str,
    bytes: usize,
    ratio_to_binary16: f64,
    operations: u32,
    predicted_rms: f64,
    metrics: Metrics,
    #[serde(flatten)]
    settings: &'a Settings,
    /// What was tried beside it, with the method auto.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tried: Vec<Report<'a>>,
}

fn report<'a>(encoded: &'a Encoded, data: &Dataset) -> Report<'a> {
    Report {
        method: encoded.method,
        transfer: domain_name(encoded.transfer),
        bytes: encoded.bytes.len(),
        ratio_to_binary16: data.description().half_bytes() as f64 / encoded.bytes.len() as f64,
        operations: encoded.operations,
        predicted_rms: encoded.predicted_rms,
        metrics: encoded.metrics,
        settings: &encoded.settings,
        tried: Vec::new(),
    }
}

/// The encoders that are asked for, with their options; refuses options that do not go together.
fn encoders(args: &Arguments) -> Result<Vec<Box<dyn Encoder>>> {
    args.check_owners()?;
    let method = args.shared.method.as_str();
    let asked = ENCODERS.iter().filter(|encoder| [AUTO, encoder.method()].contains(&method));
    let asked = asked.map(|encoder| encoder.configured(&args.matches)).collect::<Result<Vec<_>>>()?;
    for common in args.commons() {
        if method == AUTO {
            let all: Vec<&dyn Encoder> = asked.iter().map(AsRef::as_ref).collect();
            auto::check(&all, args.goal(), &common)?;
        } else {
            asked.iter().try_for_each(|encoder| encoder.check(args.goal(), &common))?;
        }
    }
    Ok(asked)
}

/// Encodes, verifies and writes.
///
/// # Errors
/// If options do not go together, data cannot be read, or the goal cannot be reached.
pub fn run(args: &Arguments) -> Result<u8> {
    let shared = &args.shared;
    let encoders = encoders(args)?;
    shared.threads.apply();
    let data = Dataset::open(&shared.dataset)?;
    let beside = files::folder_of(&shared.output);
    let temporary =
        tempfile::Builder::new().prefix(".selvedge-").tempdir_in(beside).map_err(ToolError::io(beside))?;
    let progress = Progress::new();
    let coarser = pyramid::levels(&data, shared.levels as usize, temporary.path())?;
    progress.report("coarser levels", 1, 1);
    let levels = Levels { finest: &data, coarser: &coarser };
    let (goal, commons) = (args.goal(), args.commons());
    let all = match encoders.as_slice() {
        [one] if shared.method != AUTO => vec![encode(one.as_ref(), &levels, goal, &commons[0], &progress)?],
        all => {
            let all: Vec<&dyn Encoder> = all.iter().map(AsRef::as_ref).collect();
            auto::encode(&all, &levels, goal, &commons, args.preference(), &progress)?
        }
    };
    progress.clear();
    if shared.times {
        eprintln!("{}", progress.times("the rest"));
    }
    let [best, tried @ ..] = all.as_slice() else {
        return Err(ToolError::Mismatch("an encoder gave no file".into()));
    };
    files::write(&shared.output, &best.bytes)?;
    tried.iter().for_each(|other| eprintln!("tried {}", other.line()));
    if !tried.is_empty() {
        eprintln!("wrote {}", best.line());
    }
    if shared.json {
        let tried = tried.iter().map(|other| report(other, &data)).collect();
        print_json(&Report { tried, ..report(best, &data) })?;
    }
    Ok(0)
}
