//! Periodic value noise in two dimensions, from a repeatable table: variation of colour, width and path that
//! still tiles.

use crate::math::random::Random;

/// A random number from -1 to 1.
pub fn signed(random: &mut Random) -> f32 {
    random.word() as f32 / 2_147_483_648.0 - 1.0
}

/// Smooth noise with period 1 along both axes.
#[derive(Clone, Debug)]
pub struct Noise {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Noise {
    /// A table of `columns` x `rows` random values.
    pub fn new(random: &mut Random, columns: usize, rows: usize) -> Noise {
        Noise { columns, rows, values: (0..columns * rows).map(|_| signed(random)).collect() }
    }

    /// From -1 to 1, with continuous slope.
    pub fn at(&self, x: f32, y: f32) -> f32 {
        let (x, y) = (x.rem_euclid(1.0) * self.columns as f32, y.rem_euclid(1.0) * self.rows as f32);
        let value = |i: usize, j: usize| self.values[j % self.rows * self.columns + i % self.columns];
        let fade = |t: f32| t * t * (3.0 - 2.0 * t);
        let (i, j) = (x as usize, y as usize);
        let (u, v) = (fade(x - i as f32), fade(y - j as f32));
        let low = value(i, j) * (1.0 - u) + value(i + 1, j) * u;
        let high = value(i, j + 1) * (1.0 - u) + value(i + 1, j + 1) * u;
        low * (1.0 - v) + high * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_tiles_and_keeps_its_range() {
        let noise = Noise::new(&mut Random::new(4), 5, 3);
        for i in 0..100 {
            let (x, y) = (i as f32 * 0.0137, i as f32 * 0.031);
            assert!(noise.at(x, y).abs() <= 1.0);
            assert!((noise.at(x, y) - noise.at(x + 1.0, y - 2.0)).abs() < 1e-4);
        }
    }
}
