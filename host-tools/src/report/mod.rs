//! Error against run time: every method and baseline over a sweep of its quality on some datasets, as tables,
//! plots, pictures and one page.
//!
//! A line of the table ([`Line`]) is complete when it is written: it is appended to `measured.jsonl` in the
//! folder of the report, and a later run with the same dataset, method and setting takes it from there. Files
//! that were encoded lie in `files/`.

pub mod page;
pub mod plot;
pub mod stability;
pub mod sweep;

use crate::check::count;
use crate::data::dataset::{Dataset, Description};
use crate::data::picture::Picture;
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::baseline::decoder::{Decoder, Locator, POSITION};
use crate::measure::compare::{self, Metrics, Source, compare_every};
use crate::measure::similarity::{flip, ssim};
use crate::measure::speed::{self, Adapter, Speed};
use selvedge::{FilteredQuery, Selvedge};
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// What a report is made of.
#[derive(Clone, Debug)]
pub struct Request {
    /// Datasets.
    pub datasets: Vec<PathBuf>,
    /// Folder of the results.
    pub out: PathBuf,
    /// Budgets of the sweep, as ratios of the data's bytes in binary16 to those of a file.
    pub ratios: Vec<f64>,
    /// Components that decompositions are made with.
    pub rank: usize,
    /// Whether directions are held out as well.
    pub held_out: bool,
    /// Methods whose names contain one of these; all if empty.
    pub methods: Vec<String>,
    /// Errors are taken at every so many-th light of each view, the first of them moving from view to view;
    /// `None` for as many as keep [`COMPARED`].
    pub every: Option<usize>,
}

/// Texels times pairs that a setting is compared at, about, if the caller does not say how many.
pub const COMPARED: usize = 9_000_000;

impl Default for Request {
    fn default() -> Request {
        Request {
            datasets: Vec::new(),
            out: PathBuf::new(),
            ratios: vec![1600.0, 800.0, 400.0, 200.0],
            rank: 160,
            held_out: true,
            methods: Vec::new(),
            every: None,
        }
    }
}

/// Whose method a line is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A file of this format.
    File,
    /// A baseline in floats.
    Baseline,
}

/// Operations of a filtered sample: 32-bit multiplications of values, over random samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Mean.
    pub mean: f64,
    /// Largest that was met.
    pub largest: u64,
    /// What a file states for the worst sample.
    pub stated: Option<u32>,
}

impl Operations {
    /// Of a file.
    pub fn of_file(file: &Selvedge<'_>) -> Operations {
        Operations::of_random(Some(file.header().operations), |q| {
            let counted = count::filtered(file, 0, q.u_q32, q.v_q32, q.light, q.view);
            counted.expect("a method of these tools").operations
        })
    }

    fn of_random(stated: Option<u32>, count: impl Fn(&FilteredQuery) -> u64) -> Operations {
        let counts: Vec<u64> = speed::random_queries(2000).iter().map(count).collect();
        Operations {
            mean: counts.iter().sum::<u64>() as f64 / counts.len() as f64,
            largest: counts.into_iter().max().unwrap_or(0),
            stated,
        }
    }
}

/// A measured setting of a method on a dataset.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line {
    /// What it is found by in a later run.
    pub key: String,
    /// The dataset's name.
    pub dataset: String,
    /// The picture of its data in the folder, which tells datasets of one name apart.
    pub reference: String,
    /// Adapter of the kernel's rate, or why there is none.
    pub adapter: String,
    /// Cores of the rates of all cores.
    pub cores: usize,
    /// The method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// File or baseline.
    pub kind: Kind,
    /// Bytes.
    pub bytes: u64,
    /// Every how many-th light they are of.
    pub every: usize,
    /// Errors over all texels and views.
    pub metrics: Metrics,
    /// Mean SSIM of the list of pairs.
    pub ssim: f64,
    /// Mean FLIP of the list of pairs.
    pub flip: f64,
    /// Operations.
    pub operations: Operations,
    /// Rates.
    pub speed: Speed,
    /// Seconds of encoding, what a sweep shares between its settings included once for each.
    pub encode_seconds: f64,
    /// Seconds of `open`, for files.
    pub open_seconds: Option<f64>,
    /// Largest resident memory since the work began that its method shares between settings, bytes, where
    /// the system tells it.
    pub peak_memory: Option<u64>,
    /// What training or encoding found and a user should know.
    pub found: String,
    /// Its picture in the folder, if it has one.
    pub picture: Option<String>,
}

