//! Third-party formats: every variant is read as an independent writer meant it, exports come back, and
//! nothing that is damaged does harm.

mod archives;
mod btf;
mod program;

use selvedge_tests::foreign::{btf_variants, radiance, zip};
use selvedge_tests::targets::{archive, btf, image_pixels};
use selvedge_tools::data::dataset::{Dataset, Description, Sample};
use selvedge_tools::data::directions::from_degrees;
use std::path::Path;

const QUIET: &(dyn Fn(usize, usize) + Sync) = &|_, _| {};

/// Directions that have whole degrees.
fn small(path: &Path, sample: Sample, size: [usize; 2], value: impl Fn(usize) -> f32) -> Dataset {
    let lights = vec![from_degrees(0.0, 0.0), from_degrees(30.0, 60.0), from_degrees(60.0, 342.0)];
    let views = vec![from_degrees(15.0, 120.0), from_degrees(75.0, 0.0)];
    let texts = ["Linen".into(), "measured".into(), "CC0".into()];
    let description =
        Description { size, lights, views, sample, cosine_included: true, texel_nm: [70_000; 2], texts };
    let length = description.texel_len();
    Dataset::from_fn(path, description, |texel, i| value(texel * length + i)).expect("written")
}

fn values(dataset: &Dataset) -> Vec<f32> {
    let mut values = vec![0.0; dataset.description().texels() * dataset.description().texel_len()];
    dataset.read(0, dataset.description().texels(), &mut Vec::new(), &mut values).expect("read");
    values
}

/// Every byte of a zip's stored files is as it should be for one picture and two lights.
fn pictures(names: [&str; 2], bytes: [&[u8]; 2]) -> Vec<u8> {
    zip(&[
        ("readme.txt", b"hello"),
        (names[0], bytes[0]),
        ("__MACOSX/._x.jpg", b"no image"),
        (names[1], bytes[1]),
    ])
}

fn jpeg(size: [u32; 2], colour: [u8; 3]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<u8> = (0..size[0] * size[1]).flat_map(|_| colour).collect();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100)
        .encode(&pixels, size[0], size[1], image::ExtendedColorType::Rgb8)
        .expect("encoded");
    bytes
}

#[test]
fn damaged_third_party_files_do_no_harm() {
    // Small ones, whole, cut at every byte and with every byte changed.
    let small = btf_variants();
    let pick = |name: &str| {
        small
            .iter()
            .find(|written| written.name.contains(name))
            .unwrap_or_else(|| panic!("{name}"))
            .bytes
            .clone()
    };
    let names = [
        "model 11, 2 bytes",
        "extension 2, log true, heights true",
        "FMF06FC, 4",
        "PVF06FC, 2 bytes",
        "older layout",
        "compression 0, 2",
        "compression 2, 2",
    ];
    let mut count = 0u64;
    let mut all = |good: &[u8], run: fn(&[u8])| {
        for at in 0..good.len() {
            run(&good[..at]);
            for mask in [0x01, 0x80, 0xff] {
                let mut bad = good.to_vec();
                bad[at] ^= mask;
                run(&bad);
            }
            count += 4;
        }
    };
    names.iter().for_each(|name| all(&pick(name), btf));
    let rows = [[128, 7, 0, 129]; 16];
    let (jpeg, hdr) = (jpeg([8, 4], [10, 200, 30]), radiance("EXPOSURE=2\n", "+X 4 -Y 4", &rows));
    all(&pictures(["tl000 pl000 tv000 pv000.jpg", "tl015 pl000 tv000 pv000.jpg"], [&jpeg, &jpeg]), archive);
    all(&jpeg, image_pixels);
    all(&hdr, image_pixels);
    println!("{count} damaged files");
    assert!(count > 20_000);
}
