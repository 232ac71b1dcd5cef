//! Trained ensembles as files: a Selvedge file of content 1 with all columns of every dictionary, in
//! integers.
//!
//! What the factors themselves do not say, the directions and how training went, stands beside them in a
//! section of an optional kind as JSON, which decoders skip.

use crate::error::{Result, ToolError};
use crate::format::container::take_apart;
use crate::format::model::{MaterialModel, MetadataModel, TransferModel};
use crate::format::triangulate::project;
use crate::format::write::write_dictionary;
use crate::math::linear::{Basis, nearest_orthogonal, product_at};
use crate::methods::sparse_ensemble::dictionary::{Ensemble, Turn};
use crate::methods::sparse_ensemble::encode::columns::Used;
use crate::methods::sparse_ensemble::model::{DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel};
use crate::methods::sparse_ensemble::train::{Options, Trained};
use glam::DVec3;
use selvedge::Limits;
use selvedge::method::sparse_ensemble::check::{ANGULAR, SPATIAL};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Kind of the section of [`Training`].
pub const TRAINING: u16 = 0x8001;

/// What is known of a dictionary beside its factors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Light directions that rows belong to.
    pub lights: Vec<DVec3>,
    /// View directions.
    pub views: Vec<DVec3>,
    /// How it was trained.
    pub options: Options,
    /// Names of the materials it was trained on.
    pub materials: Vec<String>,
    /// Error energy over that of the blocks, after each assignment, of each channel.
    pub objectives: [Vec<f64>; 3],
    /// Blocks of each dictionary.
    pub members: [Vec<usize>; 3],
}

/// A dictionary file, ready to encode with.
#[derive(Clone, Debug, PartialEq)]
pub struct DictionaryFile {
    /// The file itself.
    pub bytes: Vec<u8>,
    /// The ensembles, with the integer columns.
    pub ensembles: [Ensemble; 3],
    /// What is known of it.
    pub training: Training,
}

fn to_factor(basis: &Basis) -> FactorModel {
    Used::new(basis, &vec![true; basis.columns]).factor
}

fn to_basis(factor: &FactorModel) -> Basis {
    let columns = factor.columns as usize;
    let rows = factor.entries.len() / columns.max(1);
    let norm = |c: usize| {
        (0..rows).map(|r| (factor.entries[r * columns + c] as f64).powi(2)).sum::<f64>().sqrt().max(1e-9)
    };
    let norms: Vec<f64> = (0..columns).map(norm).collect();
    Basis::from_fn(rows, columns, |r, c| (factor.entries[r * columns + c] as f64 / norms[c]) as f32)
}

/// The bytes of a trained ensemble.
pub fn to_bytes(trained: &Trained, training: &Training, metadata: MetadataModel) -> Vec<u8> {
    let channel = |ensemble: &Ensemble| {
        let dictionary = |k: usize| {
            let [light, view] = ensemble.angular(k);
            let turn = &ensemble.turns[k];
            DictionaryModel {
                light: to_factor(&light),
                view: to_factor(&view),
                x: to_factor(&turn.x),
                y: to_factor(&turn.y),
            }
        };
        let dictionaries: Vec<DictionaryModel> = (0..ensemble.turns.len()).map(dictionary).collect();
        Some(EnsembleModel { dictionaries, ..EnsembleModel::default() })
    };
    let mut json = serde_json::to_vec(training).expect("plain data");
    json.resize(json.len().next_multiple_of(4), b' ');
    let project_all = |set: &[DVec3]| set.iter().map(|&d| project(d)).collect::<Vec<_>>();
    let model: MaterialModel = MaterialModel {
        size: [1, 1],
        level_count: 1,
        edge: training.options.edge as u32,
        layer_count: 1,
        transfer: TransferModel::Linear { exponent: 0 },
        cosine_included: false,
        matrix_q13: [0; 9],
        metadata,
        lights: project_all(&training.lights),
        views: (training.views != training.lights).then(|| project_all(&training.views)),
        channels: Default::default(),
        texture: Box::new(EnsembleTexture { channels: trained.ensembles.each_ref().map(channel) }),
        extras: vec![(TRAINING, 0, json)],
    };
    write_dictionary(&model)
}