/// Part of every key: changes with what is measured or how, so that lines of before are measured anew.
pub const REVISION: u32 = 2;

/// Errors of an encoding that did not see some directions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HeldOut {
    /// What it is found by in a later run.
    pub key: String,
    /// The dataset's name.
    pub dataset: String,
    /// The method.
    pub method: String,
    /// Bytes.
    pub bytes: u64,
    /// At pairs that were encoded.
    pub seen: Metrics,
    /// At pairs of a light and a view that were both held out.
    pub unseen: Metrics,
}

/// Something that can be measured.
pub enum Subject<'a> {
    /// A file.
    File(&'a Selvedge<'a>),
    /// A baseline.
    Baseline(&'a dyn Decoder),
}

impl<'a> Subject<'a> {
    /// As a source of radiance.
    pub fn source<'s>(&'s self, locator: &'s Locator<'s>) -> Source<'s> {
        match self {
            Subject::File(file) => Source::File(file, 0),
            Subject::Baseline(decoder) => Source::Baseline(*decoder, locator),
        }
    }

    /// Errors against data, at every so many-th light of each view. What is equal has no finite ratio, which
    /// a table of numbers could not hold.
    ///
    /// # Errors
    /// If data cannot be read.
    pub fn metrics(
        &self,
        locator: &Locator<'_>,
        data: &Dataset,
        every: usize,
        offset: f32,
        peak: f32,
    ) -> Result<Metrics> {
        let found = compare_every(
            every,
            Source::Data(data),
            self.source(locator),
            data.description(),
            offset,
            Some(peak as f64),
            &|_, _| (),
        )?;
        Ok(Metrics { psnr_db: found.psnr_db.clamp(-999.0, 999.0), ..found })
    }

    /// Operations of random samples.
    pub fn operations(&self, locator: &Locator<'_>) -> Operations {
        match self {
            Subject::File(file) => Operations::of_file(file),
            Subject::Baseline(decoder) => Operations::of_random(None, |q| {
                let m = locator.file.material();
                // The same price of finding directions for all, but for those who look at every one.
                let find = if decoder.two_nearest() {
                    3 * (locator.lights.len() + locator.views.len()) as u64
                } else {
                    count::locate(locator.file, m.light_start, q.light)
                        + count::locate(locator.file, m.view_start, q.view)
                };
                decoder.operations(&locator.at(q, decoder.two_nearest())) + POSITION + find
            }),
        }
    }

    fn speed(&self, locator: &Locator<'_>, adapter: &Adapter) -> Speed {
        match self {
            Subject::File(file) => speed::of_file(file, adapter),
            Subject::Baseline(decoder) => speed::of_baseline(*decoder, locator),
        }
    }
}

/// What is fixed for a dataset while its lines are measured.
pub struct Bench<'a> {
    /// The data.
    pub data: &'a Dataset,
    /// Finds directions for baselines.
    pub locator: &'a Locator<'a>,
    /// Adapter of the kernel.
    pub adapter: &'a Adapter,
    /// Pairs of light and view whose images are looked at, with the reference's.
    pub looked_at: Vec<([usize; 2], Vec<[f32; 3]>)>,
    /// Every how many-th light is compared.
    pub every: usize,
    /// Factor that makes the mean of the data 0.4, for SSIM, FLIP and pictures.
    pub exposure: f32,
    /// Folder of the report.
    pub out: &'a Path,
}

/// Sixty-four pairs, spread over both sets.
pub fn pairs_looked_at(description: &Description) -> Vec<[usize; 2]> {
    let (lights, views) = (description.lights.len(), description.views.len());
    // A lattice: each eighth of the lights meets each eighth of the views.
    (0..64).map(|i| [(i * lights / 64 + i % 8 * lights / 8) % lights, (i * views / 64) % views]).collect()
}

