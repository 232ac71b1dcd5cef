//! A sample on its way into a method, and what a method says of it.

use selvedge::Located;
use selvedge::kernel::position::{Axis, Place, Span};
use serde::{Serialize, Serializer};
use serde_json::Value;
use std::fmt::Debug;

/// What a method is asked: a place on a level, and located directions.
#[derive(Clone, Copy, Debug)]
pub struct SampleAt {
    /// Level of detail, and texels along both axes.
    pub place: Place,
    /// The light.
    pub light: Located,
    /// The view.
    pub view: Located,
}

/// The one or two blocks of an axis (6.2).
pub fn spans(axis: Axis) -> Vec<Span> {
    if axis.count == 2 { vec![axis.first, axis.second] } else { vec![axis.first] }
}

/// The textures of a sample, taken apart by their method.
pub trait Explained: Debug {
    /// For programs.
    fn to_json(&self) -> Value;

    /// For people: what belongs to one channel, with at most `most` terms of a list.
    fn channel_text(&self, _channel: usize, _most: usize) -> String {
        String::new()
    }

    /// For people: what belongs to all channels, with at most `most` terms of a list.
    fn text(&self, _most: usize) -> String {
        String::new()
    }
}

impl Serialize for dyn Explained {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_json().serialize(serializer)
    }
}
