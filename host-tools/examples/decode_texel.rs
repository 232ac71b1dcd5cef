//! Decodes a filtered sample, and all directions of one texel: its apparent BRDF, as a picture with a column
//! for each light and a row for each view.
//!
//!     cargo run -p selvedge-tools --example decode_texel -- \
//!         decoder-core/tests/data/carpet07-excerpt.selv 12 34 abrdf.png

use selvedge::{Direction, Limits, position_from_f32};
use selvedge_tools::data::picture::Picture;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, x, y, picture] = arguments.as_slice() else {
        return Err("usage: decode_texel FILE.selv X Y PICTURE.png".into());
    };
    let (x, y): (u32, u32) = (x.parse()?, y.parse()?);
    let bytes = std::fs::read(file)?;
    let material = selvedge::open(&bytes, &Limits::default())?;
    let header = material.header();
    if x >= header.width || y >= header.height {
        return Err(format!("the image has {} x {} texels", header.width, header.height).into());
    }

    // A filtered sample: any position, any directions. Positions are fractions of the image and wrap;
    // directions are unit vectors with z along the normal. Nothing here can fail.
    let light = Direction::from_unit_vector([0.3, 0.1, 0.948]);
    let view = Direction::from_unit_vector([0.0, 0.0, 1.0]);
    let [u, v] = [(x, header.width), (y, header.height)].map(|(texel, size)| {
        // The middle of the texel.
        position_from_f32((texel as f32 + 0.5) / size as f32)
    });
    println!("filtered: {:?}", material.filtered(u, v, light, view).to_f32());

    // One texel at its own sample directions, without interpolation.
    let pairs = [header.light_count as usize, header.view_count as usize];
    let abrdf = Picture::from_fn(pairs[0], pairs[1], |light, view| {
        material.point(x, y, light as u32, view as u32).to_f32()
    });
    println!("light 0, view 0: {:?}", abrdf.pixels[0]);
    abrdf.enlarged(2).save(Path::new(picture))?;
    Ok(())
}
