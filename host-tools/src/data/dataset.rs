//! The working file of a measured or modelled material: every texel's radiance for every pair of directions.
//!
//! Training and encoding read it twice and never hold it in memory. Its values stand texel by texel, so that
//! a block of any edge is `edge` runs of bytes, whichever edge is tried:
//!
//! `values[y][x][view][light][red, green, blue]`, linear radiance, binary16 or binary32, little-endian.
//!
//! Before them stands a head: 8 bytes of magic, its length, and a JSON object of [`Description`] and
//! [`Statistics`]. The file is a tool's working file, not a format to publish; `.selv` is.

use crate::error::{Result, ToolError};
use crate::files::{folder_of, read_exact_at, write_all_at};
use glam::DVec3;
use half::slice::HalfFloatSliceExt as _;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"\x93SELVSET";
/// Bytes before the values.
const HEAD_LENGTH: u64 = 65_536;
/// Most directions of a set.
pub const MOST_DIRECTIONS: usize = 1024;
/// Most texels along an axis.
pub const MOST_TEXELS: usize = 16_384;
/// Most directions, texels along an axis and bytes of values.
const LIMITS: (usize, usize, u64) = (MOST_DIRECTIONS, MOST_TEXELS, 1 << 43);

/// The first value that is not from 0 to `largest`.
pub fn first_beyond(values: &[f32], largest: f32) -> Option<usize> {
    let range = 0.0..=largest;
    // Nearly always there is none, and a fold without an early end is vectorised.
    let is_good = values.iter().fold(true, |good, v| good & range.contains(v));
    if is_good { None } else { values.iter().position(|v| !range.contains(v)) }
}

/// How a value is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sample {
    /// IEEE binary16.
    #[default]
    Half,
    /// IEEE binary32.
    Float,
}

impl Sample {
    /// Largest value that it holds.
    pub fn largest(self) -> f32 {
        match self {
            Sample::Half => half::f16::MAX.to_f32(),
            Sample::Float => f32::MAX,
        }
    }

    /// Bytes of a value.
    pub fn len_bytes(self) -> usize {
        match self {
            Sample::Half => 2,
            Sample::Float => 4,
        }
    }
}

/// What a dataset is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Texels along x and y.
    pub size: [usize; 2],
    /// Light directions: unit vectors in the tangent frame.
    pub lights: Vec<DVec3>,
    /// View directions.
    pub views: Vec<DVec3>,
    /// How values are stored.
    pub sample: Sample,
    /// Values contain the cosine of the light's angle.
    pub cosine_included: bool,
    /// Width and height of a texel in nanometres, 0 if unknown.
    pub texel_nm: [u32; 2],
    /// Name, origin of the data, licence.
    pub texts: [String; 3],
}

impl Description {
    /// Pairs of directions.
    pub fn pairs(&self) -> usize {
        self.lights.len() * self.views.len()
    }

    /// Numbers of one texel: `[view][light][colour]`.
    pub fn texel_len(&self) -> usize {
        self.pairs() * 3
    }

    /// Texels.
    pub fn texels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Bytes of the values in binary16, by which ratios of compression are counted.
    pub fn half_bytes(&self) -> u64 {
        self.texels() as u64 * self.texel_len() as u64 * 2
    }

    fn check(&self) -> std::result::Result<(), String> {
        let (directions, side, bytes) = LIMITS;
        for (name, set) in [("light", &self.lights), ("view", &self.views)] {
            if set.is_empty() || set.len() > directions {
                return Err(format!("{} {name} directions; 1 to {directions} are possible", set.len()));
            }
            if let Some(i) =
                set.iter().position(|d| !d.is_finite() || (d.length() - 1.0).abs() > 1e-3 || d.z < 0.0)
            {
                return Err(format!("{name} direction {i} is not a unit vector of the upper hemisphere"));
            }
        }
        if self.size.iter().any(|&n| n == 0 || n > side) {
            return Err(format!(
                "{} x {} texels; 1 to {side} along an axis are possible",
                self.size[0], self.size[1]
            ));
        }
        let length = self.texels() as u64 * self.texel_len() as u64 * self.sample.len_bytes() as u64;
        if length > bytes {
            return Err(format!("{length} bytes of values; {bytes} are possible"));
        }
        Ok(())
    }
}

