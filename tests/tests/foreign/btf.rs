//! The containers of Bonn: every variant is read as an independent writer meant it, and exports come back.

use super::{QUIET, small, values};
use selvedge_tests::foreign::{LIGHTS, VIEWS, Written, btf_variants};
use selvedge_tools::data::dataset::{Dataset, Description, Sample, Writer};
use selvedge_tools::data::directions::grid;
use selvedge_tools::foreign::btf::{Btf, write};
use selvedge_tools::foreign::bytes::Bytes;
use selvedge_tools::foreign::{ImportOptions, Kind, detect, import_btf};
use std::path::Path;

fn read(written: &Written) -> Btf {
    Btf::read(Bytes::from_memory(Path::new("a.btf"), written.bytes.clone()))
        .unwrap_or_else(|error| panic!("{}: {error}", written.name))
}

#[test]
fn every_variant_of_btf_is_read_as_it_was_written() {
    let variants = btf_variants();
    let mut worst = 0.0f64;
    for written in &variants {
        let btf = read(written);
        let [width, height, lights, views] = written.shape;
        let head = btf.head();
        assert_eq!(
            (head.size, head.lights.len(), head.views.len()),
            ([width, height], lights, views),
            "{}",
            written.name
        );
        assert_eq!(head.unread, 0, "{}", written.name);
        for (found, angles) in head.lights.iter().zip(LIGHTS).chain(head.views.iter().zip(VIEWS)) {
            let [polar, azimuth] = angles.map(f64::from);
            let expected = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
            assert!(
                found.to_array().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
                "{}: {found} for {expected:?}",
                written.name
            );
        }
        // Whole, and texel by texel: runs begin and end anywhere.
        let mut all = vec![0.0; written.expected.len() * 3];
        btf.texels(0, width * height, &mut all).expect("decoded");
        let mut single = vec![0.0; btf.texel_len()];
        for texel in 0..width * height {
            btf.texels(texel, 1, &mut single).expect("decoded");
            for (i, (&found, expected)) in
                single.iter().zip(written.expected[texel * lights * views..].as_flattened()).enumerate()
            {
                let (in_all, error) = (all[texel * single.len() + i], (f64::from(found) - expected).abs());
                assert!(
                    (in_all - found).abs() as f64 <= 2.0 * written.tolerance,
                    "{}: texel {texel}, number {i}",
                    written.name
                );
                assert!(
                    error <= written.tolerance,
                    "{}: texel {texel}, number {i}: {found} for {expected}",
                    written.name
                );
                worst = worst.max(error);
            }
        }
    }
    println!("{} variants, largest error {worst:.1e}", variants.len());
    assert!(variants.len() >= 60);
}

#[test]
fn heads_say_what_stands_in_them() {
    let of = |name: &str| {
        btf_variants()
            .into_iter()
            .find(|written| written.name.contains(name))
            .unwrap_or_else(|| panic!("{name}"))
    };
    let rotated = read(&of("model 11, 2 bytes, version 4"));
    let head = rotated.head();
    assert_eq!(
        (head.rotations, head.rotated, head.cosine_included, head.version),
        (6, 1, Some(true), Some(4))
    );
    assert_eq!(
        (head.setup.as_str(), head.sensor.as_str(), head.light_source.as_str(), head.pixels_per_mm),
        ("Dome 1", "sensor", "lamp", 10.0)
    );
    assert!(head.layout.contains("4 + 3 + 2 components, binary16, colour model 11"), "{}", head.layout);
    assert_eq!(rotated.description().texel_nm, [100_000; 2]);
    assert_eq!(read(&of("version 1")).head().cosine_included, None);
    let heights = read(&of("extension 2, log true, heights true"));
    assert_eq!(heights.head().height_map, Some([2, 2]));
    assert_eq!(heights.height_map().expect("there"), [0.25, 0.5, 0.75, 1.0]);
    let masked = read(&of("compression 2, 2 lines"));
    assert!(masked.head().layout.contains("2 texels masked out and absent"), "{}", masked.head().layout);
}

#[test]
fn a_btf_becomes_a_dataset_and_is_told_what_was_cut() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    for written in btf_variants() {
        std::fs::write(at("a.btf"), &written.bytes).expect("written");
        assert_eq!(detect(&at("a.btf")).expect("known"), Kind::Btf);
        let btf = Btf::open(&at("a.btf")).expect("opened");
        let options = ImportOptions { sample: Sample::Float, ..ImportOptions::default() };
        let imported = import_btf(&btf, &at("a.selvset"), &options, QUIET).expect("imported");
        let dataset = Dataset::open(&at("a.selvset")).expect("opened");
        let negative = written.expected.as_flattened().iter().filter(|&&v| v < 0.0).count();
        let said = imported
            .notes
            .iter()
            .any(|note| note.starts_with(&format!("{negative} of ")) && note.contains("negative"));
        // Where a value is as near to zero as binary32 is to it, either count is right.
        let is_clear =
            written.expected.as_flattened().iter().all(|v| *v == 0.0 || v.abs() > written.tolerance);
        assert!(!is_clear || said == (negative > 0), "{}: {negative}, {:?}", written.name, imported.notes);
        let mut values = vec![0.0; written.expected.len() * 3];
        dataset.read(0, dataset.description().texels(), &mut Vec::new(), &mut values).expect("read");
        for (found, expected) in values.iter().zip(written.expected.as_flattened()) {
            assert!((f64::from(*found) - expected.max(0.0)).abs() <= written.tolerance, "{}", written.name);
        }
    }
}

