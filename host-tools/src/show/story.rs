//! The encoder's part of the demo: materials are modelled, dictionaries trained, a third material encoded
//! with and without them, measured against its data, and shown.

use crate::data::dataset::{Dataset, Sample};
use crate::data::picture::{Picture, beside_error};
use crate::data::pyramid;
use crate::encode::goal::{Goal, Verified};
use crate::error::{Result, ToolError};
use crate::files;
use crate::format::model::{MetadataModel, TransferModel};
use crate::measure::compare::{self, Source};
use crate::methods::sparse_ensemble::dictionary_file::{self, Training};
use crate::methods::sparse_ensemble::encode::verified::encode_verified;
use crate::methods::sparse_ensemble::encode::{Encoded, Options, prepare};
use crate::methods::sparse_ensemble::train;
use crate::progress::Quiet;
use crate::show::ball::render_ball;
use crate::synth::{Mesostructure, Request, synthesise};
use selvedge::Limits;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What the demo's page and its later steps need.
pub struct Story {
    /// Files that were written.
    pub written: Vec<(PathBuf, Vec<u8>)>,
    /// A section of the page.
    pub html: String,
}

/// Texels along the side of the encoded material.
const SIZE: usize = 48;
/// Bytes of the files, as parts of the data in binary16.
const RATIOS: [u64; 3] = [1000, 500, 250];
/// Bytes of the file with the trained dictionary, likewise.
const TRAINED_RATIO: u64 = 250;

