//! The values of a `.btf`: factorisations of the whole, of each view, and the plain store.

use super::colour::Model;
use super::head::{Head, read_rotations};
use crate::error::Result;
use crate::foreign::bytes::{Bytes, Cursor, Width};
use crate::math::linear::product_bt;

/// How the values of a file become radiance.
#[derive(Debug)]
pub(super) enum Body {
    /// Factorisations of the matrix of texels and pairs: of each channel, or one of all.
    Full { factors: Vec<Factor>, model: Model },
    /// A factorisation and a mean of each view.
    Views(Vec<View>),
    /// The values.
    Store(Store),
}

/// A matrix as a product of two: rows of texels times rows of pairs.
#[derive(Debug)]
pub(super) struct Factor {
    components: usize,
    width: Width,
    /// Where the rows of the texels begin, and how many a texel has: 1, or one for each channel.
    texels: u64,
    texel_rows: usize,
    /// Rows of the pairs, `[view][light]`, or with a channel each behind.
    pairs: Vec<f32>,
    pair_rows: usize,
}

/// One view: a value is a mean plus a row of lights times a row of texels.
#[derive(Debug)]
pub(super) struct View {
    components: usize,
    width: Width,
    /// Rows `[light][channel]` with the means of each, if texels are on disk as plain rows; else rows of
    /// lights alone.
    lights: Vec<f32>,
    means: Option<Vec<f32>>,
    /// Where the rows of texels begin; and their means, where these belong to `[texel][channel]`.
    texels: u64,
    texel_means: u64,
}

/// Every value in binary16, `[texel][view][light][channel]`, in chunks of scan lines.
#[derive(Debug)]
pub(super) struct Store {
    /// Which texels are there, if some are not.
    mask: Option<Vec<u8>>,
    /// Texels that are there before each row.
    before: Vec<u32>,
    chunks: Vec<u64>,
    chunk_texels: u64,
}

fn bits(width: Width) -> &'static str {
    match width {
        Width::Half => "binary16",
        Width::Single => "binary32",
        Width::Double => "binary64",
    }
}

/// One factorisation: size of a number, components, rows, columns, and the tables S, U and SxV.
fn read_factor(cursor: &mut Cursor<'_>, head: &Head, channels: usize) -> Result<Factor> {
    let width = cursor.width()?;
    let components = cursor.u32("components")?;
    let [rows, columns] = [cursor.u32("rows")? as usize, cursor.u32("columns")? as usize];
    if components == 0 {
        return cursor.fail(12, "a factorisation without components");
    }
    // The usual arrangement goes first where both fit.
    let usual = rows == head.pairs() * channels && columns == head.texels();
    let transposed = rows == head.texels() * channels && columns == head.pairs();
    if !usual && !transposed {
        let due = format!(
            "{} x {} or {} x {}",
            head.pairs() * channels,
            head.texels(),
            head.texels() * channels,
            head.pairs()
        );
        return cursor.fail(8, format!("a factorisation of {rows} x {columns} where {due} are due"));
    }
    let wide = components as u64;
    cursor.table(wide, 1, width, "singular values")?;
    let first = cursor.table(rows as u64, wide, width, "the factor U")?;
    let second = cursor.table(columns as u64, wide, width, "the factor SxV")?;
    let [pairs, texels] = if usual { [first, second] } else { [second, first] };
    let [pair_rows, texel_rows] = if usual { [channels, 1] } else { [1, channels] };
    let pairs = cursor.bytes.numbers(pairs, (head.pairs() * pair_rows) as u64 * wide, width)?;
    Ok(Factor { components: components as usize, width, texels, texel_rows, pairs, pair_rows })
}

