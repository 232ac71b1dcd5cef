//! Writes a `.btf` as large as the published ones: `large_btf PATH [TEXELS DIRECTIONS COMPONENTS]`, 400, 151
//! and 100 if not given.
//!
//! `DFMF08FCR`, colour model 11, binary16; texels along either side, directions of light and of view (81 or
//! 151), components of each channel. See "Bring your own BTF" of the README for what importing it takes.

use selvedge_tests::foreign::write_large;
use selvedge_tools::data::directions::{grid, to_degrees};
use std::io::{BufWriter, Write as _};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: usize| arguments.get(i).map_or(Some(default), |text| text.parse().ok());
    let (Some(path), Some(texels), Some(directions), Some(components)) =
        (arguments.first(), number(1, 400), number(2, 151), number(3, 100))
    else {
        eprintln!("large_btf PATH [TEXELS DIRECTIONS COMPONENTS]");
        std::process::exit(1);
    };
    let Some(directions) = grid(directions) else {
        eprintln!("large_btf: 81 or 151 directions");
        std::process::exit(1);
    };
    let angles: Vec<[f32; 2]> =
        directions.iter().map(|&d| to_degrees(d).map(|n| n.to_radians() as f32)).collect();
    let file = std::fs::File::create(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let mut out = BufWriter::with_capacity(1 << 20, file);
    write_large(&mut out, [texels; 2], &angles, [components; 3])
        .and_then(|()| out.flush())
        .unwrap_or_else(|error| panic!("{path}: {error}"));
}
