//! The containers of the University of Bonn, `.btf`: UBO2014 and its kin.
//!
//! | signature | what it holds |
//! |---|---|
//! | `!DFMF08FCR` | a factorisation of each channel of a decorrelated colour model |
//! | `!FMF12FCER`, `!FMF06FCR`, `!FMF06FC` | one factorisation of all; the first may be in the logarithm and have a height map |
//! | `!PVF06FCR`, `!PVF06FC` | a factorisation and a mean for each view; also the older layout with the number 301074 |
//! | `!BDIF06R2!` | every value in binary16; uncompressed, whole or without the texels of a mask |
//!
//! The layouts are documented nowhere but in their readers, which differ. What is done here:
//!
//! * **Rows.** Row 0 of a factor is the top row of the picture, as Bonn's own library has it (cgbonn/btflib,
//!   which also makes such files of pictures). The C++ reader (zeroeffects/btf) turns rows, for pictures that
//!   begin at the bottom.
//! * **Model 11.** `U = u (Y + e)`, as btflib has it; `btf.hh` computes `u Y + e` and cuts RGB at 1.
//! * **Directions.** The light list stands once for each view; the first counts and the others must be of its
//!   length.
//! * **Arrangement.** Factors may have pairs of directions as rows (usual), or texels (btflib alone reads
//!   those).
//! * **Channels.** Three are R, G and B by their names; others are spectral and refused. A single one is
//!   grey.
//! * **Rotations** are a frame for each texel, or none. Values stay in the frames they have, as in both
//!   readers; frames that are not the identity are reported.
//! * **Negative values**, which factorisations of dark materials have, become zero and are counted.
//!
//! No size is trusted: every table is known to be inside the file before anything is held for it. The side of
//! a factorisation that belongs to directions is held, in binary32; the side of the texels is read row by
//! row, so a material that unfolds to 20 GB is never in memory.

mod body;
pub mod colour;
mod head;
pub mod write;

pub use head::Head;

use super::bytes::{Bytes, Cursor};
use crate::error::{Result, ToolError};
use body::Body;
use head::{OLD_VIEWS, SIGNATURES, read_directions, read_extension, read_meta, read_rotations, read_size};
use std::path::Path;

/// A `.btf` file whose head is read and whose tables are known to be there.
#[derive(Debug)]
pub struct Btf {
    bytes: Bytes,
    head: Head,
    body: Body,
    heights: u64,
}

/// Whether a file that begins with these bytes is of the family, known or not.
pub fn is_one(start: &[u8]) -> bool {
    ["!DFMF", "!FMF", "!PVF", "!BDIF"].iter().any(|family| start.starts_with(family.as_bytes()))
}

impl Btf {
    /// Opens a file and checks its head and the place of every table.
    ///
    /// # Errors
    /// With the byte offset, if the file is not as its layout says or is of a variant that is not read, which
    /// is named.
    pub fn open(path: &Path) -> Result<Btf> {
        Btf::read(Bytes::open(path)?)
    }

    /// The same from bytes.
    ///
    /// # Errors
    /// As [`Btf::open`].
    pub fn read(bytes: Bytes) -> Result<Btf> {
        let mut start = vec![0; 12.min(bytes.length()) as usize];
        bytes.read_at(0, &mut start)?;
        let Some(signature) =
            SIGNATURES.into_iter().find(|signature| start.starts_with(signature.as_bytes()))
        else {
            let shown: String =
                String::from_utf8_lossy(&start).chars().take_while(|c| c.is_ascii_graphic()).collect();
            return bytes
                .fail(0, format!("the format {shown:?} is not read; known are {}", SIGNATURES.join(", ")));
        };
        let mut head = Head { signature, ..Head::default() };
        let mut cursor = Cursor { bytes: &bytes, at: signature.len() as u64 };
        let mut heights = 0;
        let body = if signature.starts_with("!PVF") && cursor.u32("length of the meta block")? == OLD_VIEWS {
            head.channels = ["R", "G", "B"].map(String::from).to_vec();
            cursor.u32("components")?;
            read_size(&mut cursor, &mut head)?;
            let slots = cursor.u32("views")?;
            read_directions(&mut cursor, &mut head)?;
            body::read_views(&mut cursor, &mut head, slots)?
        } else {
            cursor.at = signature.len() as u64;
            read_meta(&mut cursor, &mut head)?;
            read_directions(&mut cursor, &mut head)?;
            read_size(&mut cursor, &mut head)?;
            if signature.starts_with("!BDIF") {
                body::read_store(&mut cursor, &mut head)?
            } else {
                if signature.ends_with('R') {
                    read_rotations(&mut cursor, &mut head)?;
                }
                match signature {
                    "!DFMF08FCR" => body::read_decorrelated(&mut cursor, &mut head)?,
                    "!FMF12FCER" => {
                        let log = read_extension(&mut cursor, &mut head, &mut heights)?;
                        body::read_full(&mut cursor, &mut head, log)?
                    }
                    "!FMF06FCR" | "!FMF06FC" => body::read_full(&mut cursor, &mut head, false)?,
                    _ => {
                        cursor.u32("components")?;
                        let slots = cursor.u32("views")?;
                        body::read_views(&mut cursor, &mut head, slots)?
                    }
                }
            }
        };
        head.unread = bytes.length() - cursor.at;
        Ok(Btf { bytes, head, body, heights })
    }

    /// The header.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// Numbers of one texel: `[view][light][colour]`.
    pub fn texel_len(&self) -> usize {
        self.head.lights.len() * self.head.views.len() * 3
    }

    /// Texels that are decoded together: a few megabytes.
    pub fn batch(&self) -> usize {
        ((1 << 22) / self.texel_len()).clamp(1, 256).min(self.head.size[0] * self.head.size[1])
    }

    /// Decodes `count` texels, `[texel][view][light][colour]`, from texel `first` on; rows from the top.
    /// Values may be negative or not finite.
    ///
    /// # Errors
    /// If a number of the file is not finite, and on I/O.
    pub fn texels(&self, first: usize, count: usize, values: &mut [f32]) -> Result<()> {
        let ([width, _], length) = (self.head.size, self.texel_len());
        let mut done = 0;
        while done < count {
            let run = (width - (first + done) % width).min(count - done);
            self.body.texels(
                &self.bytes,
                &self.head,
                first + done,
                run,
                &mut values[done * length..][..run * length],
            )?;
            done += run;
        }
        Ok(())
    }

    /// Where the numbers of a texel begin in the file.
    pub fn offset(&self, texel: usize) -> u64 {
        self.body.offset(&self.head, texel)
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        self.bytes.path()
    }

    /// The height map, `[row][column]`, as it is stored: the layout states no unit.
    ///
    /// # Errors
    /// If the file has none or a height is not finite, and on I/O.
    pub fn height_map(&self) -> Result<Vec<f32>> {
        let Some([width, height]) = self.head.height_map else {
            return Err(ToolError::Usage(format!("{}: there is no height map", self.bytes.path().display())));
        };
        self.bytes.numbers(self.heights, width as u64 * height as u64, super::bytes::Width::Half)
    }
}