pub(super) fn read_decorrelated(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<Body> {
    cursor.u32("largest number of components")?;
    let number = cursor.u32("colour model")? as i32;
    let at = cursor.at - 4;
    let mean = cursor.floats("mean colour")?;
    let matrix = cursor.floats("colour matrix")?;
    let model = match Model::from_number(number, matrix, mean) {
        Ok(model) => model,
        Err(what) => return cursor.bytes.fail(at, what),
    };
    if head.channels.len() == 1 && model != Model::Rgb {
        return cursor.bytes.fail(at, format!("colour model {number} of a single channel"));
    }
    let factors =
        (0..head.channels.len()).map(|_| read_factor(cursor, head, 1)).collect::<Result<Vec<_>>>()?;
    let components: Vec<String> = factors.iter().map(|factor| factor.components.to_string()).collect();
    let name = model.name();
    head.layout = format!(
        "factorised by channel, {} components, {}, colour model {number} ({name})",
        components.join(" + "),
        bits(factors[0].width)
    );
    Ok(Body::Full { factors, model })
}

pub(super) fn read_full(cursor: &mut Cursor<'_>, head: &mut Head, is_log: bool) -> Result<Body> {
    cursor.u32("components")?;
    let factor = read_factor(cursor, head, head.channels.len())?;
    let of = if is_log { "logarithms" } else { "linear values" };
    head.layout = format!("factorised, {} components of {of}, {}", factor.components, bits(factor.width));
    Ok(Body::Full { factors: vec![factor], model: if is_log { Model::LogRgb } else { Model::Rgb } })
}

pub(super) fn read_views(cursor: &mut Cursor<'_>, head: &mut Head, slots: u32) -> Result<Body> {
    if slots as usize != head.views.len() {
        return cursor
            .bytes
            .fail(cursor.at, format!("{slots} factorisations of views, where {} are due", head.views.len()));
    }
    let (lights, texels, channels) = (head.lights.len(), head.texels(), head.channels.len());
    let mut views = Vec::with_capacity(slots as usize);
    for _ in 0..slots {
        let width = cursor.width()?;
        let components = cursor.u32("components")?;
        let [weights, dimension] = [cursor.u32("weights")? as usize, cursor.u32("dimension")? as usize];
        let usual = weights == texels && dimension == lights * channels;
        let transposed = weights == lights && dimension == texels * channels;
        if !usual && !transposed {
            let due = format!("{texels} x {} or {lights} x {}", lights * channels, texels * channels);
            return cursor.fail(8, format!("a view of {weights} x {dimension} where {due} are due"));
        }
        let wide = components as u64;
        cursor.table(wide, 1, width, "eigenvalues")?;
        let means = cursor.table(dimension as u64, 1, width, "means")?;
        let first = cursor.table(dimension as u64, wide, width, "components of a view")?;
        let second = cursor.table(weights as u64, wide, width, "weights of a view")?;
        let [of_lights, of_texels] = if usual { [first, second] } else { [second, first] };
        let light_rows = if usual { lights * channels } else { lights } as u64;
        views.push(View {
            components: components as usize,
            width,
            lights: cursor.bytes.numbers(of_lights, light_rows * wide, width)?,
            means: if usual { Some(cursor.bytes.numbers(means, light_rows, width)?) } else { None },
            texels: of_texels,
            texel_means: means,
        });
    }
    let most = views.iter().map(|view| view.components).max().unwrap_or(0);
    head.layout = format!("factorised by view, up to {most} components, {}", bits(views[0].width));
    Ok(Body::Views(views))
}

pub(super) fn read_store(cursor: &mut Cursor<'_>, head: &mut Head) -> Result<Body> {
    let lines = cursor.u32("scan lines of a chunk")?;
    if lines == 0 {
        return cursor.fail(4, "chunks of no scan lines");
    }
    let compression = cursor.u8("compression")?;
    match compression {
        0 | 2 => {}
        1 => {
            return cursor.fail(
                1,
                "BDIF06R2! with chunks compressed by bzip2 is not read; store it uncompressed (0 or 2)",
            );
        }
        _ => {
            return cursor
                .fail(1, format!("compression {compression} of BDIF06R2! is not known; 0 and 2 are read"));
        }
    }
    let [width, height] = head.size;
    let start = cursor.at;
    cursor.skip(head.texels() as u64, "mask")?;
    let mut mask = vec![0; head.texels()];
    cursor.bytes.read_at(start, &mut mask)?;
    read_rotations(cursor, head)?;
    let is_sparse = compression == 2;
    let mut before = Vec::with_capacity(height);
    let mut stored = 0u32;
    for row in mask.chunks(width) {
        before.push(stored);
        stored += if is_sparse { row.iter().filter(|&&m| m != 0).count() } else { width } as u32;
    }
    let texel_bytes = head.pairs() as u64 * head.channels.len() as u64 * 2;
    let chunk_texels = lines as u64 * width as u64;
    let mut chunks = Vec::new();
    let mut left = stored as u64;
    while left > 0 {
        let length = cursor.u32("length of a chunk")?;
        let due = left.min(chunk_texels) * texel_bytes;
        if (length as u64) < due {
            return cursor.fail(4, format!("a chunk of {length} bytes where {due} are due"));
        }
        chunks.push(cursor.at);
        cursor.skip(length as u64, "chunk")?;
        left -= left.min(chunk_texels);
    }
    let missing = mask.iter().filter(|&&m| m == 0).count();
    let absent = if missing > 0 {
        format!(", {missing} texels masked out{}", if is_sparse { " and absent (black)" } else { "" })
    } else {
        String::new()
    };
    head.layout = format!("every value, binary16, chunks of {lines} lines{absent}");
    Ok(Body::Store(Store { mask: is_sparse.then_some(mask), before, chunks, chunk_texels }))
}

impl Body {
    /// Where the numbers of a texel begin in the file; of several tables, in the first.
    pub(super) fn offset(&self, head: &Head, texel: usize) -> u64 {
        match self {
            Body::Full { factors, .. } => {
                factors[0].texels
                    + (texel * factors[0].texel_rows * factors[0].components) as u64 * factors[0].width as u64
            }
            Body::Views(views) => {
                let rows = if views[0].means.is_some() { 1 } else { head.channels.len() };
                views[0].texels + (texel * rows * views[0].components) as u64 * views[0].width as u64
            }
            Body::Store(store) => {
                store.place(head, texel).unwrap_or(store.chunks.first().copied().unwrap_or(0))
            }
        }
    }

    /// Decodes a run of texels in one row of the file.
    pub(super) fn texels(
        &self,
        bytes: &Bytes,
        head: &Head,
        first: usize,
        count: usize,
        values: &mut [f32],
    ) -> Result<()> {
        match self {
            Body::Full { factors, model } => {
                full(bytes, head, factors, first, count, values)?;
                if *model != Model::Rgb {
                    values.as_chunks_mut::<3>().0.iter_mut().for_each(|rgb| *rgb = model.to_rgb(*rgb));
                }
                Ok(())
            }
            Body::Views(views) => of_views(bytes, head, views, first, count, values),
            Body::Store(store) => stored(bytes, head, store, first, count, values),
        }
    }
}

fn full(
    bytes: &Bytes,
    head: &Head,
    factors: &[Factor],
    first: usize,
    count: usize,
    values: &mut [f32],
) -> Result<()> {
    let (pairs, channels) = (head.pairs(), head.channels.len());
    let mut plane = Vec::new();
    for (channel, factor) in factors.iter().enumerate() {
        let Factor { components, width, texels, texel_rows, pair_rows, .. } = *factor;
        let row = (texel_rows * components) as u64;
        let of_texels =
            bytes.numbers(texels + first as u64 * row * width as u64, count as u64 * row, width)?;
        // Rows of the product: `[texel][pair]` of one channel, or with the channel behind either.
        let (rows, columns) = (count * texel_rows, pairs * pair_rows);
        if pair_rows == 3 {
            product_bt(values, &of_texels, &factor.pairs, [rows, components, columns], false);
            continue;
        }
        plane.resize(rows * columns, 0.0);
        product_bt(&mut plane, &of_texels, &factor.pairs, [rows, components, columns], false);
        for (row, numbers) in plane.chunks(columns).enumerate() {
            let (texel, channel) = if texel_rows == 3 { (row / 3, row % 3) } else { (row, channel) };
            for (rgb, &number) in
                values[texel * pairs * 3..][..pairs * 3].as_chunks_mut::<3>().0.iter_mut().zip(numbers)
            {
                if channels == 1 { *rgb = [number; 3] } else { rgb[channel] = number }
            }
        }
    }
    Ok(())
}

fn of_views(
    bytes: &Bytes,
    head: &Head,
    views: &[View],
    first: usize,
    count: usize,
    values: &mut [f32],
) -> Result<()> {
    let (lights, channels, length) = (head.lights.len(), head.channels.len(), head.pairs() * 3);
    let mut plane = Vec::new();
    for (v, view) in views.iter().enumerate() {
        let View { components, width, texels, texel_means, .. } = *view;
        // Rows of texels, `[texel]` and then columns `[light][channel]`; or rows `[texel][channel]` and
        // columns `[light]`.
        let texel_rows = if view.means.is_some() { 1 } else { channels };
        let row = (texel_rows * components) as u64;
        let of_texels =
            bytes.numbers(texels + first as u64 * row * width as u64, count as u64 * row, width)?;
        let (rows, columns) = (count * texel_rows, lights * channels / texel_rows);
        plane.clear();
        match &view.means {
            Some(means) => (0..rows).for_each(|_| plane.extend_from_slice(means)),
            None => {
                let means = bytes.numbers(
                    texel_means + (first * channels * width as usize) as u64,
                    rows as u64,
                    width,
                )?;
                means.iter().for_each(|&mean| plane.extend(std::iter::repeat_n(mean, columns)));
            }
        }
        if components > 0 {
            product_bt(&mut plane, &of_texels, &view.lights, [rows, components, columns], true);
        }
        for texel in 0..count {
            for (light, rgb) in values[texel * length + v * lights * 3..][..lights * 3]
                .as_chunks_mut::<3>()
                .0
                .iter_mut()
                .enumerate()
            {
                *rgb = std::array::from_fn(|c| {
                    let c = c.min(channels - 1);
                    if texel_rows == 1 {
                        plane[texel * columns + light * channels + c]
                    } else {
                        plane[(texel * channels + c) * columns + light]
                    }
                });
            }
        }
    }
    Ok(())
}

impl Store {
    /// Where the values of a texel begin, if it is there.
    fn place(&self, head: &Head, texel: usize) -> Option<u64> {
        let row = texel / head.size[0];
        let is_there = |texel: usize| self.mask.as_ref().is_none_or(|mask| mask[texel] != 0);
        let in_row = (row * head.size[0]..texel).filter(|&before| is_there(before)).count() as u64;
        let index = self.before[row] as u64 + in_row;
        let length = (head.pairs() * head.channels.len() * 2) as u64;
        is_there(texel)
            .then(|| self.chunks[(index / self.chunk_texels) as usize] + index % self.chunk_texels * length)
    }
}

fn stored(
    bytes: &Bytes,
    head: &Head,
    store: &Store,
    first: usize,
    count: usize,
    values: &mut [f32],
) -> Result<()> {
    let (channels, length) = (head.channels.len(), head.pairs() * 3);
    for (texel, out) in (first..first + count).zip(values.chunks_mut(length)) {
        let Some(at) = store.place(head, texel) else {
            out.fill(0.0);
            continue;
        };
        let numbers = bytes.numbers(at, (head.pairs() * channels) as u64, Width::Half)?;
        out.as_chunks_mut::<3>()
            .0
            .iter_mut()
            .zip(numbers.chunks(channels))
            .for_each(|(rgb, n)| *rgb = std::array::from_fn(|c| n[c.min(channels - 1)]));
    }
    Ok(())
}
