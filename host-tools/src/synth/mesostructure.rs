//! The kinds of modelled surfaces.

use super::mesh::Mesh;
use super::{solids, yarns};
use crate::error::{Result, ToolError};
use crate::math::random::Random;

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
    pub fn mesh(self, seed: u64) -> Mesh {
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
