//! N-mode singular value decomposition (Tucker; Vasilescu and Terzopoulos 2004, Wang et al. 2005): a core
//! tensor and a matrix for each mode.
//!
//! Modes are x, y, view, and light with colour, as in the comparison of Ruiters and Klein (2009). Each matrix
//! holds the leading eigenvectors of its mode's Gram matrix (HOSVD). As they store it, the spatial modes keep
//! half of the rows and columns; to be fast, a renderer multiplies the core by them beforehand, which takes
//! four times the memory and is what [`Decoded`] does.

use super::Row;
use super::decoder::{At, Blend, Decoder, Frame, add_row, dot, inverse_operations};
use super::pca::{decode_and_compare, quantised};
use crate::data::pass::pass;
use crate::error::Result;
use crate::math::linear::{Basis, eigenbasis, product, product_at, product_bt};
use crate::math::pca::Pca;

/// Most columns of view, and of light, that a decoder works with.
pub const MOST_COLUMNS: usize = 512;

/// The decomposition at its largest size; smaller ones are parts of it.
pub struct Tucker<'a, 'd> {
    pca: &'a Pca<'d>,
    x: Basis,
    y: Basis,
    view: Basis,
    light: Basis,
    /// `[x][y][view][light]` of the kept columns.
    core: Vec<f32>,
    kept: [usize; 4],
}

/// Decomposes the data about their mean; `views` and `lights` are the most columns of these modes.
///
/// # Errors
/// If the data cannot be read.
pub fn tucker<'a, 'd>(pca: &'a Pca<'d>, views: usize, lights: usize) -> Result<Tucker<'a, 'd>> {
    let description = pca.dataset.description();
    let [width, height] = description.size;
    let (view_count, light_len, columns) =
        (description.views.len(), description.lights.len() * 3, pca.mean.len());
    let offset = pca.dataset.statistics().log_offset();
    let centred = |values: &[f32]| -> Vec<f32> {
        values
            .chunks(columns)
            .flat_map(|texel| texel.iter().zip(&pca.mean).map(|(&x, m)| pca.domain.forward(x, offset) - m))
            .collect()
    };
    // Gram matrices of view and light; those of x and y are of the texels' products in the space of the
    // components, which loses what they lose.
    let grams = |_: usize, values: &[f32]| {
        let (mut of_views, mut of_lights) =
            (vec![0.0f32; view_count * view_count], vec![0.0f32; light_len * light_len]);
        for texel in centred(values).chunks(columns) {
            product_bt(&mut of_views, texel, texel, [view_count, light_len, view_count], true);
            product_at(&mut of_lights, texel, texel, [light_len, view_count, light_len], true);
        }
        (of_views, of_lights)
    };
    let add = |(a, b): &mut (Vec<f64>, Vec<f64>), (x, y): (Vec<f32>, Vec<f32>)| {
        a.iter_mut().zip(x).for_each(|(a, x)| *a += x as f64);
        b.iter_mut().zip(y).for_each(|(b, y)| *b += y as f64);
    };
    let (of_views, of_lights) = pass(
        pca.dataset,
        grams,
        (vec![0.0; view_count * view_count], vec![0.0; light_len * light_len]),
        add,
    )?;
    let rank = pca.rank();
    let sample = |x: usize, y: usize| &pca.of_texels[(y * width + x) * rank..][..rank];
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| *a as f64 * *b as f64).sum::<f64>();
    let of_x: Vec<f64> = (0..width * width)
        .map(|i| (0..height).map(|y| dot(sample(i / width, y), sample(i % width, y))).sum())
        .collect();
    let of_y: Vec<f64> = (0..height * height)
        .map(|i| (0..width).map(|x| dot(sample(x, i / height), sample(x, i % height))).sum())
        .collect();
    let kept = [width.div_ceil(2), height.div_ceil(2), views.min(view_count), lights.min(light_len)];
    let x = eigenbasis(&of_x, width).0.first(kept[0]);
    let y = eigenbasis(&of_y, height).0.first(kept[1]);
    let view = eigenbasis(&of_views, view_count).0.first(kept[2]);
    let light = eigenbasis(&of_lights, light_len).0.first(kept[3]);

    // The core: each texel in the two angular bases, then the spatial ones.
    let angular = kept[2] * kept[3];
    let work = |_: usize, values: &[f32]| {
        let mut all = Vec::new();
        for texel in centred(values).chunks(columns) {
            let mut by_light = vec![0.0; view_count * kept[3]];
            product(&mut by_light, texel, &light.entries, [view_count, light_len, kept[3]], false);
            let mut both = vec![0.0; angular];
            product_at(&mut both, &view.entries, &by_light, [kept[2], view_count, kept[3]], false);
            all.extend(both);
        }
        all
    };
    let texels = pass(pca.dataset, work, Vec::new(), |all: &mut Vec<f32>, part| all.extend(part))?;
    let mut by_x = vec![0.0; height * kept[0] * angular];
    for row in 0..height {
        product_at(
            &mut by_x[row * kept[0] * angular..][..kept[0] * angular],
            &x.entries,
            &texels[row * width * angular..][..width * angular],
            [kept[0], width, angular],
            false,
        );
    }
    let mut core = vec![0.0; kept[1] * kept[0] * angular];
    product_at(&mut core, &y.entries, &by_x, [kept[1], height, kept[0] * angular], false);
    Ok(Tucker { pca, x, y, view, light, core, kept })
}

