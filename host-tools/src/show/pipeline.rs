//! The modelled part of the demo, from data to files: materials are modelled, dictionaries trained, a third
//! material encoded with and without them, measured against its data, and shown.

use crate::data::dataset::{Dataset, Sample};
use crate::data::picture::{Picture, beside_error};
use crate::data::pyramid;
use crate::encode::goal::{Goal, Verified};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::model::{MetadataModel, TransferModel};
use crate::measure::compare;
use crate::measure::radiance::AtLevel;
use crate::methods::sparse_ensemble::dictionary_file::{self, DictionaryFile, Training};
use crate::methods::sparse_ensemble::encode::verified::encode_verified;
use crate::methods::sparse_ensemble::encode::{Encoded, Options, prepare};
use crate::methods::sparse_ensemble::train;
use crate::progress::Quiet;
use crate::show::ball::render_ball;
use crate::synth::{Mesostructure, Request, synthesise};
use selvedge::{Limits, Selvedge};
use std::path::{Path, PathBuf};

/// What the demo's page and its later steps need.
pub(super) struct Modelled {
    /// Files that were written.
    pub(super) written: Vec<(PathBuf, Vec<u8>)>,
    /// A section of the page.
    pub(super) html: String,
}

/// Where lines of progress go.
type Log<'a> = dyn FnMut(String) + 'a;

/// Texels along the side of the encoded material.
const SIZE: usize = 48;
/// Bytes of the files, as parts of the data in binary16.
const RATIOS: [u64; 3] = [1000, 500, 250];
/// Bytes of the file with the trained dictionary, likewise.
const TRAINED_RATIO: u64 = 250;

/// Runs it into a folder.
pub(super) fn run(out: &Path, log: &mut Log<'_>) -> Result<Modelled> {
    let data_folder = out.join("data");
    std::fs::create_dir_all(&data_folder).map_err(ToolError::io(&data_folder))?;
    let [cloth, knit, tissue] = model(&data_folder, log)?;
    let dictionary = train_on(&[&knit, &tissue], &out.join("knit-and-tissue.selvdict"), log)?;
    let (written, rows) = encode(&cloth, &dictionary, out, log)?;
    let balls: Vec<&[u8]> = written.iter().take(RATIOS.len()).map(|(_, bytes)| bytes.as_slice()).collect();
    pictures(&cloth, &balls, out)?;
    let html = html(&rows, cloth.description().half_bytes(), &balls);
    Ok(Modelled { written, html })
}

/// Renders the data: a cloth to encode, a knit and a tissue to train on.
fn model(folder: &Path, log: &mut Log<'_>) -> Result<[Dataset; 3]> {
    let mut rendered = |kind: Mesostructure, size: usize, seed: u64| -> Result<Dataset> {
        let path = folder.join(format!("{}.selvset", kind.name()));
        let request =
            Request { kind, size: [size, size], directions: 81, seed, samples: 4, sample: Sample::Half };
        synthesise(&request, &path, &|_, _| ())?;
        let dataset = Dataset::open(&path)?;
        let (bytes, largest) = (dataset.description().half_bytes(), dataset.statistics().largest);
        log(format!(
            "modelled {}: {size} x {size} texels, 81 x 81 directions, {bytes} bytes, values up to \
             {largest:.2}",
            kind.name()
        ));
        Ok(dataset)
    };
    Ok([
        rendered(Mesostructure::Cloth, SIZE, 1)?,
        rendered(Mesostructure::Knit, 32, 2)?,
        rendered(Mesostructure::Tissue, 32, 3)?,
    ])
}

/// Trains dictionaries and writes them, and reads what was written.
fn train_on(data: &[&Dataset], path: &Path, log: &mut Log<'_>) -> Result<DictionaryFile> {
    let options = train::Options {
        dictionaries: 4,
        sparsity: [64, 16, 16],
        edge: 4,
        blocks: 128,
        iterations: 6,
        ..train::Options::default()
    };
    let Some(trained) = train::train(data, &options, None, &mut |_| true)? else {
        return Err(ToolError::Mismatch("the training was stopped".into()));
    };
    let ends = trained
        .objectives
        .each_ref()
        .map(|o| format!("{:.3} to {:.3}", o.first().unwrap_or(&0.0), o.last().unwrap_or(&0.0)));
    log(format!(
        "trained 4 dictionaries a channel on knit and tissue: error over energy {}",
        ends.join(", ")
    ));
    let description = data[0].description();
    let training = Training {
        lights: description.lights.clone(),
        views: description.views.clone(),
        options,
        materials: vec!["knit".into(), "tissue".into()],
        objectives: trained.objectives.clone(),
        members: trained.members.clone(),
    };
    let metadata = MetadataModel {
        texts: ["demo".into(), "trained on knit and tissue".into(), "CC0-1.0".into()],
        ..MetadataModel::default()
    };
    files::write(path, &dictionary_file::to_bytes(&trained, &training, metadata))?;
    dictionary_file::from_bytes(path, files::read(path)?)
}

/// Files that were written, by path.
type Written = Vec<(PathBuf, Vec<u8>)>;