impl<'a> Bench<'a> {
    /// Reads what is compared with.
    pub fn new(
        data: &'a Dataset,
        locator: &'a Locator<'a>,
        adapter: &'a Adapter,
        every: Option<usize>,
        out: &'a Path,
    ) -> Result<Bench<'a>> {
        let image = |pair: [usize; 2]| {
            Ok((pair, compare::image(Source::Data(data), data.description(), pair[0], pair[1])?))
        };
        let looked_at = pairs_looked_at(data.description()).into_iter().map(image).collect::<Result<_>>()?;
        let mean = data.statistics().mean.iter().sum::<f64>() / 3.0;
        let description = data.description();
        let every = every
            .unwrap_or((description.texels() * description.pairs()).div_ceil(COMPARED))
            .clamp(1, description.lights.len());
        Ok(Bench {
            data,
            locator,
            adapter,
            looked_at,
            every,
            exposure: if mean > 0.0 { (0.4 / mean) as f32 } else { 1.0 },
            out,
        })
    }

    /// Errors over all texels and views and every so many-th light.
    pub fn metrics(&self, subject: &Subject<'_>) -> Result<Metrics> {
        let statistics = self.data.statistics();
        subject.metrics(self.locator, self.data, self.every, statistics.log_offset(), statistics.largest)
    }

    /// Mean SSIM and FLIP over the pairs that are looked at.
    pub fn similarity(&self, subject: &Subject<'_>) -> Result<[f64; 2]> {
        use rayon::prelude::*;
        let description = self.data.description();
        let shown = |image: &[[f32; 3]]| -> Vec<[f32; 3]> {
            image.iter().map(|rgb| rgb.map(|c| (c * self.exposure).clamp(0.0, 1.0))).collect()
        };
        let both = |([light, view], reference): &([usize; 2], Vec<[f32; 3]>)| -> Result<[f64; 2]> {
            let image = compare::image(subject.source(self.locator), description, *light, *view)?;
            let (a, b) = (shown(reference), shown(&image));
            Ok([ssim(&a, &b, description.size[0]), flip(&a, &b, description.size[0])])
        };
        let all: Vec<[f64; 2]> = self.looked_at.par_iter().map(both).collect::<Result<_>>()?;
        Ok([0, 1].map(|i| all.iter().map(|pair| pair[i]).sum::<f64>() / all.len() as f64))
    }

    /// The decoded image and its error at two pairs, as a picture; `None` as the subject shows the data.
    pub fn picture(&self, subject: Option<&Subject<'_>>, name: &str) -> Result<String> {
        let description = self.data.description();
        let mut tiles = Vec::new();
        for i in [9, 38] {
            let ([light, view], reference) = &self.looked_at[i];
            let decoded = subject
                .map(|s| compare::image(s.source(self.locator), description, *light, *view))
                .transpose()?;
            let [width, height] = description.size;
            let offset = self.data.statistics().log_offset();
            let factor = (192 / width.max(height)).max(1);
            let shown = decoded.as_ref().unwrap_or(reference);
            tiles.push(
                Picture { width, height, pixels: shown.clone() }.exposed(self.exposure).enlarged(factor),
            );
            if let Some(decoded) = &decoded {
                tiles.push(
                    crate::data::picture::log_error(
                        decoded,
                        reference,
                        description.size,
                        offset,
                        ERROR_WHITE,
                    )
                    .enlarged(factor),
                );
            }
        }
        let name = format!("{name}.png");
        Picture::beside(&tiles, 6).save(&self.out.join(&name))?;
        Ok(name)
    }
}

/// Error of the natural logarithm that is white in pictures.
pub const ERROR_WHITE: f32 = 2.0;

/// What a store finds again.
pub trait Keyed: Serialize + serde::de::DeserializeOwned {
    /// By what.
    fn key(&self) -> &str;
}

impl Keyed for Line {
    fn key(&self) -> &str {
        &self.key
    }
}

