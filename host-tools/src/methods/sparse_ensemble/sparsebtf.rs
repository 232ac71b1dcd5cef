//! Import of the files of SparseBTF (Kavoosighafi et al. 2023), without encoding again.
//!
//! The authors' coefficients and dictionaries become a legal file: each column is scaled to its largest
//! entry and the scale folded into the coefficients, columns and dictionaries that no block uses are left
//! out, and the values of each atom are quantised over their own range. A channel without coefficients
//! whose partners have theirs becomes a mean alone, from the shared mean of all three (their average).

use crate::error::{Result, ToolError};
use crate::format::model::{ChannelModel, MaterialModel, MetadataModel, PairTableModel, TransferModel};
use crate::format::tables::{quantise_means, quantise_scales};
use crate::format::triangulate::project;
use crate::format::units::{LARGEST_ENTRY, ONE_Q13, ONE_Q15, ONE_Q20};
use crate::methods::sparse_ensemble::model::{
    AtomModel, DictionaryModel, EnsembleModel, EnsembleTexture, FactorModel,
};
use crate::methods::sparse_ensemble::quantise::{FloatRecord, quantise};
use std::collections::BTreeMap;
use std::f64::consts::LN_2;
use std::path::{Path, PathBuf};

/// Texels along the side of the authors' blocks.
const EDGE: usize = 10;
/// Bits of a quantised coefficient, where none are asked for.
pub const VALUE_BITS: u32 = 10;
/// What the authors add before the logarithm.
pub const LOG_OFFSET: f32 = 1e-5;
/// Red, green and blue from the authors' Y, U, V.
pub const YUV_TO_RGB: [[f64; 3]; 3] = [[1.0, 0.0, 1.13983], [1.0, -0.39465, -0.58060], [1.0, 2.03211, 0.0]];
/// Rows of the light and view tables.
pub type Pairs = Vec<f64>;

/// One channel's coefficients as the authors store them.
#[derive(Clone, Debug, Default)]
pub struct AuthorsChannel {
    /// Column numbers (x, y, light, view) of every coefficient.
    pub columns: Vec<[u16; 4]>,
    /// Their values.
    pub values: Vec<f64>,
    /// Dictionary of each block.
    pub membership: Vec<u16>,
    /// Coefficients of each block.
    pub counts: Vec<u16>,
    /// `factors[mode][dictionary][row][column]`, flat.
    pub factors: [Vec<f64>; 4],
}

/// A material of the authors', decoded from its files.
#[derive(Clone, Debug, Default)]
pub struct AuthorsMaterial {
    /// Blocks along x and y.
    pub blocks: [usize; 2],
    /// Rows of the four factors: texels, texels, lights, views.
    pub rows: [usize; 4],
    /// Channels that have coefficients.
    pub channels: [Option<AuthorsChannel>; 3],
    /// Shared means, `[view * lights + light]`.
    pub mean: Pairs,
    /// Shared standard deviations.
    pub deviation: Pairs,
    /// Unit vectors of the directions.
    pub directions: Vec<glam::DVec3>,
    /// Name of the material.
    pub name: String,
}

/// Bytes of a file, as what they hold.
struct Foreign {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Foreign {
    fn read(path: PathBuf) -> Result<Foreign> {
        let bytes = std::fs::read(&path).map_err(ToolError::io(&path))?;
        Ok(Foreign { path, bytes })
    }

    fn fail<T>(&self, offset: usize, what: impl Into<String>) -> Result<T> {
        Err(ToolError::Foreign { path: self.path.clone(), offset: offset as u64, what: what.into() })
    }

    fn halves(&self) -> Vec<f64> {
        self.bytes.as_chunks::<2>().0.iter().map(|&b| half::f16::from_le_bytes(b).to_f64()).collect()
    }

    fn doubles(&self) -> Vec<f64> {
        self.bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect()
    }

    /// Refuses numbers that are not finite.
    fn finite(&self, numbers: &[f64], size: usize) -> Result<()> {
        match numbers.iter().position(|n| !n.is_finite()) {
            Some(i) => self.fail(i * size, format!("the number {} is not finite", numbers[i])),
            None => Ok(()),
        }
    }
}

/// Names of the materials whose coefficients are in a folder.
///
/// # Errors
/// If the folder cannot be read.
pub fn materials_in(folder: &Path) -> Result<Vec<String>> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .map_err(ToolError::io(folder))?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter_map(|name| {
            let name = name.strip_prefix("Coeffs_BTF_")?;
            ["Y", "U", "V"]
                .iter()
                .find_map(|letter| name.strip_suffix(&format!("_1e-05_{letter}.bin")))
                .map(str::to_owned)
        })
        .collect();
    names.sort();
    names.dedup();
    Ok(names)
}

