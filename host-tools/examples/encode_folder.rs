//! Encodes a folder of images, or a dataset, within a number of bytes.
//!
//! A folder has an image for each pair of directions, with angles in the names (`selvedge import --help`).
//! Two commands make one to try:
//!
//!     cargo run -- synth checker --size 16 --samples 1 -o checker.selvset
//!     cargo run -- export checker.selvset -o checker-images
//!     cargo run --release -p selvedge-tools --example encode_folder -- checker-images checker.selv 80000

use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::data::pyramid;
use selvedge_tools::encode::ENCODERS;
use selvedge_tools::encode::encoder::{Common, Levels, encode};
use selvedge_tools::encode::goal::Goal;
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::files;
use selvedge_tools::foreign::{ImportOptions, images};
use selvedge_tools::progress::Progress;
use std::path::Path;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [source, output, bytes] = arguments.as_slice() else {
        return Err(ToolError::Usage("encode_folder SOURCE OUTPUT.selv BYTES".into()));
    };
    let (source, output) = (Path::new(source), Path::new(output));
    let bytes = bytes.parse().map_err(|_| ToolError::Usage(format!("{bytes}: not a number of bytes")))?;
    let work = tempfile::tempdir().map_err(ToolError::io(output))?;
    let progress = Progress::new();

    // A dataset is a file on disk, [texel][view][light][colour]; images are transposed into one.
    let dataset = if Dataset::is_one(source) {
        Dataset::open(source)?
    } else {
        let path = work.path().join("imported.selvset");
        let report = |done, all| progress.report("importing", done, all);
        images::import(source, &path, &ImportOptions::default(), &report)?;
        Dataset::open(&path)?
    };

    // Three levels of detail, each half the size of the one before.
    let coarser = pyramid::levels(&dataset, 3, work.path())?;
    let levels = Levels { finest: &dataset, coarser: &coarser };
    // Every method has an encoder; these have the defaults of their options.
    for encoder in ENCODERS {
        let made = encode(*encoder, &levels, Goal::Bytes(bytes), &Common::default(), &progress);
        progress.clear();
        match made {
            // What is reported was measured: the file, decoded by the core at every texel and pair of
            // directions, against the data.
            Ok(encoded) => {
                println!("{}", encoded.line());
                let path = output.with_extension(format!("{}.selv", encoded.method));
                files::write(&path, &encoded.bytes)?;
            }
            Err(error @ ToolError::Unreachable { .. }) => println!("{}: {error}", encoder.method()),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
