//! The encoder of the sparse tensor (chapter 12): a dataset becomes a file for a goal in bytes or error.
//!
//! [`fit`](mod@fit) decomposes in floats as the paper does; [`integers`] turns light atoms and fibres into
//! the numbers of a file. The texels are then coded against *those* numbers, from the data themselves, so
//! that coefficients make up for rounding of the atoms as far as they can, and the error is known before
//! anything is decoded. [`shapes`] chooses the sizes of dictionaries and lists; [`encoder`] is all of it
//! behind the trait of encoders.

#[cfg(feature = "cli")]
mod arguments;
mod coder;
pub mod encoder;
pub mod fit;
pub mod integers;
mod lists;
pub mod options;
mod ranges;
pub mod shapes;

pub use coder::{encode, encode_fit};
pub use options::{Encoded, Options};
pub use shapes::ShapeSearch;

#[cfg(test)]
mod tests {
    use super::fit::{Shape, Training};
    use super::{Options, encode};
    use crate::data::dataset::{Dataset, Description, Sample};
    use crate::data::transfer::Domain;
    use crate::encode::goal::Target;
    use crate::math::pca::pca;
    use crate::measure::baseline::tests::small;
    use crate::measure::compare::compare;
    use crate::measure::radiance::AtLevel;
    use selvedge::Limits;

    fn options(target: Target) -> Options {
        let shape = Shape { light_atoms: 5, abrdf_atoms: 7, entries: 3, coefficients: 4 };
        Options { shape, target, value_bits: None, training: Training { iterations: 4, rounds: 2, seed: 1 } }
    }

    /// Decoded against the data, in the domain that was coded.
    fn decoded(data: &Dataset, bytes: &[u8], domain: Domain) -> f64 {
        let file = selvedge::open(bytes, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"));
        let metrics = compare(
            data,
            &AtLevel::finest(&file),
            data.description(),
            data.statistics().log_offset(),
            None,
            &|_, _| (),
        )
        .expect("compared");
        if domain == Domain::Log { metrics.log_rms } else { metrics.linear_rms }
    }

    #[test]
    fn what_is_predicted_is_decoded_and_goals_are_met() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [21, 12]);
        for domain in [Domain::Log, Domain::Linear] {
            let components = pca(&data, domain, 12).expect("made");
            let all = encode(&components, &[], &options(Target::AsGiven), |_, _, _| ()).expect("encoded");
            let found = decoded(&data, &all.bytes, domain);
            // Below the prediction where what would be negative is decoded as zero.
            let lowest = if domain == Domain::Log { 0.97 } else { 0.85 };
            assert!(
                (lowest..1.03).contains(&(found / all.predicted_rms)),
                "{domain:?}: {found} {}",
                all.predicted_rms
            );
            assert!(
                found < 0.5 * components.predicted_rms(0),
                "{domain:?}: {found} {}",
                components.predicted_rms(0)
            );
            let size = all.bytes.len() as u64 - 100;
            let smaller =
                encode(&components, &[], &options(Target::Bytes(size)), |_, _, _| ()).expect("encoded");
            assert!(smaller.bytes.len() as u64 <= size && smaller.predicted_rms >= all.predicted_rms * 0.99);
            let rms = all.predicted_rms * 1.2;
            let looser = encode(&components, &[], &options(Target::Rms(rms)), |_, _, _| ()).expect("encoded");
            assert!(looser.predicted_rms <= rms && looser.bytes.len() <= all.bytes.len());
            assert!(encode(&components, &[], &options(Target::Rms(rms * 1e-3)), |_, _, _| ()).is_err());
            assert!(encode(&components, &[], &options(Target::Bytes(500)), |_, _, _| ()).is_err());
        }
    }

    /// Name, texels, directions of light and view, and the value of a texel's number.
    type Case = (&'static str, [usize; 2], usize, usize, fn(usize, usize) -> f32);

    /// Materials at the ends of what data can be: each encodes, opens, and is decoded to what was predicted.
    #[test]
    fn odd_data_are_encoded() {
        let folder = tempfile::tempdir().expect("a folder");
        let grid = crate::data::directions::grid(81).expect("known");
        let cases: [Case; 9] = [
            ("one texel", [1, 1], 9, 6, |_, i| 0.5 + (i % 7) as f32 * 0.1),
            ("one direction", [5, 4], 1, 1, |t, i| 0.5 + ((t * 3 + i) % 5) as f32 * 0.1),
            ("one number", [1, 1], 1, 1, |_, _| 0.25),
            ("black", [6, 5], 9, 6, |_, _| 0.0),
            ("constant", [6, 5], 9, 6, |_, _| 0.75),
            ("rank one", [6, 5], 9, 6, |t, i| (1.0 + t as f32 * 0.1) * (0.2 + (i % 11) as f32 * 0.05)),
            ("zeros", [6, 5], 9, 6, |t, i| if (t + i) % 3 == 0 { 0.0 } else { 0.4 }),
            ("a highlight a million times the rest", [6, 5], 9, 6, |t, i| {
                if t == 7 && i / 3 == 11 { 600.0 } else { 0.0006 + (i % 5) as f32 * 1e-5 }
            }),
            ("very small", [6, 5], 9, 6, |t, i| 1e-15 * (1.0 + ((t + i) % 4) as f32)),
        ];
        for (name, size, lights, views, value) in cases {
            let path = folder.path().join("odd.selvset");
            let description = Description {
                size,
                lights: grid[..lights].to_vec(),
                views: grid[..views].to_vec(),
                sample: Sample::Float,
                ..Description::default()
            };
            let data = Dataset::from_fn(&path, description, value).expect("written");
            for domain in [Domain::Log, Domain::Linear] {
                let components = pca(&data, domain, 8).expect("made");
                let encoded = encode(&components, &[], &options(Target::AsGiven), |_, _, _| ())
                    .unwrap_or_else(|error| panic!("{name} {domain:?}: {error}"));
                let found = decoded(&data, &encoded.bytes, domain);
                // A unit of the last place of a channel, which is a millionth of its range, may be lost on
                // the way.
                let range = if domain == Domain::Log { 20.0 } else { data.statistics().largest as f64 };
                assert!(
                    found <= encoded.predicted_rms * 1.05 + range * 2e-4,
                    "{name} {domain:?}: {found} {}",
                    encoded.predicted_rms
                );
                println!("{name}, {domain:?}: {found:.3e}, predicted {:.3e}", encoded.predicted_rms);
            }
        }
    }

    #[test]
    fn bytes_do_not_depend_on_threads() {
        let folder = tempfile::tempdir().expect("a folder");
        let data = small(folder.path(), [9, 7]);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                encode(
                    &pca(&data, Domain::Linear, 8).expect("made"),
                    &[],
                    &options(Target::AsGiven),
                    |_, _, _| (),
                )
                .expect("encoded")
                .bytes
            })
        };
        assert!(with(1) == with(2) && with(1) == with(3));
    }
}
