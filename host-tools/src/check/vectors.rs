//! The conformance suite: readable recipes become files, and files are checked against what their
//! recipes state.
//!
//! A recipe names a base, changes to its model by JSON pointer, and changes to its bytes by place; an invalid
//! one states the rule that is broken, where, and what is found there (1.4-4). What is stated comes from the
//! recipe alone, never from a decoder.

use crate::check::edits::{Edit, Number, place};
use crate::check::extreme::extreme;
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::bits::hex;
use crate::format::container::{is_dictionary, repair_checksums, repair_header_checksum};
use crate::format::model::MaterialModel;
use crate::format::write::{write_dictionary, write_material, write_split};
use crate::methods::{by_name, by_number};
use selvedge::Limits;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A file of recipes: those of one chapter.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Chapter {
    /// The base of recipes that name none.
    base: Option<String>,
    #[serde(default)]
    valid: Vec<Recipe>,
    #[serde(default)]
    invalid: Vec<Recipe>,
}

/// How one file is made.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Recipe {
    /// Name of the file.
    name: String,
    /// What it is for.
    note: String,
    /// `METHOD example`, `METHOD extreme SEED`, or the name of another recipe whose model is taken.
    base: Option<String>,
    /// Which file of the model: `whole`, or `material` or `dictionary` where it is split in two.
    #[serde(default)]
    part: FilePart,
    /// Values of the model by JSON pointer.
    #[serde(default)]
    change: BTreeMap<String, Value>,
    /// Changes to the bytes, in order.
    #[serde(default)]
    bytes: Vec<Edit>,
    /// Checksums that are made right at the end.
    #[serde(default)]
    checksums: Checksums,
    /// Name of the vector that is given as the external dictionary.
    dictionary: Option<String>,
    /// Limits of the caller: bytes, operations, texels; 0 for none.
    limits: Option<[u32; 3]>,
    /// What an invalid file breaks.
    expect: Option<Expect>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FilePart {
    #[default]
    Whole,
    Material,
    Dictionary,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Checksums {
    #[default]
    All,
    Header,
    None,
}

/// What a checker reports first.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Expect {
    rule: String,
    #[serde(default)]
    part: ExpectPart,
    at: String,
    found: Number,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ExpectPart {
    #[default]
    File,
    Dictionary,
}

/// What a vector must give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The decode digest in hexadecimal.
    Digest(String),
    /// A legal dictionary, which has no digest.
    Legal,
    /// A finding: rule, `file` or `dictionary`, byte offset, what was found.
    Broken(String, String, u32, u32),
}

/// One vector.
#[derive(Clone, Debug)]
pub struct Vector {
    /// Path inside the suite.
    pub path: String,
    /// What it is for.
    pub note: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Path of the dictionary that is given with it.
    pub dictionary: Option<String>,
    /// Limits of the caller: bytes, operations, texels.
    pub limits: Option<[u32; 3]>,
    /// What is expected; of a valid material as the suite's manifest states it, or as this decoder answers
    /// while it is made.
    pub answer: Answer,
}

impl Vector {
    /// The caller's limits.
    pub fn limits(&self) -> Limits {
        let or_none = |n: u32| if n == 0 { u32::MAX } else { n };
        self.limits.map_or(Limits::NONE, |[bytes, operations, texels]| Limits {
            bytes: or_none(bytes),
            operations: or_none(operations),
            texels: or_none(texels),
        })
    }
}

/// The model of a base.
fn base_of(base: &str, models: &BTreeMap<String, MaterialModel>) -> Result<MaterialModel> {
    let words: Vec<&str> = base.split(' ').collect();
    match words.as_slice() {
        [method, "example"] => Ok((by_name(method)?.example)()),
        [method, "extreme", seed] => {
            let seed = seed.parse().map_err(|_| ToolError::Usage(format!("`{seed}` is no seed")))?;
            Ok(extreme(by_name(method)?, seed))
        }
        _ => {
            let missing = || ToolError::Usage(format!("no recipe before this one is `{base}`"));
            models.get(base).cloned().ok_or_else(missing)
        }
    }
}

