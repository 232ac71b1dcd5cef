//! Principal components of clusters of texels: local PCA, or per-cluster factorisation (Müller, Meseth, Klein
//! 2003).
//!
//! Texels go to the cluster whose components come nearest to them, and components are found anew for the
//! texels of a cluster, in turn. All of it happens in the space of the leading components of the whole
//! ([`Pca`]), whose rank is the caller's choice; errors are measured on the data themselves. Clusters have a
//! mean of their own. All factors are quantised to 8 or 16 bits with a scale for each component of a cluster,
//! and everything is counted.

use super::Row;
use super::decoder::{At, Blend, Decoder, Pairs, add_row, inverse_operations};
use super::pca::{decode_and_compare, quantised};
use crate::data::dataset::Dataset;
use crate::data::transfer::Domain;
use crate::error::Result;
use crate::math::linear::{eigenbasis, product_bt};
use crate::math::pca::Pca;
use crate::math::random::Random;
use rayon::prelude::*;

/// Rounds of assignment and components.
const ROUNDS: usize = 12;

/// Clusters with their components.
pub struct Clusters<'a, 'd> {
    pca: &'a Pca<'d>,
    clusters: usize,
    components: usize,
    /// Cluster of each texel.
    assigned: Vec<usize>,
    /// Means in the space of the components: `[cluster][rank]`.
    means: Vec<f32>,
    /// Components of each cluster: `[cluster][component][rank]`.
    bases: Vec<f32>,
}

/// Squared distance of a sample from the mean and components of a cluster.
fn distance(sample: &[f32], mean: &[f32], basis: &[f32]) -> f64 {
    let rest: Vec<f32> = sample.iter().zip(mean).map(|(s, m)| s - m).collect();
    let energy: f64 = rest.iter().map(|&r| r as f64 * r as f64).sum();
    let taken: f64 = basis
        .chunks(sample.len())
        .map(|b| b.iter().zip(&rest).map(|(b, r)| *b as f64 * *r as f64).sum::<f64>().powi(2))
        .sum();
    energy - taken
}

/// Clusters of the texels of a dataset.
pub fn clusters<'a, 'd>(pca: &'a Pca<'d>, clusters: usize, components: usize) -> Clusters<'a, 'd> {
    let (rank, texels) = (pca.rank(), pca.of_texels.len() / pca.rank());
    let sample = |i: usize| &pca.of_texels[i * rank..][..rank];
    let mut random = Random::new(1);
    let mut means: Vec<f32> =
        (0..clusters).flat_map(|_| sample(random.range(0, texels as i64 - 1) as usize).to_vec()).collect();
    let components = components.min(rank);
    let mut bases = vec![0.0f32; clusters * components * rank];
    let mut assigned = vec![0; texels];
    for round in 0..ROUNDS {
        let nearest = |i: usize| {
            let of = |k: usize| {
                // The first rounds go by means alone, as k-means does.
                let basis = if round < ROUNDS / 3 {
                    &[][..]
                } else {
                    &bases[k * components * rank..][..components * rank]
                };
                distance(sample(i), &means[k * rank..][..rank], basis)
            };
            (0..clusters)
                .map(|k| (k, of(k)))
                .fold((0, f64::MAX), |best, next| if next.1 < best.1 { next } else { best })
                .0
        };
        assigned = (0..texels).into_par_iter().map(nearest).collect();
        let found: Vec<(Vec<f32>, Vec<f32>)> =
            (0..clusters).into_par_iter().map(|k| components_of(pca, &assigned, k, components)).collect();
        for (k, (mean, basis)) in found.into_iter().enumerate() {
            means[k * rank..][..rank].copy_from_slice(&mean);
            bases[k * components * rank..][..components * rank].copy_from_slice(&basis);
        }
    }
    Clusters { pca, clusters, components, assigned, means, bases }
}

/// Mean and leading components of the texels of a cluster.
fn components_of(
    pca: &Pca<'_>,
    assigned: &[usize],
    cluster: usize,
    components: usize,
) -> (Vec<f32>, Vec<f32>) {
    let rank = pca.rank();
    let members: Vec<&[f32]> = assigned
        .iter()
        .enumerate()
        .filter(|(_, k)| **k == cluster)
        .map(|(i, _)| &pca.of_texels[i * rank..][..rank])
        .collect();
    let count = members.len().max(1) as f64;
    let mut mean = vec![0.0f64; rank];
    members.iter().for_each(|member| mean.iter_mut().zip(*member).for_each(|(m, s)| *m += *s as f64 / count));
    let mut covariance = vec![0.0f64; rank * rank];
    for member in &members {
        let rest: Vec<f64> = member.iter().zip(&mean).map(|(s, m)| *s as f64 - m).collect();
        for (a, row) in rest.iter().zip(covariance.chunks_mut(rank)) {
            row.iter_mut().zip(&rest).for_each(|(c, b)| *c += a * b);
        }
    }
    let (basis, _) = eigenbasis(&covariance, rank);
    let columns =
        (0..components).flat_map(|c| (0..rank).map(move |r| (r, c))).map(|(r, c)| basis.at(r, c)).collect();
    (mean.iter().map(|&m| m as f32).collect(), columns)
}