/// What a pass over the values finds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Mean of each colour.
    pub mean: [f64; 3],
    /// Least value.
    pub least: f32,
    /// Largest value.
    pub largest: f32,
}

impl Statistics {
    /// One thousandth of the mean: the offset of every logarithm that errors are measured by.
    ///
    /// For a black material, whose mean is zero, a millionth.
    pub fn log_offset(&self) -> f32 {
        let mean = self.mean.iter().sum::<f64>() / 3.0;
        if mean > 0.0 { (mean / 1000.0).max(1e-30) as f32 } else { 1e-6 }
    }
}

impl Statistics {
    /// The offset that logarithms are coded with: that of errors, but at most 1 (3.1-16).
    pub fn coded_offset(&self) -> f32 {
        self.log_offset().min(1.0)
    }
}

#[derive(Serialize, Deserialize)]
struct Head {
    description: Description,
    statistics: Statistics,
}

/// A dataset being written, beside its place until it is whole.
pub struct Writer {
    file: tempfile::NamedTempFile,
    path: PathBuf,
    description: Description,
}

fn invalid(path: &Path, offset: u64, what: impl Into<String>) -> ToolError {
    ToolError::Foreign { path: path.to_owned(), offset, what: what.into() }
}

impl Writer {
    /// Begins a dataset.
    ///
    /// # Errors
    /// If the description is beyond what a dataset can be, or the folder cannot be written to.
    pub fn create(path: &Path, description: Description) -> Result<Writer> {
        description.check().map_err(|what| ToolError::Usage(format!("{}: {what}", path.display())))?;
        let folder = folder_of(path);
        let file = tempfile::Builder::new()
            .prefix(".selvedge-")
            .tempfile_in(folder)
            .map_err(|error| ToolError::io(path)(error.kind().into()))?;
        let length = HEAD_LENGTH
            + description.texels() as u64
                * description.texel_len() as u64
                * description.sample.len_bytes() as u64;
        // A few megabytes of factors may unfold to terabytes, and the file has no bytes on the disk before
        // they are written.
        let free = fs4::available_space(folder).map_err(ToolError::io(folder))?;
        if length > free {
            return Err(ToolError::Usage(format!(
                "{}: the dataset takes {length} bytes, and {free} are free",
                path.display()
            )));
        }
        file.as_file().set_len(length).map_err(ToolError::io(path))?;
        Ok(Writer { file, path: path.to_owned(), description })
    }

    /// What is being written.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Writes numbers of one texel from pair `first_pair` on, `[view][light][colour]`; any thread may.
    ///
    /// # Errors
    /// If a number is negative or not finite (or, with the place, beyond binary16 where that is stored), or
    /// on I/O.
    pub fn put(&self, texel: usize, first_pair: usize, values: &[f32]) -> Result<()> {
        let largest = self.description.sample.largest();
        if let Some(i) = first_beyond(values, largest) {
            let ([x, y], [light, view]) = (self.texel_place(texel), self.pair_place(first_pair + i / 3));
            let what = format!(
                "texel ({x}, {y}), light {light}, view {view}: {} is not a radiance from 0 to {largest:e}",
                values[i]
            );
            return Err(ToolError::Usage(format!("{}: {what}", self.path.display())));
        }
        let mut bytes = vec![0; values.len() * self.description.sample.len_bytes()];
        match self.description.sample {
            Sample::Half => {
                let mut half = vec![half::f16::ZERO; values.len()];
                half.convert_from_f32_slice(values);
                bytes.as_chunks_mut().0.iter_mut().zip(&half).for_each(|(bytes, v)| *bytes = v.to_le_bytes());
            }
            Sample::Float => {
                bytes.as_chunks_mut().0.iter_mut().zip(values).for_each(|(bytes, v)| *bytes = v.to_le_bytes())
            }
        }
        let at = (texel * self.description.texel_len() + first_pair * 3) as u64
            * self.description.sample.len_bytes() as u64;
        write_all_at(self.file.as_file(), &bytes, HEAD_LENGTH + at).map_err(ToolError::io(&self.path))
    }

