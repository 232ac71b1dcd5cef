//! What gives radiance at texels and pairs of directions: a dataset, an open file at a level of detail, a
//! baseline.

use crate::data::dataset::{Dataset, Description};
use crate::error::{Result, ToolError};
use crate::format::query::query;
use crate::measure::baseline::decoder::{Decoder, Locator};
use selvedge::{Rgb, Selvedge};

/// Images of a baseline that are decoded together.
const BASELINE_IMAGES: usize = 8;

/// Something that gives linear radiance at the directions of a reference.
pub trait Radiance: Sync {
    /// Texels along x and y.
    fn size(&self) -> [usize; 2];

    /// Whether it can be asked for the directions of a reference.
    ///
    /// # Errors
    /// [`ToolError::Different`] if it has its own alone, and they are others.
    fn check_directions(&self, _reference: &Description) -> Result<()> {
        Ok(())
    }

    /// Images that are read or decoded together; [`usize::MAX`] if the more, the better.
    fn images_at_once(&self) -> usize;

    /// Linear radiance at some pairs of a reference's directions, `view * lights + light`, ascending. `out`
    /// has `[pair][texel]`.
    ///
    /// # Errors
    /// If data cannot be read.
    fn images(&self, reference: &Description, pairs: &[usize], out: &mut [[f32; 3]]) -> Result<()>;
}

impl Radiance for Dataset {
    fn size(&self) -> [usize; 2] {
        self.description().size
    }

    fn check_directions(&self, reference: &Description) -> Result<()> {
        let counts = |of: &Description| (of.lights.len(), of.views.len());
        if counts(self.description()) != counts(reference) {
            return Err(ToolError::Different(format!(
                "{}: other directions than those of the reference",
                self.path().display()
            )));
        }
        Ok(())
    }

    fn images_at_once(&self) -> usize {
        usize::MAX
    }

    fn images(&self, reference: &Description, pairs: &[usize], out: &mut [[f32; 3]]) -> Result<()> {
        let (Some(&first), Some(&last)) = (pairs.first(), pairs.last()) else { return Ok(()) };
        let texels = reference.texels();
        let mut bytes = Vec::new();
        let mut run = vec![0.0; (last + 1 - first) * 3];
        for texel in 0..texels {
            self.read_pairs(texel, first, &mut bytes, &mut run)?;
            let rgb = &run.as_chunks::<3>().0;
            pairs.iter().enumerate().for_each(|(i, pair)| out[i * texels + texel] = rgb[pair - first]);
        }
        Ok(())
    }
}

impl<T: Radiance + ?Sized> Radiance for &T {
    fn size(&self) -> [usize; 2] {
        (**self).size()
    }

    fn check_directions(&self, reference: &Description) -> Result<()> {
        (**self).check_directions(reference)
    }

    fn images_at_once(&self) -> usize {
        (**self).images_at_once()
    }

    fn images(&self, reference: &Description, pairs: &[usize], out: &mut [[f32; 3]]) -> Result<()> {
        (**self).images(reference, pairs, out)
    }
}

/// An open file, decoded by the core at a level of detail.
#[derive(Clone, Copy)]
pub struct AtLevel<'a> {
    /// The file.
    pub file: &'a Selvedge<'a>,
    /// The level.
    pub level: u32,
}

impl<'a> AtLevel<'a> {
    /// A file at its finest level.
    pub fn finest(file: &'a Selvedge<'a>) -> AtLevel<'a> {
        AtLevel { file, level: 0 }
    }
}

impl Radiance for AtLevel<'_> {
    fn size(&self) -> [usize; 2] {
        self.file.image_size(self.level).map(|n| n as usize)
    }

    fn images_at_once(&self) -> usize {
        1
    }

    fn images(&self, reference: &Description, pairs: &[usize], out: &mut [[f32; 3]]) -> Result<()> {
        let (texels, lights) = (reference.texels(), reference.lights.len());
        let mut scratch = vec![0; self.file.image_scratch_len()];
        let mut image = vec![Rgb::default(); texels];
        for (&pair, out) in pairs.iter().zip(out.chunks_mut(texels)) {
            let [light, view] = [reference.lights[pair % lights], reference.views[pair / lights]].map(query);
            self.file
                .decode_image(self.level, light, view, &mut scratch, &mut image)
                .expect("the buffers are as long as asked for");
            out.iter_mut().zip(&image).for_each(|(out, rgb)| *out = rgb.to_f32());
        }
        Ok(())
    }
}

/// A baseline, and what finds its directions.
#[derive(Clone, Copy)]
pub struct Baseline<'a> {
    /// The baseline.
    pub decoder: &'a dyn Decoder,
    /// What finds its directions.
    pub locator: &'a Locator<'a>,
}

impl Radiance for Baseline<'_> {
    fn size(&self) -> [usize; 2] {
        self.locator.size
    }

    fn images_at_once(&self) -> usize {
        BASELINE_IMAGES
    }

    fn images(&self, reference: &Description, pairs: &[usize], out: &mut [[f32; 3]]) -> Result<()> {
        let (texels, lights, near) = (reference.texels(), reference.lights.len(), self.decoder.two_nearest());
        let mut begun = 0;
        for same in pairs.chunk_by(|a, b| a / lights == b / lights) {
            let blend = |pair: &usize| self.locator.light(query(reference.lights[pair % lights]), near);
            let view = self.locator.view(query(reference.views[same[0] / lights]), near);
            let out = &mut out[begun * texels..][..same.len() * texels];
            self.decoder.images(&same.iter().map(blend).collect::<Vec<_>>(), view, out);
            begun += same.len();
        }
        Ok(())
    }
}