/// Bytes at a width: the mean and components of each cluster with their scales, the number of each texel's
/// cluster in bits, and its coefficients.
pub fn bytes(data: &Dataset, clusters: usize, components: usize, bits: u32) -> u64 {
    let (texels, columns) = (data.description().texels() as u64, data.description().texel_len() as u64);
    let (clusters, components, width) = (clusters as u64, components as u64, bits as u64 / 8);
    let number = (64 - (clusters - 1).leading_zeros()) as u64 * texels;
    clusters * ((components + 1) * columns * width + 8 + 8 * components)
        + number.div_ceil(8)
        + texels * components * width
}

impl Clusters<'_, '_> {
    /// Bytes at a width.
    pub fn bytes(&self, bits: u32) -> u64 {
        bytes(self.pca.dataset, self.clusters, self.components, bits)
    }

    /// How many clusters and components.
    pub fn describe(&self) -> String {
        format!("{} clusters of {} components", self.clusters, self.components)
    }

    /// Decodes what a width would store.
    pub fn decoder(&self, bits: u32) -> Decoded {
        let (rank, n) = (self.pca.rank(), self.components);
        let columns = self.pca.mean.len();
        // Each cluster's mean and components in the space of the data.
        let mut rows = Vec::with_capacity(self.clusters * (n + 1) * columns);
        for k in 0..self.clusters {
            let mut inside = self.means[k * rank..][..rank].to_vec();
            inside.extend(&self.bases[k * n * rank..][..n * rank]);
            let mut lifted = vec![0.0; (n + 1) * columns];
            product_bt(&mut lifted, &inside, &self.pca.of_pairs, [n + 1, rank, columns], false);
            lifted[..columns].iter_mut().zip(&self.pca.mean).for_each(|(l, m)| *l += m);
            // A row has a scale of its own: as a column of the transposed.
            for row in lifted.chunks(columns) {
                rows.extend(quantised(row, 1, 1, bits));
            }
        }
        // Coefficients: a scale for each component of each cluster.
        let mut coefficients = vec![0.0f32; self.assigned.len() * n];
        for k in 0..self.clusters {
            let members: Vec<usize> = (0..self.assigned.len()).filter(|&i| self.assigned[i] == k).collect();
            let project = |i: usize, c: usize| {
                let basis = &self.bases[(k * n + c) * rank..][..rank];
                let sample = &self.pca.of_texels[i * rank..][..rank];
                let mean = &self.means[k * rank..][..rank];
                basis.iter().zip(sample.iter().zip(mean)).map(|(b, (s, m))| b * (s - m)).sum::<f32>()
            };
            let of_cluster: Vec<f32> = members
                .iter()
                .flat_map(|&i| (0..n).map(move |c| (i, c)))
                .map(|(i, c)| project(i, c))
                .collect();
            let rounded = quantised(&of_cluster, n.max(1), n, bits);
            members
                .iter()
                .zip(rounded.chunks(n.max(1)))
                .for_each(|(&i, row)| coefficients[i * n..][..n].copy_from_slice(row));
        }
        let description = self.pca.dataset.description();
        Decoded {
            rows,
            coefficients,
            assigned: self.assigned.clone(),
            clusters: self.clusters,
            components: n,
            columns,
            domain: self.pca.domain,
            offset: self.pca.dataset.statistics().log_offset(),
            width: description.size[0],
            lights: description.lights.len(),
            bytes: self.bytes(bits),
        }
    }

    /// Errors over all values, decoded from quantised factors.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn measure(&self, bits: u32) -> Result<Row> {
        let decoded = self.decoder(bits);
        let (columns, n) = (decoded.columns, decoded.components);
        let decode = |texel: usize, out: &mut [f32]| {
            let rows = &decoded.rows[self.assigned[texel] * (n + 1) * columns..][..(n + 1) * columns];
            out.copy_from_slice(&rows[..columns]);
            for (c, row) in rows[columns..].chunks(columns).enumerate() {
                add_row(out, decoded.coefficients[texel * n + c], row);
            }
        };
        decode_and_compare(self.pca, self.bytes(bits), &decode)
    }
}

