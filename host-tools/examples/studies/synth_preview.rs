//! Draws modelled mesostructures: `synth_preview <folder> <pixels> [name]...` writes `synth-<name>.png` for
//! each.

use selvedge_tools::error::ToolError;
use selvedge_tools::synth::{Mesostructure, preview};
use std::path::Path;

fn main() -> Result<(), ToolError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, pixels, names @ ..] = &arguments[..] else {
        return Err(ToolError::Usage("synth_preview <folder> <pixels> [name]...".into()));
    };
    let pixels = pixels.parse().map_err(|_| ToolError::Usage(format!("{pixels}: not a number of pixels")))?;
    let kinds = if names.is_empty() {
        Mesostructure::all().to_vec()
    } else {
        names.iter().map(|name| name.parse()).collect::<Result<_, _>>()?
    };
    for kind in kinds {
        let begun = std::time::Instant::now();
        preview(kind, 1, pixels).save(&Path::new(folder).join(format!("synth-{}.png", kind.name())))?;
        println!("{}: {:.1} s", kind.name(), begun.elapsed().as_secs_f64());
    }
    Ok(())
}
