//! What is asked of an import, and what comes of one.

use super::pixels::Colours;
use crate::data::dataset::{Description, Sample, Statistics};

/// What the user asks of an import, and what it cannot find in the data.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// How values are stored.
    pub sample: Sample,
    /// Whether values contain the cosine of the light's angle; if `None`, as the data state it, and if they
    /// do not, yes.
    pub cosine_included: Option<bool>,
    /// Name of the material; if empty, that of the data.
    pub name: String,
    /// Origin of the data; if empty, that of the data.
    pub origin: String,
    /// Licence of the data; if empty, that of the data.
    pub licence: String,
    /// Bytes for the images held at once. A single image that needs more than this, or than a megabyte, is
    /// refused.
    pub memory: usize,
    /// What the three numbers of an image are.
    pub colours: Colours,
}

impl Default for ImportOptions {
    fn default() -> ImportOptions {
        let [name, origin, licence] = Default::default();
        ImportOptions {
            sample: Sample::Half,
            cosine_included: None,
            name,
            origin,
            licence,
            memory: 1 << 30,
            colours: Colours::Auto,
        }
    }
}

impl ImportOptions {
    /// Why a value cannot be stored.
    pub(super) fn refusal(&self, value: f32) -> String {
        let hint = if value.is_finite() && self.sample == Sample::Half { "; --float holds it" } else { "" };
        format!("{value} is not a radiance from 0 to {:e}{hint}", self.sample.largest())
    }

    /// A description of data, completed by the user's options.
    pub(super) fn describe(&self, found: &Description) -> Description {
        let asked = [&self.name, &self.origin, &self.licence];
        let texts =
            std::array::from_fn(
                |i| if asked[i].is_empty() { clean(&found.texts[i]) } else { asked[i].clone() },
            );
        let cosine_included = self.cosine_included.unwrap_or(found.cosine_included);
        Description { sample: self.sample, cosine_included, texts, ..found.clone() }
    }
}

/// A third-party text as a file may have it (3.4-3): without invisible characters, at most 200 characters.
pub fn clean(text: &str) -> String {
    text.chars()
        .filter(|&c| !selvedge::container::metadata::is_invisible(c))
        .take(200)
        .collect::<String>()
        .trim()
        .to_owned()
}

/// What came of an import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Of the dataset.
    pub statistics: Statistics,
    /// What the user should know: a line each.
    pub notes: Vec<String>,
}

/// Negative values that became 0.
#[derive(Clone, Copy, Default)]
pub(super) struct Clipped {
    pub count: u64,
    pub least: f32,
}

impl Clipped {
    /// Makes them 0. Infinities and NaN are left to be refused.
    pub fn of(values: &mut [f32]) -> Clipped {
        let mut clipped = Clipped::default();
        values.iter_mut().filter(|v| **v < 0.0 && v.is_finite()).for_each(|v| {
            clipped.count += 1;
            clipped.least = clipped.least.min(*v);
            *v = 0.0;
        });
        clipped
    }
}
