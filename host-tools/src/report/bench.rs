//! What is measured of a file or a baseline, against the data of one dataset.

use super::line::{COMPARED, Operations};
use crate::check::count;
use crate::data::dataset::{Dataset, Description};
use crate::data::picture::{Picture, log_error};
use crate::error::Result;
use crate::measure::baseline::decoder::{Decoder, Locator, POSITION};
use crate::measure::compare::{self, Comparison, Metrics};
use crate::measure::radiance::{AtLevel, Baseline, Radiance};
use crate::measure::similarity::{flip, ssim};
use crate::measure::speed::{self, Adapter, Speed};
use rayon::prelude::*;
use selvedge::Selvedge;
use std::path::Path;

/// Something that can be measured.
pub(super) enum Subject<'a> {
    /// A file.
    File(&'a Selvedge<'a>),
    /// A baseline.
    Baseline(&'a dyn Decoder),
}

impl<'a> Subject<'a> {
    /// As a source of radiance.
    pub(super) fn source<'s>(&'s self, locator: &'s Locator<'s>) -> Box<dyn Radiance + 's> {
        match self {
            Subject::File(file) => Box::new(AtLevel::finest(file)),
            Subject::Baseline(decoder) => Box::new(Baseline { decoder: *decoder, locator }),
        }
    }

    /// Errors against data, at every N-th light of each view. A PSNR is clamped to 999 dB, as equal
    /// images have no finite one.
    ///
    /// # Errors
    /// If data cannot be read.
    pub(super) fn metrics(
        &self,
        locator: &Locator<'_>,
        data: &Dataset,
        every: usize,
        offset: f32,
        peak: f32,
    ) -> Result<Metrics> {
        let peak = Some(peak as f64);
        let comparison = Comparison { description: data.description(), log_offset: offset, peak, every };
        let found = comparison.run(data, &*self.source(locator), &|_, _| ())?;
        Ok(Metrics { psnr_db: found.psnr_db.clamp(-999.0, 999.0), ..found })
    }

    /// Operations of random samples.
    pub(super) fn operations(&self, locator: &Locator<'_>) -> Operations {
        match self {
            Subject::File(file) => Operations::of_file(file),
            Subject::Baseline(decoder) => Operations::of_random(None, |q| {
                let m = locator.file.material();
                // The same cost of locating directions for all, but for those that compare with every one.
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

    /// Rates.
    pub(super) fn speed(&self, locator: &Locator<'_>, adapter: &Adapter) -> Speed {
        match self {
            Subject::File(file) => speed::of_file(file, adapter),
            Subject::Baseline(decoder) => speed::of_baseline(*decoder, locator),
        }
    }
}

/// What is fixed for a dataset while its lines are measured.
pub(super) struct Bench<'a> {
    /// The data.
    pub(super) data: &'a Dataset,
    /// Finds directions for baselines.
    pub(super) locator: &'a Locator<'a>,
    /// Adapter of the kernel.
    pub(super) adapter: &'a Adapter,
    /// Pairs of light and view whose images are looked at, with the reference's.
    pub(super) looked_at: Vec<([usize; 2], Vec<[f32; 3]>)>,
    /// Every N-th light of each view is compared.
    pub(super) every: usize,
    /// Factor that makes the mean of the data 0.4, for SSIM, FLIP and pictures.
    pub(super) exposure: f32,
    /// Folder of the report.
    pub(super) out: &'a Path,
}

/// Sixty-four pairs, spread over both sets.
pub(super) fn pairs_looked_at(description: &Description) -> Vec<[usize; 2]> {
    let (lights, views) = (description.lights.len(), description.views.len());
    // A lattice: each eighth of the lights meets each eighth of the views.
    (0..64).map(|i| [(i * lights / 64 + i % 8 * lights / 8) % lights, (i * views / 64) % views]).collect()
}

impl<'a> Bench<'a> {
    /// Reads the images that similarity is measured against.
    ///
    /// # Errors
    /// If data cannot be read.
    pub(super) fn new(
        data: &'a Dataset,
        locator: &'a Locator<'a>,
        adapter: &'a Adapter,
        every: Option<usize>,
        out: &'a Path,
    ) -> Result<Bench<'a>> {
        let image =
            |pair: [usize; 2]| Ok((pair, compare::image(data, data.description(), pair[0], pair[1])?));
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

    /// Errors over all texels and views and every N-th light.
    ///
    /// # Errors
    /// If data cannot be read.
    pub(super) fn metrics(&self, subject: &Subject<'_>) -> Result<Metrics> {
        let statistics = self.data.statistics();
        subject.metrics(self.locator, self.data, self.every, statistics.log_offset(), statistics.largest)
    }

    /// Mean SSIM and FLIP over the pairs that are looked at.
    ///
    /// # Errors
    /// If the subject cannot be read.
    pub(super) fn similarity(&self, subject: &Subject<'_>) -> Result<[f64; 2]> {
        let description = self.data.description();
        let shown = |image: &[[f32; 3]]| -> Vec<[f32; 3]> {
            image.iter().map(|rgb| rgb.map(|c| (c * self.exposure).clamp(0.0, 1.0))).collect()
        };
        let both = |([light, view], reference): &([usize; 2], Vec<[f32; 3]>)| -> Result<[f64; 2]> {
            let image = compare::image(&*subject.source(self.locator), description, *light, *view)?;
            let (a, b) = (shown(reference), shown(&image));
            Ok([ssim(&a, &b, description.size[0]), flip(&a, &b, description.size[0])])
        };
        let all: Vec<[f64; 2]> = self.looked_at.par_iter().map(both).collect::<Result<_>>()?;
        Ok([0, 1].map(|i| all.iter().map(|pair| pair[i]).sum::<f64>() / all.len() as f64))
    }

    /// The decoded image and its error at two pairs, as a picture; `None` as the subject shows the data.
    /// Gives its name in the folder.
    ///
    /// # Errors
    /// If data cannot be read or the picture not be written.
    pub(super) fn picture(&self, subject: Option<&Subject<'_>>, name: &str) -> Result<String> {
        let description = self.data.description();
        let mut tiles = Vec::new();
        for i in [9, 38] {
            let ([light, view], reference) = &self.looked_at[i];
            let decoded = subject
                .map(|s| compare::image(&*s.source(self.locator), description, *light, *view))
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
                    log_error(decoded, reference, description.size, offset, ERROR_WHITE).enlarged(factor),
                );
            }
        }
        let name = format!("{name}.png");
        Picture::beside(&tiles, 6).save(&self.out.join(&name))?;
        Ok(name)
    }
}

/// Error of the natural logarithm that is white in pictures.
const ERROR_WHITE: f32 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

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
