//! Opens a file and lists what its header and directory say.
//!
//!     cargo run -p selvedge-tools --example open_and_list -- decoder-core/tests/data/carpet07-excerpt.selv

use selvedge::Limits;
use selvedge_tools::check::info::info;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: open_and_list FILE.selv")?;
    let bytes = std::fs::read(path)?;
    // Every rule of the format is checked here, once; the error is the first broken rule, with its offset.
    let material = selvedge::open(&bytes, &Limits::default())?;

    let (header, metadata) = (material.header(), material.metadata());
    println!("{}; origin: {}; licence: {}", metadata.name, metadata.origin, metadata.licence);
    println!("{} x {} texels", header.width, header.height);
    println!("{} light and {} view directions", header.light_count, header.view_count);
    println!("{} levels of detail, {} quality layers", header.level_count, header.layer_count);
    println!("{} operations for a filtered sample at worst", header.operations);

    // The core knows sections by number; the tools know their names.
    let info = info(&material)?;
    println!("method {}\n\n   offset    length  kind  section", info.method);
    for (section, named) in material.sections().zip(&info.sections) {
        let (offset, length, kind) = (section.offset, section.length, section.kind);
        println!("{offset:>9} {length:>9}  {kind:04x}  {} {}", named.kind, named.which);
    }
    Ok(())
}
