//! Materials in third-party formats: what a path holds, by its content, and a dataset of it.
//!
//! | module | does |
//! |---|---|
//! | [`btf`] | the containers of Bonn, `.btf` |
//! | [`images`], [`archive`], [`pixels`] | sets of images in folders and zip archives, and the single image |
//! | [`ubo`] | a set of images in the layout of UBO2003 |
//! | [`bytes`] | a file that is read at offsets and never trusted |
//!
//! The files of SparseBTF have a module of their own, [`crate::methods::sparse_ensemble::sparsebtf`]: they are
//! imported without re-encoding.

pub mod archive;
pub mod btf;
pub mod bytes;
pub mod images;
mod options;
pub mod pixels;
pub mod ubo;

pub use options::{ImportOptions, Imported, clean};

use crate::data::dataset::{Dataset, Description, Sample, Statistics, Writer, first_beyond};
use crate::data::directions;
use crate::error::{Result, ToolError};
use crate::format::container::is_dictionary;
use crate::methods::sparse_ensemble::sparsebtf;
use crate::work::ordered;
use btf::Btf;
use glam::DVec3;
use images::ImageSet;
use options::Clipped;
use serde::Serialize;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a path holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A file of this format.
    Material,
    /// A dictionary of this format.
    Dictionary,
    /// A dataset, the working file.
    Dataset,
    /// A container of Bonn.
    Btf,
    /// A zip archive.
    Zip,
    /// A folder of SparseBTF files.
    SparseBtf,
    /// Any other folder: of images, or of nothing that is known.
    Folder,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Kind::Material => "Selvedge file",
            Kind::Dictionary => "Selvedge dictionary",
            Kind::Dataset => "dataset",
            Kind::Btf => ".btf",
            Kind::Zip => "zip archive",
            Kind::SparseBtf => "folder of SparseBTF files",
            Kind::Folder => "folder",
        })
    }
}

/// What a path holds, by its content and not by its name.
///
/// # Errors
/// If it is none of the kinds, and on I/O.
pub fn detect(path: &Path) -> Result<Kind> {
    if path.is_dir() {
        return Ok(if sparsebtf::materials_in(path)?.is_empty() { Kind::Folder } else { Kind::SparseBtf });
    }
    let mut start = Vec::new();
    File::open(path)
        .map_err(ToolError::io(path))?
        .take(64)
        .read_to_end(&mut start)
        .map_err(ToolError::io(path))?;
    if start.starts_with(&selvedge::container::header::MAGIC) {
        Ok(if is_dictionary(&start) { Kind::Dictionary } else { Kind::Material })
    } else if Dataset::is_one(path) {
        Ok(Kind::Dataset)
    } else if btf::is_one(&start) {
        Ok(Kind::Btf)
    } else if archive::is_zip(&start) {
        Ok(Kind::Zip)
    } else {
        let what = "this is neither a Selvedge file, a dataset, a .btf of Bonn nor a zip archive";
        Err(ToolError::Foreign { path: path.to_owned(), offset: 0, what: what.into() })
    }
}

