//! The record of a method: what the tools need of it, in one place.

use crate::format::model::MaterialModel;
use crate::format::texture::Texture;
use crate::math::random::Random;
use crate::methods::advice::{Advice, Advise};
use crate::methods::reach::Reach;
use crate::methods::sample::{Explained, SampleAt};
use selvedge::{Rule, Selvedge, Values};
use serde_json::Value;

/// A method of the format, as the tools have it.
///
/// A new method is a folder beside this file and one line of [`METHODS`](crate::methods::METHODS).
pub struct Method {
    /// Number in the header (3.1-8).
    pub number: u32,
    /// The one name, such as `sparse-tensor`: of options, recipes, reports and files of the specification.
    pub name: &'static str,
    /// The same in words.
    pub title: &'static str,
    /// Where it is published.
    pub paper: &'static str,
    /// Red, green and blue in plots.
    pub colour: [u8; 3],
    /// Its sections.
    pub sections: &'static [SectionName],
    /// The textures of an open material.
    pub read: fn(&Selvedge<'_>) -> Box<dyn Texture>,
    /// A texture from what [`Texture::to_json`] gives, for recipes.
    pub from_json: fn(Value) -> serde_json::Result<Box<dyn Texture>>,
    /// The smallest material that has every section: the worked example of the method's chapter.
    pub example: fn() -> MaterialModel,
    /// A legal material at the ends of what is legal, by random numbers.
    pub extreme: fn(&mut Random, Reach) -> MaterialModel,
    /// Takes the textures of a sample apart; the material has texture.
    pub explain: fn(&Selvedge<'_>, &SampleAt) -> Box<dyn Explained>,
    /// Computes the textures of a sample step by step and adds the operations that they take; the material
    /// has texture.
    pub count: fn(&Selvedge<'_>, &SampleAt, &mut u64) -> Values,
    /// The advice that it has.
    pub advice: &'static [&'static Advice],
    /// Walks the textures of a legal material for advice.
    pub advise: fn(&Selvedge<'_>, &mut Advise<'_>),
    /// What to do about broken rules of its chapter.
    pub hints: &'static [(Rule, &'static str)],
}

/// The name of a kind of section.
pub struct SectionName {
    /// Its kind.
    pub kind: u32,
    /// Its name.
    pub name: &'static str,
    /// Which of its kind an instance is, in words.
    pub instance: fn(u32) -> String,
}

impl std::fmt::Debug for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({})", self.name, self.number)
    }
}

impl PartialEq for Method {
    fn eq(&self, other: &Method) -> bool {
        self.number == other.number
    }
}