/// Reads a material's files; `blocks` along x and y, or a square if `None`.
///
/// # Errors
/// If a file cannot be read, or is not what its layout says ([`ToolError::Foreign`], with the byte).
pub fn read_material(folder: &Path, name: &str, blocks: Option<[usize; 2]>) -> Result<AuthorsMaterial> {
    let locations = Foreign::read(folder.join("xyz_loc.bin"))?;
    let xyz = locations.doubles();
    let count = xyz.len() / 4;
    if count == 0 || locations.bytes.len() != count * 32 || count > 1024 {
        return locations.fail(
            0,
            format!("{} bytes are not x, y, z and id of 1 to 1,024 directions", locations.bytes.len()),
        );
    }
    locations.finite(&xyz, 8)?;
    let directions: Vec<glam::DVec3> =
        (0..count).map(|i| glam::DVec3::new(xyz[i], xyz[count + i], xyz[2 * count + i])).collect();
    if let Some(i) = directions.iter().position(|d| (d.length() - 1.0).abs() > 1e-3 || d.z < 0.0) {
        return locations.fail(i * 8, "a direction is not a unit vector of the upper hemisphere");
    }
    let rows = [EDGE, EDGE, count, count];
    let statistics = Foreign::read(folder.join(format!("{name}_mean_std.bin")))?;
    let numbers = statistics.doubles();
    if statistics.bytes.len() != count * count * 16 {
        return statistics.fail(
            0,
            format!("{} bytes are not mean and deviation of {count} x {count} pairs", statistics.bytes.len()),
        );
    }
    statistics.finite(&numbers, 8)?;
    let mut material = AuthorsMaterial {
        rows,
        mean: numbers[..count * count].to_vec(),
        deviation: numbers[count * count..].to_vec(),
        directions,
        name: name.to_owned(),
        ..AuthorsMaterial::default()
    };
    let mut shape = blocks;
    for (c, letter) in ["Y", "U", "V"].iter().enumerate() {
        let path = folder.join(format!("Coeffs_BTF_{name}_1e-05_{letter}.bin"));
        if !path.exists() {
            continue;
        }
        let coefficients = Foreign::read(path)?;
        let dictionaries = Foreign::read(folder.join(format!("DictEnsOrth4D{letter}.bin")))?;
        let (channel, blocks) = read_channel(&coefficients, &dictionaries, rows, shape)?;
        shape = Some(blocks);
        material.channels[c] = Some(channel);
    }
    match shape {
        Some(blocks) if material.channels.iter().any(Option::is_some) => {
            material.blocks = blocks;
            Ok(material)
        }
        _ => Err(ToolError::Usage(format!("{}: no coefficients of {name}", folder.display()))),
    }
}