/// The model of a recipe: its base, changed.
fn model_of(
    recipe: &Recipe,
    usual: Option<&str>,
    models: &BTreeMap<String, MaterialModel>,
) -> Result<MaterialModel> {
    let wrong = |why: String| ToolError::Usage(format!("{}: {why}", recipe.name));
    let base = recipe.base.as_deref().or(usual).ok_or_else(|| wrong("it names no base".into()))?;
    let base = base_of(base, models).map_err(|error| wrong(error.to_string()))?;
    if recipe.change.is_empty() {
        return Ok(base);
    }
    let method = by_number(base.method()).map_err(|finding| wrong(finding.to_string()))?;
    let mut value = serde_json::to_value(&base).map_err(|error| wrong(error.to_string()))?;
    for (pointer, new) in &recipe.change {
        let slot = value.pointer_mut(pointer).ok_or_else(|| wrong(format!("the model has no {pointer}")))?;
        if slot == new {
            return Err(wrong(format!("{pointer} is changed to what it is")));
        }
        *slot = new.clone();
    }
    let mut model: MaterialModel<Value> =
        serde_json::from_value(value).map_err(|error| wrong(error.to_string()))?;
    let texture = (method.from_json)(model.texture.take()).map_err(|error| wrong(error.to_string()))?;
    Ok(model.with_texture(texture))
}

/// Name of a part in a manifest.
fn part_name(part: selvedge::Part) -> &'static str {
    if part == selvedge::Part::File { "file" } else { "dictionary" }
}

/// This decoder's answer to a vector.
pub fn answer(bytes: &[u8], dictionary: Option<&[u8]>, limits: &Limits) -> Answer {
    if is_dictionary(bytes) {
        let mut first = selvedge::First::default();
        selvedge::validate(bytes, dictionary, limits, &mut first);
        return match first.0 {
            None => Answer::Legal,
            Some(f) => Answer::Broken(f.rule.id().into(), part_name(f.part).into(), f.offset, f.found),
        };
    }
    match selvedge::open_with(bytes, dictionary, limits) {
        Ok(material) => Answer::Digest(hex(&material.decode_digest())),
        Err(f) => Answer::Broken(f.rule.id().into(), part_name(f.part).into(), f.offset, f.found),
    }
}

/// Makes every vector of a folder of recipes, in the order of their files.
///
/// # Errors
/// If a recipe cannot be read or carried out.
pub fn make(folder: &Path) -> Result<Vec<Vector>> {
    let recipes = folder.join("recipes");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(&recipes)
        .map_err(ToolError::io(&recipes))?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "json"));
    paths.sort();
    let (mut made, mut models, mut order) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
    for path in paths {
        let text = files::read(&path)?;
        let chapter: Chapter = serde_json::from_slice(&text)
            .map_err(|error| ToolError::Usage(format!("{}: {error}", path.display())))?;
        let of = |kind: &'static str| move |recipe| (kind, recipe);
        for (kind, recipe) in
            chapter.valid.into_iter().map(of("valid")).chain(chapter.invalid.into_iter().map(of("invalid")))
        {
            let model = model_of(&recipe, chapter.base.as_deref(), &models)?;
            let vector = make_one(kind, &recipe, &model, &made)
                .map_err(|error| ToolError::Usage(format!("{}: {error}", recipe.name)))?;
            if kind == "valid" {
                models.insert(recipe.name.clone(), model);
            }
            order.push(recipe.name.clone());
            if made.insert(recipe.name.clone(), vector).is_some() {
                return Err(ToolError::Usage(format!("two recipes have the name {}", recipe.name)));
            }
        }
    }
    Ok(order.into_iter().filter_map(|name| made.remove(&name)).collect())
}

fn make_one(
    kind: &str,
    recipe: &Recipe,
    model: &MaterialModel,
    made: &BTreeMap<String, Vector>,
) -> Result<Vector> {
    let mut bytes = match recipe.part {
        FilePart::Whole => write_material(model),
        FilePart::Material => write_split(model).0,
        FilePart::Dictionary => write_dictionary(&MaterialModel { extras: Vec::new(), ..model.clone() }),
    };
    let bytes_of = |name: &str| made.get(name).map(|vector| &vector.bytes[..]);
    let moving = recipe.bytes.iter().rposition(Edit::moves).map_or(0, |last| last + 1);
    for edit in &recipe.bytes[..moving] {
        edit.apply(&mut bytes, &bytes_of)?;
    }
    let whole = bytes.clone();
    for edit in &recipe.bytes[moving..] {
        edit.apply(&mut bytes, &bytes_of)?;
    }
    match recipe.checksums {
        Checksums::All if !recipe.bytes.is_empty() => repair_checksums(&mut bytes),
        Checksums::Header => repair_header_checksum(&mut bytes),
        _ => {}
    }
    let dictionary = recipe
        .dictionary
        .as_ref()
        .map(|name| made.get(name).ok_or_else(|| ToolError::Usage(format!("no recipe before it is {name}"))));
    let dictionary = dictionary.transpose()?;
    let path = format!("{kind}/{}.selv", recipe.name);
    let mut vector = Vector {
        path,
        note: recipe.note.clone(),
        bytes,
        dictionary: dictionary.map(|d| d.path.clone()),
        limits: recipe.limits,
        answer: Answer::Legal,
    };
    vector.answer = match (&recipe.expect, kind) {
        (Some(expect), "invalid") => {
            let of_dictionary = matches!(expect.part, ExpectPart::Dictionary);
            let looked_at = if of_dictionary { dictionary.map_or(&[][..], |d| &d.bytes) } else { &whole };
            let part = if of_dictionary { "dictionary" } else { "file" };
            Answer::Broken(
                expect.rule.clone(),
                part.into(),
                place(looked_at, &expect.at)? as u32,
                expect.found.get()?,
            )
        }
        (None, "valid") => match answer(&vector.bytes, dictionary.map(|d| &d.bytes[..]), &vector.limits()) {
            Answer::Broken(rule, part, at, found) => {
                return Err(ToolError::Mismatch(format!(
                    "{}: a valid file, which breaks {rule} at byte {at} of the {part} (found {found})",
                    vector.path
                )));
            }
            answer => answer,
        },
        _ => return Err(ToolError::Usage("invalid files state what they break, valid ones do not".into())),
    };
    Ok(vector)
}

