//! Where the images of a material are: a folder with all below it, or a zip archive, which is read as it is.

use super::bytes::Bytes;
use super::pixels::Stream;
use crate::error::{Result, ToolError};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folders in folders that are looked into.
const DEPTH: usize = 8;
/// Most entries of a folder or an archive: two images for each pair of directions.
const MOST_ENTRIES: usize = 1 << 21;

/// A reader of a file that others read as well.
#[derive(Clone, Debug)]
pub struct Positioned {
    bytes: Arc<Bytes>,
    at: u64,
}

impl Read for Positioned {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = (out.len() as u64).min(self.bytes.length().saturating_sub(self.at)) as usize;
        self.bytes.read_at(self.at, &mut out[..count]).map_err(std::io::Error::other)?;
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Positioned {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.bytes.length().checked_add_signed(by),
        };
        self.at = at.ok_or(std::io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}

/// A folder or a zip archive.
#[derive(Debug)]
pub enum Archive {
    /// A folder.
    Folder(PathBuf),
    /// A zip archive.
    Zip {
        /// Where it is.
        path: PathBuf,
        /// Its directory, which every reader shares.
        zip: Box<zip::ZipArchive<Positioned>>,
        /// Numbers of its files by their names.
        numbers: BTreeMap<PathBuf, usize>,
    },
}

/// Whether a file that begins with these bytes is a zip archive.
pub fn is_zip(start: &[u8]) -> bool {
    start.starts_with(b"PK\x03\x04") || start.starts_with(b"PK\x05\x06")
}

impl Archive {
    /// Opens a folder, or reads the directory of an archive.
    ///
    /// # Errors
    /// If it is neither, and on I/O.
    pub fn open(path: &Path) -> Result<Archive> {
        if path.is_dir() {
            return Ok(Archive::Folder(path.to_owned()));
        }
        Archive::from_bytes(Bytes::open(path)?)
    }

    /// Reads the directory of an archive from bytes.
    ///
    /// # Errors
    /// If they are no archive.
    pub fn from_bytes(bytes: Bytes) -> Result<Archive> {
        let path = bytes.path().to_owned();
        let bad = |what: String| ToolError::Foreign { path: path.clone(), offset: 0, what };
        let zip = zip::ZipArchive::new(Positioned { bytes: Arc::new(bytes), at: 0 })
            .map_err(|error| bad(error.to_string()))?;
        if zip.len() > MOST_ENTRIES {
            return Err(bad(format!("{} entries; {MOST_ENTRIES} are possible", zip.len())));
        }
        let mut numbers = BTreeMap::new();
        for number in 0..zip.len() {
            let name = zip
                .name_for_index(number)
                .map(|name| name.map_err(|error| bad(error.to_string())))
                .transpose()?
                .unwrap_or_default();
            // Of entries of one name the archive's directory has the last.
            if !name.ends_with('/') {
                numbers.insert(PathBuf::from(&*name), number);
            }
        }
        Ok(Archive::Zip { path, zip: Box::new(zip), numbers })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        match self {
            Archive::Folder(path) | Archive::Zip { path, .. } => path,
        }
    }

    /// Names of all files, sorted; those of a zip with `/` between folders.
    ///
    /// # Errors
    /// If there are too many or folders are too deep, and on I/O.
    pub fn names(&self) -> Result<Vec<PathBuf>> {
        let mut names: Vec<PathBuf> = match self {
            Archive::Folder(path) => {
                let mut names = Vec::new();
                walk(path, Path::new(""), DEPTH, &mut names)?;
                names
            }
            Archive::Zip { numbers, .. } => numbers.keys().cloned().collect(),
        };
        names.retain(|name| !is_hidden(name));
        names.sort();
        Ok(names)
    }

    /// Whether it has a file.
    pub fn has(&self, name: &Path) -> bool {
        match self {
            Archive::Folder(folder) => folder.join(name).is_file(),
            Archive::Zip { numbers, .. } => numbers.contains_key(name),
        }
    }

    /// A file of this name in the folder itself, or in a zip archive also in the folder that it was made of.
    pub fn find_shallow(&self, name: &str) -> Option<PathBuf> {
        match self {
            Archive::Folder(_) => Some(PathBuf::from(name)).filter(|path| self.has(path)),
            Archive::Zip { numbers, .. } => numbers
                .keys()
                .find(|path| path.ends_with(name) && path.components().count() <= 2 && !is_hidden(path))
                .cloned(),
        }
    }

    /// What errors call a file of it.
    pub fn describe(&self, name: &Path) -> PathBuf {
        self.path().join(name)
    }

    /// Opens a file of it. One in a zip is unpacked into memory, at most `memory` bytes.
    ///
    /// # Errors
    /// If it is not there, is larger or damaged, and on I/O.
    pub fn read(&self, name: &Path, memory: usize) -> Result<Box<dyn Stream + Send>> {
        match self {
            Archive::Folder(folder) => {
                let path = folder.join(name);
                Ok(Box::new(BufReader::new(File::open(&path).map_err(ToolError::io(&path))?)))
            }
            Archive::Zip { zip, numbers, .. } => {
                let bad = |what: String| ToolError::Picture { path: self.describe(name), what };
                let number = *numbers.get(name).ok_or_else(|| bad("there is no such file".into()))?;
                // A reader of its own; the directory is shared.
                let mut zip = zip::ZipArchive::clone(zip);
                let file = zip.by_index(number).map_err(|error| bad(error.to_string()))?;
                let mut bytes = Vec::new();
                // What is stated may be wrong; what comes out counts.
                file.take(memory as u64 + 1)
                    .read_to_end(&mut bytes)
                    .map_err(|error| bad(error.to_string()))?;
                if bytes.len() > memory {
                    return Err(bad(format!("more than {memory} bytes, which are allowed (--memory)")));
                }
                Ok(Box::new(Cursor::new(bytes)))
            }
        }
    }
}

/// Whether a file or a folder that it is in begins with a point.
fn is_hidden(name: &Path) -> bool {
    name.components().any(|part| part.as_os_str().as_encoded_bytes().starts_with(b"."))
}

fn walk(folder: &Path, below: &Path, depth: usize, names: &mut Vec<PathBuf>) -> Result<()> {
    let here = folder.join(below);
    for entry in std::fs::read_dir(&here).map_err(ToolError::io(&here))? {
        let entry = entry.map_err(ToolError::io(&here))?;
        let name = below.join(entry.file_name());
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        // A link to nothing is not there.
        let Ok(kind) = std::fs::metadata(entry.path()) else { continue };
        if kind.is_dir() {
            // A link to a folder above would never end.
            if entry.file_type().is_ok_and(|kind| kind.is_symlink()) {
                continue;
            }
            if depth == 0 {
                return Err(ToolError::Usage(format!(
                    "{}: folders in folders, more than {DEPTH} deep",
                    folder.join(name).display()
                )));
            }
            walk(folder, &name, depth - 1, names)?;
        } else if kind.is_file() {
            names.push(name);
        }
        if names.len() > MOST_ENTRIES {
            return Err(ToolError::Usage(format!("{}: more than {MOST_ENTRIES} files", folder.display())));
        }
    }
    Ok(())
}
