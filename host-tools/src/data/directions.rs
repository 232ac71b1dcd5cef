//! The sets of directions that measured materials use, as rings around the normal.

use glam::DVec3;

/// A ring: polar angle from the normal, first azimuth and step, in degrees; the count is 360 / step.
type Ring = (f64, f64, f64);

/// The 81 directions of UBO2003 and UTIA (Sattler et al. 2003, table 1).
const RINGS_81: &[Ring] = &[
    (0.0, 0.0, 360.0),
    (15.0, 0.0, 60.0),
    (30.0, 0.0, 30.0),
    (45.0, 0.0, 20.0),
    (60.0, 0.0, 18.0),
    (75.0, 0.0, 15.0),
];

/// The 151 directions of UBO2014 (Bonn dome).
const RINGS_151: &[Ring] = &[
    (0.0, 0.0, 360.0),
    (11.0, 15.0, 60.0),
    (23.5, 0.0, 30.0),
    (30.0, 15.0, 30.0),
    (37.5, 0.0, 30.0),
    (45.0, 0.0, 20.0),
    (52.5, 7.5, 20.0),
    (60.0, 0.0, 15.0),
    (67.5, 7.5, 15.0),
    (75.0, 0.0, 15.0),
];

/// A unit vector from the angle to the normal and the azimuth, in degrees.
pub fn from_degrees(polar: f64, azimuth: f64) -> DVec3 {
    let ((sin_p, cos_p), (sin_a, cos_a)) = (polar.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    DVec3::new(sin_p * cos_a, sin_p * sin_a, cos_p)
}

/// The angle to the normal and the azimuth from 0 to 360, in degrees; azimuth 0 at the normal.
pub fn to_degrees(direction: DVec3) -> [f64; 2] {
    let polar = direction.x.hypot(direction.y).atan2(direction.z).to_degrees();
    let azimuth =
        if polar < 1e-9 { 0.0 } else { direction.y.atan2(direction.x).to_degrees().rem_euclid(360.0) };
    [polar, azimuth]
}

/// The known grid of `count` directions: 81 or 151, ring by ring, azimuths ascending.
pub fn grid(count: usize) -> Option<Vec<DVec3>> {
    let rings = match count {
        81 => RINGS_81,
        151 => RINGS_151,
        _ => return None,
    };
    let ring = |&(polar, first, step): &Ring| {
        (0..(360.0 / step) as usize).map(move |i| from_degrees(polar, first + step * i as f64))
    };
    Some(rings.iter().flat_map(ring).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_have_their_counts_and_angles_come_back() {
        for count in [81, 151] {
            let grid = grid(count).expect("known");
            assert_eq!(grid.len(), count);
            for direction in &grid {
                let [polar, azimuth] = to_degrees(*direction);
                assert!((from_degrees(polar, azimuth) - *direction).length() < 1e-12);
            }
        }
        assert!(grid(80).is_none());
    }
}