impl Tucker<'_, '_> {
    /// Bytes with so many columns of view and light: mean, core, four matrices, scales.
    pub fn bytes(&self, views: usize, lights: usize, bits: u32) -> u64 {
        let [kx, ky, ..] = self.kept.map(|n| n as u64);
        let (v, l, width) = (views as u64, lights as u64, bits as u64 / 8);
        let rows = |basis: &Basis, columns: u64| basis.rows as u64 * columns;
        let numbers = self.pca.mean.len() as u64
            + kx * ky * v * l
            + rows(&self.x, kx)
            + rows(&self.y, ky)
            + rows(&self.view, v)
            + rows(&self.light, l);
        numbers * width + 8 + 8 * (v * l + kx + ky + v + l)
    }

    /// Decodes what so many columns of a width would store.
    ///
    /// # Panics
    /// With more columns than [`MOST_COLUMNS`].
    pub fn decoder(&self, views: usize, lights: usize, bits: u32) -> Decoded {
        assert!(views <= MOST_COLUMNS && lights <= MOST_COLUMNS, "more columns than a sample has room for");
        let [kx, ky, kv, kl] = self.kept;
        let (views, lights) = (views.min(kv), lights.min(kl));
        let matrix = |basis: &Basis, columns: usize| quantised(&basis.entries, basis.columns, columns, bits);
        let (x, y, view, light) = (
            matrix(&self.x, kx),
            matrix(&self.y, ky),
            matrix(&self.view, views),
            matrix(&self.light, lights),
        );
        // A scale for each pair of angular columns.
        let part: Vec<f32> = self
            .core
            .chunks(kv * kl)
            .flat_map(|cell| (0..views).flat_map(move |v| &cell[v * kl..][..lights]))
            .copied()
            .collect();
        let angular = views * lights;
        let core = quantised(&part, angular, angular, bits);
        let description = self.pca.dataset.description();
        let [width, height] = description.size;
        // Back along y, then x: every texel's angular core.
        let mut by_y = vec![0.0; height * kx * angular];
        product(&mut by_y, &y, &core, [height, ky, kx * angular], false);
        let mut texels = vec![0.0; height * width * angular];
        for row in 0..height {
            product(
                &mut texels[row * width * angular..][..width * angular],
                &x,
                &by_y[row * kx * angular..][..kx * angular],
                [width, kx, angular],
                false,
            );
        }
        Decoded {
            frame: Frame::new(self.pca, self.pca.mean.clone()),
            texels,
            view,
            light,
            views,
            lights,
            bytes: self.bytes(views, lights, bits),
        }
    }

    /// Errors over all values, decoded from quantised factors.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn measure(&self, views: usize, lights: usize, bits: u32) -> Result<Row> {
        let Decoded { frame, texels, view, light, views, lights, bytes } = self.decoder(views, lights, bits);
        let (view_count, light_len) = (view.len() / views, frame.lights * 3);
        let decode = |texel: usize, out: &mut [f32]| {
            let mut by_view = vec![0.0; view_count * lights];
            product(
                &mut by_view,
                &view,
                &texels[texel * views * lights..][..views * lights],
                [view_count, views, lights],
                false,
            );
            out.copy_from_slice(&frame.mean);
            product_bt(out, &by_view, &light, [view_count, lights, light_len], true);
        };
        decode_and_compare(self.pca, bytes, &decode)
    }
}

