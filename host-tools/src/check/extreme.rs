//! Legal files at the ends of what is legal, by seed: for the tests that hold decoders equal.

use crate::format::model::MaterialModel;
use crate::math::random::Random;
use crate::methods::reach::Reach;
use crate::methods::{METHODS, Method};

/// A legal material of a method by its seed.
pub fn extreme(method: &Method, seed: u64) -> MaterialModel {
    let mut model = (method.extreme)(&mut Random::new(seed), Reach::FULL);
    model.metadata.texts[0] += &format!(" {seed}");
    model
}

/// A legal material by its seed, of every method in turn.
pub fn extreme_of_any_method(seed: u64) -> MaterialModel {
    extreme(METHODS[(seed % METHODS.len() as u64) as usize], seed)
}
