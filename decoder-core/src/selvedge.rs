//! An open material, and every question that it answers.

use crate::container::directory::{METADATA, find_in, read_entry};
use crate::container::header::Header;
use crate::container::metadata::{Metadata, read_metadata};
use crate::kernel::colour::{Rgb, Values};
use crate::kernel::direction::{Direction, Located, direction_from_binary32, sample_direction};
use crate::kernel::interpolation::{
    filtered_values, light_sample, locate_light, locate_view, point_values, radiance,
};
use crate::kernel::levels::trilinear_values;
use crate::kernel::material::Material;
use crate::kernel::position::fraction_from_binary32;
use crate::kernel::words::{DICTIONARY_START, Words, word};
use crate::walk::check::Section;
use core::fmt;

/// An open material. Copies are cheap: it borrows the file's bytes and owns nothing.
#[derive(Clone, Copy, Debug)]
pub struct Selvedge<'a> {
    pub(crate) words: Words<'a>,
    pub(crate) header: Header,
    pub(crate) material: Material,
}

impl<'a> Selvedge<'a> {
    /// The header's fields.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What the kernel knows of this material; word numbers from the start of the file.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// The bytes, as the kernel reads them.
    pub fn words(&self) -> Words<'a> {
        self.words
    }

    /// What a person or a renderer wants to know beside the values.
    pub fn metadata(&self) -> Metadata<'a> {
        let section = find_in(|offset| word(self.words, offset >> 2), self.header.section_count, METADATA, 0);
        let range = section.map(|s| s.offset as usize..s.offset as usize + s.length as usize);
        range.and_then(|range| self.words.file.get(range)).and_then(read_metadata).unwrap_or_default()
    }

    /// The sections of the file, in order.
    pub fn sections(&self) -> impl Iterator<Item = Section> + '_ {
        (0..self.header.section_count).map(|index| read_entry(|offset| word(self.words, offset >> 2), index))
    }

    /// The same material, decoded only up to a quality layer: 1 for the first alone. Its digest is then that
    /// of the layers.
    pub fn with_layers(mut self, layers: u32) -> Self {
        // Not `clamp`, which panics if its bounds cross.
        self.material.layer_limit = layers.min(self.header.layer_count).max(1);
        self
    }

    /// The record for a kernel whose buffer holds this file from word `file_start` on, and the external
    /// dictionary, if there is one, from word `dictionary_start` on. Buffers end before word 2^31.
    pub fn material_at(&self, file_start: u32, dictionary_start: u32) -> Material {
        let place = |start: u32| {
            if start < DICTIONARY_START {
                start.wrapping_add(file_start)
            } else {
                (start & 0x7fff_ffff).wrapping_add(dictionary_start)
            }
        };
        let mut material = self.material;
        material.file_start = file_start;
        // Zero says that there is none; no section begins in the header.
        let move_there = |start: &mut u32| {
            if *start != 0 {
                *start = place(*start);
            }
        };
        move_there(&mut material.light_start);
        move_there(&mut material.view_start);
        material.parts.iter_mut().for_each(move_there);
        for channel in &mut material.channels {
            move_there(&mut channel.mean_start);
            move_there(&mut channel.scale_start);
        }
        material
    }

    /// Sample direction `index` of the light, as a query; an index beyond the end is clamped to the last.
    pub fn light_direction(&self, index: u32) -> Direction {
        let last = self.material.light_count.wrapping_sub(1);
        sample_direction(self.words, self.material.light_start, index.min(last))
    }

    /// Sample direction `index` of the view, as a query; an index beyond the end is clamped to the last.
    pub fn view_direction(&self, index: u32) -> Direction {
        let last = self.material.view_count.wrapping_sub(1);
        sample_direction(self.words, self.material.view_start, index.min(last))
    }

    /// A light direction, located among the sample directions; reuse it for many texels.
    pub fn locate_light(&self, direction: Direction) -> Located {
        locate_light(self.words, &self.material, direction)
    }

    /// A view direction, located.
    pub fn locate_view(&self, direction: Direction) -> Located {
        locate_view(self.words, &self.material, direction)
    }

    /// Radiance of one texel of level 0 for one pair of sample directions (8.5). Indices beyond the end are
    /// moved to the last.
    pub fn point(&self, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Rgb {
        let values = self.point_values(texel_x, texel_y, light_index, view_index);
        radiance(&self.material, values, &light_sample(self.words, &self.material, light_index))
    }

    /// Channel values, Q20, of one texel of level 0 for one pair of sample directions (8.5).
    pub fn point_values(&self, texel_x: u32, texel_y: u32, light_index: u32, view_index: u32) -> Values {
        point_values(self.words, &self.material, texel_x, texel_y, light_index, view_index)
    }

    /// Radiance at any position and for any directions, at full resolution (8.4). `u` and `v` are u0.32
    /// fractions of the image.
    pub fn filtered(&self, u_q32: u32, v_q32: u32, light: Direction, view: Direction) -> Rgb {
        let (light, view) = (self.locate_light(light), self.locate_view(view));
        radiance(&self.material, self.filtered_values(u_q32, v_q32, &light, &view), &light)
    }

    /// Channel values, Q20, at any position for located directions (8.4).
    pub fn filtered_values(&self, u_q32: u32, v_q32: u32, light: &Located, view: &Located) -> Values {
        filtered_values(self.words, &self.material, 0, u_q32, v_q32, light, view)
    }

    /// Radiance at any position, between two levels of detail (9.2). The level is in Q16: `0x18000` is 1.5.
    pub fn trilinear(
        &self,
        level_q16: u32,
        u_q32: u32,
        v_q32: u32,
        light: Direction,
        view: Direction,
    ) -> Rgb {
        let light = self.locate_light(light);
        let view = self.locate_view(view);
        let values = trilinear_values(self.words, &self.material, level_q16, u_q32, v_q32, &light, &view);
        radiance(&self.material, values, &light)
    }
}

/// A lent buffer is too short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferTooSmall {
    /// Elements needed.
    pub needed: usize,
    /// Elements lent.
    pub lent: usize,
}

impl fmt::Display for BufferTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the buffer has {} elements, {} are needed", self.lent, self.needed)
    }
}

impl core::error::Error for BufferTooSmall {}

impl Rgb {
    /// Linear radiance as floats: a bit cast.
    pub fn to_f32(self) -> [f32; 3] {
        [f32::from_bits(self.r), f32::from_bits(self.g), f32::from_bits(self.b)]
    }

    /// The three words.
    pub fn to_words(self) -> [u32; 3] {
        [self.r, self.g, self.b]
    }
}

impl Direction {
    /// From a unit vector in the material's tangent frame, by integer arithmetic on its bits (5.2-3).
    pub fn from_unit_vector([x, y, z]: [f32; 3]) -> Direction {
        direction_from_binary32(x.to_bits(), y.to_bits(), z.to_bits())
    }
}

/// A position of any magnitude as its u0.32 fraction, by integer arithmetic on its bits (6.1-2).
pub fn position_from_f32(position: f32) -> u32 {
    fraction_from_binary32(position.to_bits())
}
