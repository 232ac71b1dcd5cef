//! What several commands share: threads, limits, materials given by paths, output.

use crate::data::dataset::Dataset;
use crate::error::{Result, ToolError};
use crate::files;
use crate::methods::read;
use clap::Args;
use selvedge::container::header::CONTENT_DICTIONARY;
use selvedge::{Limits, Selvedge};
use std::path::{Path, PathBuf};

/// Number of threads; results do not depend on it.
#[derive(Args)]
pub struct Threads {
    /// Threads; all cores if not given. Results do not depend on it
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

/// A file and its external dictionary.
#[derive(Args)]
pub struct FileArgs {
    /// The file; - for standard input
    pub file: PathBuf,
    /// External dictionary of the file
    #[arg(long)]
    pub dictionary: Option<PathBuf>,
    #[command(flatten)]
    pub limits: LimitArgs,
}

/// Resource limits.
#[derive(Args)]
pub struct LimitArgs {
    /// Refuse files of more bytes
    #[arg(long, default_value_t = Limits::default().bytes)]
    max_bytes: u32,
    /// Refuse files that state more operations per sample
    #[arg(long, default_value_t = Limits::default().operations)]
    max_operations: u32,
    /// Refuse images of more texels
    #[arg(long, default_value_t = Limits::default().texels)]
    max_texels: u32,
}

impl LimitArgs {
    pub fn limits(&self) -> Limits {
        Limits { bytes: self.max_bytes, operations: self.max_operations, texels: self.max_texels }
    }
}

/// Text to stdout.
pub fn print(text: &str) -> Result<()> {
    files::write(Path::new("-"), text.as_bytes())
}

/// Anything as JSON, to stdout.
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&(serde_json::to_string_pretty(value).expect("plain data") + "\n"))
}

/// A finding about a source's file.
pub fn invalid(source: &FileArgs) -> impl FnOnce(selvedge::Finding) -> ToolError {
    let path = source.file.clone();
    |finding| ToolError::Invalid { path, finding }
}

/// A material's bytes, opened for as long as `use_it` runs.
pub fn with_material<T>(
    source: &FileArgs,
    use_it: impl FnOnce(selvedge::Selvedge<'_>) -> Result<T>,
) -> Result<T> {
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

/// Warns of a file whose triangulation differs from the one that this tool computes.
pub fn warn_of_triangles(path: &Path, file: &Selvedge<'_>) {
    if !read::same_triangles(file) {
        eprintln!(
            "warning: {}: its triangulation differs from the one that this tool computes; interpolated bits \
             may change",
            path.display()
        );
    }
}

/// A material given by its path: a dataset or a file.
pub enum Given {
    Data(Dataset),
    File(Vec<u8>, Option<Vec<u8>>),
}

impl Given {
    pub fn open(path: &Path, dictionary: Option<&Path>) -> Result<Given> {
        if Dataset::is_one(path) {
            return Ok(Given::Data(Dataset::open(path)?));
        }
        Ok(Given::File(files::read(path)?, dictionary.map(files::read).transpose()?))
    }

    pub fn opened<'a>(&'a self, path: &Path, limits: &Limits) -> Result<Option<Selvedge<'a>>> {
        match self {
            Given::Data(_) => Ok(None),
            Given::File(bytes, dictionary) => selvedge::open_with(bytes, dictionary.as_deref(), limits)
                .map(Some)
                .map_err(|finding| ToolError::Invalid { path: path.to_owned(), finding }),
        }
    }
}
