//! Runs a decoder over the conformance suite: this one, or any program that answers over its standard
//! streams.
//!
//! The program reads queries until its input ends. A query is the line `check FILE_BYTES DICTIONARY_BYTES
//! MAX_BYTES MAX_OPERATIONS MAX_TEXELS` (a dictionary of `-` bytes is none), then the bytes of both. The
//! answer is one line: `digest HEX` for a material, `legal` for a dictionary, or `broken RULE PART OFFSET
//! FOUND` with the rule that 1.4 finds first.

use crate::check::vectors::{Answer, Vector, answer};
use crate::error::{Result, ToolError};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};

/// A vector whose answer differs from the stated one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// Path of the vector.
    pub path: String,
    /// What its suite states.
    pub stated: String,
    /// What was answered.
    pub answered: String,
}

/// An answer as its line.
pub fn line(answer: &Answer) -> String {
    match answer {
        Answer::Digest(digest) => format!("digest {digest}"),
        Answer::Legal => "legal".into(),
        Answer::Broken(rule, part, offset, found) => format!("broken {rule} {part} {offset} {found}"),
    }
}

fn dictionary_of<'a>(vectors: &'a BTreeMap<&str, &Vector>, vector: &Vector) -> Result<Option<&'a [u8]>> {
    let find = |path: &String| {
        let missing =
            || ToolError::Usage(format!("{}: its dictionary {path} is not in the suite", vector.path));
        vectors.get(path.as_str()).map(|v| &v.bytes[..]).ok_or_else(missing)
    };
    vector.dictionary.as_ref().map(find).transpose()
}

fn by_path(vectors: &[Vector]) -> BTreeMap<&str, &Vector> {
    vectors.iter().map(|vector| (vector.path.as_str(), vector)).collect()
}

/// Runs this decoder over a suite.
///
/// # Errors
/// If a vector names a dictionary that is not there.
pub fn run_own(vectors: &[Vector]) -> Result<Vec<Disagreement>> {
    let all = by_path(vectors);
    let check = |vector: &Vector| -> Result<Option<Disagreement>> {
        let answered = answer(&vector.bytes, dictionary_of(&all, vector)?, &vector.limits());
        Ok((answered != vector.answer).then(|| Disagreement {
            path: vector.path.clone(),
            stated: line(&vector.answer),
            answered: line(&answered),
        }))
    };
    Ok(vectors.par_iter().map(check).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// Runs a program over a suite.
///
/// # Errors
/// If the program cannot be run or ends before it has answered.
pub fn run_program(vectors: &[Vector], program: &[String]) -> Result<Vec<Disagreement>> {
    let Some((name, arguments)) = program.split_first() else {
        return Err(ToolError::Usage("no program is given".into()));
    };
    let at = Path::new(name);
    let mut child = Command::new(name)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(ToolError::io(at))?;
    let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
        return Err(ToolError::Usage(format!("{name} has no standard streams")));
    };
    let (mut input, mut output) = (BufWriter::new(input), BufReader::new(output));
    let all = by_path(vectors);
    let mut found = Vec::new();
    for vector in vectors {
        let dictionary = dictionary_of(&all, vector)?;
        let (limits, length) = (vector.limits(), dictionary.map_or("-".into(), |d| d.len().to_string()));
        let send = |input: &mut dyn Write| -> std::io::Result<()> {
            writeln!(
                input,
                "check {} {length} {} {} {}",
                vector.bytes.len(),
                limits.bytes,
                limits.operations,
                limits.texels
            )?;
            input.write_all(&vector.bytes)?;
            input.write_all(dictionary.unwrap_or(&[]))?;
            input.flush()
        };
        send(&mut input).map_err(ToolError::io(at))?;
        let mut answered = String::new();
        if output.read_line(&mut answered).map_err(ToolError::io(at))? == 0 {
            return Err(ToolError::Mismatch(format!("{name} ended at {}", vector.path)));
        }
        let (stated, answered) = (line(&vector.answer), answered.trim_end().to_owned());
        if stated != answered {
            found.push(Disagreement { path: vector.path.clone(), stated, answered });
        }
    }
    drop(input);
    child.wait().map_err(ToolError::io(at))?;
    Ok(found)
}
