//! Whole images for one light and one view: the same bits as a texel at a time, with the work shared.
//!
//! For fixed directions the product of the two angular columns belongs to an atom, so it is made once an
//! image; a coefficient is multiplied once a block, and only the spatial columns are paid per texel.
//! That is what the order of products of 10.7 is for.

use crate::colour::{Rgb, Values};
use crate::direction::{Direction, Taps};
use crate::ensemble::{RECORD_BOUND, Record};
use crate::fixed::{HALF_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::interpolation::{VALUE_BOUND, mean_q20, radiance, scale_q15, scale_texture};
use crate::material::{CHANNEL_FULL, CHANNEL_MISSING, Channel, METHOD_SPARSE_TENSOR, level_size};
use crate::open::Selvedge;
use crate::records::{Blend, Table, atoms_of, entry, for_each_coefficient, record_of};
use crate::result::BufferTooSmall;
use crate::tensor_paths;
use crate::words::word;

/// Texels along the side of the largest block.
const LANES: usize = 16;
/// One number for each texel of a row of a block.
type Lanes = [i32; LANES];

/// How a texture becomes the value of its channel, for one light and view (8.3).
#[derive(Clone, Copy)]
struct Finish {
    state: u32,
    mean: i32,
    /// The scale and its shift, if the channel has one.
    scale: Option<(i32, u32)>,
}

impl Finish {
    fn of(selvedge: &Selvedge<'_>, channel: Channel, light: Taps, view: Taps) -> Finish {
        let (words, material) = (selvedge.words(), selvedge.material());
        let mean = if channel.state == CHANNEL_MISSING {
            0
        } else {
            mean_q20(words, material, channel, light, view)
        };
        let scaled = channel.scale_start != 0;
        let scale = scaled.then(|| {
            (
                scale_q15(words, material, channel, light, view),
                word(words, channel.scale_start.wrapping_add(1)),
            )
        });
        Finish { state: channel.state, mean, scale }
    }

    #[inline(always)]
    fn value(&self, texture: i32) -> i32 {
        // A channel without texture has none, whatever its method gave; a missing one has a mean of zero.
        let texture = match (self.state == CHANNEL_FULL, self.scale) {
            (false, _) => 0,
            (true, None) => texture,
            (true, Some((scale, shift))) => scale_texture(texture, scale, shift),
        };
        clamp_magnitude(texture.wrapping_add(self.mean), VALUE_BOUND)
    }
}

impl Selvedge<'_> {
    /// Texels of a level: width and height.
    pub fn image_size(&self, level: u32) -> [u32; 2] {
        let level = level.min(self.material().level_count.wrapping_sub(1));
        [level_size(self.material().width, level), level_size(self.material().height, level)]
    }

    /// Words of scratch that [`Selvedge::decode_image`] and [`Selvedge::decode_channel`] need.
    pub fn image_scratch_len(&self) -> usize {
        if self.material().method == METHOD_SPARSE_TENSOR {
            return if self.material().full_count > 0 { tensor_paths::image_scratch_len(self) } else { 0 };
        }
        self.material().channels.iter().map(|channel| self.atom_total(*channel)).max().unwrap_or(0)
    }

    /// Atoms of all dictionaries of a channel.
    fn atom_total(&self, channel: Channel) -> usize {
        if channel.state != CHANNEL_FULL {
            return 0;
        }
        (0..word(self.words(), channel.atoms_start)).map(|k| atoms_of(self.words(), channel, k).len()).sum()
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
        let (light, view) = (self.locate_light(light), self.locate_view(view));
        let out = out.get_mut(..texels).unwrap_or(&mut []);
        let channel = channel.min(2);
        if self.has_tensor() {
            self.tensor_image(level, light, view, scratch, |at, values| {
                if let (Some(slot), Some(&value)) = (out.get_mut(at), values.get(channel)) {
                    *slot = value;
                }
            });
            return Ok(());
        }
        self.channel_image(channel, level, light, view, scratch, |at, value| {
            if let Some(slot) = out.get_mut(at) {
                *slot = value;
            }
        });
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
        let (light, view) = (self.locate_light(light), self.locate_view(view));
        let out = out.get_mut(..texels).unwrap_or(&mut []);
        if self.has_tensor() {
            self.tensor_image(level, light, view, scratch, |at, [c0, c1, c2]| {
                if let Some(slot) = out.get_mut(at) {
                    *slot = radiance(self.material(), Values { c0, c1, c2 }, light);
                }
            });
            return Ok(());
        }
        // The buffer holds the channel values first, then what they become.
        self.channel_image(0, level, light, view, scratch, |at, value| {
            if let Some(slot) = out.get_mut(at) {
                slot.r = value as u32;
            }
        });
        self.channel_image(1, level, light, view, scratch, |at, value| {
            if let Some(slot) = out.get_mut(at) {
                slot.g = value as u32;
            }
        });
        self.channel_image(2, level, light, view, scratch, |at, value| {
            if let Some(slot) = out.get_mut(at) {
                slot.b = value as u32;
            }
        });
        for texel in out {
            let values = Values { c0: texel.r as i32, c1: texel.g as i32, c2: texel.b as i32 };
            *texel = radiance(self.material(), values, light);
        }
        Ok(())
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

    /// Whether the textures are those of a sparse tensor, which gives all channels at once.
    fn has_tensor(&self) -> bool {
        self.material().method == METHOD_SPARSE_TENSOR && self.material().full_count > 0
    }

    /// The channel values of every texel of a sparse tensor.
    fn tensor_image(
        &self,
        level: u32,
        light: Taps,
        view: Taps,
        scratch: &mut [i32],
        mut put: impl FnMut(usize, [i32; 3]),
    ) {
        let level = level.min(self.material().level_count.wrapping_sub(1));
        let [f0, f1, f2] = self.material().channels.map(|channel| Finish::of(self, channel, light, view));
        tensor_paths::image_textures(self, level, light, view, scratch, |at, [t0, t1, t2]| {
            put(at, [f0.value(t0), f1.value(t1), f2.value(t2)])
        });
    }

    /// Every texel of one channel of a sparse ensemble, block by block; of a channel without texture, of any
    /// method.
    #[inline(always)]
    fn channel_image(
        &self,
        number: usize,
        level: u32,
        light: Taps,
        view: Taps,
        scratch: &mut [i32],
        mut put: impl FnMut(usize, i32),
    ) {
        let (words, material) = (self.words(), self.material());
        let level = level.min(material.level_count.wrapping_sub(1));
        let [width, height] = self.image_size(level);
        let texels = (width as usize).saturating_mul(height as usize);
        let Some(&channel) = material.channels.get(number) else { return };
        let finish = Finish::of(self, channel, light, view);
        if channel.state != CHANNEL_FULL {
            (0..texels).for_each(|at| put(at, finish.value(0)));
            return;
        }
        self.angular_products(channel, light, view, scratch);
        let edge = material.edge;
        let blocks_x = width.div_ceil(edge.max(1));
        for block_y in 0..height.div_ceil(edge.max(1)) {
            for block_x in 0..blocks_x {
                let mut sums = [[0i32; LANES]; LANES];
                let block = block_y.wrapping_mul(blocks_x).wrapping_add(block_x);
                for layer in 0..material.layer_limit {
                    let record = record_of(words, material, channel, level, layer, block);
                    if record.count > 0 {
                        self.add_record(channel, &record, scratch, &mut sums);
                    }
                }
                let (x0, y0) = (block_x.wrapping_mul(edge), block_y.wrapping_mul(edge));
                for (y, row) in (y0..height.min(y0.wrapping_add(edge))).zip(&sums) {
                    let at = (y as usize).wrapping_mul(width as usize).wrapping_add(x0 as usize);
                    for (x, &texture) in (x0..width.min(x0.wrapping_add(edge))).zip(row) {
                        put(at.wrapping_add(x.wrapping_sub(x0) as usize), finish.value(texture));
                    }
                }
            }
        }
    }

    /// The product of the angular columns of every atom (10.7-1), dictionary by dictionary.
    fn angular_products(&self, channel: Channel, light: Taps, view: Taps, out: &mut [i32]) {
        let words = self.words();
        let mut slots = out.iter_mut();
        for k in 0..word(words, channel.atoms_start) {
            let columns = |which: u32, taps: Taps| {
                Blend::rows(Table::new(words, channel.angular_start, k, which), taps)
            };
            let (u_light, u_view) = (columns(0, light), columns(1, view));
            for (&[a0, a1, a2, a3, ..], slot) in atoms_of(words, channel, k).iter().zip(&mut slots) {
                let atom = u32::from_le_bytes([a0, a1, a2, a3]);
                let product =
                    u_light.column((atom >> 14) & 0x3ff).wrapping_mul(u_view.column((atom >> 4) & 0x3ff));
                *slot = product.wrapping_add(HALF_Q15) >> 15;
            }
        }
    }

    /// Adds a record to the texture of its block: 10.7 with the spatial rows of single texels.
    #[inline(always)]
    fn add_record(&self, channel: Channel, record: &Record, products: &[i32], sums: &mut [Lanes; LANES]) {
        let words = self.words();
        // Lists follow each other (10.5-4), so the words between two are two an atom.
        let list = |k: u32| word(words, channel.atoms_start.wrapping_add(3).wrapping_add(k.wrapping_mul(2)));
        let first = (list(record.dictionary).wrapping_sub(list(0)) >> 1) as usize;
        let products = products.get(first..).unwrap_or(&[]);
        let x_table = Table::new(words, channel.spatial_start, record.dictionary, 0);
        let y_table = Table::new(words, channel.spatial_start, record.dictionary, 1);
        let edge = self.material().edge;
        let column_of = |table: Table<'_>, column: u32| {
            let mut lanes = [0i32; LANES];
            for (row, lane) in (0..edge).zip(&mut lanes) {
                *lane = entry(table.row(row), column);
            }
            lanes
        };
        let mut total = [[0i32; LANES]; LANES];
        let mut sum_y = [0i32; LANES];
        let mut sum_xy = 0i32;
        let mut spatial = 0u32;
        let close_x = |sum_y: &mut Lanes, sum_xy: &mut i32, spatial: u32| {
            let u = column_of(x_table, spatial & 0xf);
            for (lane, u) in sum_y.iter_mut().zip(u) {
                *lane = lane.wrapping_add(multiply_q15(*sum_xy, u));
            }
            *sum_xy = 0;
        };
        let close_y = |total: &mut [Lanes; LANES], sum_y: &mut Lanes, spatial: u32| {
            for (row, u) in total.iter_mut().zip(column_of(y_table, spatial >> 4)).take(edge as usize) {
                for (lane, sum) in row.iter_mut().zip(sum_y.iter()) {
                    *lane = lane.wrapping_add(multiply_q15(*sum, u));
                }
            }
            *sum_y = [0; LANES];
        };
        for_each_coefficient(words, channel, record, |c| {
            let next = c.atom >> 24;
            if next != spatial {
                close_x(&mut sum_y, &mut sum_xy, spatial);
                if next >> 4 != spatial >> 4 {
                    close_y(&mut total, &mut sum_y, spatial);
                }
                spatial = next;
            }
            let product = products.get(c.position as usize).copied().unwrap_or(0);
            sum_xy = sum_xy.wrapping_add(round_shift(c.value.wrapping_mul(product), c.atom & 0xf));
        });
        close_x(&mut sum_y, &mut sum_xy, spatial);
        close_y(&mut total, &mut sum_y, spatial);
        for (sums, total) in sums.iter_mut().zip(&total) {
            for (sum, total) in sums.iter_mut().zip(total) {
                *sum = sum.wrapping_add(clamp_magnitude(round_shift(*total, record.shift), RECORD_BOUND));
            }
        }
    }
}
