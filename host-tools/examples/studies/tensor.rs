//! The sparse tensor against principal components on a dataset, by sizes of its dictionaries and lists.
//!
//! `cargo run --release -p selvedge-tools --example tensor -- DATASET log|linear RANK
//! LIGHT_ATOMS,ABRDF_ATOMS,ENTRIES,COEFFICIENTS ...`
//!
//! For each shape: bytes and error of the file as the core decodes it, the error that was predicted, and the
//! fewest bytes of principal components at 8 or 16 bits for the same error.

use selvedge::Limits;
use selvedge_tools::data::dataset::Dataset;
use selvedge_tools::data::transfer::Domain;
use selvedge_tools::encode::goal::Target;
use selvedge_tools::error::{Result, ToolError};
use selvedge_tools::measure::baseline::pca;
use selvedge_tools::measure::compare::compare;
use selvedge_tools::measure::radiance::AtLevel;
use selvedge_tools::methods::sparse_tensor::encode::fit::{Shape, Training, fit};
use selvedge_tools::methods::sparse_tensor::encode::{Options, encode_fit};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, domain, rank, shapes @ ..] = arguments.as_slice() else {
        return Err(ToolError::Usage(
            "DATASET log|linear RANK LIGHT_ATOMS,ABRDF_ATOMS,ENTRIES,COEFFICIENTS ...".into(),
        ));
    };
    let domain = if domain == "log" { Domain::Log } else { Domain::Linear };
    let number =
        |text: &str| text.parse::<usize>().map_err(|_| ToolError::Usage(format!("`{text}` is no number")));
    let data = Dataset::open(Path::new(path))?;
    let start = Instant::now();
    let mut components = pca::components(&data, domain, number(rank)?)?;
    println!(
        "components: rank {}, {:.1} s; error of the means {:.5}, of all components {:.5}",
        components.rank(),
        start.elapsed().as_secs_f64(),
        components.predicted_rms(0),
        components.predicted_rms(components.rank())
    );
    for shape in shapes {
        let n: Vec<usize> = shape.split(',').map(number).collect::<Result<_>>()?;
        let [light_atoms, abrdf_atoms, entries, coefficients] = n[..] else {
            return Err(ToolError::Usage(format!("`{shape}` is no shape")));
        };
        let shape = Shape { light_atoms, abrdf_atoms, entries, coefficients };
        let start = Instant::now();
        let fitted = fit(&components, shape, Training::default(), |_, _, _| ());
        let values = (data.description().texels() * data.description().texel_len()) as f64;
        let rms = |errors: &[f64]| (errors.last().copied().unwrap_or(0.0) / values).sqrt();
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{shape:?}: {seconds:.1} s, first K-SVD {:.5}, second {:.5}, {:?}",
            rms(&fitted.of_texels),
            rms(&fitted.of_fibres),
            fitted.trained
        );
        let start = Instant::now();
        let encoded = encode_fit(
            &components,
            &fitted,
            &[],
            &Options { shape, target: Target::AsGiven, value_bits: None, training: Training::default() },
        )?;
        let file =
            selvedge::open(&encoded.bytes, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"));
        let metrics = compare(
            &data,
            &AtLevel::finest(&file),
            data.description(),
            data.statistics().log_offset(),
            None,
            &|_, _| (),
        )?;
        let error = if domain == Domain::Log { metrics.log_rms } else { metrics.linear_rms };
        let rival = components.reach(error)?.map_or("-".into(), |choice| {
            format!(
                "{} bytes (rank {}, {} bits), {:.2} times",
                choice.row.bytes,
                choice.rank,
                choice.bits,
                choice.row.bytes as f64 / encoded.bytes.len() as f64
            )
        });
        let mean = encoded.coefficients as f64 / data.description().texels() as f64;
        println!(
            "  {} bytes, error {error:.5} (predicted {:.5}), {mean:.2} coefficients a texel of {} bits, {} clipped, {} operations, {:.1} s; components {rival}",
            encoded.bytes.len(),
            encoded.predicted_rms,
            selvedge_tools::methods::sparse_tensor::model::tensor_of(&encoded.model)
                .map_or(0, |t| t.lists[0][0].value_bits),
            encoded.clipped,
            file.header().operations,
            start.elapsed().as_secs_f64()
        );
    }
    Ok(())
}