    fn texel_place(&self, texel: usize) -> [usize; 2] {
        [texel % self.description.size[0], texel / self.description.size[0]]
    }

    /// Puts images, `[y][x]`, of successive pairs from `first_pair` on.
    ///
    /// # Errors
    /// As [`Writer::put`].
    pub fn put_images(&self, first_pair: usize, images: &[Vec<[f32; 3]>]) -> Result<()> {
        (0..self.description.texels()).into_par_iter().try_for_each_init(Vec::new, |run, texel| {
            run.clear();
            run.extend(images.iter().flat_map(|image| image[texel]));
            self.put(texel, first_pair, run)
        })
    }

    fn pair_place(&self, pair: usize) -> [usize; 2] {
        [pair % self.description.lights.len(), pair / self.description.lights.len()]
    }

    /// Measures the values, writes the header and puts the file in its place.
    ///
    /// # Errors
    /// If a text of the description is too long, and on I/O; the file that was there before is then as it was.
    pub fn finish(mut self) -> Result<Statistics> {
        let read = Dataset {
            file: self.file.reopen().map_err(ToolError::io(&self.path))?,
            path: self.path.clone(),
            description: self.description.clone(),
            statistics: Statistics::default(),
        };
        let statistics = read.measure()?;
        let head =
            serde_json::to_vec(&Head { description: self.description, statistics }).expect("plain data");
        if head.len() as u64 > HEAD_LENGTH - 16 {
            return Err(ToolError::Usage(format!(
                "{}: the texts of the description are too long",
                self.path.display()
            )));
        }
        let mut start = MAGIC.to_vec();
        start.extend((head.len() as u64).to_le_bytes());
        start.extend(head);
        start.resize(HEAD_LENGTH as usize, 0);
        write_all_at(self.file.as_file(), &start, 0).map_err(ToolError::io(&self.path))?;
        self.file.flush().map_err(ToolError::io(&self.path))?;
        crate::files::persist(self.file, &self.path)?;
        Ok(statistics)
    }
}

/// A dataset to be read, from any thread.
#[derive(Debug)]
pub struct Dataset {
    file: File,
    path: PathBuf,
    description: Description,
    statistics: Statistics,
}

impl Dataset {
    /// Opens a dataset.
    ///
    /// # Errors
    /// If it is none, or shorter than it says.
    pub fn open(path: &Path) -> Result<Dataset> {
        let file = File::open(path).map_err(ToolError::io(path))?;
        let length = file.metadata().map_err(ToolError::io(path))?.len();
        let mut start = vec![0; HEAD_LENGTH.min(length) as usize];
        read_exact_at(&file, &mut start, 0).map_err(ToolError::io(path))?;
        if start.len() < HEAD_LENGTH as usize || &start[..8] != MAGIC {
            return Err(invalid(path, 0, "this is not a dataset"));
        }
        let head_length = u64::from_le_bytes(std::array::from_fn(|i| start[8 + i]));
        let head = start.get(16..).and_then(|rest| rest.get(..usize::try_from(head_length).ok()?));
        let Some(head) = head else { return Err(invalid(path, 8, format!("a head of {head_length} bytes"))) };
        let Head { description, statistics } =
            serde_json::from_slice(head).map_err(|error| invalid(path, 16, error.to_string()))?;
        description.check().map_err(|what| invalid(path, 16, what))?;
        let wanted = HEAD_LENGTH
            + description.texels() as u64
                * description.texel_len() as u64
                * description.sample.len_bytes() as u64;
        if length != wanted {
            return Err(invalid(path, length.min(wanted), format!("{length} bytes where {wanted} are due")));
        }
        Ok(Dataset { file, path: path.to_owned(), description, statistics })
    }

