//! Prints how a dataset compresses: Selvedge files beside the baselines, and where their bytes go.
//!
//! `layout DATASET RATIO...`, for instance `layout cloth.selvset 4000 2800 2000 1000 500`. A budget is the
//! bytes of the values in binary16 over a ratio. The tables are Markdown on standard output; what is done is
//! told on standard error.

use selvedge::Limits;
use selvedge::container::directory;
use selvedge::method::sparse_ensemble::check;
use selvedge::method::sparse_ensemble::check::LOW_BITS_LIMIT;
use selvedge::method::sparse_ensemble::{LOW_BITS_BITS, SHIFT_BITS};
use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::data::transfer::Domain;
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::format::model::TransferModel;
use selvedge_tools::measure::baseline::pca::{Choice, components};
use selvedge_tools::measure::baseline::published::Published;
use selvedge_tools::measure::compare::{Metrics, compare};
use selvedge_tools::measure::radiance::AtLevel;
use selvedge_tools::methods::sparse_ensemble::encode::{Criterion, Encoded, Options, encode, prepare};
use selvedge_tools::methods::sparse_ensemble::model::ensembles;
use std::path::Path;

/// Edges of blocks that are tried.
const EDGES: [usize; 4] = [10, 8, 4, 2];
/// Most principal components.
const RANK: usize = 192;
/// The published layout is searched up to the largest budget times this.
const REACH: u64 = 24;

/// A file of ours for one budget.
struct Ours {
    budget: u64,
    edge: usize,
    encoded: Encoded,
    metrics: Metrics,
    operations: u32,
    /// Bytes of each kind of section.
    sections: [usize; 8],
}

/// Kinds of sections in the order of the tables.
const KINDS: [u32; 8] = [
    directory::METADATA,
    directory::DIRECTIONS,
    directory::MEANS,
    directory::SCALES,
    check::ANGULAR,
    check::SPATIAL,
    check::ATOMS,
    check::COEFFICIENTS,
];

/// Bits of the sections of coefficients: their heads and first bits of records, record heads, positions,
/// values.
fn coefficient_bits(encoded: &Encoded) -> [u64; 4] {
    let bits_for = |n: u32| 32 - n.leading_zeros();
    let mut bits = [0u64; 4];
    for ensemble in ensembles(&encoded.model) {
        for coefficients in ensemble.coefficients.iter().flatten() {
            let largest =
                coefficients.records.iter().map(|record| record.coefficients.len() as u32).max().unwrap_or(0);
            let head = bits_for(ensemble.dictionaries.len() as u32 - 1)
                + bits_for(largest).max(1)
                + SHIFT_BITS
                + LOW_BITS_BITS;
            bits[0] += 4 * 32;
            for record in &coefficients.records {
                let (count, last) =
                    (record.coefficients.len() as u32, record.coefficients.last().map_or(0, |c| c.0));
                bits[0] += 32;
                bits[1] += head as u64;
                if count > 0 {
                    // Low bits of each, and a one after as many zeros as the high part grows.
                    bits[2] += (0..=LOW_BITS_LIMIT)
                        .map(|low| (count * low + count + (last >> low)) as u64)
                        .min()
                        .unwrap_or(0);
                    bits[3] += (count * coefficients.value_bits) as u64;
                }
            }
        }
    }
    bits
}

fn ours(dataset: &Dataset, budgets: &[u64]) -> Result<Vec<Ours>> {
    let log_offset = dataset.statistics().log_offset();
    let prepared = prepare(vec![dataset], TransferModel::Log2 { offset: log_offset }, &|_, _| ())?;
    let mut all = Vec::new();
    for &budget in budgets {
        for edge in EDGES {
            // Ours: everything that a file is made with is set here.
            let ensembles = prepared.own_ensembles(edge);
            let options = Options { edge, criterion: Criterion::Bytes(budget), ..Options::default() };
            let encoded = match encode(&prepared, &ensembles, &options, &|_, _| ()) {
                Ok(encoded) => encoded,
                Err(error @ ToolError::Unreachable { .. }) => {
                    eprintln!("{budget} bytes, edge {edge}: {error}");
                    continue;
                }
                Err(error) => return Err(error),
            };
            let file = selvedge::open(&encoded.bytes, &Limits::NONE)
                .map_err(|finding| ToolError::Mismatch(format!("a file just written: {finding}")))?;
            let metrics = compare(
                dataset,
                &AtLevel::finest(&file),
                dataset.description(),
                log_offset,
                None,
                &|_, _| (),
            )?;
            let mut sections = [0; 8];
            for section in file.sections() {
                let kind = KINDS.iter().position(|&kind| kind == section.kind & 0x7fff);
                sections[kind.unwrap_or(0)] += section.length as usize;
            }
            let operations = file.header().operations;
            eprintln!(
                "{budget} bytes, edge {edge}: {} bytes, log {:.4}, linear {:.5}",
                encoded.bytes.len(),
                metrics.log_rms,
                metrics.linear_rms
            );
            all.push(Ours { budget, edge, encoded, metrics, operations, sections });
        }
    }
    Ok(all)
}

