//! What a method stores of a material, to everything that does not care which method it is.

use crate::error::{Result, ToolError};
use crate::format::container::RawSection;
use serde::{Serialize, Serializer};
use serde_json::Value;
use std::any::Any;
use std::fmt::Debug;

/// The texture of a material: what its method adds to means and scales, quantised.
///
/// Sizes, levels, layers, directions and the edge of a block are the model's
/// ([`MaterialModel`](super::model::MaterialModel)); a texture has the same of them.
pub trait Texture: Any + Debug + Send + Sync {
    /// Number of the method in the header (3.1-8).
    fn method(&self) -> u32;

    /// Name of the method, as everywhere.
    fn name(&self) -> &'static str;

    /// Which channels have texture.
    fn channels(&self) -> [bool; 3];

    /// The sections that an external dictionary can have in the material's place (3.5).
    fn dictionary_sections(&self) -> Vec<RawSection>;

    /// The sections that are always in the material's own file.
    fn own_sections(&self) -> Vec<RawSection>;

    /// Operations of the textures of a filtered sample at worst on a level, for blocks of `edge` texels: the
    /// method's own part of 4.2-1.
    fn operations(&self, edge: u32, level: usize) -> u64;

    /// Leaves what is kept.
    fn keep(&mut self, kept: &Kept<'_>);

    /// Leaves out what no sample uses; every sample keeps its bits.
    fn drop_unused(&mut self);

    /// `(1 - alpha) self + alpha other`.
    ///
    /// # Errors
    /// [`ToolError::Usage`] if the method has no blends, which is the default, if the other texture is of
    /// another method, or if the result is beyond the format.
    fn blend(&self, other: &dyn Texture, alpha: f64, options: Blend) -> Result<Blended> {
        let _ = (other, alpha, options);
        Err(ToolError::Usage(format!("{} has no blends", self.name())))
    }

    /// For the recipes of the conformance suite: the same fields, to be changed by JSON pointer.
    fn to_json(&self) -> Value;

    /// A copy.
    fn boxed(&self) -> Box<dyn Texture>;

    /// Whether two textures are equal.
    fn is_same(&self, other: &dyn Texture) -> bool;
}

/// What stays of a texture.
#[derive(Clone, Debug)]
pub struct Kept<'a> {
    /// The first layers.
    pub layers: usize,
    /// The first levels.
    pub levels: usize,
    /// Channels that keep their texture.
    pub channels: [bool; 3],
    /// Numbers of the light directions that stay, ascending.
    pub lights: &'a [u32],
    /// Numbers of the view directions that stay, ascending.
    pub views: &'a [u32],
}

/// How to blend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Blend {
    /// No change of basis: the layers of both, one of `a` and one of `b` in turn.
    pub exact: bool,
    /// Most coefficients of a record after a change of basis or a sum; as many as both have if `None`.
    pub most: Option<u32>,
    /// Bits of a value; the larger number of both if `None`. Exact blends keep the bits that there are.
    pub value_bits: Option<u32>,
    /// Blend textures and scales apart where scales differ. This is how normalised materials are blended in
    /// the SparseBTF paper; values then move smoothly from one to the other, but not linearly.
    pub scales_apart: bool,
}

/// A blended texture.
#[derive(Debug)]
pub struct Blended {
    /// The texture.
    pub texture: Box<dyn Texture>,
    /// What it lost.
    pub report: BlendReport,
}

/// What a change of basis cost, over all blocks, layers and levels.
///
/// Energies are sums of squares of textures before scales, over all texels of blocks and all pairs of
/// sample directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlendReport {
    /// Records that are a sum on one dictionary, or of one material alone.
    pub summed: u64,
    /// Records that took a change of basis.
    pub changed: u64,
    /// Energy of the blended textures as they should be; of an exact blend it is not formed.
    pub energy: f64,
    /// Energy outside of the span of the dictionaries that were kept.
    pub outside: f64,
    /// Energy of the whole difference: outside of the span, or beyond the number of coefficients.
    pub lost: f64,
}

impl dyn Texture {
    /// The texture as the type of one method, if it is of that method.
    pub fn downcast_ref<T: Texture>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }

    /// The same, to be changed.
    pub fn downcast_mut<T: Texture>(&mut self) -> Option<&mut T> {
        (self as &mut dyn Any).downcast_mut()
    }
}

impl Clone for Box<dyn Texture> {
    fn clone(&self) -> Self {
        self.boxed()
    }
}

impl PartialEq for dyn Texture {
    fn eq(&self, other: &dyn Texture) -> bool {
        self.is_same(other)
    }
}

impl Serialize for dyn Texture {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        self.to_json().serialize(serializer)
    }
}