/// Reads a dictionary file that this module wrote.
///
/// # Errors
/// If it breaks a rule of the format, or does not say how it was trained.
pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<DictionaryFile> {
    let mut finding = None;
    selvedge::validate(&bytes, None, &Limits::NONE, &mut |found: selvedge::Finding| {
        finding = Some(found);
        false
    });
    if let Some(finding) = finding {
        return Err(ToolError::Invalid { path: path.to_owned(), finding });
    }
    let fail = |what: &str| ToolError::Foreign { path: path.to_owned(), offset: 0, what: what.into() };
    let (_, parts) = take_apart(&bytes);
    let json = parts
        .iter()
        .find(|p| p.kind == TRAINING as u32)
        .ok_or_else(|| fail("this is not a dictionary made by training"))?;
    let training: Training = serde_json::from_slice(&json.bytes).map_err(|error| fail(&error.to_string()))?;
    let rows = [training.lights.len(), training.views.len()];
    let edge = training.options.edge;
    let mut ensembles: [Ensemble; 3] = Default::default();
    for (c, ensemble) in ensembles.iter_mut().enumerate() {
        let factors = |kind: u32, rows: [usize; 2]| -> Option<Vec<[FactorModel; 2]>> {
            let part = parts.iter().find(|p| p.kind == kind && p.instance == c as u32)?;
            read_factors(&part.bytes, rows)
        };
        let (Some(angular), Some(spatial)) = (factors(ANGULAR, rows), factors(SPATIAL, [edge, edge])) else {
            return Err(fail(&format!(
                "channel {c} has no factors of {} x {} directions and {edge} x {edge} texels",
                rows[0], rows[1]
            )));
        };
        let tables: Vec<DictionaryModel> = angular
            .into_iter()
            .zip(spatial)
            .map(|([light, view], [x, y])| DictionaryModel { light, view, x, y })
            .collect();
        *ensemble = to_ensemble(tables).ok_or_else(|| fail("the dictionaries have no bases in common"))?;
    }
    Ok(DictionaryFile { bytes, ensembles, training })
}

/// The two tables of each dictionary in a section of factors (10.1, 10.2), which is known to be legal.
fn read_factors(bytes: &[u8], rows: [usize; 2]) -> Option<Vec<[FactorModel; 2]>> {
    let word = |i: usize| bytes.get(i * 4..i * 4 + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let table = |columns: u32, start: u32, rows: usize| -> Option<FactorModel> {
        let row_bytes = columns.div_ceil(2) as usize * 4;
        let mut entries = Vec::new();
        for row in 0..rows {
            let at = start as usize * 4 + row * row_bytes;
            entries.extend(
                bytes
                    .get(at..at + columns as usize * 2)?
                    .as_chunks::<2>()
                    .0
                    .iter()
                    .map(|&b| i16::from_le_bytes(b)),
            );
        }
        Some(FactorModel { columns, entries })
    };
    (0..word(0)? as usize)
        .map(|k| {
            let at = 2 + 4 * k;
            Some([table(word(at)?, word(at + 2)?, rows[0])?, table(word(at + 1)?, word(at + 3)?, rows[1])?])
        })
        .collect()
}

/// Columns from the first on in which dictionaries differ.
fn turned_columns(factors: &[&FactorModel]) -> usize {
    let columns = factors[0].columns as usize;
    let differs = |c: &usize| {
        let column =
            |f: &FactorModel| f.entries.iter().skip(*c).step_by(columns).copied().collect::<Vec<i16>>();
        factors.iter().any(|f| column(f) != column(factors[0]))
    };
    (0..columns).rev().find(differs).map_or(0, |c| c + 1)
}

/// Shared bases are those of the first dictionary; the others turn its first columns.
fn to_ensemble(tables: Vec<DictionaryModel>) -> Option<Ensemble> {
    let first = tables.first()?;
    if tables.iter().any(|t| t.light.columns != first.light.columns || t.view.columns != first.view.columns) {
        return None;
    }
    let (light, view) = (to_basis(&first.light), to_basis(&first.view));
    let turn_of =
        |shared: &Basis, pick: &dyn Fn(&DictionaryModel) -> &FactorModel| -> Option<Vec<Option<Basis>>> {
            let r = turned_columns(&tables.iter().map(pick).collect::<Vec<_>>());
            let base = shared.first(r);
            let turn = |(k, table): (usize, &DictionaryModel)| {
                if k == 0 || r == 0 {
                    return Some(None);
                }
                let mut product = vec![0.0; r * r];
                product_at(
                    &mut product,
                    &base.entries,
                    &to_basis(pick(table)).first(r).entries,
                    [r, base.rows, r],
                    false,
                );
                nearest_orthogonal(&product.iter().map(|&p| p as f64).collect::<Vec<_>>(), r).map(Some)
            };
            tables.iter().enumerate().map(turn).collect()
        };
    let (lights, views) = (turn_of(&light, &|t| &t.light)?, turn_of(&view, &|t| &t.view)?);
    let turns = tables.iter().zip(lights.into_iter().zip(views)).map(|(t, (light, view))| Turn {
        light,
        view,
        x: to_basis(&t.x),
        y: to_basis(&t.y),
    });
    Some(Ensemble { turns: turns.collect(), light, view, tables: Some(tables) })
}
