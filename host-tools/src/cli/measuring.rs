//! The commands that measure: how fast a file is, and the report of error against run time.

use super::commands::Threads;
use super::{LimitArgs, print, print_json};
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::speed::{self, Adapter, Rate, Speed};
use crate::report::page::{Page, write_stability};
use crate::report::stability;
use crate::report::{Operations, Request, Store, sweep};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Commands of this module.
#[derive(Subcommand)]
pub enum Measuring {
    /// Measure how fast files are sampled: on one core and all, random and coherent, by the kernel
    Bench(BenchArgs),
    /// Error against run time: all methods and baselines on datasets, as tables, plots, pictures and a page
    Report(ReportArgs),
}

#[derive(Args)]
pub struct BenchArgs {
    /// Files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The external dictionary of the files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Args)]
pub struct ReportArgs {
    /// Datasets
    #[arg(required_unless_present = "stability")]
    datasets: Vec<PathBuf>,
    /// Measure numerical stability too, or alone if there is no dataset
    #[arg(long)]
    stability: bool,
    /// Folder of the results; a run that was stopped goes on from what is there
    #[arg(long)]
    out: PathBuf,
    /// Sizes of the sweep, as ratios of the data in binary16 to the file
    #[arg(long, value_delimiter = ',', default_values_t = Request::default().ratios, value_parser = parse_ratio)]
    ratios: Vec<f64>,
    /// Components that decompositions are made with
    #[arg(long, default_value_t = Request::default().rank as u16, value_parser = clap::value_parser!(u16).range(1..=2048))]
    rank: u16,
    /// Only methods whose names contain one of these, as "linear" or "tensor,PCA"
    #[arg(long, value_delimiter = ',')]
    methods: Vec<String>,
    /// Do not measure at held out directions, which encodes each method once more
    #[arg(long)]
    no_held_out: bool,
    /// Take errors at every so many-th light of each view; as many as are quick if not given, 1 for all
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    every: Option<u16>,
    /// Say nothing
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    threads: Threads,
}

fn parse_ratio(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|ratio: &f64| (1.0..=1e9).contains(ratio))
        .ok_or_else(|| "a ratio from 1 to 1e9".to_owned())
}

/// What is told of a file.
#[derive(serde::Serialize)]
struct Measured {
    file: PathBuf,
    bytes: usize,
    open_seconds: f64,
    operations: Operations,
    speed: Speed,
    adapter: String,
    cores: usize,
}

/// Runs a command.
///
/// # Errors
/// Of the command.
pub fn run(command: Measuring) -> Result<u8> {
    match command {
        Measuring::Bench(args) => bench(&args),
        Measuring::Report(args) => make_report(args),
    }
}

fn bench(args: &BenchArgs) -> Result<u8> {
    args.threads.apply();
    let adapter = Adapter::any();
    let dictionary = args.dictionary.as_deref().map(files::read).transpose()?;
    let mut all = Vec::new();
    for path in &args.files {
        let bytes = files::read(path)?;
        let file = selvedge::open_with(&bytes, dictionary.as_deref(), &args.limits.limits());
        let file = file.map_err(|finding| ToolError::Invalid { path: path.clone(), finding })?;
        all.push(Measured {
            file: path.clone(),
            bytes: bytes.len(),
            open_seconds: speed::open_seconds(&bytes, dictionary.as_deref()),
            operations: Operations::of_file(&file),
            speed: speed::of_file(&file, &adapter),
            adapter: adapter.name.clone(),
            cores: rayon::current_num_threads(),
        });
    }
    if args.json {
        print_json(&all)?;
        return Ok(0);
    }
    let row = |name: &str, rate: &Rate| {
        format!(
            "  {name:24} {:9.3} M/s  ({:.3} to {:.3}; {:.3} of the reference)\n",
            rate.median / 1e6,
            rate.least / 1e6,
            rate.most / 1e6,
            rate.to_reference
        )
    };
    let mut text = String::new();
    for m in &all {
        let s = &m.speed;
        text +=
            &format!("{}: {} bytes, opened in {:.3} ms\n", m.file.display(), m.bytes, m.open_seconds * 1e3);
        text += &format!(
            "  operations a filtered sample: mean {:.0}, largest met {}, stated {}\n",
            m.operations.mean,
            m.operations.largest,
            m.operations.stated.unwrap_or(0)
        );
        text += &row("random, one core", &s.random);
        text += &row("coherent, one core", &s.coherent);
        text += &row("one by one, one core", &s.single);
        text += &row(&format!("random, {} cores", m.cores), &s.random_all);
        text += &row(&format!("coherent, {} cores", m.cores), &s.coherent_all);
        match &s.kernel {
            Some(rate) => text += &row("kernel, random", rate),
            None => text += &format!("  kernel                   not measured: {}\n", m.adapter),
        }
    }
    print(&text)?;
    Ok(0)
}

fn make_report(args: ReportArgs) -> Result<u8> {
    args.threads.apply();
    let request = Request {
        datasets: args.datasets,
        out: args.out,
        ratios: args.ratios,
        rank: args.rank as usize,
        held_out: !args.no_held_out,
        methods: args.methods,
        every: args.every.map(usize::from),
    };
    let files = request.out.join("files");
    std::fs::create_dir_all(&files).map_err(ToolError::io(&files))?;
    let adapter = Adapter::any();
    let mut lines = Store::open(request.out.join("measured.jsonl"))?;
    let mut held = Store::open(request.out.join("held-out.jsonl"))?;
    let say = sweep::teller(args.quiet);
    let mut asked = sweep::Asked::new();
    for path in &request.datasets {
        asked.extend(sweep::measure(&request, path, &adapter, &mut lines, &mut held, &say)?);
    }
    // Lines of other requests stay in the store, but not on this page.
    lines.lines.retain(|line| asked.contains(&line.key));
    held.lines.retain(|line| asked.contains(&line.key));
    let broken = if args.stability { stability_page(&request.out, &say)? } else { 0 };
    if request.datasets.is_empty() {
        return answer(broken);
    }
    Page {
        lines: &lines.lines,
        held_out: &held.lines,
        adapter: &adapter.name,
        cores: rayon::current_num_threads(),
        stability: request.out.join("stability.html").exists(),
    }
    .write(&request.out)?;
    answer(broken)
}

/// The page of stability; how many cases are broken.
fn stability_page(out: &Path, say: &dyn Fn(&str)) -> Result<usize> {
    say("numerical stability");
    let temporary =
        tempfile::Builder::new().prefix(".selvedge-").tempdir_in(out).map_err(ToolError::io(out))?;
    let verdicts = stability::run(temporary.path(), |_, _| ());
    write_stability(&verdicts, out)?;
    let broken: Vec<_> = verdicts.iter().filter(|v| !v.holds()).collect();
    for v in &broken {
        say(&format!("{}, {}: {:?}", v.group, v.name, v.outcome));
    }
    Ok(broken.len())
}

fn answer(broken: usize) -> Result<u8> {
    if broken == 0 {
        Ok(0)
    } else {
        Err(ToolError::Mismatch(format!("{broken} cases of numerical stability exceed their bounds")))
    }
}
