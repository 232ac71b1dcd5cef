//! Levels of detail of a dataset, averaged in linear radiance (9.1): a sum of logarithms would lose energy.

use crate::data::dataset::{Dataset, Description, Writer};
use crate::error::Result;
use rayon::prelude::*;
use std::path::Path;

/// Writes the next level: each texel is the mean of the up to four that it covers.
///
/// # Errors
/// If the data cannot be read, or the level not be written.
pub fn next_level(dataset: &Dataset, path: &Path) -> Result<Dataset> {
    let fine = dataset.description();
    let [width, height] = fine.size;
    let texel_nm = fine.texel_nm.map(|nm| nm.saturating_mul(2));
    let description = Description { size: [width.div_ceil(2), height.div_ceil(2)], texel_nm, ..fine.clone() };
    let (length, across) = (fine.texel_len(), description.size[0]);
    let texels = description.texels();
    let writer = Writer::create(path, description)?;
    (0..texels).into_par_iter().try_for_each(|texel| -> Result<()> {
        let (x, y) = (texel % across * 2, texel / across * 2);
        let (mut sum, mut run, mut bytes) = (vec![0.0f32; length], vec![0.0f32; length], Vec::new());
        let mut count = 0.0;
        for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]
            .into_iter()
            .filter(|&(x, y)| x < width && y < height)
        {
            dataset.read(y * width + x, 1, &mut bytes, &mut run)?;
            sum.iter_mut().zip(&run).for_each(|(sum, value)| *sum += value);
            count += 1.0;
        }
        // Four binary16 values cannot overflow binary32; a mean of legal values is one.
        sum.iter_mut().for_each(|sum| *sum /= count);
        writer.put(texel, 0, &sum)
    })?;
    writer.finish()?;
    Dataset::open(path)
}

/// All levels from the second on, in a folder for temporary files.
///
/// # Errors
/// As [`next_level`].
pub fn levels(dataset: &Dataset, count: usize, folder: &Path) -> Result<Vec<Dataset>> {
    let mut levels: Vec<Dataset> = Vec::new();
    for level in 1..count {
        let finer = levels.last().unwrap_or(dataset);
        let next = next_level(finer, &folder.join(format!("level-{level}.selvset")))?;
        levels.push(next);
    }
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_the_texels_that_are_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let direction = vec![glam::DVec3::Z];
        let description = Description {
            size: [3, 3],
            lights: direction.clone(),
            views: direction,
            ..Description::default()
        };
        let writer = Writer::create(&folder.path().join("fine"), description).expect("created");
        (0..9).for_each(|i| writer.put(i, 0, &[i as f32, 1.0, 0.5]).expect("put"));
        writer.finish().expect("finished");
        let fine = Dataset::open(&folder.path().join("fine")).expect("opened");
        let levels = levels(&fine, 3, folder.path()).expect("levels");
        let red = |d: &Dataset| d.image(0, 0).expect("image").iter().map(|rgb| rgb[0]).collect::<Vec<f32>>();
        assert_eq!(red(&levels[0]), [2.0, 3.5, 6.5, 8.0]);
        assert_eq!(red(&levels[1]), [5.0]);
    }
}
