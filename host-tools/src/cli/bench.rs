//! `bench`: how fast files are sampled.

use super::common::{LimitArgs, Threads, print, print_json};
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::speed::{self, Adapter, Rate, Speed};
use crate::report::Operations;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Arguments {
    /// Files to measure
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// External dictionary of the files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    threads: Threads,
}

/// The report of a file.
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

/// Measures.
pub fn run(args: Arguments) -> Result<u8> {
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