/// Runs it into a folder.
pub fn tell(out: &Path, say: &mut dyn FnMut(String)) -> Result<Story> {
    let data_folder = out.join("data");
    std::fs::create_dir_all(&data_folder).map_err(ToolError::io(&data_folder))?;
    let mut datasets = Vec::new();
    for (kind, size, seed) in
        [(Mesostructure::Cloth, SIZE, 1), (Mesostructure::Knit, 32, 2), (Mesostructure::Tissue, 32, 3)]
    {
        let path = data_folder.join(format!("{}.selvset", kind.name()));
        let request =
            Request { kind, size: [size, size], directions: 81, seed, samples: 4, sample: Sample::Half };
        synthesise(&request, &path, &|_, _| ())?;
        let dataset = Dataset::open(&path)?;
        let (bytes, largest) = (dataset.description().half_bytes(), dataset.statistics().largest);
        say(format!(
            "modelled {}: {size} x {size} texels, 81 x 81 directions, {bytes} bytes, values up to {largest:.2}",
            kind.name()
        ));
        datasets.push(dataset);
    }
    let [cloth, others @ ..] = datasets.as_slice() else {
        return Err(ToolError::Mismatch("no dataset".into()));
    };

    let options = train::Options {
        dictionaries: 4,
        sparsity: [64, 16, 16],
        edge: 4,
        blocks: 128,
        iterations: 6,
        ..train::Options::default()
    };
    let references: Vec<&Dataset> = others.iter().collect();
    let Some(trained) = train::train(&references, &options, None, &mut |_| true)? else {
        return Err(ToolError::Mismatch("the training was stopped".into()));
    };
    let ends = trained
        .objectives
        .each_ref()
        .map(|o| format!("{:.3} to {:.3}", o.first().unwrap_or(&0.0), o.last().unwrap_or(&0.0)));
    say(format!(
        "trained 4 dictionaries a channel on knit and tissue: error over energy {}",
        ends.join(", ")
    ));
    let description = others[0].description();
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
    let dictionary_path = out.join("knit-and-tissue.selvdict");
    files::write(&dictionary_path, &dictionary_file::to_bytes(&trained, &training, metadata))?;
    let dictionary = dictionary_file::from_bytes(&dictionary_path, files::read(&dictionary_path)?)?;

    let temporary = tempfile::tempdir_in(&data_folder).map_err(ToolError::io(&data_folder))?;
    let coarser = pyramid::levels(cloth, 3, temporary.path())?;
    let levels: Vec<&Dataset> = std::iter::once(cloth).chain(&coarser).collect();
    let transfer = TransferModel::Log2 { offset: cloth.statistics().coded_offset() };
    let prepared = prepare(levels, transfer, &|_, _| ())?;
    let raw = cloth.description().half_bytes();
    let options = Options { layers: 2, ..Options::default() };
    let mut rows = String::new();
    let mut written = Vec::new();
    let mut row = |name: &str, verified: &Verified<Encoded>, say: &mut dyn FnMut(String)| {
        let (bytes, metrics) = (verified.encoded.bytes.len(), &verified.metrics);
        let ratio = raw as f64 / bytes as f64;
        say(format!(
            "encoded cloth, {name}: {bytes} bytes ({ratio:.0}:1), blocks of {edge} x {edge}, log RMS {log:.4}, linear RMS {linear:.5}, {operations} operations",
            edge = verified.encoded.model.edge,
            log = metrics.log_rms,
            linear = metrics.linear_rms,
            operations = verified.operations
        ));
        let _ = writeln!(
            rows,
            "<tr><td>{name}</td><td>{bytes}</td><td>{ratio:.0}:1</td><td>{}</td><td>{:.4}</td><td>{:.5}</td><td>{:.2}</td><td>{}</td></tr>",
            verified.encoded.model.edge,
            metrics.log_rms,
            metrics.linear_rms,
            metrics.psnr_db,
            verified.operations
        );
    };
    for ratio in RATIOS {
        let verified = encode_verified(
            &prepared,
            &|edge| prepared.own_ensembles(edge),
            Goal::Bytes(raw / ratio),
            &options,
            &Quiet,
        )?;
        row("own columns", &verified, say);
        written.push((out.join(format!("cloth-{ratio}.selv")), verified.encoded.bytes));
    }
    let ensembles = |edge: usize| dictionary.ensembles.each_ref().map(|e| e.with_edge(edge));
    let options = Options { edge: 4, ..options };
    let verified =
        encode_verified(&prepared, &ensembles, Goal::Bytes(raw / TRAINED_RATIO), &options, &Quiet)?;
    row("columns trained on knit and tissue", &verified, say);
    written.push((out.join("cloth-trained.selv"), verified.encoded.bytes));
    for (path, bytes) in &written {
        files::write(path, bytes)?;
    }

    let (_, bytes) = &written[RATIOS.len() - 1];
    let file =
        selvedge::open(bytes, &Limits::NONE).map_err(|finding| ToolError::Mismatch(finding.to_string()))?;
    let description = cloth.description();
    for (number, [light, view]) in [[0, 0], [21, 3], [60, 42]].into_iter().enumerate() {
        let [decoded, reference] = [Source::File(&file, 0), Source::Data(cloth)]
            .map(|source| compare::image(source, description, light, view));
        let picture =
            beside_error(&decoded?, &reference?, description.size, cloth.statistics().log_offset(), 1.0, 1.0);
        picture.save(&out.join(format!("cloth-{number}.png")))?;
    }
    let light = glam::DVec3::new(-0.45, 0.5, 0.74).normalize();
    let balls: Vec<Picture> = written
        .iter()
        .take(RATIOS.len())
        .map(|(_, bytes)| {
            let file = selvedge::open(bytes, &Limits::NONE)
                .map_err(|finding| ToolError::Mismatch(finding.to_string()))?;
            render_ball(&file, 320, light, 1.0)
        })
        .collect::<Result<_>>()?;
    Picture::beside(&balls, 12).save(&out.join("cloth-balls.png"))?;

    let html = format!(
        "<h2>From data to files</h2><p>A modelled cloth, encoded within {} of the {raw} bytes that its data have in binary16; two quality \
layers, three levels of detail. Errors are of the file as decoded, over all texels and pairs of directions.</p>\
<table><tr><th>columns</th><th>bytes</th><th>ratio</th><th>edge</th><th>log RMS</th><th>linear RMS</th><th>PSNR, dB</th><th>operations</th></tr>{rows}</table>\
<p><img src=\"cloth-balls.png\" alt=\"balls of cloth\"></p><p>{} bytes a ball, from left to right.</p>\
<p>Decoded (1/{}), data, error (white is 1 in the natural logarithm), at three pairs of directions:</p>\
<p><img src=\"cloth-0.png\" alt=\"cloth from above\"></p><p><img src=\"cloth-1.png\" alt=\"cloth lit from the side\"></p><p><img src=\"cloth-2.png\" alt=\"cloth at grazing angles\"></p>",
        RATIOS.map(|r| format!("1/{r}")).join(", "),
        written
            .iter()
            .take(RATIOS.len())
            .map(|(_, bytes)| bytes.len().to_string())
            .collect::<Vec<_>>()
            .join(", "),
        RATIOS[RATIOS.len() - 1],
    );
    Ok(Story { written, html })
}
