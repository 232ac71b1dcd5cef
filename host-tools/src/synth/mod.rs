//! BTFs of modelled mesostructures with shadowing, masking and interreflection.
//!
//! After Suykens et al. 2003, section 3: a small piece of geometry is looked at along every view through every
//! texel, and lit from every direction. The six kinds here are triangle meshes that tile:
//!
//! | module | does |
//! |---|---|
//! | [`solids`], [`yarns`] | the geometry, from a seed |
//! | [`mesh`], [`noise`] | height fields and swept tubes; periodic variation |
//! | [`trace`], [`shadow`], [`radiosity`] | what is seen, lit, and bounced |
//! | [`shade`], [`preview`](mod@preview) | radiance; pictures for documentation |
//!
//! A tile is the unit square and less than 0.09 high. A texel is a square of the plane halfway up; a viewer
//! sees it where rays through the stratified points of that square meet the surface. Texel rows ascend with y of
//! the tangent frame. Nothing is random but the geometry: equal requests give equal bytes, whatever the threads.

pub mod mesh;
pub mod noise;
pub mod preview;
pub mod radiosity;
pub mod shade;
pub mod shadow;
pub mod solids;
pub mod trace;
pub mod yarns;

pub use preview::preview;

use crate::dataset::{Description, Sample, Statistics, Writer};
use crate::directions;
use crate::error::{Result, ToolError};
use crate::random::Random;
use glam::Vec3A;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A kind of modelled surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mesostructure {
    /// Raised pink glossy cells on a blue plane.
    Checker,
    /// Concentric rings of gold on a glossy blue plane.
    Rings,
    /// Loosely intertwined round fibres over a dark plane.
    Tissue,
    /// A dense twill of two colours.
    Cloth,
    /// Stockinette.
    Knit,
    /// Beaten copper with sharp highlights.
    Hammered,
}

impl Mesostructure {
    /// All kinds.
    pub fn all() -> [Mesostructure; 6] {
        use Mesostructure::{Checker, Cloth, Hammered, Knit, Rings, Tissue};
        [Checker, Rings, Tissue, Cloth, Knit, Hammered]
    }

    /// Its name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Mesostructure::Checker => "checker",
            Mesostructure::Rings => "rings",
            Mesostructure::Tissue => "tissue",
            Mesostructure::Cloth => "cloth",
            Mesostructure::Knit => "knit",
            Mesostructure::Hammered => "hammered",
        }
    }

    /// One period of its geometry.
    pub fn mesh(self, seed: u64) -> mesh::Mesh {
        let random = &mut Random::new(seed);
        match self {
            Mesostructure::Checker => solids::checker(random),
            Mesostructure::Rings => solids::rings(random),
            Mesostructure::Tissue => yarns::tissue(random),
            Mesostructure::Cloth => yarns::cloth(random),
            Mesostructure::Knit => yarns::knit(random),
            Mesostructure::Hammered => solids::hammered(random),
        }
    }
}

impl std::str::FromStr for Mesostructure {
    type Err = ToolError;

    fn from_str(name: &str) -> Result<Mesostructure> {
        let known = || Mesostructure::all().map(Mesostructure::name).join(", ");
        Mesostructure::all()
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| ToolError::Usage(format!("{name}: known mesostructures are {}", known())))
    }
}

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

/// Writes a dataset of a modelled surface; `progress` receives texels done and texels in all, from any thread.
///
/// # Errors
/// For a count of directions or samples that is not offered, and what [`Writer`] refuses.
pub fn synthesise(request: &Request, path: &Path, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Statistics> {
    let Some(grid) = directions::grid(request.directions) else {
        return Err(ToolError::Usage(format!("{} directions; 81 and 151 are known", request.directions)));
    };
    let strata = request.samples.isqrt();
    if !(1..=4).contains(&strata) || strata * strata != request.samples {
        return Err(ToolError::Usage(format!("{} samples; 1, 4, 9 and 16 are possible", request.samples)));
    }
    let description = Description {
        size: request.size,
        lights: grid.clone(),
        views: grid.clone(),
        sample: request.sample,
        cosine_included: true,
        texel_nm: [0, 0],
        texts: [request.kind.name().into(), format!("modelled mesostructure, seed {}", request.seed), "CC0-1.0".into()],
    };
    let writer = Writer::create(path, description)?;
    let directions: Vec<Vec3A> = grid.iter().map(|d| d.as_vec3a()).collect();
    let scene = shade::Scene::new(request.kind.mesh(request.seed), directions.clone());
    let (texels, done) = (writer.description().texels(), AtomicUsize::new(0));
    (0..texels).into_par_iter().try_for_each(|texel| {
        let values = texel_values(&scene, &directions, request.size, texel, strata);
        writer.put(texel, 0, &values)?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, texels);
        Ok::<(), ToolError>(())
    })?;
    writer.finish()
}

/// Radiance of one texel: `[view][light][colour]`.
fn texel_values(scene: &shade::Scene, views: &[Vec3A], size: [usize; 2], texel: usize, strata: usize) -> Vec<f32> {
    let of_view = scene.lights() * 3;
    let mut values = vec![0.0; views.len() * of_view];
    let weight = 1.0 / (strata * strata) as f32;
    let at = |cell: usize, stratum: usize, count: usize| (cell as f32 + (stratum as f32 + 0.5) / strata as f32) / count as f32;
    for (&view, sums) in views.iter().zip(values.chunks_exact_mut(of_view)) {
        for stratum in 0..strata * strata {
            let (x, y) = (at(texel % size[0], stratum % strata, size[0]), at(texel / size[0], stratum / strata, size[1]));
            scene.add_radiance(x, y, view, weight, sums);
        }
    }
    values
}
