//! BTFs of modelled mesostructures with shadowing, masking and interreflection.
//!
//! After Suykens et al. 2003, section 3: a small piece of geometry is looked at along every view through
//! every texel, and lit from every direction. The six kinds here are triangle meshes that tile:
//!
//! | module | does |
//! |---|---|
//! | `solids`, `yarns` | the geometry, from a seed |
//! | `mesh`, `noise` | height fields and swept tubes; periodic variation |
//! | `trace`, `shadow`, `radiosity` | what is seen, lit, and bounced |
//! | `shade`, [`preview`](mod@preview) | radiance; pictures for documentation |
//!
//! A tile is the unit square and less than 0.09 high. A texel is a square of the plane halfway up; a viewer
//! sees it where rays through the stratified points of that square meet the surface. Texel rows ascend with y
//! of the tangent frame. Nothing is random but the geometry: equal requests give equal bytes, whatever the
//! threads.
//!
//! What is left out: specular light between surfaces, light through yarns, and hairs. Highlights are those of
//! the rays of a texel, without a filter over its area; more rays make textures finer than a texel calmer.

mod mesh;
mod mesostructure;
mod noise;
pub mod preview;
mod radiosity;
mod shade;
mod shadow;
mod solids;
mod trace;
mod yarns;

pub use mesostructure::Mesostructure;
pub use preview::preview;

use crate::data::dataset::{Description, Sample, Statistics, Writer};
use crate::data::directions;
use crate::error::{Result, ToolError};
use glam::{DVec3, Vec3A};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What to make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// The surface.
    pub kind: Mesostructure,
    /// Texels along x and y of the tile.
    pub size: [usize; 2],
    /// Directions of lights, and of views: 81 or 151.
    pub directions: usize,
    /// Of the geometry's variation.
    pub seed: u64,
    /// Rays for each texel and view: 1, 4, 9 or 16.
    pub samples: usize,
    /// How values are stored.
    pub sample: Sample,
}