/// Encodes the cloth with columns of its own at three sizes, and with trained ones; rows of the page's table.
fn encode(
    cloth: &Dataset,
    dictionary: &DictionaryFile,
    out: &Path,
    log: &mut Log<'_>,
) -> Result<(Written, String)> {
    let folder = &out.join("data");
    let temporary = tempfile::tempdir_in(folder).map_err(ToolError::io(folder))?;
    let coarser = pyramid::levels(cloth, 3, temporary.path())?;
    let levels: Vec<&Dataset> = std::iter::once(cloth).chain(&coarser).collect();
    let transfer = TransferModel::Log2 { offset: cloth.statistics().coded_offset() };
    let prepared = prepare(levels, transfer, &|_, _| ())?;
    let raw = cloth.description().half_bytes();
    let options = Options { layers: 2, ..Options::default() };
    let mut rows = String::new();
    let mut written = Vec::new();
    for ratio in RATIOS {
        let goal = Goal::Bytes(raw / ratio);
        let own = |edge| prepared.own_ensembles(edge);
        let verified = encode_verified(&prepared, &own, goal, &options, &Quiet)?;
        rows += &row("own columns", raw, &verified, log);
        written.push((out.join(format!("cloth-{ratio}.selv")), verified.encoded.bytes));
    }
    let ensembles = |edge: usize| dictionary.ensembles.each_ref().map(|e| e.with_edge(edge));
    let options = Options { edge: 4, ..options };
    let goal = Goal::Bytes(raw / TRAINED_RATIO);
    let verified = encode_verified(&prepared, &ensembles, goal, &options, &Quiet)?;
    rows += &row("columns trained on knit and tissue", raw, &verified, log);
    written.push((out.join("cloth-trained.selv"), verified.encoded.bytes));
    written.iter().try_for_each(|(path, bytes)| files::write(path, bytes))?;
    Ok((written, rows))
}

/// A row of the page's table, and a line of the log.
fn row(name: &str, raw: u64, verified: &Verified<Encoded>, log: &mut Log<'_>) -> String {
    let Verified { encoded, metrics, operations } = verified;
    let (bytes, edge) = (encoded.bytes.len(), encoded.model.edge);
    let ratio = raw as f64 / bytes as f64;
    let (log_rms, linear_rms, psnr) = (metrics.log_rms, metrics.linear_rms, metrics.psnr_db);
    log(format!(
        "encoded cloth, {name}: {bytes} bytes ({ratio:.0}:1), blocks of {edge} x {edge}, log RMS {log_rms:.4}, \
         linear RMS {linear_rms:.5}, {operations} operations"
    ));
    format!(
        "<tr><td>{name}</td><td>{bytes}</td><td>{ratio:.0}:1</td><td>{edge}</td><td>{log_rms:.4}</td>\
         <td>{linear_rms:.5}</td><td>{psnr:.2}</td><td>{operations}</td></tr>\n"
    )
}

/// Opens a file that was just written.
fn opened(bytes: &[u8]) -> Result<Selvedge<'_>> {
    selvedge::open(bytes, &Limits::NONE).map_err(|finding| ToolError::Mismatch(finding.to_string()))
}

/// Decoded images beside the data, of the last file; a ball of each.
fn pictures(cloth: &Dataset, files: &[&[u8]], out: &Path) -> Result<()> {
    let Some(last) = files.last() else { return Ok(()) };
    let file = opened(last)?;
    let description = cloth.description();
    for (number, [light, view]) in [[0, 0], [21, 3], [60, 42]].into_iter().enumerate() {
        let decoded = compare::image(&AtLevel::finest(&file), description, light, view)?;
        let reference = compare::image(cloth, description, light, view)?;
        let picture =
            beside_error(&decoded, &reference, description.size, cloth.statistics().log_offset(), 1.0, 1.0);
        picture.save(&out.join(format!("cloth-{number}.png")))?;
    }
    let light = glam::DVec3::new(-0.45, 0.5, 0.74).normalize();
    let ball = |bytes: &&[u8]| render_ball(&opened(bytes)?, 320, light, 1.0);
    let balls = files.iter().map(ball).collect::<Result<Vec<_>>>()?;
    Picture::beside(&balls, 12).save(&out.join("cloth-balls.png"))
}

/// The section of the page.
fn html(rows: &str, raw: u64, balls: &[&[u8]]) -> String {
    format!(
        "<h2>From data to files</h2><p>A modelled cloth, encoded within {} of the {raw} bytes that its data have in \
         binary16; two quality layers, three levels of detail. Errors are of the file as decoded, over all texels and \
         pairs of directions.</p><table><tr><th>columns</th><th>bytes</th><th>ratio</th><th>edge</th><th>log RMS</th>\
         <th>linear RMS</th><th>PSNR, dB</th><th>operations</th></tr>{rows}</table>\
         <p><img src=\"cloth-balls.png\" alt=\"balls of cloth\"></p><p>{} bytes a ball, from left to right.</p>\
         <p>Decoded (1/{}), data, error (white is 1 in the natural logarithm), at three pairs of directions:</p>\
         <p><img src=\"cloth-0.png\" alt=\"cloth from above\"></p>\
         <p><img src=\"cloth-1.png\" alt=\"cloth lit from the side\"></p>\
         <p><img src=\"cloth-2.png\" alt=\"cloth at grazing angles\"></p>",
        RATIOS.map(|ratio| format!("1/{ratio}")).join(", "),
        balls.iter().map(|bytes| bytes.len().to_string()).collect::<Vec<_>>().join(", "),
        RATIOS[RATIOS.len() - 1],
    )
}
