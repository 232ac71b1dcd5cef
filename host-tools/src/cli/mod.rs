//! The program `selvedge`: data to stdout, the rest to stderr; silent where a check succeeds.
//!
//! Exit codes: 0 good, 1 bad usage, 2 I/O, 3 invalid file, 4 over limits, 5 unsupported. One file a command,
//! with its options and what it does with them.

#[cfg(feature = "report")]
mod bench;
mod blend;
mod common;
mod compare;
mod conform;
mod decode;
#[cfg(feature = "import")]
mod demo;
mod encode;
#[cfg(feature = "import")]
mod exchange;
mod explain;
#[cfg(feature = "import")]
mod export;
#[cfg(feature = "import")]
mod import;
mod info;
mod kernel;
#[cfg(not(all(feature = "import", feature = "report")))]
mod lacking;
mod parse;
#[cfg(feature = "report")]
mod report;
mod synth;
mod train;
mod trim;
mod validate;

#[cfg(not(feature = "report"))]
use lacking::{bench, report};
#[cfg(not(feature = "import"))]
use lacking::{demo, export, import};

use crate::error::{Result, ToolError};
use crate::format::draft;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Compressed measured materials (BTFs): import, train, encode, validate, decode, measure.
#[derive(Parser)]
#[command(
    version,
    after_help = "Exit codes: 0 success, 1 usage, 2 I/O, 3 invalid file, 4 over limits, 5 unsupported."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const COMPARE_CODES: &str =
    "Exit codes: 0 within the limits, 1 beyond --warn, 2 beyond --fail, 3 other sizes, 4 unreadable.";

#[derive(Subcommand)]
enum Command {
    /// Run everything on built-in data: model, train, encode, import, validate, decode on CPU and GPU, and
    /// show it on a page
    Demo(demo::Arguments),
    /// Convert a .btf, or images in a folder or a zip, to a dataset; or published SparseBTF coefficients to a
    /// file, without re-encoding
    Import(import::Arguments),
    /// Render a BTF of a modelled mesostructure into a dataset
    Synth(synth::Arguments),
    /// Write a dataset or a decoded file in a third-party format: a folder of EXR or PNG, a zip as UBO2003, a
    /// .btf
    Export(export::Arguments),
    /// Train a dictionary ensemble that generalises to other materials
    Train(train::Arguments),
    /// Encode a dataset to a goal: an error, a size or a number of coefficients
    Encode(Box<encode::Arguments>),
    /// Compare two materials; exit codes as idiff: 0 same, 1 warning, 2 failure, 3 other sizes, 4 unreadable
    #[command(after_help = COMPARE_CODES)]
    Compare(compare::Arguments),
    /// Remove parts that a scene does not need; the rest decodes to the same bits
    Trim(trim::Arguments),
    /// Blend two materials in coefficient space
    Blend(blend::Arguments),
    /// Benchmark sampling of files: on one core and on all, random and coherent queries, the kernel
    Bench(bench::Arguments),
    /// Measure error against run time of all methods and baselines on datasets: tables, plots, pictures and a
    /// page
    Report(report::Arguments),
    /// Describe a file, a dataset or third-party data
    Info(info::Arguments),
    /// Validate files against the specification and warn about wasteful content; silent when good
    Validate(validate::Arguments),
    /// Explain a sample: which parts of the file contribute to it, and how much
    Explain(explain::Arguments),
    /// Run the conformance suite against this decoder or an external program (stdin/stdout)
    Conform(conform::Arguments),
    /// Decode the image for one light and one view to a .png or .exr
    Decode(decode::Arguments),
    /// Write the decoder's kernel as WGSL, SPIR-V, MSL, HLSL and GLSL, with its bindings
    Kernel(kernel::Arguments),
}