#[test]
fn variants_that_are_not_read_are_named() {
    let of = |name: &str| {
        btf_variants()
            .into_iter()
            .find(|written| written.name.contains(name))
            .unwrap_or_else(|| panic!("{name}"))
            .bytes
    };
    let said = |bytes: Vec<u8>| {
        Btf::read(Bytes::from_memory(Path::new("a.btf"), bytes)).expect_err("refused").to_string()
    };
    let with = |mut bytes: Vec<u8>, at: usize, new: &[u8]| {
        bytes[at..at + new.len()].copy_from_slice(new);
        bytes
    };
    let dfmf = of("model 0, 4 bytes, version 4, 3");
    // Behind the signature: meta block, directions, size, rotations, largest number of components.
    let model_at = |bytes: &[u8]| {
        10 + u32::from_le_bytes(bytes[10..14].try_into().expect("four")) as usize
            + 4
            + 2 * (12 + 24)
            + 8
            + 4
            + 6 * 36
            + 4
    };
    for (model, words) in [
        (2u32, "Lab"),
        (5, "spectral"),
        (6, "spectral"),
        (7, "not known"),
        (13, "not known"),
        (u32::MAX, "-1"),
    ] {
        let said = said(with(dfmf.clone(), model_at(&dfmf), &model.to_le_bytes()));
        assert!(said.contains(words) && said.contains(&format!("byte {}", model_at(&dfmf))), "{said}");
    }
    assert!(said(with(dfmf.clone(), 0, b"!DFMF09XYZ")).contains("!DFMF09XYZ"));
    assert!(said(with(dfmf.clone(), 14, &9u32.to_le_bytes())).contains("version 9"));
    assert!(said(with(dfmf.clone(), 10, &9u32.to_le_bytes())).contains("meta block of 9 bytes"));
    let bdi = of("BDIF06R2!, compression 0, 1 lines, 3");
    let at =
        10 + u32::from_le_bytes(bdi[10..14].try_into().expect("four")) as usize + 4 + 2 * (12 + 24) + 8 + 4;
    assert!(said(with(bdi.clone(), at, &[1])).contains("bzip2"));
    assert!(said(with(bdi, at, &[3])).contains("compression 3"));
    let fmf = of("FMF12FCER, extension 0");
    let at = 10
        + u32::from_le_bytes(fmf[10..14].try_into().expect("four")) as usize
        + 4
        + 2 * (12 + 24)
        + 8
        + 4
        + 6 * 36;
    assert!(said(with(fmf, at, &[3])).contains("version 3 of the extension"));
    // Three channels that are no colours; names are behind version 4's counts.
    let names = dfmf.windows(15).position(|w| w == b"\x01\0\0\0R\x01\0\0\0G\x01\0\0\0B").expect("the names");
    let said = said(with(dfmf.clone(), names + 4, b"X"));
    assert!(said.contains("X, G, B"), "{said}");
}

#[test]
fn an_export_to_btf_comes_back() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    let dataset = small(&at("a"), Sample::Float, [5, 4], |n| 0.3 + ((n * 7919) % 997) as f32 / 1000.0);
    // 18 numbers of a texel: the mean and 17 others are all there is, in any order of rounding 18.
    let left = write::export(&dataset, &at("a.btf"), 19).expect("exported");
    let btf = Btf::open(&at("a.btf")).expect("opened");
    assert_eq!(
        (btf.head().signature, btf.head().unread, btf.head().cosine_included),
        ("!FMF06FC", 0, Some(true))
    );
    import_btf(&btf, &at("b"), &ImportOptions { sample: Sample::Float, ..ImportOptions::default() }, QUIET)
        .expect("imported");
    let back = Dataset::open(&at("b")).expect("opened");
    assert!(left < 1e-6, "{left}");
    assert!(values(&dataset).iter().zip(values(&back)).all(|(a, b)| (a - b).abs() < 2e-6));
    let (a, b) = (dataset.description(), back.description());
    assert_eq!((a.size, b.texel_nm, b.cosine_included), (b.size, [70_000; 2], true));
    assert!(
        a.lights
            .iter()
            .chain(&a.views)
            .zip(b.lights.iter().chain(&b.views))
            .all(|(a, b)| (*a - *b).length() < 1e-6)
    );
    // Fewer components leave what they say.
    let left = write::export(&dataset, &at("c.btf"), 6).expect("exported");
    import_btf(
        &Btf::open(&at("c.btf")).expect("opened"),
        &at("c"),
        &ImportOptions { sample: Sample::Float, ..ImportOptions::default() },
        QUIET,
    )
    .expect("imported");
    let back = values(&Dataset::open(&at("c")).expect("opened"));
    let rms = (values(&dataset).iter().zip(&back).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        / back.len() as f64)
        .sqrt();
    assert!((rms - left).abs() < 0.02 * left, "{rms} for {left}");
    assert!(write::export(&dataset, &at("d.btf"), 1).is_err());
}

#[test]
fn known_grids_come_back_with_their_bits() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    let grid = grid(151).expect("known");
    let description = Description {
        size: [2, 1],
        lights: grid.clone(),
        views: grid[..1].to_vec(),
        sample: Sample::Float,
        ..Description::default()
    };
    let writer = Writer::create(&at("a"), description).expect("created");
    (0..2).for_each(|texel| writer.put(texel, 0, &[0.5; 453]).expect("put"));
    writer.finish().expect("finished");
    write::export(&Dataset::open(&at("a")).expect("opened"), &at("a.btf"), 2).expect("exported");
    assert_eq!(Btf::open(&at("a.btf")).expect("opened").description().lights, grid);
}