fn read_channel(
    file: &Foreign,
    dictionary: &Foreign,
    rows: [usize; 4],
    shape: Option<[usize; 2]>,
) -> Result<(AuthorsChannel, [usize; 2])> {
    let words: Vec<u16> = file.bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)).collect();
    if file.bytes.len() % 2 != 0
        || words.len() < 4
        || words[..4].iter().zip(rows).any(|(&w, r)| w as usize != r)
    {
        return file.fail(0, format!("the sizes {:?} are not {rows:?}", words.get(..4)));
    }
    // 4 + 5 N + 2 P words, where N is the sum of the P counts: the number of blocks must explain the length.
    let fits = |blocks: usize| {
        let n = words.len().checked_sub(4 + 2 * blocks)?;
        let counts = words.get(4 + 4 * (n / 5) + blocks..4 + 4 * (n / 5) + 2 * blocks)?;
        (n % 5 == 0 && counts.iter().map(|&c| c as usize).sum::<usize>() == n / 5).then_some(n / 5)
    };
    let shape = shape.or_else(|| (1..=1638).map(|side| [side, side]).find(|s| fits(s[0] * s[1]).is_some()));
    let Some((shape, n)) = shape.and_then(|s| Some((s, fits(s[0].checked_mul(s[1])?)?))) else {
        return file.fail(8, "no number of blocks explains the length");
    };
    let blocks = shape[0] * shape[1];
    let columns: Vec<[u16; 4]> = words[4..4 + 4 * n].as_chunks::<4>().0.to_vec();
    if let Some(i) = columns.iter().position(|l| l.iter().zip(rows).any(|(&l, r)| l as usize >= r)) {
        return file.fail(8 + i * 8, format!("the columns {:?} are not there", columns[i]));
    }
    let values: Vec<f64> =
        words[4 + 4 * n + 2 * blocks..].iter().map(|&w| half::f16::from_bits(w).to_f64()).collect();
    file.finite(&values, 2)?;
    let scalars = 2 * (rows[0] * rows[0] + rows[2] * rows[2]);
    let factors = dictionary.halves();
    let count = factors.len() / scalars;
    if count == 0 || factors.len() != count * scalars || count > 256 {
        return dictionary.fail(0, format!("{} bytes are not 1 to 256 dictionaries", dictionary.bytes.len()));
    }
    dictionary.finite(&factors, 2)?;
    let membership = words[4 + 4 * n..4 + 4 * n + blocks].to_vec();
    if let Some(i) = membership.iter().position(|&k| k as usize >= count) {
        return file.fail((4 + 4 * n + i) * 2, format!("dictionary {} of {count}", membership[i]));
    }
    let mut at = 0;
    let factors = [0, 1, 2, 3].map(|mode| {
        let m = rows[mode];
        let mode_factors = &factors[at..at + count * m * m];
        at += count * m * m;
        // Columns are contiguous in the file; rows are here.
        (0..count * m * m)
            .map(|i| mode_factors[i / (m * m) * m * m + i % m * m + i / m % m])
            .collect::<Vec<f64>>()
    });
    let counts = words[4 + 4 * n + blocks..4 + 4 * n + 2 * blocks].to_vec();
    Ok((AuthorsChannel { columns, values, membership, counts, factors }, shape))
}

impl AuthorsChannel {
    fn factor(&self, rows: &[usize; 4], mode: usize, dictionary: usize, row: usize, column: usize) -> f64 {
        let m = rows[mode];
        self.factors[mode][(dictionary * m + row) * m + column]
    }

    /// First coefficient of each block, and the count at the end.
    fn starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        for &count in &self.counts {
            starts.push(starts[starts.len() - 1] + count as usize);
        }
        starts
    }
}

impl AuthorsMaterial {
    /// The authors' normalised value, equation 5, in binary64.
    pub fn normalised(&self, channel: usize, x: usize, y: usize, light: usize, view: usize) -> f64 {
        let Some(c) = &self.channels[channel] else { return 0.0 };
        let block = y / EDGE * self.blocks[0] + x / EDGE;
        let first: usize = c.counts[..block].iter().map(|&n| n as usize).sum();
        let k = c.membership[block] as usize;
        let at = [x % EDGE, y % EDGE, light, view];
        (first..first + c.counts[block] as usize)
            .map(|z| {
                c.values[z]
                    * (0..4)
                        .map(|mode| c.factor(&self.rows, mode, k, at[mode], c.columns[z][mode] as usize))
                        .product::<f64>()
            })
            .sum()
    }

    /// The authors' value of a channel, natural logarithm.
    pub fn value(&self, channel: usize, x: usize, y: usize, light: usize, view: usize) -> f64 {
        let pair = view * self.rows[2] + light;
        self.normalised(channel, x, y, light, view) * self.deviation[pair] + self.mean[pair]
    }

    /// Normalised values of a whole image at one pair, row by row.
    pub fn normalised_image(&self, channel: usize, light: usize, view: usize) -> Vec<f64> {
        let Some(c) = &self.channels[channel] else { return Vec::new() };
        let width = self.blocks[0] * EDGE;
        let mut image = vec![0.0; width * self.blocks[1] * EDGE];
        let starts = c.starts();
        for block in 0..c.counts.len() {
            let k = c.membership[block] as usize;
            let mut spatial = [[0.0f64; EDGE]; EDGE];
            for z in starts[block]..starts[block + 1] {
                let [lx, ly, ll, lv] = c.columns[z].map(|l| l as usize);
                let angular = c.values[z]
                    * c.factor(&self.rows, 2, k, light, ll)
                    * c.factor(&self.rows, 3, k, view, lv);
                spatial[ly][lx] += angular;
            }
            for (ly, row) in spatial.iter().enumerate() {
                for (lx, &sum) in row.iter().enumerate().filter(|(_, sum)| **sum != 0.0) {
                    for y in 0..EDGE {
                        let by_y = sum * c.factor(&self.rows, 1, k, y, ly);
                        for x in 0..EDGE {
                            let at = (block / self.blocks[0] * EDGE + y) * width
                                + block % self.blocks[0] * EDGE
                                + x;
                            image[at] += by_y * c.factor(&self.rows, 0, k, x, lx);
                        }
                    }
                }
            }
        }
        image
    }