/// Makes a dataset of a `.btf`, batch by batch of texels; `progress` gets how many of how many texels are
/// done.
///
/// # Errors
/// If the file is not as its layout says; if a value is infinite or beyond what `options.sample` holds; on
/// I/O. There is no dataset then.
pub fn import_btf(
    btf: &Btf,
    output: &Path,
    options: &ImportOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Imported> {
    let head = btf.head();
    let writer = Writer::create(output, options.describe(&btf.description()))?;
    let (texels, length, batch) = (head.size[0] * head.size[1], btf.texel_len(), btf.batch());
    let done = AtomicUsize::new(0);
    let work = |i: usize| -> Result<Clipped> {
        let first = i * batch;
        let count = batch.min(texels - first);
        let mut values = vec![0.0; count * length];
        btf.texels(first, count, &mut values)?;
        let clipped = Clipped::of(&mut values);
        for (i, texel) in values.chunks(length).enumerate() {
            if let Some(n) = first_beyond(texel, options.sample.largest()) {
                let (number, pair) = (first + i, n / 3);
                let [x, y] = [number % head.size[0], number / head.size[0]];
                let [light, view] = [pair % head.lights.len(), pair / head.lights.len()];
                let what =
                    format!("texel ({x}, {y}), light {light}, view {view}: {}", options.refusal(texel[n]));
                return Err(ToolError::Foreign {
                    path: btf.path().to_owned(),
                    offset: btf.offset(number),
                    what,
                });
            }
            writer.put(first + i, 0, texel)?;
        }
        progress(done.fetch_add(count, Ordering::Relaxed) + count, texels);
        Ok(clipped)
    };
    let clipped = ordered(texels.div_ceil(batch), work, Clipped::default(), |total, _, part| {
        total.count += part.count;
        total.least = total.least.min(part.least);
    })?;
    let mut notes = Vec::new();
    if clipped.count > 0 {
        let all = texels as u64 * length as u64;
        notes.push(format!(
            "{} of {all} values were negative, the least {}, as factorisations leave them; they are 0 now",
            clipped.count, clipped.least
        ));
    }
    if head.rotated > 0 {
        notes.push(format!(
            "{} of {} frames of texels are not the identity; values stay in the frames they have",
            head.rotated, head.rotations
        ));
    }
    if options.cosine_included.is_none() {
        match head.cosine_included {
            Some(true) => {}
            // The flag is not to be trusted: Bonn's own library leaves it 0 for pictures, which are radiance.
            Some(false) => notes.push(
                "the file says that values do not contain the cosine of the light's angle; --cosine included \
                 if they do"
                    .into(),
            ),
            None => notes.push(
                "the file does not say whether values contain the cosine of the light's angle; taken as if \
                 they do (--cosine)"
                    .into(),
            ),
        }
    }
    Ok(Imported { statistics: writer.finish()?, notes })
}

impl Btf {
    /// What a dataset of the file is.
    pub fn description(&self) -> Description {
        let head = self.head();
        let parts = [&head.setup, &head.sensor, &head.light_source].map(String::as_str);
        let parts: Vec<&str> =
            std::iter::once(&head.signature[1..]).chain(parts).filter(|part| !part.is_empty()).collect();
        let nm = 1e6 / f64::from(head.pixels_per_mm);
        let texel_nm = if head.pixels_per_mm > 0.0 && nm < f64::from(u32::MAX) {
            [nm.round() as u32; 2]
        } else {
            [0; 2]
        };
        Description {
            size: head.size,
            lights: known_grid(&head.lights),
            views: known_grid(&head.views),
            cosine_included: head.cosine_included.unwrap_or(true),
            texel_nm,
            texts: [String::new(), parts.join(", "), String::new()],
            ..Description::default()
        }
    }
}

/// The directions of a known grid, if these are its but for the rounding of binary32; else themselves.
fn known_grid(set: &[DVec3]) -> Vec<DVec3> {
    let is_grid = |grid: &Vec<DVec3>| {
        grid.iter().zip(set).all(|(&a, &b)| images::degrees_between(a, b) < images::SAME_DEGREES)
    };
    directions::grid(set.len()).filter(is_grid).unwrap_or_else(|| set.to_vec())
}

/// What a path with third-party data holds, for `info`.
#[derive(Debug, Serialize)]
pub struct ForeignInfo {
    /// Which kind it is.
    pub kind: Kind,
    /// The format in words.
    pub format: String,
    /// Texels along x and y.
    pub size: [usize; 2],
    /// Light and view directions.
    pub directions: [usize; 2],
    /// The light's cosine is in the values, as the data state or by default.
    pub cosine_included: bool,
    /// Width and height of a texel in nanometres, 0 if unknown.
    pub texel_nm: [u32; 2],
    /// Name, origin, licence.
    pub texts: [String; 3],
    /// Bytes of a dataset in binary16.
    pub dataset_bytes: u64,
    /// Mean, least and largest value, where they are known without reading all.
    pub statistics: Option<Statistics>,
    /// The header of a `.btf`.
    pub btf: Option<btf::Head>,
}

impl ForeignInfo {
    fn new(kind: Kind, format: impl Into<String>, description: &Description) -> ForeignInfo {
        ForeignInfo {
            kind,
            format: format.into(),
            size: description.size,
            directions: [description.lights.len(), description.views.len()],
            cosine_included: description.cosine_included,
            texel_nm: description.texel_nm,
            texts: description.texts.clone(),
            dataset_bytes: description.half_bytes(),
            statistics: None,
            btf: None,
        }
    }

    /// For people.
    pub fn text(&self) -> String {
        let known = |text: &str| if text.is_empty() { "-".to_owned() } else { text.to_owned() };
        let texel = if self.texel_nm == [0; 2] {
            "unknown".into()
        } else {
            format!("{} x {} nm", self.texel_nm[0], self.texel_nm[1])
        };
        let mut text = format!(
            "{}\n  format      {}\n  origin      {}\n  licence     {}\n  size        {} x {} texels of {texel}\n  \
             directions  {} light, {} view\n  cosine      {}\n  dataset     {} bytes in binary16\n",
            known(&self.texts[0]),
            self.format,
            known(&self.texts[1]),
            known(&self.texts[2]),
            self.size[0],
            self.size[1],
            self.directions[0],
            self.directions[1],
            if self.cosine_included { "included" } else { "not included" },
            self.dataset_bytes,
        );
        if let Some(s) = &self.statistics {
            text += &format!(
                "  values      mean {:.6}, {:.6}, {:.6}; {} to {}\n",
                s.mean[0], s.mean[1], s.mean[2], s.least, s.largest
            );
        }
        if let Some(head) = &self.btf {
            text += &format!("  stored      {}\n  channels    {}\n", head.layout, head.channels.join(", "));
            if let Some([width, height]) = head.height_map {
                text += &format!("  height map  {width} x {height}\n");
            }
            if head.rotations > 0 {
                text += &format!(
                    "  rotations   {}, of which {} are not the identity\n",
                    head.rotations, head.rotated
                );
            }
            if head.unread > 0 {
                text += &format!("  unread      {} bytes behind the values\n", head.unread);
            }
        }
        text
    }
}

/// Describes what a path with third-party data holds; of a set of images, only the first is opened.
///
/// # Errors
/// If it is not as its format says, and on I/O.
pub fn info(path: &Path, kind: Kind, memory: usize) -> Result<ForeignInfo> {
    match kind {
        Kind::Dataset => {
            let dataset = Dataset::open(path)?;
            let words = if dataset.description().sample == Sample::Half { "binary16" } else { "binary32" };
            let info = ForeignInfo::new(kind, format!("dataset, {words}"), dataset.description());
            Ok(ForeignInfo { statistics: Some(*dataset.statistics()), ..info })
        }
        Kind::Btf => {
            let btf = Btf::open(path)?;
            let info = ForeignInfo::new(kind, btf.head().signature, &btf.description());
            Ok(ForeignInfo { btf: Some(btf.head().clone()), ..info })
        }
        Kind::SparseBtf => {
            let names = sparsebtf::materials_in(path)?;
            let material = sparsebtf::read_material(path, &names[0], None)?;
            let [count, edge] = [material.directions.len(), material.rows[0]];
            let description = Description {
                size: material.blocks.map(|blocks| blocks * edge),
                lights: material.directions.clone(),
                views: material.directions,
                cosine_included: true,
                texts: [names.join(", "), String::new(), String::new()],
                ..Description::default()
            };
            let channels: Vec<&str> = ["Y", "U", "V"]
                .into_iter()
                .zip(&material.channels)
                .filter(|(_, c)| c.is_some())
                .map(|(name, _)| name)
                .collect();
            Ok(ForeignInfo::new(
                kind,
                format!("coefficients of SparseBTF, channels {}, {count} directions", channels.join(", ")),
                &description,
            ))
        }
        _ => {
            let set = ImageSet::open(path, memory)?;
            let words = if kind == Kind::Zip { "zip archive of images" } else { "folder of images" };
            Ok(ForeignInfo::new(kind, words, set.description()))
        }
    }
}