/// The decomposition decoded from what it stores, the spatial modes multiplied beforehand.
pub struct Decoded {
    frame: Frame,
    /// `[texel][view column][light column]`.
    texels: Vec<f32>,
    /// `[view][column]`.
    view: Vec<f32>,
    /// `[light and colour][column]`.
    light: Vec<f32>,
    views: usize,
    lights: usize,
    bytes: u64,
}

impl Decoded {
    /// Rows of a matrix between directions.
    #[inline(always)]
    fn blended(matrix: &[f32], row_len: usize, blend: Blend, out: &mut [f32]) {
        out.fill(0.0);
        blend.parts().for_each(|(index, weight)| add_row(out, weight, &matrix[index * row_len..][..row_len]));
    }
}

impl Decoder for Decoded {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]) {
        let (texels, v, l) = (out.len() / lights.len(), self.views, self.lights);
        let mut row = vec![0.0; v];
        Decoded::blended(&self.view, v, view, &mut row);
        let mut by_view = vec![0.0f32; texels * l];
        for (out, core) in by_view.chunks_mut(l).zip(self.texels.chunks(v * l)) {
            row.iter().zip(core.chunks(l)).for_each(|(&weight, core)| add_row(out, weight, core));
        }
        let mut rows = vec![0.0; lights.len() * 3 * l];
        lights
            .iter()
            .zip(rows.chunks_mut(3 * l))
            .for_each(|(&light, rows)| Decoded::blended(&self.light, 3 * l, light, rows));
        self.frame.images(lights, view, &rows, &by_view, out);
    }

    fn filtered(&self, at: &At) -> [f32; 3] {
        const MOST: usize = MOST_COLUMNS;
        let (v, l) = (self.views, self.lights);
        let (mut row, mut by_view, mut lights) = ([0.0f32; MOST], [0.0f32; MOST], [0.0f32; 3 * MOST]);
        Decoded::blended(&self.view, v, at.view, &mut row[..v]);
        for (texel, weight) in at.texels(self.frame.width) {
            let core = &self.texels[texel * v * self.lights..][..v * self.lights];
            row.iter()
                .zip(core.chunks(self.lights))
                .for_each(|(&of_view, core)| add_row(&mut by_view[..l], weight * of_view, core));
        }
        Decoded::blended(&self.light, 3 * self.lights, at.light, &mut lights[..3 * l]);
        let mean = self.frame.mean_at(at);
        self.frame.back(std::array::from_fn(|c| mean[c] + dot(&by_view[..l], &lights[c * l..][..l])))
    }

    fn operations(&self, at: &At) -> u64 {
        let (v, l) = (self.views as u64, self.lights as u64);
        let (of_views, of_lights) = (at.view.parts().count() as u64, at.light.parts().count() as u64);
        of_views * v
            + 4 * (v + v * l)
            + of_lights * 3 * l
            + 3 * l
            + of_views * of_lights * 4
            + inverse_operations(self.frame.domain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::transfer::Domain;
    use crate::measure::baseline::pca::components;
    use crate::measure::baseline::tests::small;

    #[test]
    fn more_columns_are_better_until_only_the_spatial_modes_lose() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [20, 12]);
        let whole = components(&data, Domain::Linear, 40).expect("made");
        let tucker = tucker(&whole, 6, 27).expect("made");
        let errors: Vec<f64> = [(1, 2), (2, 4), (4, 8), (6, 27)]
            .map(|(v, l)| tucker.measure(v, l, 16).expect("measured").linear_rms)
            .to_vec();
        assert!(errors.windows(2).all(|pair| pair[1] <= pair[0] * 1.001), "{errors:?}");
        // With all angular columns what is lost is what half of the spatial ones cannot hold.
        assert!(errors[3] < whole.predicted_rms(0), "{errors:?}");
        assert_eq!(
            tucker.bytes(2, 4, 16),
            (162 + 10 * 6 * 8 + 200 + 72 + 6 * 2 + 27 * 4) * 2 + 8 + 8 * (8 + 10 + 6 + 2 + 4)
        );
    }
}
