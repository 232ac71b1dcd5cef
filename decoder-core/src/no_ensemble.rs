//! A build without the sparse ensemble: its files are refused as unsupported (3.1-8). Twin:
//! `shaders/wgsl/no_ensemble.wgsl`.

use crate::direction::Taps;
use crate::material::{Channel, Material};
use crate::position::Axis;
use crate::words::Words;

/// No texture: nothing can be opened that has one.
pub fn texture_q20(
    _words: Words<'_>,
    _material: &Material,
    _channel: Channel,
    _level: u32,
    _x: Axis,
    _y: Axis,
    _light: Taps,
    _view: Taps,
) -> i32 {
    0
}
