//! `import`: a dataset of measured data, or a file of published coefficients.

use super::common::Threads;
use super::exchange::{self, check_applies, check_output};
use crate::data::dataset::Sample;
use crate::data::picture;
use crate::error::{Result, ToolError};
use crate::files;
use crate::foreign::pixels::Colours;
use crate::foreign::{self, ImportOptions, Kind, btf, images};
use crate::format::write;
use crate::methods::sparse_ensemble::sparsebtf;
use crate::progress::Progress;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Options of the command.
#[derive(Args)]
pub struct Arguments {
    /// Data, detected by content: a .btf of Bonn (UBO2014); a zip (UBO2003, ATRIUM) or a folder (UTIA) of
    /// images (.exr, .png, .jpg, .hdr) named tlTTT plPPP tvTTT pvPPP by polar angle and azimuth of light and
    /// view in degrees, or listed by a dataset.json; or SparseBTF, a folder with
    /// Coeffs_BTF_NAME_1e-05_{Y,U,V}.bin, DictEnsOrth4D*.bin, NAME_mean_std.bin and xyz_loc.bin
    source: PathBuf,
    /// SparseBTF: the material, if the folder has several
    #[arg(long)]
    material: Option<String>,
    /// SparseBTF: blocks along x and y, if the image is not square, as 40x30
    #[arg(long, value_parser = exchange::blocks)]
    blocks: Option<[usize; 2]>,
    /// SparseBTF: bits of a quantised coefficient, 1 to 16; 10 if not given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16))]
    value_bits: Option<u32>,
    /// The dataset (.selvset) to write; the file (.selv) if the source is SparseBTF
    #[arg(short, long)]
    output: PathBuf,
    /// SparseBTF: write the dictionaries to a file of their own
    #[arg(long)]
    dictionary: Option<PathBuf>,
    #[command(flatten)]
    data: DataArgs,
}

/// Whether the light's cosine is in values.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Cosine {
    /// Values contain it, as radiance does
    Included,
    /// Values do not contain it
    Excluded,
}

/// Options of a source that becomes a dataset.
#[derive(Args)]
pub struct DataArgs {
    /// Store 32-bit floats instead of binary16
    #[arg(long)]
    float: bool,
    /// Whether values contain the cosine of the light's polar angle; as the data state it if not given, and
    /// included if they do not
    #[arg(long, value_enum)]
    cosine: Option<Cosine>,
    /// Name of the material; that of the file or folder if not given
    #[arg(long)]
    name: Option<String>,
    /// Origin of the data
    #[arg(long, default_value = "")]
    origin: String,
    /// Licence of the data
    #[arg(long, default_value = "")]
    licence: String,
    /// Colour space of images, auto if not given: channels X, Y, Z of an EXR are CIE XYZ
    #[arg(long, value_enum)]
    colours: Option<Colours>,
    /// Memory budget for images held at once, MB; a larger single image is refused
    ///
    /// 1000 if not given; a larger budget writes longer runs to disk
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    memory: Option<u32>,
    /// Write the height map of a .btf to an .exr, values unchanged
    #[arg(long, value_parser = exchange::exr)]
    height_map: Option<PathBuf>,
    /// Report how long each step took
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    threads: Threads,
}

impl DataArgs {
    /// What a folder of SparseBTF does not take: its files become a finished file as they are.
    fn check_unused(&self) -> Result<()> {
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

/// Imports a source by what its content is.
///
/// # Errors
/// If options do not apply to that kind of source, the data are damaged, and on I/O.
pub fn run(args: Arguments) -> Result<u8> {
    match foreign::detect(&args.source)? {
        Kind::SparseBtf => {
            args.data.check_unused()?;
            import_coefficients(&args)?;
        }
        kind @ (Kind::Btf | Kind::Zip | Kind::Folder) => {
            let of_sparse = [
                ("--material", args.material.is_some()),
                ("--blocks", args.blocks.is_some()),
                ("--value-bits", args.value_bits.is_some()),
                ("--dictionary", args.dictionary.is_some()),
            ];
            of_sparse.into_iter().try_for_each(|(option, is_given)| {
                check_applies(option, is_given, false, "folders of SparseBTF")
            })?;
            import_data(&args.source, kind, &args.output, args.data)?;
        }
        kind => return Err(ToolError::Usage(format!("{}: this is a {kind} already", args.source.display()))),
    }
    Ok(0)
}

/// Makes a dataset of third-party data.
fn import_data(from: &Path, kind: Kind, output: &Path, args: DataArgs) -> Result<()> {
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
        texts.iter().find(|(_, text)| text.chars().any(selvedge::container::metadata::is_invisible))
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
    let report = |done, all| progress.report("reading", done, all);
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
            let imported = foreign::import_btf(&btf, output, &options, &report)?;
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
            set.import(output, &options, &report)?
        }
    };
    progress.clear();
    if args.times {
        eprintln!("{}", progress.times("statistics"));
    }
    imported.notes.iter().for_each(|note| eprintln!("{note}"));
    Ok(())
}

/// Makes a file of published coefficients, as they are.
fn import_coefficients(args: &Arguments) -> Result<()> {
    let (folder, output) = (args.source.as_path(), args.output.as_path());
    if args.dictionary.as_deref().is_some_and(|dictionary| dictionary == output) {
        return Err(ToolError::Usage("--output and --dictionary must be two files".into()));
    }
    let there = sparsebtf::materials_in(folder)?;
    let name = match (&args.material, there.as_slice()) {
        (Some(name), there) if there.contains(name) => name.clone(),
        (None, [only]) => only.clone(),
        (_, []) => {
            return Err(ToolError::Usage(format!(
                "{}: no Coeffs_BTF_NAME_1e-05_{{Y,U,V}}.bin",
                folder.display()
            )));
        }
        (_, there) => return Err(ToolError::Usage(format!("--material says which: {}", there.join(", ")))),
    };
    let value_bits = args.value_bits.unwrap_or(sparsebtf::VALUE_BITS);
    let model = sparsebtf::read_material(folder, &name, args.blocks)?.to_model(value_bits)?;
    let Some(dictionary) = &args.dictionary else {
        return files::write(output, &write::write_material(&model));
    };
    let (material, bytes) = write::write_split(&model);
    files::write(dictionary, &bytes)?;
    files::write(output, &material)
}
