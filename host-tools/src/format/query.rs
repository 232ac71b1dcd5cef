//! Directions as unit vectors, and as the decoder is asked for them.

use crate::format::triangulate::project;
use selvedge::Direction;
use selvedge::container::directions::cosine_of;

/// A sample direction as a query: the point that an encoder writes for it (5.1-4).
pub fn query(direction: glam::DVec3) -> Direction {
    let [x, y] = project(direction);
    Direction { x_q18: x << 4, y_q18: y << 4, z_q15: cosine_of(x, y) as i32 }
}

/// The unit vector of a direction: the inverse of the projection x / (1 + z).
pub fn vector(direction: Direction) -> glam::DVec3 {
    let p = glam::DVec2::new(direction.x_q18 as f64, direction.y_q18 as f64) / 262_144.0;
    let scale = 1.0 + p.length_squared();
    glam::DVec3::new(2.0 * p.x / scale, 2.0 * p.y / scale, (1.0 - p.length_squared()) / scale)
}
