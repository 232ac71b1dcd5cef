//! The stores of a report: a line of JSON for each measurement, appended when it is complete, so that an
//! interrupted run is resumed.

use super::line::{HeldOut, Line};
use crate::error::{Result, ToolError};
use crate::files;
use serde::Serialize;
use std::io::Write as _;
use std::path::PathBuf;

/// A line of a store.
pub trait Keyed: Serialize + serde::de::DeserializeOwned {
    /// What it is found by in a later run.
    fn key(&self) -> &str;
}

impl Keyed for Line {
    fn key(&self) -> &str {
        &self.key
    }
}

impl Keyed for HeldOut {
    fn key(&self) -> &str {
        &self.key
    }
}

/// Lines of earlier runs, and the file that new ones are appended to.
pub struct Store<T> {
    path: PathBuf,
    /// All lines.
    pub lines: Vec<T>,
}

impl<T: Keyed> Store<T> {
    /// Reads the lines of earlier runs; a last line that was cut off by a crash is dropped.
    ///
    /// # Errors
    /// If the file cannot be read or repaired, or has a line that this version does not understand: nothing
    /// measured is thrown away.
    pub fn open(path: PathBuf) -> Result<Store<T>> {
        let text = if path.exists() {
            String::from_utf8_lossy(&files::read(&path)?).into_owned()
        } else {
            String::new()
        };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let parse = |(i, line): (usize, &str)| {
            serde_json::from_str(line).map_err(|why| {
                ToolError::Mismatch(format!(
                    "{}, line {}: of another version ({why}); start in another folder",
                    path.display(),
                    i + 1
                ))
            })
        };
        let lines: Vec<T> = whole.lines().enumerate().map(parse).collect::<Result<_>>()?;
        if whole != text {
            files::write(&path, whole.as_bytes())?;
        }
        Ok(Store { path, lines })
    }

    /// Appends a line.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, line: T) -> Result<()> {
        let mut file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .map_err(ToolError::io(&self.path))?;
        file.write_all(to_json_line(&line).as_bytes()).map_err(ToolError::io(&self.path))?;
        self.lines.push(line);
        Ok(())
    }
}

fn to_json_line<T: Serialize>(line: &T) -> String {
    let mut text = serde_json::to_string(line).expect("plain data");
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::line::tests::line;

    #[test]
    fn a_store_gives_back_its_lines_and_leaves_out_half_ones() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("measured.jsonl");
        let mut store = Store::open(path.clone()).expect("opened");
        store.add(line(10, 5.0)).expect("added");
        store.add(line(20, 4.0)).expect("added");
        let mut text = std::fs::read_to_string(&path).expect("read");
        text.push_str("{\"key\":\"ha");
        std::fs::write(&path, text).expect("written");
        let mut store = Store::<Line>::open(path.clone()).expect("opened");
        assert_eq!(store.lines.len(), 2);
        assert_eq!(store.lines[0].key(), "10 5");
        store.add(line(30, 3.0)).expect("added");
        assert_eq!(Store::<Line>::open(path).expect("opened").lines.len(), 3);
    }
}
