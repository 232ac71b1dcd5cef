//! Training of an ensemble of orthonormal 4-D dictionaries (SparseBTF 2023, equation 2), one time, for unseen
//! materials.
//!
//! Alternates three steps, none of which can raise the objective: each block goes to the dictionary that
//! leaves the least error with `sparsity` coefficients; its coefficients are cut to those (hard
//! thresholding); and each basis of each dictionary becomes the orthogonal matrix that fits the cut
//! coefficients best (orthogonal Procrustes, by a singular value decomposition), mode by mode. Light and view
//! bases are turned within a subspace of the leading eigenvectors over all materials (HOSVD), which divides
//! the work by ten and more; outside of it all dictionaries share the remaining eigenvectors, so that their
//! bases are complete.
//!
//! Every sum is made in a fixed order: the result depends neither on the number of threads nor on
//! interruptions.

use crate::data::dataset::Dataset;
use crate::error::{Result, ToolError};
use crate::format::model::TransferModel;
use crate::math::linear::{Basis, eigenbasis, nearest_orthogonal};
use crate::math::random::Random;
use crate::methods::sparse_ensemble::blocks::{self, Blocks, Moments};
use crate::methods::sparse_ensemble::dictionary::{Ensemble, Scratch, Turn};
use crate::methods::sparse_ensemble::encode::candidates::magnitude_of_rank;
use crate::methods::sparse_ensemble::encode::{Prepared, prepare};
use crate::work::ordered;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Dictionaries of each channel.
    pub dictionaries: usize,
    /// Coefficients of a block in each channel.
    pub sparsity: [usize; 3],
    /// Texels along the side of a block.
    pub edge: usize,
    /// Columns of the light and view bases that are trained; more than there are directions means all.
    pub subspace: usize,
    /// Blocks to train on, of all materials together.
    pub blocks: usize,
    /// Most iterations of each channel.
    pub iterations: usize,
    /// Ends a channel when an iteration improves the objective by less than this part of it.
    pub tolerance: f64,
    /// Chooses the blocks.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            dictionaries: 8,
            sparsity: [256, 32, 32],
            edge: 10,
            subspace: 48,
            blocks: 2880,
            iterations: 40,
            tolerance: 1e-4,
            seed: 1,
        }
    }
}

/// What training reports while it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Channel, 0 to 2.
    pub channel: usize,
    /// Iteration of this channel, from 0.
    pub iteration: usize,
    /// Error energy over that of the blocks.
    pub objective: f64,
    /// Dictionaries without a block that were started again.
    pub revived: usize,
}

/// A trained ensemble of each channel and how its objective went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trained {
    /// The ensembles.
    pub ensembles: [Ensemble; 3],
    /// Error energy over that of the blocks, after each assignment.
    pub objectives: [Vec<f64>; 3],
    /// Blocks of each dictionary.
    pub members: [Vec<usize>; 3],
}

/// A kept coefficient of a block.
type Kept = Vec<(u32, f32)>;

/// Everything that the next iteration depends on, as it is kept on disk.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct State {
    /// What it was made from; another training does not continue it.
    identity: String,
    /// Channel that is being trained.
    channel: usize,
    /// Iterations that this channel has had.
    iteration: usize,
    /// Dictionary of each block.
    assigned: Vec<u32>,
    /// Turns of each channel so far: light, view, x, y of each dictionary, the bits of their entries.
    turns: [Vec<[Vec<u32>; 4]>; 3],
    objectives: [Vec<f64>; 3],
    members: [Vec<usize>; 3],
}

fn to_bits(basis: &Basis) -> Vec<u32> {
    basis.entries.iter().map(|entry| entry.to_bits()).collect()
}

fn from_bits(bits: &[u32]) -> Basis {
    let n = bits.len().isqrt();
    Basis { rows: n, columns: n, entries: bits.iter().map(|&bits| f32::from_bits(bits)).collect() }
}