/// Clusters decoded from what they store.
pub struct Decoded {
    /// `[cluster][mean and components][pair and colour]`.
    rows: Vec<f32>,
    /// `[texel][component]`.
    coefficients: Vec<f32>,
    assigned: Vec<usize>,
    clusters: usize,
    components: usize,
    columns: usize,
    domain: Domain,
    offset: f32,
    width: usize,
    lights: usize,
    bytes: u64,
}

impl Decoded {
    /// Mean and components of a cluster at one pair.
    #[inline(always)]
    fn row(&self, cluster: usize, row: usize, pair: usize) -> [f32; 3] {
        let start = (cluster * (self.components + 1) + row) * self.columns + pair * 3;
        std::array::from_fn(|c| self.rows[start + c])
    }

    /// The texels of a sample, each with its weights of mean and components; those of one cluster are put
    /// together.
    #[inline(always)]
    fn gathered(&self, at: &At) -> ([(usize, f32); 4], usize) {
        let mut clusters = [(usize::MAX, 0.0); 4];
        let mut count = 0;
        for (texel, weight) in at.texels(self.width) {
            let cluster = self.assigned[texel];
            match clusters[..count].iter_mut().find(|c| c.0 == cluster) {
                Some(known) => known.1 += weight,
                None => {
                    clusters[count] = (cluster, weight);
                    count += 1;
                }
            }
        }
        (clusters, count)
    }
}

impl Decoder for Decoded {
    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn images(&self, lights: &[Blend], view: Blend, out: &mut [[f32; 3]]) {
        let (texels, n) = (out.len() / lights.len(), self.components);
        let mut blended = vec![[0.0f32; 3]; self.clusters * (n + 1)];
        for (&light, out) in lights.iter().zip(out.chunks_mut(texels)) {
            let pairs = Pairs::of(light, view, self.lights);
            for (i, sum) in blended.iter_mut().enumerate() {
                *sum = [0.0; 3];
                pairs.iter().for_each(|&(pair, weight)| {
                    add_row(sum, weight, &self.row(i / (n + 1), i % (n + 1), pair))
                });
            }
            for (texel, rgb) in out.iter_mut().enumerate() {
                let rows = &blended[self.assigned[texel] * (n + 1)..][..n + 1];
                let mut sum = rows[0];
                rows[1..]
                    .iter()
                    .zip(&self.coefficients[texel * n..])
                    .for_each(|(row, &weight)| add_row(&mut sum, weight, row));
                *rgb = sum.map(|y| self.domain.back(y, self.offset));
            }
        }
    }

    fn filtered(&self, at: &At) -> [f32; 3] {
        let n = self.components;
        let (clusters, count) = self.gathered(at);
        let (pairs, texels) = (at.pairs(self.lights), at.texels(self.width));
        let mut sum = [0.0f32; 3];
        for &(cluster, of_mean) in &clusters[..count] {
            for row in 0..=n {
                let weight = if row == 0 {
                    of_mean
                } else {
                    let of = |(texel, weight): (usize, f32)| {
                        if self.assigned[texel] == cluster {
                            weight * self.coefficients[texel * n + row - 1]
                        } else {
                            0.0
                        }
                    };
                    texels.into_iter().map(of).sum()
                };
                pairs.iter().for_each(|&(pair, share)| {
                    add_row(&mut sum, weight * share, &self.row(cluster, row, pair))
                });
            }
        }
        sum.map(|y| self.domain.back(y, self.offset))
    }

    fn operations(&self, at: &At) -> u64 {
        let (pairs, n, clusters) =
            (at.pairs(self.lights).len() as u64, self.components as u64, self.gathered(at).1 as u64);
        4 * n + pairs + clusters * (n + 1) * pairs * 4 + inverse_operations(self.domain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::transfer::Domain;
    use crate::measure::baseline::pca::components;
    use crate::measure::baseline::tests::small;

    #[test]
    fn one_cluster_is_principal_components_and_more_are_better() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [21, 12]);
        let mut whole = components(&data, Domain::Linear, 12).expect("made");
        let two = whole.measure(2, 16).expect("measured").linear_rms;
        let one = clusters(&whole, 1, 2).measure(16).expect("measured").linear_rms;
        assert!((one - two).abs() < 0.02 * two, "{one} {two}");
        let four = clusters(&whole, 4, 2);
        let row = four.measure(16).expect("measured");
        assert!(row.linear_rms < 0.9 * one, "{} {one}", row.linear_rms);
        assert_eq!(row.bytes, 4 * (3 * 162 * 2 + 8 + 16) + 252 * 2 / 8 + 252 * 2 * 2);
    }
}
