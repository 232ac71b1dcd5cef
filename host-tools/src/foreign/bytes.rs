//! Bytes of a third-party file: read at offsets, never beyond the end, and every failure with its offset.

use crate::error::{Result, ToolError};
use crate::files::read_exact_at;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The widths that numbers of third-party files have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// IEEE binary16.
    Half = 2,
    /// IEEE binary32.
    Single = 4,
    /// IEEE binary64.
    Double = 8,
}

/// A file on disk, or its bytes.
#[derive(Debug)]
enum Store {
    Disk(File),
    Memory(Vec<u8>),
}

/// A third-party file that is read at offsets, by any thread.
#[derive(Debug)]
pub struct Bytes {
    store: Store,
    length: u64,
    path: PathBuf,
}

impl Bytes {
    /// A file.
    ///
    /// # Errors
    /// On I/O.
    pub fn open(path: &Path) -> Result<Bytes> {
        let file = File::open(path).map_err(ToolError::io(path))?;
        let length = file.metadata().map_err(ToolError::io(path))?.len();
        Ok(Bytes { store: Store::Disk(file), length, path: path.to_owned() })
    }

    /// Bytes that are there already; `path` is what errors call them.
    pub fn from_memory(path: &Path, bytes: Vec<u8>) -> Bytes {
        Bytes { length: bytes.len() as u64, store: Store::Memory(bytes), path: path.to_owned() }
    }

    /// Bytes of the file.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// What errors call it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The error that something is wrong at an offset.
    pub(super) fn fail<T>(&self, offset: u64, what: impl Into<String>) -> Result<T> {
        Err(ToolError::Foreign { path: self.path.clone(), offset, what: what.into() })
    }

    /// Fills `out` from an offset on.
    ///
    /// # Errors
    /// If the file ends before, and on I/O.
    pub fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.check(offset, out.len() as u64, "bytes")?;
        match &self.store {
            Store::Disk(file) => read_exact_at(file, out, offset).map_err(ToolError::io(&self.path)),
            Store::Memory(bytes) => {
                out.copy_from_slice(&bytes[offset as usize..][..out.len()]);
                Ok(())
            }
        }
    }

    /// Checks that `length` bytes are there from an offset on.
    fn check(&self, offset: u64, length: u64, what: &str) -> Result<()> {
        if offset.checked_add(length).is_none_or(|end| end > self.length) {
            return self.fail(
                self.length.min(offset),
                format!("{length} bytes of {what} begin at {offset}, but the file has {}", self.length),
            );
        }
        Ok(())
    }

    /// `count` little-endian numbers from an offset on, all finite in binary32.
    ///
    /// # Errors
    /// If the file ends before or a number is not finite, and on I/O. Nothing is held before the length is
    /// known to be there.
    pub fn numbers(&self, offset: u64, count: u64, width: Width) -> Result<Vec<f32>> {
        let size = width as u64;
        let Some(length) = count.checked_mul(size) else {
            return self.fail(offset, format!("{count} numbers of {size} bytes"));
        };
        self.check(offset, length, "numbers")?;
        let mut numbers = vec![0.0f32; count as usize];
        // By parts, so that the bytes are not held beside all the numbers.
        const PART: usize = 1 << 16;
        let mut bytes = vec![0; PART.min(length as usize)];
        for (part, out) in numbers.chunks_mut(PART / width as usize).enumerate() {
            let at = offset + (part * PART) as u64;
            let bytes = &mut bytes[..out.len() * width as usize];
            self.read_at(at, bytes)?;
            match width {
                Width::Half => out
                    .iter_mut()
                    .zip(bytes.as_chunks().0)
                    .for_each(|(n, &b)| *n = half::f16::from_le_bytes(b).to_f32()),
                Width::Single => {
                    out.iter_mut().zip(bytes.as_chunks().0).for_each(|(n, &b)| *n = f32::from_le_bytes(b))
                }
                Width::Double => out
                    .iter_mut()
                    .zip(bytes.as_chunks().0)
                    .for_each(|(n, &b)| *n = f64::from_le_bytes(b) as f32),
            }
            if let Some(i) = out.iter().position(|n| !n.is_finite()) {
                return self.fail(at + i as u64 * size, format!("the number {} is not finite", out[i]));
            }
        }
        Ok(numbers)
    }
}

/// A position in a file that advances as fields are read.
pub(super) struct Cursor<'a> {
    /// The file.
    pub(super) bytes: &'a Bytes,
    /// Offset of the next field.
    pub(super) at: u64,
}

impl Cursor<'_> {
    /// The error that something is wrong with the field that was read last, of so many bytes.
    pub(super) fn fail<T>(&self, length: u64, what: impl Into<String>) -> Result<T> {
        self.bytes.fail(self.at - length, what)
    }

    fn field<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        self.bytes.check(self.at, N as u64, what)?;
        let mut field = [0; N];
        self.bytes.read_at(self.at, &mut field)?;
        self.at += N as u64;
        Ok(field)
    }

    /// A byte.
    pub(super) fn u8(&mut self, what: &str) -> Result<u8> {
        self.field::<1>(what).map(|[byte]| byte)
    }

    /// Four bytes.
    pub(super) fn u32(&mut self, what: &str) -> Result<u32> {
        self.field(what).map(u32::from_le_bytes)
    }

    /// A finite number.
    pub(super) fn f32(&mut self, what: &str) -> Result<f32> {
        let number = self.field(what).map(f32::from_le_bytes)?;
        if number.is_finite() { Ok(number) } else { self.fail(4, format!("{what}: {number}")) }
    }

    /// `N` finite numbers.
    pub(super) fn floats<const N: usize>(&mut self, what: &str) -> Result<[f32; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f32(what)?;
        }
        Ok(numbers)
    }

    /// A width of numbers: 2, 4 or 8.
    pub(super) fn width(&mut self) -> Result<Width> {
        match self.u8("size of a number")? {
            2 => Ok(Width::Half),
            4 => Ok(Width::Single),
            8 => Ok(Width::Double),
            other => self.fail(1, format!("numbers of {other} bytes; 2, 4 and 8 are known")),
        }
    }

    /// A text of `length` bytes without its padding, of which the first 200 characters are kept.
    pub(super) fn text(&mut self, length: u32, what: &str) -> Result<String> {
        let mut bytes = vec![0; length.min(1024) as usize];
        let start = self.at;
        self.skip(length as u64, what)?;
        self.bytes.read_at(start, &mut bytes)?;
        let text = String::from_utf8_lossy(&bytes);
        let text = text.split('\0').next().unwrap_or_default();
        Ok(super::options::clean(text))
    }

    /// Skips `length` bytes, which must be there.
    pub(super) fn skip(&mut self, length: u64, what: &str) -> Result<()> {
        self.bytes.check(self.at, length, what)?;
        self.at += length;
        Ok(())
    }

    /// Skips a table of `rows` times `columns` numbers, which must be there; its start.
    pub(super) fn table(&mut self, rows: u64, columns: u64, width: Width, what: &str) -> Result<u64> {
        let start = self.at;
        match rows.checked_mul(columns).and_then(|n| n.checked_mul(width as u64)) {
            Some(length) => self.skip(length, what)?,
            None => return self.bytes.fail(start, format!("{what}: {rows} x {columns} numbers")),
        }
        Ok(start)
    }
}