/// Where blocks to train on are: dataset and number of the block.
fn choose_blocks(prepared: &[Prepared<'_>], options: &Options) -> Vec<(usize, usize)> {
    let all: Vec<(usize, usize)> = prepared
        .iter()
        .enumerate()
        .flat_map(|(d, prepared)| {
            let [width, height] = prepared.levels[0].description().size;
            // Blocks that the image fills, or those of an image smaller than a block.
            let (across, down) = ((width / options.edge).max(1), (height / options.edge).max(1));
            let stride = width.div_ceil(options.edge);
            (0..across * down).map(move |i| (d, i / across * stride + i % across))
        })
        .collect();
    let count = options.blocks.clamp(1, all.len());
    let mut order = all;
    let mut random = Random::new(options.seed);
    for i in 0..count {
        let other = random.range(i as i64, order.len() as i64 - 1) as usize;
        order.swap(i, other);
    }
    order.truncate(count);
    order.sort_unstable();
    order
}

/// Trains on datasets with equal directions.
///
/// With `state` the progress of every iteration is kept in that file and continued from it; it is removed at
/// the end. `tell` hears of each iteration and may stop the training by `false`, after which `Ok(None)` is
/// returned.
///
/// # Errors
/// If datasets differ in their directions or cannot be read, or the state is of another training.
pub fn train(
    datasets: &[&Dataset],
    options: &Options,
    state: Option<&Path>,
    tell: &mut dyn FnMut(Step) -> bool,
) -> Result<Option<Trained>> {
    let [lights, views] = equal_directions(datasets)?;
    let identity = identity(datasets, options);
    let mut now = match state.filter(|path| path.exists()) {
        Some(path) => resume(path, identity)?,
        None => State { identity, ..State::default() },
    };
    let mut prepared = Vec::new();
    for dataset in datasets {
        let transfer = TransferModel::Log2 { offset: dataset.statistics().coded_offset() };
        prepared.push(prepare(vec![dataset], transfer, &|_, _| ())?);
    }
    let chosen = choose_blocks(&prepared, options);
    let subspaces = [lights, views].map(|n| options.subspace.clamp(1, n));
    while now.channel < 3 {
        let full = shared_bases(&prepared, now.channel, [lights, views]);
        let shared = Ensemble {
            light: full[0].first(subspaces[0]),
            view: full[1].first(subspaces[1]),
            ..Ensemble::default()
        };
        let set = Set::read(&prepared, &chosen, now.channel, shared, options)?;
        let mut each = |now: &State, step: Step| -> Result<bool> {
            if let Some(path) = state {
                crate::files::write(path, &serde_json::to_vec(now).expect("plain data"))?;
            }
            Ok(tell(step))
        };
        if !train_channel(&set, options, &mut now, &mut each)? {
            return Ok(None);
        }
    }
    let ensembles = std::array::from_fn(|c| {
        let [light, view] = shared_bases(&prepared, c, [lights, views]);
        Ensemble { light, view, turns: turns_from_bits(&now.turns[c]), tables: None }
    });
    if let Some(path) = state {
        std::fs::remove_file(path).map_err(ToolError::io(path))?;
    }
    Ok(Some(Trained { ensembles, objectives: now.objectives, members: now.members }))
}

/// The numbers of light and view directions of datasets that have the same.
fn equal_directions(datasets: &[&Dataset]) -> Result<[usize; 2]> {
    let Some(first) = datasets.first() else {
        return Err(ToolError::Usage("training needs a dataset".into()));
    };
    for dataset in datasets {
        let other = dataset.description();
        if other.lights != first.description().lights || other.views != first.description().views {
            return Err(ToolError::Usage(format!(
                "{}: other directions than those of {}",
                dataset.path().display(),
                first.path().display()
            )));
        }
    }
    Ok([first.description().lights.len(), first.description().views.len()])
}

/// The state of this training in a file.
fn resume(path: &Path, identity: String) -> Result<State> {
    let bytes = crate::files::read(path)?;
    let found: State = serde_json::from_slice(&bytes).map_err(|error| ToolError::Foreign {
        path: path.to_owned(),
        offset: 0,
        what: error.to_string(),
    })?;
    if found.identity != identity {
        return Err(ToolError::Usage(format!(
            "{}: is of another training; remove it to start again",
            path.display()
        )));
    }
    Ok(found)
}

/// Trains the channel at which the state is to its end; `false` if `each` stops it.
fn train_channel(
    set: &Set,
    options: &Options,
    now: &mut State,
    each: &mut dyn FnMut(&State, Step) -> Result<bool>,
) -> Result<bool> {
    let c = now.channel;
    if now.iteration == 0 {
        let (ensemble, assigned) = set.begin(options);
        now.turns[c] = turns_to_bits(&ensemble);
        now.assigned = assigned;
    }
    let mut ensemble = Ensemble { turns: turns_from_bits(&now.turns[c]), ..set.shared.clone() };
    loop {
        let (kept, assigned, error, errors) = set.assign(&ensemble, &now.assigned, options.sparsity[c]);
        now.assigned = assigned;
        let objective = if set.energy > 0.0 { error / set.energy } else { 0.0 };
        let before = now.objectives[c].last().copied();
        now.objectives[c].push(objective);
        let members = |k: usize| now.assigned.iter().filter(|&&a| a as usize == k).count();
        now.members[c] = (0..ensemble.turns.len()).map(members).collect();
        let settled =
            before.is_some_and(|before| before - objective < options.tolerance * before) || objective <= 0.0;
        let last = settled || now.iteration + 1 >= options.iterations;
        let mut revived = 0;
        if !last {
            set.fit(&mut ensemble, &kept, &now.assigned);
            revived = set.revive(&mut ensemble, &now.members[c], &errors);
        }
        let iteration = now.iteration;
        now.iteration += 1;
        now.turns[c] = turns_to_bits(&ensemble);
        if last {
            now.channel += 1;
            now.iteration = 0;
            now.assigned.clear();
        }
        if !each(now, Step { channel: c, iteration, objective, revived })? {
            return Ok(false);
        }
        if last {
            return Ok(true);
        }
    }
}

/// What makes two trainings the same.
fn identity(datasets: &[&Dataset], options: &Options) -> String {
    let of = |dataset: &&Dataset| {
        serde_json::to_string(&(dataset.description(), dataset.statistics())).expect("plain data")
    };
    let all =
        serde_json::to_string(options).expect("plain data") + &datasets.iter().map(of).collect::<String>();
    selvedge::sha256(all.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn turns_to_bits(ensemble: &Ensemble) -> Vec<[Vec<u32>; 4]> {
    let bits = |turn: &Turn| {
        [turn.light.as_ref(), turn.view.as_ref(), Some(&turn.x), Some(&turn.y)]
            .map(|basis| basis.map_or_else(Vec::new, to_bits))
    };
    ensemble.turns.iter().map(bits).collect()
}

fn turns_from_bits(bits: &[[Vec<u32>; 4]]) -> Vec<Turn> {
    let some = |bits: &Vec<u32>| (!bits.is_empty()).then(|| from_bits(bits));
    bits.iter()
        .map(|[light, view, x, y]| Turn {
            light: some(light),
            view: some(view),
            x: from_bits(x),
            y: from_bits(y),
        })
        .collect()
}

/// Eigenvectors between lights and between views, over all materials, each of which counts the same.
fn shared_bases(prepared: &[Prepared<'_>], channel: usize, counts: [usize; 2]) -> [Basis; 2] {
    let sum = |pick: &dyn Fn(&Moments) -> &Vec<f64>, n: usize| {
        let mut total = vec![0.0; n * n];
        for material in prepared {
            let texels = material.levels[0].description().texels() as f64;
            total.iter_mut().zip(pick(&material.moments)).for_each(|(a, b)| *a += b / texels);
        }
        eigenbasis(&total, n).0
    };
    [sum(&|m| &m.lights[channel], counts[0]), sum(&|m| &m.views[channel], counts[1])]
}

/// Blocks of one channel in the subspace.
struct Set {
    shared: Ensemble,
    edge: usize,
    cores: Vec<Vec<f32>>,
    /// Energy of each block, outside of the subspace too.
    energies: Vec<f64>,
    energy: f64,
}

/// The four modes, in the order in which they are fitted.
const MODES: usize = 4;

impl Set {
    fn read(
        prepared: &[Prepared<'_>],
        chosen: &[(usize, usize)],
        channel: usize,
        shared: Ensemble,
        options: &Options,
    ) -> Result<Set> {
        let readers: Vec<Blocks<'_>> = prepared.iter().map(|p| p.blocks(0, options.edge)).collect();
        let work = |i: usize| -> Result<(Vec<f32>, f64)> {
            let (d, block) = chosen[i];
            let (mut scratch, mut planes) = (blocks::Scratch::default(), Default::default());
            readers[d].read(block, &mut scratch, &mut planes)?;
            let mut core = Vec::new();
            shared.to_core(&planes[channel], &mut Scratch::default(), &mut core);
            Ok((core, planes[channel].iter().map(|&v| (v as f64).powi(2)).sum()))
        };
        let start = (Vec::with_capacity(chosen.len()), Vec::new());
        let (cores, energies) =
            ordered(chosen.len(), work, start, |(cores, energies), _, (core, energy)| {
                cores.push(core);
                energies.push(energy);
            })?;
        let energy = energies.iter().sum();
        Ok(Set { shared, edge: options.edge, cores, energies, energy })
    }

    /// Sizes of the modes: light, view, x, y.
    fn sizes(&self) -> [usize; MODES] {
        [self.shared.light.columns, self.shared.view.columns, self.edge, self.edge]
    }

    /// Distance of neighbours along a mode, in a core.
    fn strides(&self) -> [usize; MODES] {
        let [light, view, x, _] = self.sizes();
        [1, light, light * view, light * view * x]
    }

    /// Eigenvectors of each mode over some blocks: the dictionary to begin with.
    fn eigen_turn(&self, blocks: &[usize]) -> Turn {
        let (sizes, strides) = (self.sizes(), self.strides());
        let mut bases: Vec<Basis> = (0..MODES)
            .map(|mode| {
                let (n, stride) = (sizes[mode], strides[mode]);
                let work = |i: usize| -> std::result::Result<Vec<f64>, ()> {
                    let core = &self.cores[blocks[i]];
                    // Rows of this mode: each of `n` places, `stride` numbers side by side.
                    let mut gram = vec![0.0f32; n * n];
                    if stride == 1 {
                        crate::math::linear::product_at(&mut gram, core, core, [n, core.len() / n, n], false);
                    } else {
                        for part in core.chunks(n * stride) {
                            crate::math::linear::product_bt(&mut gram, part, part, [n, stride, n], true);
                        }
                    }
                    Ok(gram.iter().map(|&g| g as f64).collect())
                };
                let sum = ordered(blocks.len(), work, vec![0.0; n * n], |sum, _, gram| {
                    sum.iter_mut().zip(gram).for_each(|(a, b)| *a += b)
                });
                eigenbasis(&sum.unwrap_or_default(), n).0
            })
            .collect();
        let (y, x, view, light) = (bases.remove(3), bases.remove(2), bases.remove(1), bases.remove(0));
        Turn { light: Some(light), view: Some(view), x, y }
    }

    /// Clusters by where a block's energy is, and the eigenvectors of each.
    fn begin(&self, options: &Options) -> (Ensemble, Vec<u32>) {
        let features: Vec<Vec<f32>> = self.cores.iter().map(|core| self.feature(core)).collect();
        let distance =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| ((a - b) as f64).powi(2)).sum::<f64>();
        let count = options.dictionaries.clamp(1, self.cores.len());
        // Farthest first: each centre is the block that is worst served by those before.
        let mut centres: Vec<Vec<f32>> = Vec::new();
        let mut nearest = vec![f64::MAX; features.len()];
        let largest = |values: &[f64]| {
            values
                .iter()
                .enumerate()
                .fold((0, f64::MIN), |best, (i, &v)| if v > best.1 { (i, v) } else { best })
                .0
        };
        while centres.len() < count {
            let next = if centres.is_empty() { largest(&self.energies) } else { largest(&nearest) };
            centres.push(features[next].clone());
            nearest.iter_mut().zip(&features).for_each(|(n, f)| *n = n.min(distance(f, &features[next])));
        }
        let mut assigned = vec![0u32; features.len()];
        for _ in 0..10 {
            for (assigned, feature) in assigned.iter_mut().zip(&features) {
                let distances: Vec<f64> = centres.iter().map(|centre| -distance(feature, centre)).collect();
                *assigned = largest(&distances) as u32;
            }
            for (k, centre) in centres.iter_mut().enumerate() {
                let members: Vec<&Vec<f32>> = features
                    .iter()
                    .zip(&assigned)
                    .filter(|(_, a)| **a as usize == k)
                    .map(|(f, _)| f)
                    .collect();
                if !members.is_empty() {
                    *centre = (0..centre.len())
                        .map(|i| members.iter().map(|f| f[i]).sum::<f32>() / members.len() as f32)
                        .collect();
                }
            }
        }
        let turns = (0..count)
            .map(|k| {
                let members: Vec<usize> =
                    (0..assigned.len()).filter(|&i| assigned[i] as usize == k).collect();
                self.eigen_turn(&members)
            })
            .collect();
        (Ensemble { turns, ..self.shared.clone() }, assigned)
    }

    /// Shares of a block's energy along each mode, as amplitudes.
    fn feature(&self, core: &[f32]) -> Vec<f32> {
        let (sizes, strides) = (self.sizes(), self.strides());
        let mut sums: Vec<Vec<f64>> = sizes.iter().map(|&n| vec![0.0; n]).collect();
        for (i, &value) in core.iter().enumerate() {
            let energy = (value as f64).powi(2);
            for mode in 0..MODES {
                sums[mode][i / strides[mode] % sizes[mode]] += energy;
            }
        }
        let total: f64 = sums[0].iter().sum::<f64>().max(1e-30);
        sums.into_iter().flatten().map(|sum| (sum / total).sqrt() as f32).collect()
    }

    /// The best dictionary of each block, its coefficients, and the errors.
    fn assign(
        &self,
        ensemble: &Ensemble,
        before: &[u32],
        sparsity: usize,
    ) -> (Vec<Kept>, Vec<u32>, f64, Vec<f64>) {
        let work = |i: usize| -> std::result::Result<(Kept, u32, f64), ()> {
            let (mut scratch, mut tensor, mut buckets) = (Scratch::default(), Vec::new(), Vec::new());
            let (mut best, mut most) = (before[i] as usize, f64::MIN);
            for k in 0..ensemble.turns.len() {
                ensemble.to_coefficients(k, &self.cores[i], &mut scratch, &mut tensor);
                let (_, energy) = magnitude_of_rank(&tensor, sparsity, &mut buckets);
                if energy > most {
                    (best, most) = (k, energy);
                }
            }
            // Energies by buckets are near; between the new dictionary and the old the exact ones decide, so
            // that the objective cannot rise.
            let mut exact = |k: usize| {
                ensemble.to_coefficients(k, &self.cores[i], &mut scratch, &mut tensor);
                let (limit, _) = magnitude_of_rank(&tensor, sparsity, &mut buckets);
                largest(&tensor, limit, sparsity)
            };
            let (mut kept, mut energy) = exact(best);
            if best != before[i] as usize {
                let (old, old_energy) = exact(before[i] as usize);
                if old_energy >= energy {
                    (best, kept, energy) = (before[i] as usize, old, old_energy);
                }
            }
            Ok((kept, best as u32, (self.energies[i] - energy).max(0.0)))
        };
        let start = (Vec::new(), Vec::new(), 0.0, Vec::new());
        let done =
            ordered(self.cores.len(), work, start, |(kept, assigned, total, errors), _, (list, k, error)| {
                kept.push(list);
                assigned.push(k);
                *total += error;
                errors.push(error);
            });
        done.unwrap_or_default()
    }

    /// Procrustes updates of every basis of every dictionary.
    fn fit(&self, ensemble: &mut Ensemble, kept: &[Kept], assigned: &[u32]) {
        let (sizes, strides) = (self.sizes(), self.strides());
        for mode in 0..MODES {
            let n = sizes[mode];
            // Everything but this mode.
            let others = Ensemble {
                turns: ensemble
                    .turns
                    .iter()
                    .map(|turn| match mode {
                        0 => Turn { light: None, ..turn.clone() },
                        1 => Turn { view: None, ..turn.clone() },
                        2 => Turn { x: Basis::identity(n), ..turn.clone() },
                        _ => Turn { y: Basis::identity(n), ..turn.clone() },
                    })
                    .collect(),
                ..self.shared.clone()
            };
            let work = |i: usize| -> std::result::Result<Vec<f64>, ()> {
                let (mut scratch, mut tensor) = (Scratch::default(), Vec::new());
                others.to_coefficients(assigned[i] as usize, &self.cores[i], &mut scratch, &mut tensor);
                let mut fit = vec![0.0f64; n * n];
                for &(place, value) in &kept[i] {
                    let column = place as usize / strides[mode] % n;
                    let first = place as usize - column * strides[mode];
                    for row in 0..n {
                        fit[row * n + column] += value as f64 * tensor[first + row * strides[mode]] as f64;
                    }
                }
                Ok(fit)
            };
            let start = vec![vec![0.0; n * n]; ensemble.turns.len()];
            let fits = ordered(self.cores.len(), work, start, |total, i, fit| {
                total[assigned[i] as usize].iter_mut().zip(fit).for_each(|(a, b)| *a += b);
            });
            for (turn, fit) in ensemble.turns.iter_mut().zip(fits.unwrap_or_default()) {
                // A dictionary without blocks has nothing to fit.
                if fit.iter().all(|&f| f == 0.0) {
                    continue;
                }
                if let Some(basis) = nearest_orthogonal(&fit, n) {
                    match mode {
                        0 => turn.light = Some(basis),
                        1 => turn.view = Some(basis),
                        2 => turn.x = basis,
                        _ => turn.y = basis,
                    }
                }
            }
        }
    }

    /// Dictionaries without a block start again, from the blocks with the largest errors.
    fn revive(&self, ensemble: &mut Ensemble, members: &[usize], errors: &[f64]) -> usize {
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(a.cmp(&b)));
        let mut worst = order.into_iter().filter(|&i| errors[i] > 0.0);
        let mut revived = 0;
        for (turn, _) in ensemble.turns.iter_mut().zip(members).filter(|(_, count)| **count == 0) {
            if let Some(block) = worst.next() {
                *turn = self.eigen_turn(&[block]);
                revived += 1;
            }
        }
        revived
    }
}

/// The largest coefficients, at most `count`, among those of at least `limit`; and their energy.
fn largest(tensor: &[f32], limit: f32, count: usize) -> (Kept, f64) {
    let mut list: Kept =
        (0u32..).zip(tensor).filter(|(_, v)| v.abs() >= limit && **v != 0.0).map(|(i, &v)| (i, v)).collect();
    list.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
    list.truncate(count);
    let energy = list.iter().map(|(_, v)| (*v as f64).powi(2)).sum();
    (list, energy)
}