/// The list of a suite: a line a vector, columns parted by tabs.
pub fn manifest(vectors: &[Vector]) -> String {
    let mut text = String::from(
        "# valid\tfile\tdictionary\tdecode digest\n# invalid\tfile\tdictionary\t\
         limits: bytes,operations,texels\trule\tpart\toffset\tfound\n",
    );
    for v in vectors {
        let dictionary = v.dictionary.as_deref().unwrap_or("-");
        let limits = v
            .limits
            .map_or("-".into(), |[bytes, operations, texels]| format!("{bytes},{operations},{texels}"));
        let _ = match &v.answer {
            Answer::Digest(digest) => writeln!(text, "valid\t{}\t{dictionary}\t{digest}", v.path),
            Answer::Legal => writeln!(text, "valid\t{}\t{dictionary}\t-", v.path),
            Answer::Broken(rule, part, offset, found) => writeln!(
                text,
                "invalid\t{}\t{dictionary}\t{limits}\t{rule}\t{part}\t{offset}\t{found}",
                v.path
            ),
        };
    }
    text
}

/// Reads a suite as it lies in a folder: its manifest and its files, without recipes.
///
/// # Errors
/// If a file cannot be read or the manifest is none.
pub fn read(folder: &Path) -> Result<Vec<Vector>> {
    let path = folder.join("manifest.tsv");
    let bytes = files::read(&path)?;
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let mut vectors = Vec::new();
    for (number, line) in
        text.lines().enumerate().filter(|(_, line)| !line.starts_with('#') && !line.is_empty())
    {
        let wrong = || ToolError::Usage(format!("{}: line {} is not understood", path.display(), number + 1));
        let columns: Vec<&str> = line.split('\t').collect();
        let optional = |text: &str| (text != "-").then(|| text.to_owned());
        let (file, dictionary, limits, answer) = match columns.as_slice() {
            ["valid", file, dictionary, digest] => {
                (*file, optional(dictionary), None, optional(digest).map_or(Answer::Legal, Answer::Digest))
            }
            ["invalid", file, dictionary, limits, rule, part, offset, found] => {
                let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
                let limits = optional(limits)
                    .map(|text| text.split(',').map(number).collect::<Result<Vec<u32>>>())
                    .transpose()?;
                let limits = limits.map(|l| <[u32; 3]>::try_from(l).map_err(|_| wrong())).transpose()?;
                (
                    *file,
                    optional(dictionary),
                    limits,
                    Answer::Broken((*rule).into(), (*part).into(), number(offset)?, number(found)?),
                )
            }
            _ => return Err(wrong()),
        };
        vectors.push(Vector {
            path: file.into(),
            note: String::new(),
            bytes: files::read(&folder.join(file))?,
            dictionary,
            limits,
            answer,
        });
    }
    Ok(vectors)
}

/// Writes a suite beside its recipes: files, and the manifest last.
///
/// # Errors
/// If something cannot be made or written.
pub fn write(folder: &Path) -> Result<usize> {
    let vectors = make(folder)?;
    for kind in ["valid", "invalid"] {
        let path = folder.join(kind);
        std::fs::create_dir_all(&path).map_err(ToolError::io(&path))?;
    }
    for vector in &vectors {
        files::write(&folder.join(&vector.path), &vector.bytes)?;
    }
    files::write(&folder.join("manifest.tsv"), manifest(&vectors).as_bytes())?;
    Ok(vectors.len())
}