fn print_ours(all: &[Ours], whole: u64) {
    println!("\n### Ours: the material's own bases, one dictionary a channel, one threshold\n");
    println!("| 1/ratio | edge | bytes | log RMS | linear RMS | operations | coefficients |");
    println!("|---:|---:|---:|---:|---:|---:|---:|");
    for o in all {
        let [c0, c1, c2] = o.encoded.coefficients;
        let (m, bytes) = (&o.metrics, o.encoded.bytes.len());
        println!(
            "| {} | {} | {bytes} | {:.4} | {:.5} | {} | {c0} + {c1} + {c2} |",
            whole / o.budget,
            o.edge,
            m.log_rms,
            m.linear_rms,
            o.operations
        );
    }
    println!("\n### Where the bytes of our files go\n");
    println!(
        "| 1/ratio | edge | directions | means | angular | spatial | atoms | positions | values | record heads | first bits | rest |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for o in all {
        let [_, directions, means, scales, angular, spatial, atoms, coefficients] = o.sections;
        let [firsts, heads, positions, values] = coefficient_bits(&o.encoded).map(|bits| bits.div_ceil(8));
        // Streams end on a word in each channel.
        let padding = coefficients as i64 - (firsts + heads + positions + values) as i64;
        assert!(
            (-4..16).contains(&padding),
            "the coefficients have {padding} bytes beside those that were counted"
        );
        let rest = o.encoded.bytes.len()
            - directions
            - means
            - scales
            - angular
            - spatial
            - atoms
            - (firsts + heads + positions + values) as usize;
        let ratio = whole / o.budget;
        println!(
            "| {ratio} | {} | {directions} | {} | {angular} | {spatial} | {atoms} | {positions} | {values} | {heads} | {firsts} | {rest} |",
            o.edge,
            means + scales
        );
    }
}

fn run(path: &Path, ratios: &[u64]) -> Result<()> {
    let dataset = Dataset::open(path)?;
    let description = dataset.description();
    let whole = description.half_bytes();
    let budgets: Vec<u64> = ratios.iter().map(|ratio| whole / ratio).collect();
    let [width, height] = description.size;
    println!(
        "{}: {width} x {height} texels, {} lights, {} views, {whole} bytes in binary16",
        description.texts[0],
        description.lights.len(),
        description.views.len()
    );

    let all = ours(&dataset, &budgets)?;
    print_ours(&all, whole);

    let data = Published::new(&dataset)?;
    let ensembles = data.own_ensembles()?;
    let mut layout = data.layout(&ensembles, budgets.iter().max().copied().unwrap_or(whole) * REACH)?;
    eprintln!("the published layout is projected");
    let mut components = components(&dataset, Domain::Log, RANK)?;
    eprintln!("{} components are found", components.rank());

    println!("\n### Equal bytes\n");
    println!(
        "Published layout: the material's own eigenbases, {} bytes that are not counted. Ours: the edge of least log RMS.\n",
        layout.dictionary_bytes()
    );
    println!(
        "| 1/ratio | budget | ours: edge | log RMS | linear RMS | PCA: rank, bits | log RMS | linear RMS | published: coefficients | log RMS | linear RMS |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    let mut reached = Vec::new();
    for (&ratio, &budget) in ratios.iter().zip(&budgets) {
        let best = all
            .iter()
            .filter(|o| o.budget == budget)
            .min_by(|a, b| a.metrics.log_rms.total_cmp(&b.metrics.log_rms));
        let of_ours = best.map_or("| | |".into(), |o| {
            format!("{} | {:.4} | {:.5}", o.edge, o.metrics.log_rms, o.metrics.linear_rms)
        });
        let of_pca = components.best_at(budget)?.map_or("| | |".into(), |c| {
            format!("{}, {} | {:.4} | {:.5}", c.rank, c.bits, c.row.log_rms, c.row.linear_rms)
        });
        let of_published = layout.at(budget)?.map_or("| | |".into(), |(n, row)| {
            let [y, u, v] = Published::sparsity(n);
            format!("{y} + {u} + {v} | {:.4} | {:.5}", row.log_rms, row.linear_rms)
        });
        println!("| {ratio} | {budget} | {of_ours} | {of_pca} | {of_published} |");
        reached.extend(best.map(|o| (ratio, o)));
    }
    println!("\n### Equal log RMS: the bytes that reach that of ours\n");
    println!(
        "| 1/ratio | log RMS | ours | PCA | PCA / ours | rank, bits | published | published / ours | its linear RMS |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for (ratio, o) in reached {
        let (goal, bytes) = (o.metrics.log_rms, o.encoded.bytes.len());
        let of_pca = match components.reach(goal)? {
            Some(Choice { rank, bits, row }) => {
                format!("{} | {:.2} | {rank}, {bits}", row.bytes, row.bytes as f64 / bytes as f64)
            }
            None => format!("more than {} | | ", components.bytes(components.rank(), 8)),
        };
        let of_published = match layout.reach(goal)? {
            Some((_, row)) => {
                format!("{} | {:.2} | {:.5}", row.bytes, row.bytes as f64 / bytes as f64, row.linear_rms)
            }
            None => "beyond the search | | ".into(),
        };
        println!("| {ratio} | {goal:.4} | {bytes} | {of_pca} | {of_published} |");
    }
    Ok(())
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let ratios: Vec<u64> =
        arguments.iter().skip(1).filter_map(|ratio| ratio.parse().ok()).filter(|&ratio| ratio > 0).collect();
    if ratios.is_empty() || ratios.len() + 1 != arguments.len() {
        eprintln!("usage: layout DATASET RATIO...");
        std::process::exit(1);
    }
    if let Err(error) = run(Path::new(&arguments[0]), &ratios) {
        eprintln!("{error}");
        std::process::exit(error.exit_code().into());
    }
}
