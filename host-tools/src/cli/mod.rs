//! The program `selvedge`: data to stdout, the rest to stderr; silent where a check succeeds.
//!
//! Exit codes: 0 good, 1 bad usage, 2 I/O, 3 invalid file, 4 over limits, 5 unsupported.

mod commands;
mod encoding;
mod measuring;

use crate::check::conform;
use crate::check::explain;
use crate::check::info;
use crate::check::validate;
use crate::check::vectors;
use crate::error::{Result, ToolError};
use crate::files;
use crate::foreign::{self, Kind};
use crate::format::write;
use crate::gpu::kernel;
use crate::methods::sparse_ensemble::sparsebtf;
use crate::show::ball;
use crate::show::demo;
use clap::{Args, Parser, Subcommand};
use selvedge::header::CONTENT_DICTIONARY;
use selvedge::{Direction, Limits};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Compressed measured materials: import, check, decode.
#[derive(Parser)]
#[command(
    version,
    about,
    after_help = "Exit codes: 0 good, 1 bad usage, 2 I/O, 3 invalid file, 4 over limits, 5 unsupported."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The whole story on a built-in material: files, checks, pictures and a page
    Demo {
        /// Folder for the results
        #[arg(long)]
        out: PathBuf,
    },
    /// Make a dataset of a .btf or of images in a folder or a zip; or a file of SparseBTF .bin files without
    /// encoding anew
    Import {
        /// What is imported, told apart by its content: a .btf of Bonn (UBO2014); a zip (UBO2003, ATRIUM) or
        /// a folder (UTIA) with images named tlTTT plPPP tvTTT pvPPP (.exr, .png, .jpg, .hdr), or a
        /// folder with a dataset.json that lists them; or a folder with
        /// Coeffs_BTF_NAME_1e-05_{Y,U,V}.bin, DictEnsOrth4D*.bin, NAME_mean_std.bin and xyz_loc.bin
        source: PathBuf,
        /// SparseBTF: the material, if the folder has several
        #[arg(long)]
        material: Option<String>,
        /// SparseBTF: blocks along x and y, if the image is not square, as 40x30
        #[arg(long, value_parser = parse_blocks)]
        blocks: Option<[usize; 2]>,
        /// SparseBTF: bits of a quantised coefficient, 1 to 16; 10 if not given
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16))]
        value_bits: Option<u32>,
        /// The dataset (.selvset) to write, or of SparseBTF the file (.selv)
        #[arg(short, long)]
        output: PathBuf,
        /// SparseBTF: put the dictionaries into a file of their own
        #[arg(long)]
        dictionary: Option<PathBuf>,
        #[command(flatten)]
        data: commands::DataArgs,
    },
    #[command(flatten)]
    Material(commands::Material),
    #[command(flatten)]
    Measuring(measuring::Measuring),
    /// Say what a file is
    Info {
        #[command(flatten)]
        source: Source,
        /// As JSON
        #[arg(long)]
        json: bool,
    },
    /// Check files against every rule of the specification, and for what is unwise; silent when good
    Validate {
        /// Files, folders with .selv files, - for standard input
        #[arg(required_unless_present_any = ["rules", "schema"])]
        files: Vec<PathBuf>,
        /// The external dictionary of the files
        #[arg(long)]
        dictionary: Option<PathBuf>,
        #[command(flatten)]
        limits: LimitArgs,
        /// How findings are told
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
        /// The same as --format json
        #[arg(long, conflicts_with = "format")]
        json: bool,
        /// Warnings make a file fail
        #[arg(long)]
        warnings_as_errors: bool,
        /// Another severity, as W1=off or 3.2-5=warning: off, note, warning, error
        #[arg(long = "severity", value_name = "RULE=SEVERITY", value_parser = parse_severity)]
        severities: Vec<(String, validate::Severity)>,
        /// List all rules that are checked, and stop
        #[arg(long)]
        rules: bool,
        /// Print the JSON schema of --format json, and stop
        #[arg(long)]
        schema: bool,
    },
    /// Say which block, dictionary and atoms made the sample of a texel, and what each gave
    Explain {
        #[command(flatten)]
        source: Source,
        /// The texel, as 10,20
        #[arg(long, value_parser = parse_texel)]
        texel: [u32; 2],
        /// Light: angle from the normal and azimuth, degrees
        #[arg(long, default_value = "30,0", value_parser = parse_angles, allow_hyphen_values = true)]
        light: Direction,
        /// View: angle from the normal and azimuth, degrees
        #[arg(long, default_value = "0,0", value_parser = parse_angles, allow_hyphen_values = true)]
        view: Direction,
        /// Coefficients that are listed of a record
        #[arg(long, default_value_t = 8)]
        most: usize,
        /// As JSON, with all coefficients
        #[arg(long)]
        json: bool,
    },
    /// Hold this decoder, or a program that answers over its standard streams, against the conformance suite
    Conform {
        /// Folder of the suite, with its manifest.tsv
        folder: PathBuf,
        /// Make the files of the suite from its recipes first
        #[arg(long)]
        make: bool,
        /// The program and its arguments, behind --
        #[arg(last = true)]
        program: Vec<String>,
    },
    /// Write the image for one light and one view as .png or .exr
    Decode {
        #[command(flatten)]
        source: Source,
        /// The picture to write
        #[arg(short, long)]
        output: PathBuf,
        /// Light: angle from the normal and azimuth, degrees
        #[arg(long, default_value = "30,0", value_parser = parse_angles, allow_hyphen_values = true)]
        light: Direction,
        /// View: angle from the normal and azimuth, degrees
        #[arg(long, default_value = "0,0", value_parser = parse_angles, allow_hyphen_values = true)]
        view: Direction,
        /// Level of detail
        #[arg(long, default_value_t = 0)]
        level: u32,
        /// Quality layers to decode
        #[arg(long)]
        layers: Option<u32>,
        /// Factor for .png; .exr has the decoder's bits
        #[arg(long, default_value_t = 1.0, value_parser = parse_exposure, allow_negative_numbers = true)]
        exposure: f32,
    },
    /// Write the decoder's kernel as WGSL, SPIR-V, MSL, HLSL and GLSL, with its bindings
    Kernel {
        /// Folder for the files; without it the WGSL goes to stdout
        #[arg(long)]
        out: Option<PathBuf>,
    },
}

