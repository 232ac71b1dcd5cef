//! What a batch is asked.

use crate::kernel::direction::Direction;
use crate::selvedge::position_from_f32;

/// A filtered sample to be made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilteredQuery {
    /// u0.32 fraction of the image along x.
    pub u_q32: u32,
    /// u0.32 fraction of the image along y.
    pub v_q32: u32,
    /// Light direction.
    pub light: Direction,
    /// View direction.
    pub view: Direction,
}

impl FilteredQuery {
    /// From a position of any magnitude, which wraps, and unit vectors in the material's tangent frame.
    pub fn from_f32(position: [f32; 2], light: [f32; 3], view: [f32; 3]) -> FilteredQuery {
        let [u_q32, v_q32] = position.map(position_from_f32);
        FilteredQuery {
            u_q32,
            v_q32,
            light: Direction::from_unit_vector(light),
            view: Direction::from_unit_vector(view),
        }
    }
}
