//! What batches and images stand on: directions and tables made ready, and what a method brings to them.
//!
//! A method without fast paths of its own has [`plain`] ones: it is walked sample by sample, with the same bits.

pub(crate) mod finish;
pub(crate) mod located;
pub(crate) mod plain;
pub(crate) mod table;

use crate::kernel::colour::Rgb;
use crate::kernel::direction::Located;

/// An image that is wanted: a level that is there, and located directions.
pub struct ImageQuery {
    /// Level of detail.
    pub level: u32,
    /// Texels along x and y.
    pub size: [u32; 2],
    /// The light.
    pub light: Located,
    /// The view.
    pub view: Located,
}

/// Where the textures of an image go, Q20, row by row.
pub enum Textures<'o> {
    /// Those of one channel.
    One(u32, &'o mut [i32]),
    /// Those of three channels, as words of red, green and blue.
    All(&'o mut [Rgb]),
}

impl Textures<'_> {
    /// Puts the textures of a texel; a place outside is none.
    #[inline(always)]
    pub fn put(&mut self, at: usize, [t0, t1, t2]: [i32; 3]) {
        match self {
            Textures::One(channel, out) => {
                if let Some(slot) = out.get_mut(at) {
                    *slot = [t0, t1, t2].get(*channel as usize).copied().unwrap_or(0);
                }
            }
            Textures::All(out) => {
                if let Some(slot) = out.get_mut(at) {
                    *slot = Rgb { r: t0 as u32, g: t1 as u32, b: t2 as u32 };
                }
            }
        }
    }
}