/// Writes a dataset of a modelled surface; `progress` receives texels done and texels in all, from any
/// thread.
///
/// # Errors
/// For a count of directions or samples that is not offered, and what [`Writer`] refuses.
pub fn synthesise(
    request: &Request,
    path: &Path,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Statistics> {
    let Some(grid) = directions::grid(request.directions) else {
        return Err(ToolError::Usage(format!("{} directions; 81 and 151 are known", request.directions)));
    };
    if ![1, 4, 9, 16].contains(&request.samples) {
        return Err(ToolError::Usage(format!("{} samples; 1, 4, 9 and 16 are possible", request.samples)));
    }
    let description = Description {
        size: request.size,
        lights: grid.clone(),
        views: grid,
        sample: request.sample,
        cosine_included: true,
        texel_nm: [0, 0],
        texts: [
            request.kind.name().into(),
            format!("modelled mesostructure, seed {}", request.seed),
            "CC0-1.0".into(),
        ],
    };
    let writer = Writer::create(path, description)?;
    write_texels(request.kind.mesh(request.seed), &writer, request.samples.isqrt(), progress)?;
    writer.finish()
}

/// Every texel of a surface, with `strata` rays along both axes of a texel.
fn write_texels(
    mesh: mesh::Mesh,
    writer: &Writer,
    strata: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<()> {
    let description = writer.description();
    let vectors = |set: &[DVec3]| set.iter().map(|d| d.as_vec3a()).collect::<Vec<Vec3A>>();
    let views = vectors(&description.views);
    let scene = shade::Scene::new(mesh, vectors(&description.lights));
    let (texels, done) = (description.texels(), AtomicUsize::new(0));
    (0..texels).into_par_iter().try_for_each(|texel| {
        let values = texel_values(&scene, &views, description.size, texel, strata);
        writer.put(texel, 0, &values)?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, texels);
        Ok(())
    })
}

/// A point of the unit square in each of `strata` x `strata` cells, no two in one row or column: edges along
/// the axes, which weaves are full of, get as many steps as there are points.
fn stratified(index: usize, strata: usize) -> [f32; 2] {
    let (i, j, n) = (index % strata, index / strata, strata as f32);
    [(i as f32 + (j as f32 + 0.5) / n) / n, (j as f32 + ((strata - 1 - i) as f32 + 0.5) / n) / n]
}

/// Radiance of one texel: `[view][light][colour]`.
fn texel_values(
    scene: &shade::Scene,
    views: &[Vec3A],
    size: [usize; 2],
    texel: usize,
    strata: usize,
) -> Vec<f32> {
    let of_view = scene.lights() * 3;
    let mut values = vec![0.0; views.len() * of_view];
    let weight = 1.0 / (strata * strata) as f32;
    let at = |cell: usize, part: f32, count: usize| (cell as f32 + part) / count as f32;
    for (&view, sums) in views.iter().zip(values.chunks_exact_mut(of_view)) {
        for stratum in 0..strata * strata {
            let [u, v] = stratified(stratum, strata);
            scene.add_radiance(
                at(texel % size[0], u, size[0]),
                at(texel / size[0], v, size[1]),
                view,
                weight,
                sums,
            );
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset::Dataset;
    use mesh::{Look, Mesh, Tube};

    fn description(size: [usize; 2], sample: Sample) -> Description {
        let set: Vec<DVec3> = directions::grid(81).expect("known").into_iter().step_by(5).collect();
        Description {
            size,
            lights: set.clone(),
            views: set,
            sample,
            cosine_included: true,
            ..Description::default()
        }
    }

    fn white() -> Look {
        Look::glossy([1.0; 3], [0.0; 3], 0.5)
    }

    #[test]
    fn a_white_plane_sends_out_the_lights_cosine() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.selvset");
        let writer = Writer::create(&path, description([3, 2], Sample::Float)).expect("created");
        let mut mesh = Mesh::default();
        mesh.add_height_field(8, |_, _| 0.02, |_, _| white());
        write_texels(mesh, &writer, 2, &|_, _| ()).expect("written");
        writer.finish().expect("finished");
        let dataset = Dataset::open(&path).expect("opened");
        for (l, light) in dataset.description().lights.iter().enumerate() {
            for view in 0..dataset.description().views.len() {
                let image = dataset.image(l, view).expect("read");
                assert!(
                    image.iter().flatten().all(|&c| (f64::from(c) - light.z).abs() < 1e-3),
                    "light {l}, view {view}: {image:?}"
                );
            }
        }
    }

    /// A tube on a wavy ground: shadows, bounces and a seam, at small cost.
    fn small_mesh() -> Mesh {
        let mut mesh = Mesh::default();
        mesh.add_height_field(16, |x, _| 0.01 * (x * std::f32::consts::TAU).sin(), |_, _| white());
        mesh.add_tube(&Tube {
            steps: [24, 12],
            shift: glam::vec2(0.0, 1.0),
            turns: 2.0,
            centre: &|u| glam::vec3a(0.9, u, 0.06),
            section: &|_, _| [0.2, 0.02],
            look: &|_, _| Look::glossy([0.5, 0.2, 0.1], [0.1; 3], 0.2),
        });
        mesh
    }

    #[test]
    fn threads_change_no_byte() {
        let folder = tempfile::tempdir().expect("a folder");
        let bytes = [1, 2].map(|threads| {
            let path = folder.path().join(threads.to_string());
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                let writer = Writer::create(&path, description([8, 8], Sample::Half)).expect("created");
                write_texels(small_mesh(), &writer, 2, &|_, _| ()).expect("written");
                writer.finish().expect("finished");
            });
            std::fs::read(&path).expect("read")
        });
        assert!(bytes[0] == bytes[1]);
    }

    #[test]
    fn names_are_known_and_others_and_odd_requests_refused() {
        for kind in Mesostructure::all() {
            assert_eq!(kind.name().parse::<Mesostructure>().expect("known"), kind);
        }
        let said = "velvet".parse::<Mesostructure>().expect_err("unknown").to_string();
        assert!(said.contains("velvet") && said.contains("hammered"), "{said}");
        let request = Request {
            kind: Mesostructure::Cloth,
            size: [1, 1],
            directions: 81,
            seed: 0,
            samples: 4,
            sample: Sample::Half,
        };
        for odd in [
            Request { directions: 80, ..request },
            Request { samples: 5, ..request },
            Request { size: [0, 1], ..request },
        ] {
            assert!(synthesise(&odd, Path::new("never.selvset"), &|_, _| ()).is_err());
        }
    }

    #[test]
    fn meshes_tile_are_flat_enough_and_repeat_from_their_seed() {
        for kind in Mesostructure::all() {
            let mesh = kind.mesh(3);
            let [low, high] = mesh.heights();
            assert!(high - low < 0.09, "{kind:?}: {low} to {high}");
            assert!(mesh.vertices.iter().all(|v| v.position.is_finite()
                && (v.normal.length() - 1.0).abs() < 1e-4
                && v.normal.dot(v.tangent).abs() < 1e-3));
            assert!(
                mesh.vertices
                    .iter()
                    .all(|v| v.look.albedo.min_element() >= 0.0 && v.look.albedo.max_element() <= 0.9),
                "{kind:?}"
            );
            let (again, other) = (kind.mesh(3), kind.mesh(4));
            let same = |a: &Mesh, b: &Mesh| {
                a.vertices.iter().zip(&b.vertices).all(|(a, b)| a.position == b.position && a.look == b.look)
            };
            assert!(same(&mesh, &again) && !same(&mesh, &other), "{kind:?}");
        }
    }
}
