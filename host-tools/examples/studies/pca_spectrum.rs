//! Prints the rank that principal components need for given errors, from all singular values: a bound in
//! their favour.
//!
//! `pca_spectrum DATASET RMS...`, where an error is of `ln(x + offset)`, before any rounding of the factors.
//! It holds the whole matrix of logarithms and the products between its rows in memory (12 bytes for each
//! pair of texels, 4 for each value of the data).

use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::data::transfer::log2;
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::math::linear::product_bt;
use std::f32::consts::LN_2;
use std::path::Path;

/// Texels whose logarithms are read at once.
const BATCH: usize = 64;

fn run(path: &Path, errors: &[f64]) -> Result<()> {
    let dataset = Dataset::open(path)?;
    let (texels, columns) = (dataset.description().texels(), dataset.description().texel_len());
    let offset = dataset.statistics().log_offset();
    let mut matrix = vec![0.0f32; texels * columns];
    let mut bytes = Vec::new();
    for (i, part) in matrix.chunks_mut(BATCH * columns).enumerate() {
        dataset.read(i * BATCH, part.len() / columns, &mut bytes, part)?;
        part.iter_mut().for_each(|x| *x = LN_2 * log2(*x + offset));
    }
    let mut mean = vec![0.0f64; columns];
    matrix.chunks(columns).for_each(|row| mean.iter_mut().zip(row).for_each(|(sum, &x)| *sum += x as f64));
    let mean: Vec<f32> = mean.iter().map(|sum| (sum / texels as f64) as f32).collect();
    matrix.chunks_mut(columns).for_each(|row| row.iter_mut().zip(&mean).for_each(|(x, mean)| *x -= mean));
    let energy: f64 = matrix.iter().map(|&x| (x as f64).powi(2)).sum();
    let mut products = vec![0.0f32; texels * texels];
    product_bt(&mut products, &matrix, &matrix, [texels, columns, texels], false);
    drop(matrix);
    let products = faer::Mat::from_fn(texels, texels, |i, j| products[i * texels + j]);
    let no_values = |_| ToolError::Usage("the eigenvalues were not found".into());
    let values = products.self_adjoint_eigenvalues(faer::Side::Lower).map_err(no_values)?;
    let count = (texels * columns) as f64;
    println!("{texels} texels, {columns} columns, log RMS without components {:.4}", (energy / count).sqrt());
    for &error in errors {
        let goal = error * error * count;
        let mut left = energy;
        // Ascending, so the largest are at the end.
        let rank = values.iter().rev().take_while(|&&value| {
            let more = left > goal;
            left -= (value as f64).max(0.0);
            more
        });
        let rank = rank.count();
        println!(
            "log RMS {error}: rank {rank}, {} bytes at 8 bits with a scale for each column",
            columns + 8 + rank * (texels + columns + 8)
        );
    }
    Ok(())
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let errors: Option<(String, Vec<f64>)> =
        arguments.next().zip(arguments.map(|e| e.parse().ok()).collect::<Option<Vec<f64>>>());
    let Some((path, errors)) = errors else {
        eprintln!("pca_spectrum DATASET RMS...");
        std::process::exit(1);
    };
    if let Err(error) = run(Path::new(&path), &errors) {
        eprintln!("{error}");
        std::process::exit(error.exit_code().into());
    }
}