/// How findings are told.
#[derive(Clone, Copy, clap::ValueEnum, PartialEq)]
enum Format {
    /// A line a finding
    Text,
    /// By the published schema
    Json,
    /// SARIF 2.1.0, for code hosts and editors
    Sarif,
}

/// A material and its dictionary.
#[derive(Args)]
struct Source {
    /// The file, - for standard input
    file: PathBuf,
    /// Its external dictionary
    #[arg(long)]
    dictionary: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Limits of the caller.
#[derive(Args)]
pub struct LimitArgs {
    /// Refuse files of more bytes
    #[arg(long, default_value_t = Limits::default().bytes)]
    max_bytes: u32,
    /// Refuse files whose samples cost more operations
    #[arg(long, default_value_t = Limits::default().operations)]
    max_operations: u32,
    /// Refuse images of more texels
    #[arg(long, default_value_t = Limits::default().texels)]
    max_texels: u32,
}

impl LimitArgs {
    fn limits(&self) -> Limits {
        Limits { bytes: self.max_bytes, operations: self.max_operations, texels: self.max_texels }
    }
}

fn parse_blocks(text: &str) -> std::result::Result<[usize; 2], String> {
    let parts: Option<Vec<usize>> =
        text.split('x').map(|n| n.parse().ok().filter(|n| (1..=1638).contains(n))).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or_else(|| "two numbers from 1 to 1638, as 40x30".into())
}

fn parse_angles(text: &str) -> std::result::Result<Direction, String> {
    let parts: Option<Vec<f64>> =
        text.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    let Some(Ok([polar, azimuth])) = parts.map(<[f64; 2]>::try_from) else {
        return Err("two numbers, as 30,90".into());
    };
    if !(0.0..=90.0).contains(&polar) {
        return Err("the angle from the normal is 0 to 90 degrees".into());
    }
    let (polar, azimuth) = (polar.to_radians(), azimuth.to_radians());
    Ok(Direction::from_unit_vector([
        (polar.sin() * azimuth.cos()) as f32,
        (polar.sin() * azimuth.sin()) as f32,
        polar.cos() as f32,
    ]))
}

fn parse_texel(text: &str) -> std::result::Result<[u32; 2], String> {
    let parts: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or_else(|| "two numbers, as 10,20".into())
}

fn parse_severity(text: &str) -> std::result::Result<(String, validate::Severity), String> {
    let (rule, severity) = text.split_once('=').ok_or("a rule and a severity, as W1=off")?;
    Ok((rule.into(), severity.parse()?))
}

pub(crate) fn parse_exposure(text: &str) -> std::result::Result<f32, String> {
    text.parse().ok().filter(|f: &f32| f.is_finite() && *f > 0.0).ok_or_else(|| "a positive number".into())
}

/// Text to stdout.
fn print(text: &str) -> Result<()> {
    files::write(Path::new("-"), text.as_bytes())
}

/// Anything as JSON, to stdout.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&(serde_json::to_string_pretty(value).expect("plain data") + "\n"))
}

