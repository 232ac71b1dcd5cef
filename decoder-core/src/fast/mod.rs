//! What batches and images stand on: directions and tables made ready, and what a method brings to them.
//!
//! A method without a fast path of its own has [`Fast::PLAIN`]: it is walked sample by sample, with the same bits.

pub(crate) mod finish;
pub(crate) mod located;
pub(crate) mod table;

use crate::batch::FilteredQuery;
use crate::fast::finish::finish;
use crate::fast::located::ReadySets;
use crate::kernel::colour::Rgb;
use crate::kernel::direction::Located;
use crate::kernel::interpolation::{place_at_position, place_at_texel};
use crate::kernel::method::textures_q20;
use crate::selvedge::Selvedge;

/// An image that is wanted: a level that is there, and located directions.
pub struct ImageQuery {
    /// Level of detail.
    pub level: u32,
    /// Texels along x and y.
    pub size: [u32; 2],
    /// The light.
    pub light: Located,
    /// The view.
    pub view: Located,
}

/// Where the textures of an image go, Q20, row by row.
pub enum Textures<'o> {
    /// Those of one channel.
    One(u32, &'o mut [i32]),
    /// Those of three channels, as words of red, green and blue.
    All(&'o mut [Rgb]),
}

impl Textures<'_> {
    /// Puts the textures of a texel; a place outside is none.
    #[inline(always)]
    pub fn put(&mut self, at: usize, [t0, t1, t2]: [i32; 3]) {
        match self {
            Textures::One(channel, out) => {
                if let Some(slot) = out.get_mut(at) {
                    *slot = [t0, t1, t2].get(*channel as usize).copied().unwrap_or(0);
                }
            }
            Textures::All(out) => {
                if let Some(slot) = out.get_mut(at) {
                    *slot = Rgb { r: t0 as u32, g: t1 as u32, b: t2 as u32 };
                }
            }
        }
    }
}

/// Samples level 0: as many answers as queries. `None` if the scratch is too short.
pub type Batch = fn(&Selvedge<'_>, &[FilteredQuery], &mut [i32], &mut [Rgb]) -> Option<()>;

/// What a method brings to batches and images.
#[derive(Clone, Copy)]
pub struct Fast {
    /// Words of scratch that a batch of so many queries needs.
    pub batch_scratch_len: fn(&Selvedge<'_>, usize) -> usize,
    /// The batch.
    pub batch: Batch,
    /// Words of scratch that an image needs.
    pub image_scratch_len: fn(&Selvedge<'_>) -> usize,
    /// Fills in the textures of an image of which a channel that is asked for has texture.
    pub image: fn(&Selvedge<'_>, &ImageQuery, &mut [i32], Textures<'_>),
}

#[cfg_attr(not(test), allow(dead_code, reason = "methods at hand have fast paths; the next one begins here"))]
impl Fast {
    /// Sample by sample.
    pub const PLAIN: Fast = Fast {
        batch_scratch_len: |selvedge, _| ReadySets::scratch_len(selvedge.words(), selvedge.material()),
        batch: plain_batch,
        image_scratch_len: |_| 0,
        image: plain_image,
    };
}

/// Directions are located fast; textures are made one after the other.
#[cfg_attr(not(test), allow(dead_code, reason = "as Fast::PLAIN"))]
fn plain_batch(
    selvedge: &Selvedge<'_>,
    queries: &[FilteredQuery],
    scratch: &mut [i32],
    out: &mut [Rgb],
) -> Option<()> {
    let (words, material) = (selvedge.words(), selvedge.material());
    let (ready, _) = scratch.split_at_mut_checked(ReadySets::scratch_len(words, material))?;
    let sets = ReadySets::new(words, material, ready);
    for (query, rgb) in queries.iter().zip(out) {
        let (light, view) = (sets.light.locate(query.light), sets.view.locate(query.view));
        let mut textures = [0; 3];
        if material.full_count > 0 {
            let place = place_at_position(material, 0, query.u_q32, query.v_q32);
            let values = textures_q20(words, material, place, light, view);
            textures = [values.c0, values.c1, values.c2];
        }
        *rgb = finish(words, material, textures, light.taps, view.taps);
    }
    Some(())
}

#[cfg_attr(not(test), allow(dead_code, reason = "as Fast::PLAIN"))]
fn plain_image(selvedge: &Selvedge<'_>, image: &ImageQuery, _: &mut [i32], mut textures: Textures<'_>) {
    let (words, material, [width, height]) = (selvedge.words(), selvedge.material(), image.size);
    let mut at = 0usize;
    for y in 0..height {
        for x in 0..width {
            let place = place_at_texel(material, image.level, x, y);
            let values = textures_q20(words, material, place, image.light, image.view);
            textures.put(at, [values.c0, values.c1, values.c2]);
            at = at.wrapping_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::direction::Direction;
    use crate::walk::limits::Limits;

    /// What a method without a path of its own gives: the same bits as its samples, one by one.
    #[test]
    fn the_plain_paths_give_the_same_bits() {
        let bytes = include_bytes!("../../tests/data/carpet07-excerpt.selv");
        let selvedge = crate::open(bytes, &Limits::default()).expect("legal");
        let mut word = 1u32;
        let mut next = || {
            word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            word
        };
        let mut direction = || Direction {
            x_q18: (next() >> 13) as i32 - 262_144,
            y_q18: (next() >> 13) as i32 - 262_144,
            z_q15: (next() >> 16) as i32,
        };
        let queries = [0u32; 64].map(|_| {
            let (light, view) = (direction(), direction());
            FilteredQuery { u_q32: (light.x_q18 as u32) << 13, v_q32: (view.x_q18 as u32) << 13, light, view }
        });
        let mut scratch = std::vec![-1; (Fast::PLAIN.batch_scratch_len)(&selvedge, queries.len())];
        let mut out = [Rgb::default(); 64];
        (Fast::PLAIN.batch)(&selvedge, &queries, &mut scratch, &mut out).expect("enough scratch");
        for (query, rgb) in queries.iter().zip(out) {
            assert_eq!(selvedge.filtered(query.u_q32, query.v_q32, query.light, query.view), rgb);
        }
        assert!((Fast::PLAIN.batch)(&selvedge, &queries, &mut [], &mut out).is_none(), "no scratch");

        let (light, view) = (direction(), direction());
        let size = selvedge.image_size(0);
        let query = ImageQuery {
            level: 0,
            size,
            light: selvedge.locate_light(light),
            view: selvedge.locate_view(view),
        };
        let texels = (size[0] * size[1]) as usize;
        let mut all = std::vec![Rgb::default(); texels];
        (Fast::PLAIN.image)(&selvedge, &query, &mut [], Textures::All(&mut all));
        let fast = crate::method::method_of(selvedge.material().method).expect("known").fast;
        let mut scratch = std::vec![-1; (fast.image_scratch_len)(&selvedge)];
        let mut by_method = std::vec![Rgb::default(); texels];
        (fast.image)(&selvedge, &query, &mut scratch, Textures::All(&mut by_method));
        assert!(all == by_method && all.iter().any(|texel| texel.g != 0));
        for channel in 0..3 {
            let mut one = std::vec![0; texels];
            (Fast::PLAIN.image)(&selvedge, &query, &mut [], Textures::One(channel, &mut one));
            let of = |texel: &Rgb| [texel.r, texel.g, texel.b][channel as usize] as i32;
            assert!(one.iter().copied().eq(all.iter().map(of)), "{channel}");
        }
    }
}