    /// Spatial mean of the normalised values for every pair.
    fn normalised_means(&self, channel: &AuthorsChannel) -> Pairs {
        let (lights, views) = (self.rows[2], self.rows[3]);
        let mean_of = |mode: usize, k: usize, column: usize| {
            (0..EDGE).map(|row| channel.factor(&self.rows, mode, k, row, column)).sum::<f64>() / EDGE as f64
        };
        let mut sums: BTreeMap<(usize, usize, usize), f64> = BTreeMap::new();
        let mut z = 0;
        for (block, &count) in channel.counts.iter().enumerate() {
            let k = channel.membership[block] as usize;
            for _ in 0..count {
                let [lx, ly, ll, lv] = channel.columns[z].map(|l| l as usize);
                *sums.entry((k, ll, lv)).or_default() +=
                    channel.values[z] * mean_of(0, k, lx) * mean_of(1, k, ly);
                z += 1;
            }
        }
        let mut means = vec![0.0; lights * views];
        for ((k, ll, lv), sum) in sums {
            let sum = sum / channel.counts.len() as f64;
            for v in 0..views {
                let by_view = sum * channel.factor(&self.rows, 3, k, v, lv);
                for l in 0..lights {
                    means[v * lights + l] += by_view * channel.factor(&self.rows, 2, k, l, ll);
                }
            }
        }
        means
    }

    /// Spatial mean of a channel for every pair, natural logarithm; of a channel without coefficients what
    /// the shared mean of all three leaves (their average is shared).
    pub fn channel_means(&self, channel: usize) -> Pairs {
        let own = |c: &AuthorsChannel| -> Pairs {
            self.normalised_means(c)
                .iter()
                .zip(&self.deviation)
                .zip(&self.mean)
                .map(|((n, s), m)| n * s + m)
                .collect()
        };
        if let Some(c) = &self.channels[channel] {
            return own(c);
        }
        let mut rest: Pairs = self.mean.iter().map(|m| 3.0 * m).collect();
        for c in self.channels.iter().flatten() {
            for (rest, own) in rest.iter_mut().zip(own(c)) {
                *rest -= own;
            }
        }
        rest
    }

    /// The model of a file, values quantised to `value_bits`.
    ///
    /// # Errors
    /// [`ToolError::Usage`] if values are beyond the format.
    pub fn to_model(&self, value_bits: u32) -> Result<MaterialModel> {
        let missing = self.channels.iter().filter(|c| c.is_none()).count();
        let mut channels: [ChannelModel; 3] = Default::default();
        let mut texture = EnsembleTexture::default();
        for (c, channel) in channels.iter_mut().enumerate() {
            match &self.channels[c] {
                Some(authors) => {
                    channel.mean = Some(mean_table(&self.mean)?);
                    channel.scale = Some(scale_table(&self.deviation)?);
                    texture.channels[c] = Some(quantise_channel(authors, &self.rows, value_bits)?);
                }
                // One unknown follows from the shared mean; two do not, and are left out.
                None if missing == 1 => channel.mean = Some(mean_table(&self.channel_means(c))?),
                None => {}
            }
        }
        let matrix: Vec<i16> = YUV_TO_RGB.iter().flatten().map(|m| (m * ONE_Q13).round() as i16).collect();
        Ok(MaterialModel {
            size: self.blocks.map(|b| (b * EDGE) as u32),
            level_count: 1,
            edge: EDGE as u32,
            layer_count: 1,
            transfer: TransferModel::Log2 { offset: LOG_OFFSET },
            cosine_included: true,
            matrix_q13: std::array::from_fn(|i| matrix[i]),
            metadata: MetadataModel {
                texel_nm: [0, 0],
                frame: 0,
                image_origin: 0,
                primaries: 0,
                texts: [
                    self.name.clone(),
                    "SparseBTF (Kavoosighafi, Frisvad, Hajisharif, Unger, Miandji, EGSR 2023), from UBO2014 (Weinmann, Gall, Klein, ECCV 2014)".into(),
                    "MIT, (c) 2023 Behnaz Kavoosighafi; derived from the UBO2014 BTF database".into(),
                ],
            },
            lights: self.directions.iter().map(|&d| project(d)).collect(),
            views: None,
            channels,
            texture: Box::new(texture),
            extras: Vec::new(),
        })
    }
}

