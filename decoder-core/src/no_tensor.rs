//! A build without the sparse tensor: its files are refused as unsupported (3.1-8). Twin:
//! `shaders/wgsl/no_tensor.wgsl`.

use crate::colour::Values;
use crate::direction::Taps;
use crate::material::Material;
use crate::position::Axis;
use crate::words::Words;

/// No textures: nothing can be opened that has some.
pub fn textures_q20(
    _words: Words<'_>,
    _material: &Material,
    _level: u32,
    _x: Axis,
    _y: Axis,
    _light: Taps,
    _view: Taps,
) -> Values {
    Values { c0: 0, c1: 0, c2: 0 }
}
