//! Whole images for one light and one view: the same bits as a texel at a time, with work shared by the
//! material's method.

use crate::fast::finish::Finish;
use crate::fast::{ImageQuery, Textures};
use crate::kernel::colour::{Rgb, Values};
use crate::kernel::direction::Direction;
use crate::kernel::interpolation::radiance;
use crate::kernel::material::{CHANNEL_FULL, channel_of, level_size};
use crate::method;
use crate::selvedge::{BufferTooSmall, Selvedge};

impl Selvedge<'_> {
    /// Texels of a level: width and height.
    pub fn image_size(&self, level: u32) -> [u32; 2] {
        let level = level.min(self.material().level_count.wrapping_sub(1));
        [level_size(self.material().width, level), level_size(self.material().height, level)]
    }

    /// Words of scratch that [`Selvedge::decode_image`] and [`Selvedge::decode_channel`] need.
    pub fn image_scratch_len(&self) -> usize {
        if self.material().full_count == 0 {
            return 0;
        }
        method::fast::image_scratch_len(self)
    }

    /// Channel values, Q20, of every texel of a level: `[height, width]`, row-major.
    ///
    /// At level 0 each value equals that of [`Selvedge::point_values`] where the directions are sample
    /// directions. Levels and channels beyond the last are the last.
    ///
    /// # Errors
    /// If `out` has fewer than width x height elements or `scratch` fewer than
    /// [`Selvedge::image_scratch_len`].
    pub fn decode_channel(
        &self,
        channel: usize,
        level: u32,
        light: Direction,
        view: Direction,
        scratch: &mut [i32],
        out: &mut [i32],
    ) -> Result<(), BufferTooSmall> {
        let texels = self.image_buffers(level, scratch.len(), out.len())?;
        let out = out.get_mut(..texels).unwrap_or(&mut []);
        let channel = channel.min(2) as u32;
        let query = self.image_query(level, light, view);
        if channel_of(self.material(), channel).state == CHANNEL_FULL {
            method::fast::image(self, &query, scratch, Textures::One(channel, out));
        }
        let finish = self.finish_of(&query, channel);
        for value in out {
            *value = finish.value(*value);
        }
        Ok(())
    }

    /// Linear radiance of every texel of a level: `[height, width]`, row-major.
    ///
    /// # Errors
    /// As [`Selvedge::decode_channel`].
    pub fn decode_image(
        &self,
        level: u32,
        light: Direction,
        view: Direction,
        scratch: &mut [i32],
        out: &mut [Rgb],
    ) -> Result<(), BufferTooSmall> {
        let texels = self.image_buffers(level, scratch.len(), out.len())?;
        let out = out.get_mut(..texels).unwrap_or(&mut []);
        let query = self.image_query(level, light, view);
        // The buffer holds the textures first, then what they become.
        if self.material().full_count > 0 {
            method::fast::image(self, &query, scratch, Textures::All(out));
        }
        let [f0, f1, f2] = [0, 1, 2].map(|channel| self.finish_of(&query, channel));
        for texel in out {
            let [c0, c1, c2] = [f0.value(texel.r as i32), f1.value(texel.g as i32), f2.value(texel.b as i32)];
            *texel = radiance(self.material(), Values { c0, c1, c2 }, &query.light);
        }
        Ok(())
    }

    fn image_query(&self, level: u32, light: Direction, view: Direction) -> ImageQuery {
        let level = level.min(self.material().level_count.wrapping_sub(1));
        let (light, view) = (self.locate_light(light), self.locate_view(view));
        ImageQuery { level, size: self.image_size(level), light, view }
    }

    fn finish_of(&self, query: &ImageQuery, channel: u32) -> Finish {
        let (words, material) = (self.words(), self.material());
        Finish::of(words, material, channel_of(material, channel), query.light.taps, query.view.taps)
    }

    /// Checks lent buffers; gives the texels of the level.
    fn image_buffers(&self, level: u32, scratch: usize, out: usize) -> Result<usize, BufferTooSmall> {
        let [width, height] = self.image_size(level);
        let texels = (width as usize).saturating_mul(height as usize);
        let scratch_needed = self.image_scratch_len();
        if scratch < scratch_needed {
            return Err(BufferTooSmall { needed: scratch_needed, lent: scratch });
        }
        if out < texels {
            return Err(BufferTooSmall { needed: texels, lent: out });
        }
        Ok(texels)
    }
}
