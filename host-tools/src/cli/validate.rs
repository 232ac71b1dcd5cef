//! `validate`: files against every rule of the specification.

use super::common::{LimitArgs, print, print_json};
use crate::check::validate;
use crate::error::Result;
use crate::files;
use clap::Args;
use std::path::{Path, PathBuf};

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    /// Files, folders of .selv files, or - for standard input
    #[arg(required_unless_present_any = ["rules", "schema"])]
    files: Vec<PathBuf>,
    /// External dictionary of the files
    #[arg(long)]
    dictionary: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
    /// Format of the findings
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    /// Treat warnings as errors
    #[arg(long)]
    warnings_as_errors: bool,
    /// Override the severity of a rule or warning (off, note, warning, error), as W1=off or 3.2-5=warning
    #[arg(long = "severity", value_name = "RULE=SEVERITY", value_parser = parse_severity)]
    severities: Vec<(String, validate::Severity)>,
    /// List all rules and warnings, and exit
    #[arg(long)]
    rules: bool,
    /// Print the JSON schema of --format json, and exit
    #[arg(long)]
    schema: bool,
}

/// Format of the findings.
#[derive(Clone, Copy, clap::ValueEnum, PartialEq)]
enum Format {
    /// One line per finding
    Text,
    /// JSON by the published schema
    Json,
    /// SARIF 2.1.0, for code hosts and editors
    Sarif,
}

fn parse_severity(text: &str) -> std::result::Result<(String, validate::Severity), String> {
    let (rule, severity) = text.split_once('=').ok_or("a rule and a severity, as W1=off")?;
    Ok((rule.into(), severity.parse()?))
}

/// Validates, or lists what is checked.
pub fn run(args: Arguments) -> Result<u8> {
    if args.rules {
        return list_rules();
    }
    if args.schema {
        return print(&validate::schema()).map(|()| 0);
    }
    let options = validate::Options {
        limits: args.limits.limits(),
        warnings_as_errors: args.warnings_as_errors,
        severities: args.severities.into_iter().collect(),
    };
    let format = if args.json { Format::Json } else { args.format };
    check_files(&args.files, args.dictionary.as_deref(), &options, format)
}

/// Reports the findings of each file; the exit code is that of the first file that fails.
fn check_files(
    paths: &[PathBuf],
    dictionary: Option<&Path>,
    options: &validate::Options,
    format: Format,
) -> Result<u8> {
    options.check()?;
    let dictionary = dictionary.map(files::read).transpose()?;
    let mut reports = Vec::new();
    let mut code = 0;
    let paths = validate::files_of(paths)?;
    validate::validate_files(&paths, dictionary.as_deref(), options, &mut |report| {
        code = if code == 0 { report.exit_code } else { code };
        if let Some(why) = &report.unreadable {
            eprintln!("selvedge: {why}");
        }
        if format == Format::Text {
            return print(&validate::text(&report));
        }
        reports.push(report);
        Ok(())
    })?;
    match format {
        Format::Text => {}
        Format::Json => print_json(&validate::Reports {
            format: "selvedge-validation-1",
            version: env!("CARGO_PKG_VERSION"),
            files: reports,
        })?,
        Format::Sarif => print_json(&validate::sarif(&reports))?,
    }
    Ok(code)
}

/// Prints every rule and piece of advice: number, name, default severity, what it asks for.
fn list_rules() -> Result<u8> {
    let rules = selvedge::Rule::ALL
        .iter()
        .map(|rule| format!("{}\t{}\terror\t{}\n", rule.id(), rule.name(), rule.title()));
    let advice = validate::ADVICE
        .iter()
        .map(|advice| format!("{}\t{}\twarning\t{}\n", advice.id, advice.name, advice.expected));
    print(&rules.chain(advice).collect::<String>())?;
    Ok(0)
}
