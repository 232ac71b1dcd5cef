//! Directions held out: methods that did not see some of them, measured at those.

use super::groups::everything;
use super::keys::{Keys, finder, known, locator};
use super::swept::{Made, Memory, Visitor};
use crate::data::dataset::{Dataset, Description, Writer};
use crate::error::{Result, ToolError};
use crate::measure::verify::open_made;
use crate::report::line::HeldOut;
use crate::report::store::Store;
use std::path::Path;

/// Every N-th direction is held out, but for the border of the hemisphere.
const HELD: usize = 7;
/// Smallest height of a direction that is held out: beyond the others would be extrapolated.
const INSIDE: f64 = 0.45;

/// Some directions of a dataset, as a dataset.
///
/// # Errors
/// If data cannot be read or written.
fn subset(data: &Dataset, lights: &[usize], views: &[usize], path: &Path) -> Result<Dataset> {
    let description = data.description();
    let pick = |set: &[glam::DVec3], which: &[usize]| which.iter().map(|&i| set[i]).collect();
    let own = Description {
        lights: pick(&description.lights, lights),
        views: pick(&description.views, views),
        ..description.clone()
    };
    let writer = Writer::create(path, own)?;
    let (mut bytes, mut texel) = (Vec::new(), vec![0.0; description.texel_len()]);
    for i in 0..description.texels() {
        data.read(i, 1, &mut bytes, &mut texel)?;
        let pair = |view: usize, light: usize| (view * description.lights.len() + light) * 3;
        let values: Vec<f32> = views
            .iter()
            .flat_map(|&v| lights.iter().map(move |&l| (v, l)))
            .flat_map(|(v, l)| texel[pair(v, l)..][..3].to_vec())
            .collect();
        writer.put(i, 0, &values)?;
    }
    writer.finish()?;
    Dataset::open(path)
}

/// Directions that are held out, every N-th of those well inside the hemisphere; and the others.
fn split(set: &[glam::DVec3]) -> [Vec<usize>; 2] {
    let mut inside = 0;
    let (mut held, mut rest) = (Vec::new(), Vec::new());
    for (i, direction) in set.iter().enumerate() {
        if direction.z > INSIDE {
            inside += 1;
        }
        if direction.z > INSIDE && inside % HELD == HELD / 2 { held.push(i) } else { rest.push(i) }
    }
    [held, rest]
}

/// One budget again, on data without some directions.
pub(super) struct HoldOut<'a> {
    /// What lines are found by.
    pub(super) keys: &'a Keys<'a>,
    /// All data.
    pub(super) data: &'a Dataset,
    /// The budget, bytes.
    pub(super) budget: u64,
    /// Errors of pairs that were seen are taken at every N-th light of each view.
    pub(super) every: usize,
}

impl HoldOut<'_> {
    /// Makes and measures what `held` has not.
    ///
    /// # Errors
    /// If data cannot be read or results not be written.
    pub(super) fn run(&self, held: &mut Store<HeldOut>, log: &dyn Fn(&str)) -> Result<()> {
        let HoldOut { keys, data, budget, every } = *self;
        let description = data.description();
        let ([held_lights, lights], [held_views, views]) =
            (split(&description.lights), split(&description.views));
        if held_lights.is_empty() || held_views.is_empty() || lights.len() < 3 || views.len() < 3 {
            log("too few directions to hold some out");
            return Ok(());
        }
        let out = &keys.request.out;
        let temporary =
            tempfile::Builder::new().prefix(".selvedge-").tempdir_in(out).map_err(ToolError::io(out))?;
        let seen = subset(data, &lights, &views, &temporary.path().join("seen.selvset"))?;
        let unseen = subset(data, &held_lights, &held_views, &temporary.path().join("unseen.selvset"))?;
        let finder_bytes = finder(&seen)?;
        let finder_file = open_made(&finder_bytes, None)?;
        let finds = locator(&finder_file, &seen);
        // One setting of each method: the uncompressed data are asked for by their own bytes.
        let whole = seen.description().half_bytes();
        let known = known(held);
        let wanted = |method: &str, asked: u64| {
            keys.is_wanted(&known, method, if asked == whole { whole } else { budget })
        };
        let (offset, peak) = (data.statistics().log_offset(), data.statistics().largest);
        let mut visit = |made: Made| -> Result<()> {
            made.what.with(|subject, bytes| {
                let errors =
                    |part: &Dataset, every: usize| subject.metrics(&finds, part, every, offset, peak);
                held.add(HeldOut {
                    key: keys.key(&made.method, made.budget),
                    dataset: keys.name.clone(),
                    method: made.method.clone(),
                    bytes,
                    seen: errors(&seen, every)?,
                    unseen: errors(&unseen, 1)?,
                })
            })
        };
        let log = |text: &str| {
            log(&format!("{} lights and {} views held out: {text}", held_lights.len(), held_views.len()))
        };
        let memory = Memory::default();
        let mut visitor = Visitor { wanted: &wanted, visit: &mut visit, log: &log, memory: &memory };
        everything(&seen, keys.request.rank, &[budget], &mut visitor)
    }
}