    /// Makes a dataset of a function of the texel and of the number in it, `[view][light][colour]`, called in
    /// that order.
    ///
    /// # Errors
    /// As those of [`Writer`].
    pub fn from_fn(
        path: &Path,
        description: Description,
        mut value: impl FnMut(usize, usize) -> f32,
    ) -> Result<Dataset> {
        let (texels, length) = (description.texels(), description.texel_len());
        let writer = Writer::create(path, description)?;
        for texel in 0..texels {
            writer.put(texel, 0, &(0..length).map(|i| value(texel, i)).collect::<Vec<f32>>())?;
        }
        writer.finish()?;
        Dataset::open(path)
    }

    /// Whether a file begins as a dataset does.
    pub fn is_one(path: &Path) -> bool {
        let mut magic = [0; 8];
        File::open(path).and_then(|file| read_exact_at(&file, &mut magic, 0)).is_ok() && &magic == MAGIC
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it is.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// What its values are like.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Reads numbers of a run of texels: `[texel][view][light][colour]`.
    ///
    /// # Errors
    /// On I/O, and if a number is negative or not finite.
    pub fn read(
        &self,
        first_texel: usize,
        texels: usize,
        bytes: &mut Vec<u8>,
        values: &mut [f32],
    ) -> Result<()> {
        self.read_numbers(
            first_texel * self.description.texel_len(),
            bytes,
            &mut values[..texels * self.description.texel_len()],
        )
    }

    /// Reads numbers of one texel from pair `first_pair` on.
    ///
    /// # Errors
    /// As [`Dataset::read`].
    pub fn read_pairs(
        &self,
        texel: usize,
        first_pair: usize,
        bytes: &mut Vec<u8>,
        values: &mut [f32],
    ) -> Result<()> {
        self.read_numbers(texel * self.description.texel_len() + first_pair * 3, bytes, values)
    }

    /// Reads successive pairs of all texels: `[texel][pair][colour]`.
    ///
    /// # Errors
    /// As [`Dataset::read`].
    pub fn read_images(&self, first_pair: usize, pairs: usize) -> Result<Vec<f32>> {
        let mut values = vec![0.0; self.description.texels() * pairs * 3];
        let runs = values.par_chunks_mut(pairs * 3).enumerate();
        runs.try_for_each_init(Vec::new, |bytes, (texel, run)| {
            self.read_pairs(texel, first_pair, bytes, run)
        })?;
        Ok(values)
    }

    fn read_numbers(&self, first: usize, bytes: &mut Vec<u8>, values: &mut [f32]) -> Result<()> {
        let size = self.description.sample.len_bytes();
        bytes.resize(values.len() * size, 0);
        let at = HEAD_LENGTH + (first * size) as u64;
        read_exact_at(&self.file, bytes, at).map_err(ToolError::io(&self.path))?;
        match self.description.sample {
            Sample::Half => {
                // Through aligned halves, which the library converts by vector instructions where it can.
                let halves: Vec<half::f16> =
                    bytes.as_chunks::<2>().0.iter().map(|&b| half::f16::from_le_bytes(b)).collect();
                halves.convert_to_f32_slice(values);
            }
            Sample::Float => {
                values.iter_mut().zip(bytes.as_chunks::<4>().0).for_each(|(v, &b)| *v = f32::from_le_bytes(b))
            }
        }
        match first_beyond(values, f32::MAX) {
            Some(i) => {
                Err(invalid(&self.path, at + (i * size) as u64, format!("{} is not a radiance", values[i])))
            }
            None => Ok(()),
        }
    }

    /// The image of one pair of directions: `[y][x][colour]`.
    ///
    /// # Errors
    /// As [`Dataset::read`].
    pub fn image(&self, light: usize, view: usize) -> Result<Vec<[f32; 3]>> {
        let pair = view * self.description.lights.len() + light;
        let mut bytes = Vec::new();
        let mut rgb = [0.0; 3];
        let texel = |texel| self.read_pairs(texel, pair, &mut bytes, &mut rgb).map(|()| rgb);
        (0..self.description.texels()).map(texel).collect()
    }

    /// Texels read together by a pass over all of them.
    pub fn batch(&self) -> usize {
        ((1 << 20) / self.description.texel_len()).clamp(1, self.description.texels())
    }

    fn measure(&self) -> Result<Statistics> {
        let (texels, batch) = (self.description.texels(), self.batch());
        let starts: Vec<usize> = (0..texels).step_by(batch).collect();
        let parts: Vec<(DVec3, f32, f32)> = starts
            .par_iter()
            .map(|&first| {
                let count = batch.min(texels - first);
                let mut values = vec![0.0; count * self.description.texel_len()];
                self.read(first, count, &mut Vec::new(), &mut values)?;
                let (mut sum, mut least, mut largest) = (DVec3::ZERO, f32::MAX, 0.0f32);
                for rgb in values.as_chunks::<3>().0 {
                    sum += DVec3::from_array(rgb.map(f64::from));
                    least = rgb.iter().fold(least, |a, &b| a.min(b));
                    largest = rgb.iter().fold(largest, |a, &b| a.max(b));
                }
                Ok((sum, least, largest))
            })
            .collect::<Result<_>>()?;
        // In the order of the texels, whichever thread was first.
        let mut statistics = Statistics { least: f32::MAX, ..Statistics::default() };
        let mut total = DVec3::ZERO;
        for (sum, least, largest) in parts {
            total += sum;
            statistics.least = statistics.least.min(least);
            statistics.largest = statistics.largest.max(largest);
        }
        statistics.mean = (total / (texels * self.description.pairs()) as f64).to_array();
        Ok(statistics)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::directions;

    fn small(sample: Sample) -> Description {
        let lights = directions::grid(81).expect("known")[..7].to_vec();
        Description { size: [5, 3], views: lights[..2].to_vec(), lights, sample, ..Description::default() }
    }

    #[test]
    fn what_is_written_is_read_and_measured() {
        let folder = tempfile::tempdir().expect("a folder");
        for sample in [Sample::Half, Sample::Float] {
            let path = folder.path().join("a.selvset");
            let writer = Writer::create(&path, small(sample)).expect("created");
            let length = writer.description().texel_len();
            for texel in 0..15 {
                let values: Vec<f32> = (0..length).map(|i| (texel * length + i) as f32 / 4.0).collect();
                writer.put(texel, 0, &values[..9]).expect("put");
                writer.put(texel, 3, &values[9..]).expect("put");
            }
            let statistics = writer.finish().expect("finished");
            let dataset = Dataset::open(&path).expect("opened");
            assert_eq!(dataset.statistics(), &statistics);
            assert_eq!((statistics.least, statistics.largest), (0.0, (15 * length - 1) as f32 / 4.0));
            let mut values = vec![0.0; 2 * length];
            dataset.read(6, 2, &mut Vec::new(), &mut values).expect("read");
            assert!(values.iter().enumerate().all(|(i, &v)| v == (6 * length + i) as f32 / 4.0));
            assert_eq!(
                dataset.image(3, 1).expect("read")[2],
                std::array::from_fn(|c| (2 * length + (7 + 3) * 3 + c) as f32 / 4.0)
            );
        }
    }

    #[test]
    fn numbers_that_are_no_radiance_are_refused_with_their_place() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.selvset");
        let writer = Writer::create(&path, small(Sample::Half)).expect("created");
        for bad in [f32::NAN, f32::INFINITY, -1.0, 70_000.0] {
            let mut values = [0.5; 42];
            values[16] = bad;
            let said = writer.put(7, 0, &values).expect_err("refused").to_string();
            assert!(said.contains("texel (2, 1), light 5, view 0"), "{said}");
        }
        drop(writer);
        assert!(!path.exists());
        std::fs::write(&path, [1; 70]).expect("written");
        assert!(Dataset::open(&path).is_err());
    }
}
