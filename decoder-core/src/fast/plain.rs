//! Fast paths of a method that has none of its own: directions are located fast, textures made one by one.
#![cfg_attr(not(test), allow(dead_code, reason = "methods at hand have their own; the next one begins here"))]

use crate::fast::finish::finish;
use crate::fast::located::ReadySets;
use crate::fast::{ImageQuery, Textures};
use crate::kernel::colour::Rgb;
use crate::kernel::interpolation::{place_at_position, place_at_texel};
use crate::kernel::method::textures_q20;
use crate::query::FilteredQuery;
use crate::selvedge::Selvedge;

/// Words of scratch of a batch.
pub(crate) fn batch_scratch_len(selvedge: &Selvedge<'_>, _count: usize) -> usize {
    ReadySets::scratch_len(selvedge.words(), selvedge.material())
}

/// Words of scratch of an image.
pub(crate) fn image_scratch_len(_: &Selvedge<'_>) -> usize {
    0
}

/// Directions are located fast; textures are made one after the other.
pub(crate) fn batch(
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
            let values = textures_q20(words, material, &place, &light, &view);
            textures = [values.c0, values.c1, values.c2];
        }
        *rgb = finish(words, material, textures, light.taps, view.taps);
    }
    Some(())
}

/// Texels one after the other.
pub(crate) fn image(selvedge: &Selvedge<'_>, image: &ImageQuery, _: &mut [i32], mut textures: Textures<'_>) {
    let (words, material, [width, height]) = (selvedge.words(), selvedge.material(), image.size);
    let mut at = 0usize;
    for y in 0..height {
        for x in 0..width {
            let place = place_at_texel(material, image.level, x, y);
            let values = textures_q20(words, material, &place, &image.light, &image.view);
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
        let mut scratch = std::vec![-1; batch_scratch_len(&selvedge, queries.len())];
        let mut out = [Rgb::default(); 64];
        batch(&selvedge, &queries, &mut scratch, &mut out).expect("enough scratch");
        for (query, rgb) in queries.iter().zip(out) {
            assert_eq!(selvedge.filtered(query.u_q32, query.v_q32, query.light, query.view), rgb);
        }
        assert!(batch(&selvedge, &queries, &mut [], &mut out).is_none(), "no scratch");

        let (light, view) = (direction(), direction());
        let size = selvedge.image_size(0);
        let query = ImageQuery {
            level: 0,
            size,
            light: selvedge.locate_light(light),
            view: selvedge.locate_view(view),
        };
        assert_eq!(image_scratch_len(&selvedge), 0);
        let texels = (size[0] * size[1]) as usize;
        let mut all = std::vec![Rgb::default(); texels];
        image(&selvedge, &query, &mut [], Textures::All(&mut all));
        let mut scratch = std::vec![-1; crate::method::fast::image_scratch_len(&selvedge)];
        let mut by_method = std::vec![Rgb::default(); texels];
        crate::method::fast::image(&selvedge, &query, &mut scratch, Textures::All(&mut by_method));
        assert!(all == by_method && all.iter().any(|texel| texel.g != 0));
        for channel in 0..3 {
            let mut one = std::vec![0; texels];
            image(&selvedge, &query, &mut [], Textures::One(channel, &mut one));
            let of = |texel: &Rgb| [texel.r, texel.g, texel.b][channel as usize] as i32;
            assert!(one.iter().copied().eq(all.iter().map(of)), "{channel}");
        }
    }
}