impl Keyed for HeldOut {
    fn key(&self) -> &str {
        &self.key
    }
}

/// Lines of earlier runs, and the file that new ones are appended to.
pub struct Store<T> {
    path: PathBuf,
    /// All lines.
    pub lines: Vec<T>,
}

impl<T: Keyed> Store<T> {
    /// Reads what is there; a last line that was cut off by a crash is left out.
    ///
    /// # Errors
    /// If the file cannot be read, or not be mended, or has a line that this version does not understand:
    /// nothing measured is thrown away.
    pub fn open(path: PathBuf) -> Result<Store<T>> {
        let text = if path.exists() {
            String::from_utf8_lossy(&files::read(&path)?).into_owned()
        } else {
            String::new()
        };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let parse = |(i, line): (usize, &str)| {
            serde_json::from_str(line).map_err(|why| {
                ToolError::Mismatch(format!(
                    "{}, line {}: of another version ({why}); begin in another folder",
                    path.display(),
                    i + 1
                ))
            })
        };
        let lines: Vec<T> = whole.lines().enumerate().map(parse).collect::<Result<_>>()?;
        if whole != text {
            files::write(&path, whole.as_bytes())?;
        }
        Ok(Store { path, lines })
    }

    /// Keeps a line.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, line: T) -> Result<()> {
        let mut file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .map_err(ToolError::io(&self.path))?;
        file.write_all(to_json_line(&line).as_bytes()).map_err(ToolError::io(&self.path))?;
        self.lines.push(line);
        Ok(())
    }
}

fn to_json_line<T: Serialize>(line: &T) -> String {
    let mut text = serde_json::to_string(line).expect("plain data");
    text.push('\n');
    text
}

/// The methods of some lines, in the order in which they came.
pub fn methods_of<'l>(lines: &[&'l Line]) -> Vec<&'l str> {
    let mut methods: Vec<&str> = Vec::new();
    for line in lines {
        if !methods.contains(&line.method.as_str()) {
            methods.push(&line.method);
        }
    }
    methods
}

/// Lines that no other of the same dataset beats in both: fewer of `cost` and less error.
pub fn front<'l>(
    lines: &[&'l Line],
    cost: impl Fn(&Line) -> f64,
    error: impl Fn(&Line) -> f64,
) -> Vec<&'l Line> {
    let mut sorted: Vec<&Line> = lines.to_vec();
    sorted.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(error(a).total_cmp(&error(b))));
    let mut best = f64::MAX;
    sorted.retain(|line| {
        let good = error(line) < best;
        best = best.min(error(line));
        good
    });
    sorted
}

/// Resident memory at its largest since [`forget_peak`], bytes, where the system tells it.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