/// Means, natural logarithm to base two.
fn mean_table(means: &[f64]) -> Result<PairTableModel> {
    quantise_means(&means.iter().map(|m| m / LN_2 * ONE_Q20).collect::<Vec<_>>())
}

/// Scales, natural logarithm to base two.
fn scale_table(scales: &[f64]) -> Result<PairTableModel> {
    quantise_scales(&scales.iter().map(|s| s / LN_2).collect::<Vec<_>>())
}

/// A column scaled to its largest entry, and that entry.
fn scaled_column(column: &[f64]) -> (Vec<i16>, f64) {
    let largest = column.iter().fold(0.0f64, |largest, u| largest.max(u.abs()));
    let scale = if largest > 0.0 { LARGEST_ENTRY / largest } else { 0.0 };
    (column.iter().map(|u| (u * scale).round() as i16).collect(), largest)
}

/// Scaled columns of a factor that are used, and the new number and largest entry of each.
fn used_factor(
    authors: &AuthorsChannel,
    rows: &[usize; 4],
    mode: usize,
    k: usize,
    used: &BTreeMap<u16, ()>,
) -> (FactorModel, BTreeMap<u16, (u32, f64)>) {
    let m = rows[mode];
    let mut numbers = BTreeMap::new();
    let columns: Vec<Vec<i16>> = (0u32..)
        .zip(used.keys())
        .map(|(new, &old)| {
            let column: Vec<f64> =
                (0..m).map(|row| authors.factor(rows, mode, k, row, old as usize)).collect();
            let (entries, largest) = scaled_column(&column);
            numbers.insert(old, (new, largest));
            entries
        })
        .collect();
    let entries = (0..m).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
    (FactorModel { columns: columns.len() as u32, entries }, numbers)
}

/// Coefficients and dictionaries of a channel, quantised.
fn quantise_channel(authors: &AuthorsChannel, rows: &[usize; 4], value_bits: u32) -> Result<EnsembleModel> {
    let starts = authors.starts();
    let mut used: BTreeMap<u16, [BTreeMap<u16, ()>; 4]> = BTreeMap::new();
    for (block, &k) in authors.membership.iter().enumerate() {
        let of_k = used.entry(k).or_default();
        for columns in &authors.columns[starts[block]..starts[block + 1]] {
            for (mode, &column) in columns.iter().enumerate() {
                of_k[mode].insert(column, ());
            }
        }
    }
    let mut dictionaries = Vec::new();
    let mut number_of = BTreeMap::new();
    let mut scales = Vec::new();
    for (&k, columns) in &used {
        number_of.insert(k, dictionaries.len());
        let [x, y, light, view] =
            [0, 1, 2, 3].map(|mode| used_factor(authors, rows, mode, k as usize, &columns[mode]));
        dictionaries.push(DictionaryModel { light: light.0, view: view.0, x: x.0, y: y.0 });
        scales.push([x.1, y.1, light.1, view.1]);
    }
    // Coefficients in units of the channel.
    let table_gain = (ONE_Q15 / LARGEST_ENTRY).powi(4);
    let blocks: Vec<FloatRecord> = authors
        .membership
        .iter()
        .enumerate()
        .map(|(block, k)| {
            let number = number_of[k];
            let list: Vec<(AtomModel, f64)> = (starts[block]..starts[block + 1])
                .map(|z| {
                    let [x, y, light, view] =
                        [0, 1, 2, 3].map(|mode| scales[number][mode][&authors.columns[z][mode]]);
                    let atom =
                        AtomModel { x: x.0, y: y.0, light: light.0, view: view.0, ..AtomModel::default() };
                    (atom, authors.values[z] * table_gain * x.1 * y.1 * light.1 * view.1)
                })
                .collect();
            (number, list)
        })
        .collect();
    let (atoms, coefficients) = quantise(&[vec![blocks]], dictionaries.len(), &[vec![value_bits]])?;
    Ok(EnsembleModel { dictionaries, atoms, coefficients })
}
