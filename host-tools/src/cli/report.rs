//! `report`: error against run time, as tables, plots, pictures and a page.

use super::common::Threads;
use crate::error::{Result, ToolError};
use crate::measure::speed::Adapter;
use crate::report::page::{Page, write_stability};
use crate::report::stability;
use crate::report::{Request, Store, sweep};
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Arguments {
    /// Datasets
    #[arg(required_unless_present = "stability")]
    datasets: Vec<PathBuf>,
    /// Also measure numerical stability; only that if no dataset is given
    #[arg(long)]
    stability: bool,
    /// Folder of the results; an interrupted run is resumed
    #[arg(long)]
    out: PathBuf,
    /// Compression ratios of the sweep: bytes of the data in binary16 over bytes of the file
    #[arg(long, value_delimiter = ',', value_parser = parse_ratio)]
    #[arg(default_values_t = Request::default().ratios)]
    ratios: Vec<f64>,
    /// Rank of the decompositions
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=2048))]
    #[arg(default_value_t = Request::default().rank as u16)]
    rank: u16,
    /// Only methods whose names contain one of these, as "linear" or "tensor,PCA"
    #[arg(long, value_delimiter = ',')]
    methods: Vec<String>,
    /// Skip held-out directions, for which each method is encoded once more
    #[arg(long)]
    no_held_out: bool,
    /// Evaluate every N-th light (default: chosen for speed; 1 = all)
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    every: Option<u16>,
    /// Log nothing
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

/// Measures and writes the page.
pub fn run(args: Arguments) -> Result<u8> {
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