/// Begins to look for the largest memory anew; false where the system cannot.
pub fn forget_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// A text as a cell of CSV (RFC 4180).
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// The table as CSV.
pub fn to_csv(lines: &[Line]) -> String {
    let mut text = String::from(
        "dataset,method,setting,kind,bytes,linear_rms,log_rms,psnr_db,peak,relative_l2,ssim,flip,largest,largest_x,largest_y,largest_light,largest_view,operations_mean,operations_largest,operations_stated,random_per_s,random_least,random_most,coherent_per_s,single_per_s,random_all_per_s,coherent_all_per_s,kernel_per_s,random_to_reference,encode_s,open_s,peak_memory\n",
    );
    let optional = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    for l in lines {
        let (m, s) = (&l.metrics, &l.speed);
        let kind = if l.kind == Kind::File { "file" } else { "baseline" };
        let cells = [
            quoted(&l.dataset),
            quoted(&l.method),
            quoted(&l.setting),
            kind.into(),
            l.bytes.to_string(),
            m.linear_rms.to_string(),
            m.log_rms.to_string(),
            m.psnr_db.to_string(),
            m.peak.to_string(),
            m.relative_l2.to_string(),
            l.ssim.to_string(),
            l.flip.to_string(),
            m.largest.difference.to_string(),
            m.largest.texel[0].to_string(),
            m.largest.texel[1].to_string(),
            m.largest.light.to_string(),
            m.largest.view.to_string(),
            l.operations.mean.to_string(),
            l.operations.largest.to_string(),
            optional(l.operations.stated.map(f64::from)),
            s.random.median.to_string(),
            s.random.least.to_string(),
            s.random.most.to_string(),
            s.coherent.median.to_string(),
            s.single.median.to_string(),
            s.random_all.median.to_string(),
            s.coherent_all.median.to_string(),
            optional(s.kernel.map(|k| k.median)),
            s.random.to_reference.to_string(),
            l.encode_seconds.to_string(),
            optional(l.open_seconds),
            optional(l.peak_memory.map(|b| b as f64)),
        ];
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(bytes: u64, rms: f64) -> Line {
        let metrics = Metrics { linear_rms: rms, ..Metrics::default() };
        Line {
            key: format!("{bytes} {rms}"),
            dataset: "d".into(),
            reference: String::new(),
            adapter: String::new(),
            cores: 2,
            method: "m".into(),
            setting: String::new(),
            kind: Kind::File,
            bytes,
            every: 1,
            metrics,
            ssim: 0.0,
            flip: 0.0,
            operations: Operations::default(),
            speed: Speed::default(),
            encode_seconds: 0.0,
            open_seconds: None,
            peak_memory: None,
            found: String::new(),
            picture: None,
        }
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let lines = [line(10, 5.0), line(20, 6.0), line(20, 3.0), line(30, 3.0), line(40, 1.0), line(5, 9.0)];
        let all: Vec<&Line> = lines.iter().collect();
        let found: Vec<u64> =
            front(&all, |l| l.bytes as f64, |l| l.metrics.linear_rms).iter().map(|l| l.bytes).collect();
        assert_eq!(found, [5, 10, 20, 40]);
    }

    #[test]
    fn a_store_gives_back_its_lines_and_leaves_out_half_ones() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("measured.jsonl");
        let mut store = Store::open(path.clone()).expect("opened");
        store.add(line(10, 5.0)).expect("added");
        store.add(line(20, 4.0)).expect("added");
        let mut text = std::fs::read_to_string(&path).expect("read");
        text.push_str("{\"key\":\"ha");
        std::fs::write(&path, text).expect("written");
        let mut store = Store::<Line>::open(path.clone()).expect("opened");
        assert_eq!(store.lines.len(), 2);
        assert_eq!(store.lines[0].key(), "10 5");
        store.add(line(30, 3.0)).expect("added");
        assert_eq!(Store::<Line>::open(path).expect("opened").lines.len(), 3);
    }

    #[test]
    fn every_row_of_the_csv_has_as_many_cells_as_its_head() {
        let odd = Line { method: "a, \"b\"".into(), setting: "c,d".into(), ..line(1, 1.0) };
        let text = to_csv(&[odd, line(2, 2.0)]);
        let cells = |row: &str| {
            let (mut inside, mut count) = (false, 1);
            row.chars().for_each(|c| {
                inside ^= c == '"';
                count += usize::from(c == ',' && !inside);
            });
            count
        };
        let counts: Vec<usize> = text.lines().map(cells).collect();
        assert!(counts.len() == 3 && counts.iter().all(|n| *n == counts[0]), "{counts:?}");
        assert!(text.contains("\"a, \"\"b\"\"\""));
    }

    #[test]
    fn the_pairs_looked_at_are_many_and_there() {
        let description = Description {
            lights: vec![glam::DVec3::Z; 81],
            views: vec![glam::DVec3::Z; 40],
            ..Description::default()
        };
        let pairs = pairs_looked_at(&description);
        assert!(pairs.iter().all(|p| p[0] < 81 && p[1] < 40));
        let distinct: std::collections::BTreeSet<_> = pairs.iter().collect();
        assert!(distinct.len() == 64, "{}", distinct.len());
        let one = Description {
            lights: vec![glam::DVec3::Z],
            views: vec![glam::DVec3::Z],
            ..Description::default()
        };
        assert!(pairs_looked_at(&one).iter().all(|p| *p == [0, 0]));
    }
}