fn run(cli: Cli) -> Result<u8> {
    match cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Import(args) => import::run(args),
        Command::Synth(args) => synth::run(args),
        Command::Export(args) => export::run(args),
        Command::Train(args) => train::run(args),
        Command::Encode(args) => encode::run(&args),
        Command::Compare(args) => compare::run(args),
        Command::Trim(args) => trim::run(args),
        Command::Blend(args) => blend::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Report(args) => report::run(args),
        Command::Info(args) => info::run(args),
        Command::Validate(args) => validate::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Conform(args) => conform::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Kernel(args) => kernel::run(args),
    }
}

/// Whether a command line can be parsed; nothing is run. For tests that try many.
///
/// # Errors
/// The parser's message.
pub fn understands(arguments: &[String]) -> std::result::Result<(), String> {
    Cli::try_parse_from(std::iter::once("selvedge").chain(arguments.iter().map(String::as_str)))
        .map(drop)
        .map_err(|error| error.to_string())
}

/// The program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 1 } else { 0 });
        }
    };
    match run(cli) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            // Names inside third-party files may hold control sequences of a terminal.
            let words: String =
                error
                    .to_string()
                    .chars()
                    .map(|c| {
                        if c != '\n' && selvedge::container::metadata::is_invisible(c) {
                            '\u{fffd}'
                        } else {
                            c
                        }
                    })
                    .collect();
            eprintln!("selvedge: {words}");
            if let ToolError::Invalid { finding, .. } = &error
                && draft::may_be_of_a_draft(finding.rule)
            {
                eprintln!("selvedge: {}", draft::note());
            }
            ExitCode::from(error.exit_code())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::ENCODERS;
    use clap::CommandFactory as _;

    /// Options of methods stand under headings of their own, and none has the name of another's.
    #[test]
    fn options_go_together() {
        Cli::command().debug_assert();
        let mut headings: Vec<String> = Vec::new();
        for encoder in ENCODERS {
            let command = encoder.arguments(clap::Command::new("own"));
            let of = |argument: &clap::Arg| argument.get_help_heading().unwrap_or_default().to_owned();
            let mut own: Vec<String> = command.get_arguments().map(of).collect();
            own.dedup();
            assert!(own.len() == 1 && !own[0].is_empty(), "{}: {own:?}", encoder.method());
            headings.extend(own);
        }
        headings.sort();
        headings.dedup();
        assert_eq!(headings.len(), ENCODERS.len());
    }

    #[test]
    fn options_of_a_method_are_refused_with_another() {
        let code = |arguments: &[&str]| {
            let fixed = ["selvedge", "encode", "no-such-dataset", "-o", "x"];
            let cli = Cli::try_parse_from([&fixed, arguments].concat()).expect("parsed");
            run(cli).expect_err("there is no such dataset").exit_code()
        };
        let refused: [&[&str]; 10] = [
            &[],
            &["--size", "1k", "--rank", "9"],
            &["--size", "1k", "--shape", "1,2,3,4"],
            &["--size", "1k", "--prefer", "bytes"],
            &["--size", "1k", "--method", "auto", "--edge", "4"],
            &["--size", "1k", "--method", "auto", "--layers", "2"],
            &["--coefficients", "9", "--method", "auto"],
            &["--size", "1k", "--method", "sparse-tensor", "--operations", "9"],
            &["--size", "1k", "--method", "sparse-tensor", "--edge", "4"],
            &["--rmse", "1", "--domain", "linear", "--method", "sparse-tensor"],
        ];
        assert!(refused.iter().all(|arguments| code(arguments) == 1), "refused before data are read");
        let taken: [&[&str]; 4] = [
            &["--size", "1k", "--method", "auto", "--rank", "9", "--operations", "9"],
            &["--rmse", "1", "--domain", "linear", "--method", "auto"],
            &["--shape", "1,2,3,4", "--method", "sparse-tensor"],
            &["--coefficients", "9"],
        ];
        assert!(
            taken.iter().all(|arguments| code(arguments) == 2),
            "as far as the data, which are not there"
        );
    }
}
