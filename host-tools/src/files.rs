//! Files in and out: whole reads, and writes that leave either the old file or the new one.

use crate::error::{Result, ToolError};
use std::io::{Read as _, Write as _};
use std::path::Path;

/// A whole file; `-` is standard input.
///
/// # Errors
/// [`ToolError::Io`] if it cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    if path == Path::new("-") {
        let mut bytes = Vec::new();
        std::io::stdin().read_to_end(&mut bytes).map_err(ToolError::io(path))?;
        return Ok(bytes);
    }
    std::fs::read(path).map_err(ToolError::io(path))
}

/// Writes beside the file, then renames: nobody ever sees half of it. `-` is standard output.
///
/// # Errors
/// [`ToolError::Io`] if it cannot be written; the old file is then as it was.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    if path == Path::new("-") {
        let mut out = std::io::stdout().lock();
        return match out.write_all(bytes).and_then(|()| out.flush()) {
            // Whoever reads has had enough.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            result => result.map_err(ToolError::io(path)),
        };
    }
    // A device, a pipe or a link stays what it is.
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if std::fs::metadata(&target).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        let mut open = std::fs::OpenOptions::new().write(true).open(&target).map_err(ToolError::io(path))?;
        return open.write_all(bytes).map_err(ToolError::io(path));
    }
    let path = target.as_path();
    let folder = folder_of(path);
    let mut beside = tempfile::Builder::new()
        .prefix(".selvedge-")
        .tempfile_in(folder)
        .map_err(|error| ToolError::io(path)(error.kind().into()))?;
    beside.write_all(bytes).and_then(|()| beside.as_file().sync_all()).map_err(ToolError::io(path))?;
    persist(beside, path)
}

/// The folder that a file is in or will be in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Reads at an offset, without a cursor that threads would share.
///
/// # Errors
/// If the file ends before all bytes are read, or the system refuses.
pub fn read_exact_at(file: &std::fs::File, bytes: &mut [u8], offset: u64) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset);
    #[cfg(windows)]
    {
        let mut done = 0;
        while done < bytes.len() {
            match std::os::windows::fs::FileExt::seek_read(file, &mut bytes[done..], offset + done as u64)? {
                0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
                read => done += read,
            }
        }
        Ok(())
    }
}

/// Writes at an offset, without a cursor that threads would share.
///
/// # Errors
/// If the system refuses.
pub fn write_all_at(file: &std::fs::File, bytes: &[u8], offset: u64) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::write_all_at(file, bytes, offset);
    #[cfg(windows)]
    {
        let mut done = 0;
        while done < bytes.len() {
            match std::os::windows::fs::FileExt::seek_write(file, &bytes[done..], offset + done as u64)? {
                0 => return Err(std::io::ErrorKind::WriteZero.into()),
                written => done += written,
            }
        }
        Ok(())
    }
}

/// Renames a finished temporary file to its path.
///
/// # Errors
/// [`ToolError::Io`] if the system refuses.
pub fn persist(beside: tempfile::NamedTempFile, path: &Path) -> Result<()> {
    // A temporary file is private; a result has the permissions that a new file would have.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = std::fs::metadata(path).map_or(0o644, |old| old.permissions().mode());
        beside
            .as_file()
            .set_permissions(std::fs::Permissions::from_mode(mode))
            .map_err(ToolError::io(path))?;
    }
    beside.persist(path).map_err(|error| ToolError::io(path)(error.error))?;
    Ok(())
}