/// A material's bytes, opened for as long as `use_it` runs.
/// A finding about a source's file.
fn invalid(source: &Source) -> impl FnOnce(selvedge::Finding) -> ToolError {
    let path = source.file.clone();
    |finding| ToolError::Invalid { path, finding }
}

fn with_material<T>(source: &Source, use_it: impl FnOnce(selvedge::Selvedge<'_>) -> Result<T>) -> Result<T> {
    let bytes = files::read(&source.file)?;
    let dictionary = source.dictionary.as_deref().map(files::read).transpose()?;
    let opened = selvedge::open_with(&bytes, dictionary.as_deref(), &source.limits.limits());
    use_it(opened.map_err(|finding| match finding {
        selvedge::Finding {
            rule: selvedge::Rule::Content,
            part: selvedge::Part::File,
            found: CONTENT_DICTIONARY,
            ..
        } => ToolError::Usage(format!(
            "{} is a dictionary, which has no image: give a material",
            source.file.display()
        )),
        finding => ToolError::Invalid { path: source.file.clone(), finding },
    })?)
}

fn import(
    folder: &Path,
    material: Option<String>,
    blocks: Option<[usize; 2]>,
    value_bits: u32,
    output: &Path,
    dictionary: Option<&Path>,
) -> Result<()> {
    if dictionary.is_some_and(|dictionary| dictionary == output) {
        return Err(ToolError::Usage("--output and --dictionary must be two files".into()));
    }
    let there = sparsebtf::materials_in(folder)?;
    let name = match (material, there.as_slice()) {
        (Some(name), there) if there.contains(&name) => name,
        (None, [only]) => only.clone(),
        (_, []) => {
            return Err(ToolError::Usage(format!(
                "{}: no Coeffs_BTF_NAME_1e-05_{{Y,U,V}}.bin",
                folder.display()
            )));
        }
        (_, there) => return Err(ToolError::Usage(format!("--material says which: {}", there.join(", ")))),
    };
    let model = sparsebtf::read_material(folder, &name, blocks)?.to_model(value_bits)?;
    let Some(dictionary) = dictionary else {
        return files::write(output, &write::write_material(&model));
    };
    let (material, bytes) = write::write_split(&model);
    files::write(dictionary, &bytes)?;
    files::write(output, &material)
}

/// Tells what a file, a dataset or data of others are.
fn tell_info(source: &Source, json: bool) -> Result<u8> {
    // Standard input holds a file of this format, and what is not to be known says so by its first broken
    // rule.
    let is_stream = source.file == Path::new("-");
    match if is_stream { Kind::Material } else { foreign::detect(&source.file)? } {
        Kind::Material | Kind::Dictionary => with_material(source, |material| {
            let info = info::info(&material).map_err(invalid(source))?;
            if json {
                print_json(&info)?
            } else {
                print(&info::info_text(&info))?
            }
            Ok(0)
        }),
        kind => {
            let info = foreign::info(&source.file, kind, foreign::ImportOptions::default().memory)?;
            if json {
                print_json(&info)?
            } else {
                print(&info.text())?
            }
            Ok(0)
        }
    }
}

/// Tells what is found in each file; the exit code is that of the first that is not good.
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

/// Every rule and advice: number, name, usual severity, what it asks for.
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

/// Tells every vector that is answered otherwise than its suite states.
fn conform(folder: &Path, make: bool, program: &[String]) -> Result<u8> {
    if make {
        vectors::write(folder)?;
    }
    let suite = vectors::read(folder)?;
    let found =
        if program.is_empty() { conform::run_own(&suite)? } else { conform::run_program(&suite, program)? };
    for d in &found {
        print(&format!("{}: {} is stated, {} was answered\n", d.path, d.stated, d.answered))?;
    }
    eprintln!("{} vectors, {} answered otherwise than stated", suite.len(), found.len());
    Ok(if found.is_empty() { 0 } else { 3 })
}

fn run(cli: Cli) -> Result<u8> {
    match cli.command {
        Command::Demo { out } => demo::run(&out, &mut |line| eprintln!("{line}")).map(|()| 0),
        Command::Material(command) => commands::run(command),
        Command::Measuring(command) => measuring::run(command),
        Command::Import { source, material, blocks, value_bits, output, dictionary, data } => {
            match foreign::detect(&source)? {
                Kind::SparseBtf => {
                    data.check_unused()?;
                    import(
                        &source,
                        material,
                        blocks,
                        value_bits.unwrap_or(demo::VALUE_BITS),
                        &output,
                        dictionary.as_deref(),
                    )
                    .map(|()| 0)
                }
                kind @ (Kind::Btf | Kind::Zip | Kind::Folder) => {
                    let of_sparse = [
                        ("--material", material.is_some()),
                        ("--blocks", blocks.is_some()),
                        ("--value-bits", value_bits.is_some()),
                        ("--dictionary", dictionary.is_some()),
                    ];
                    of_sparse.into_iter().try_for_each(|(option, is_given)| {
                        commands::check_applies(option, is_given, false, "folders of SparseBTF")
                    })?;
                    commands::import_data(&source, kind, &output, data).map(|()| 0)
                }
                kind => Err(ToolError::Usage(format!("{}: this is a {kind} already", source.display()))),
            }
        }
        Command::Info { source, json } => tell_info(&source, json),
        Command::Validate { rules: true, .. } => list_rules(),
        Command::Validate { schema: true, .. } => print(&validate::schema()).map(|()| 0),
        Command::Validate {
            files, dictionary, limits, format, json, warnings_as_errors, severities, ..
        } => {
            let options = validate::Options {
                limits: limits.limits(),
                warnings_as_errors,
                severities: severities.into_iter().collect(),
            };
            check_files(&files, dictionary.as_deref(), &options, if json { Format::Json } else { format })
        }
        Command::Explain { source, texel, light, view, most, json } => with_material(&source, |material| {
            let size = material.image_size(0);
            if texel[0] >= size[0] || texel[1] >= size[1] {
                return Err(ToolError::Usage(format!(
                    "--texel: the image has {} x {} texels",
                    size[0], size[1]
                )));
            }
            let explanation = explain::explain(&material, texel, light, view).map_err(invalid(&source))?;
            if json {
                print_json(&explanation)?
            } else {
                print(&explain::text(&explanation, most))?
            }
            Ok(0)
        }),
        Command::Conform { folder, make, program } => conform(&folder, make, &program),
        Command::Decode { source, output, light, view, level, layers, exposure } => {
            with_material(&source, |material| {
                let header = material.header();
                let most = [
                    ("--level", level, 0, header.level_count - 1),
                    ("--layers", layers.unwrap_or(1), 1, header.layer_count),
                ];
                if let Some((name, _, low, high)) =
                    most.iter().find(|(_, given, low, high)| !(low..=high).contains(&given))
                {
                    return Err(ToolError::Usage(format!("{name}: this file has {low} to {high}")));
                }
                let material = layers.map_or(material, |layers| material.with_layers(layers));
                let picture = ball::decode_picture(&material, level, light, view)?;
                let is_exr = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
                let picture = if is_exr { picture } else { picture.exposed(exposure) };
                picture.save(&output).map(|()| 0)
            })
        }
        Command::Kernel { out } => {
            match out {
                Some(folder) => {
                    let translated = kernel::translate()?;
                    std::fs::create_dir_all(&folder).map_err(ToolError::io(&folder))?;
                    translated
                        .iter()
                        .try_for_each(|(name, bytes)| files::write(&folder.join(name), bytes))?;
                }
                None => print(&kernel::source())?,
            }
            Ok(0)
        }
    }
}

/// Whether a command line is understood; nothing is done. For tests that try many.
///
/// # Errors
/// What is told of it.
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
            // Names inside files of others may hold what a terminal would obey.
            let words: String = error
                .to_string()
                .chars()
                .map(|c| if c != '\n' && selvedge::metadata::is_invisible(c) { '\u{fffd}' } else { c })
                .collect();
            eprintln!("selvedge: {words}");
            ExitCode::from(error.exit_code())
        }
    }
}
