//! Images of a sparse ensemble: the same bits as a texel at a time, with the work shared.
//!
//! For fixed directions the product of the two angular columns belongs to an atom, so it is made once an
//! image; a coefficient is multiplied once a block, and only the spatial columns are paid per texel.
//! That is what the order of products of 10.7 is for.

use super::records::{Blend, atoms_of, factor, for_each_coefficient, record_of};
use crate::fast::table::{Table, entry};
use crate::fast::{ImageQuery, Textures};
use crate::kernel::direction::Taps;
use crate::kernel::fixed::{HALF_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::material::{CHANNEL_FULL, channel_of};
use crate::kernel::words::word;
use crate::method::sparse_ensemble::{
    RECORD_BOUND, Record, Tables, atom_light, atom_shift, atom_view, tables_of,
};
use crate::selvedge::Selvedge;

/// Texels along the side of the largest block.
const LANES: usize = 16;
/// One number for each texel of a row of a block.
type Lanes = [i32; LANES];

/// Words of scratch: a product for each atom of the channel that has most.
pub(crate) fn image_scratch_len(selvedge: &Selvedge<'_>) -> usize {
    let (words, material) = (selvedge.words(), selvedge.material());
    let total = |number: u32| {
        if channel_of(material, number).state != CHANNEL_FULL {
            return 0;
        }
        let tables = tables_of(material, number);
        (0..word(words, tables.atoms_start)).map(|k| atoms_of(words, tables, k).len()).sum::<usize>()
    };
    (0..3).map(total).max().unwrap_or(0)
}

/// The textures of an image, channel by channel.
pub(crate) fn image(
    selvedge: &Selvedge<'_>,
    query: &ImageQuery,
    scratch: &mut [i32],
    textures: Textures<'_>,
) {
    match textures {
        Textures::One(number, out) => {
            let channel = ChannelImage { selvedge, tables: tables_of(selvedge.material(), number) };
            channel.decode(query, scratch, |at, texture| {
                if let Some(slot) = out.get_mut(at) {
                    *slot = texture;
                }
            });
        }
        Textures::All(out) => {
            for number in (0..3).filter(|&n| channel_of(selvedge.material(), n).state == CHANNEL_FULL) {
                let channel = ChannelImage { selvedge, tables: tables_of(selvedge.material(), number) };
                channel.decode(query, scratch, |at, texture| {
                    if let Some(slot) = out.get_mut(at) {
                        let word = match number {
                            0 => &mut slot.r,
                            1 => &mut slot.g,
                            _ => &mut slot.b,
                        };
                        *word = texture as u32;
                    }
                });
            }
        }
    }
}

/// An image of one channel.
struct ChannelImage<'a, 'b> {
    selvedge: &'b Selvedge<'a>,
    tables: Tables,
}

impl ChannelImage<'_, '_> {
    /// Every texel, block by block.
    #[inline(always)]
    fn decode(&self, query: &ImageQuery, scratch: &mut [i32], mut put: impl FnMut(usize, i32)) {
        let (words, material) = (self.selvedge.words(), self.selvedge.material());
        let [width, height] = query.size;
        self.angular_products(query.light.taps, query.view.taps, scratch);
        let edge = material.edge;
        let blocks_x = width.div_ceil(edge.max(1));
        for block_y in 0..height.div_ceil(edge.max(1)) {
            for block_x in 0..blocks_x {
                let mut sums = [[0i32; LANES]; LANES];
                let block = block_y.wrapping_mul(blocks_x).wrapping_add(block_x);
                for layer in 0..material.layer_limit {
                    let record = record_of(words, material, self.tables, query.level, layer, block);
                    if record.count > 0 {
                        self.add_record(&record, scratch, &mut sums);
                    }
                }
                let (x0, y0) = (block_x.wrapping_mul(edge), block_y.wrapping_mul(edge));
                for (y, row) in (y0..height.min(y0.wrapping_add(edge))).zip(&sums) {
                    let at = (y as usize).wrapping_mul(width as usize).wrapping_add(x0 as usize);
                    for (x, &texture) in (x0..width.min(x0.wrapping_add(edge))).zip(row) {
                        put(at.wrapping_add(x.wrapping_sub(x0) as usize), texture);
                    }
                }
            }
        }
    }

    /// The product of the angular columns of every atom (10.7-1), dictionary by dictionary.
    fn angular_products(&self, light: Taps, view: Taps, out: &mut [i32]) {
        let (words, tables) = (self.selvedge.words(), self.tables);
        let mut slots = out.iter_mut();
        for k in 0..word(words, tables.atoms_start) {
            let columns =
                |which: u32, taps: Taps| Blend::rows(factor(words, tables.angular_start, k, which), taps);
            let (u_light, u_view) = (columns(0, light), columns(1, view));
            for (&[a0, a1, a2, a3, ..], slot) in atoms_of(words, tables, k).iter().zip(&mut slots) {
                let atom = u32::from_le_bytes([a0, a1, a2, a3]);
                let product = u_light.column(atom_light(atom)).wrapping_mul(u_view.column(atom_view(atom)));
                *slot = product.wrapping_add(HALF_Q15) >> 15;
            }
        }
    }

    /// Adds a record to the texture of its block: 10.7 with the spatial rows of single texels.
    #[inline(always)]
    fn add_record(&self, record: &Record, products: &[i32], sums: &mut [Lanes; LANES]) {
        let (words, tables) = (self.selvedge.words(), self.tables);
        // Lists follow each other (10.5-4), so the words between two are two an atom.
        let list = |k: u32| word(words, tables.atoms_start.wrapping_add(3).wrapping_add(k.wrapping_mul(2)));
        let first = (list(record.dictionary).wrapping_sub(list(0)) >> 1) as usize;
        let products = products.get(first..).unwrap_or(&[]);
        let x_table = factor(words, tables.spatial_start, record.dictionary, 0);
        let y_table = factor(words, tables.spatial_start, record.dictionary, 1);
        let edge = self.selvedge.material().edge;
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
        for_each_coefficient(words, tables, record, |c| {
            let next = c.atom >> 24;
            if next != spatial {
                close_x(&mut sum_y, &mut sum_xy, spatial);
                if next >> 4 != spatial >> 4 {
                    close_y(&mut total, &mut sum_y, spatial);
                }
                spatial = next;
            }
            let product = products.get(c.position as usize).copied().unwrap_or(0);
            sum_xy = sum_xy.wrapping_add(round_shift(c.value.wrapping_mul(product), atom_shift(c.atom)));
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
