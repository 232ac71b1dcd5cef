//! Formats of others: every variant is read as an independent writer meant it, exports come back, and nothing
//! that is damaged does harm.

use selvedge_tests::foreign::{LIGHTS, VIEWS, Written, btf_variants, radiance, zip};
use selvedge_tests::program;
use selvedge_tests::targets::{archive, btf, image_pixels};
use selvedge_tools::data::dataset::{Dataset, Description, Sample, Writer};
use selvedge_tools::data::directions::{from_degrees, grid};
use selvedge_tools::foreign::btf::{Btf, write};
use selvedge_tools::foreign::bytes::Bytes;
use selvedge_tools::foreign::images::{self, ImageSet};
use selvedge_tools::foreign::pixels::{self, Colours};
use selvedge_tools::foreign::{ImportOptions, Kind, detect, import_btf, info, ubo};
use std::path::Path;
use std::process::Command;

const QUIET: &(dyn Fn(usize, usize) + Sync) = &|_, _| {};

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

#[test]
fn an_archive_as_ubo2003_comes_back_within_its_jpegs() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    // Smooth pictures, some values above 1.
    let smooth = |n: usize| 0.6 + 0.5 * ((n / 18 % 16) as f32 * 0.2).sin() * ((n / 288) as f32 * 0.15).cos();
    let dataset = small(&at("a"), Sample::Float, [16, 12], smooth);
    let options = ubo::Options { quality: 100, exposure: 1.0, memory: 5000 };
    let exported = ubo::export(&dataset, &at("a.zip"), &options, QUIET).expect("exported");
    let cut = values(&dataset).iter().filter(|v| **v > 1.0).count() as u64;
    assert!(cut > 0 && exported == ubo::Exported { cut, moved: (0, 0.0) }, "{exported:?}");
    assert_eq!(detect(&at("a.zip")).expect("known"), Kind::Zip);
    images::import(
        &at("a.zip"),
        &at("b"),
        &ImportOptions { sample: Sample::Float, ..ImportOptions::default() },
        QUIET,
    )
    .expect("imported");
    let back = Dataset::open(&at("b")).expect("opened");
    let angles = |set: &[glam::DVec3]| {
        set.iter()
            .map(|d| d.to_array().map(|n| (n * 1e9).round() as i64))
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(angles(&back.description().lights), angles(&dataset.description().lights));
    // The same directions in their sorted order, which is the order here.
    let worst =
        values(&dataset).iter().zip(values(&back)).map(|(a, b)| (a.min(1.0) - b).abs()).fold(0.0, f32::max);
    assert!(worst < 0.03, "{worst}");
    // Directions between whole degrees move, and say so; two at one are refused.
    let odd = |polar: f64| {
        let description = Description {
            size: [1, 1],
            lights: vec![from_degrees(23.5, 0.0), from_degrees(polar, 0.0)],
            views: vec![glam::DVec3::Z],
            ..Description::default()
        };
        let writer = Writer::create(&at("o"), description).expect("created");
        writer.put(0, 0, &[0.5; 6]).expect("put");
        writer.finish().expect("finished");
        ubo::export(&Dataset::open(&at("o")).expect("opened"), &at("o.zip"), &options, QUIET)
    };
    let moved = odd(40.0).expect("exported").moved;
    assert!(moved.0 == 1 && (moved.1 - 0.5).abs() < 1e-3, "{moved:?}");
    assert!(odd(24.2).expect_err("refused").to_string().contains("24 and 0 whole degrees"));
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
fn jpegs_are_read_whole_or_not_at_all() {
    let open = |bytes: &[u8]| pixels::open(Box::new(std::io::Cursor::new(bytes.to_vec())), 1 << 20);
    let pixels_of = |bytes: &[u8]| open(bytes).and_then(|opened| opened.pixels(Colours::Auto));
    let grey: Vec<u8> = (0..64 * 48).map(|i| (i * 5 / 64) as u8).collect();
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95)
        .encode(&grey, 64, 48, image::ExtendedColorType::L8)
        .expect("encoded");
    let opened = open(&bytes).expect("opened");
    assert_eq!(opened.size, [64, 48]);
    for (pixel, &expected) in opened.pixels(Colours::Auto).expect("decoded").iter().zip(&grey) {
        let found = pixels::to_srgb(pixel[0]) * 255.0;
        assert!(
            pixel[0] == pixel[1] && pixel[0] == pixel[2] && (found - f64::from(expected)).abs() <= 4.0,
            "{found} for {expected}"
        );
    }
    // A lenient reader would fill what is missing with grey.
    let colour = jpeg([64, 48], [10, 200, 90]);
    for good in [&bytes, &colour] {
        let whole = pixels_of(good).expect("decoded");
        let cuts: Vec<usize> = (2..good.len())
            .filter(|&cut| pixels_of(&good[..cut]).is_ok_and(|pixels| pixels != whole))
            .collect();
        assert!(cuts.is_empty(), "{cuts:?} of {}", good.len());
        // The last bytes may be filling bits and the mark of the end.
        assert!((2..good.len() - 4).all(|cut| pixels_of(&good[..cut]).is_err()));
    }
}

#[test]
fn archives_of_ubo2003_and_atrium_are_read() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    let names = [
        "UBO_X/tv030_pv030/00008 tl000 pl000 tv030 pv030.jpg",
        "UBO_X/tv030_pv030/00008 tl015 pl060 tv030 pv030.JPG",
    ];
    std::fs::write(
        at("a.bin"),
        pictures(names, [&jpeg([8, 4], [188, 188, 188]), &jpeg([8, 4], [255, 255, 255])]),
    )
    .expect("written");
    assert_eq!(detect(&at("a.bin")).expect("known"), Kind::Zip);
    images::import(&at("a.bin"), &at("a"), &ImportOptions::default(), QUIET).expect("imported");
    let dataset = Dataset::open(&at("a")).expect("opened");
    assert_eq!(
        (dataset.description().size, dataset.description().lights.len(), dataset.description().views.len()),
        ([8, 4], 2, 1)
    );
    // sRGB 188 is 0.5029 in linear light (IEC 61966-2-1).
    assert!(
        (dataset.image(0, 0).expect("read")[0][0] - 0.5029).abs() < 0.006,
        "{:?}",
        dataset.image(0, 0).expect("read")[0]
    );
    assert!((dataset.image(1, 0).expect("read")[0][0] - 1.0).abs() < 0.006);
    let told = info(&at("a.bin"), Kind::Zip, 1 << 20).expect("told");
    assert_eq!((told.size, told.directions), ([8, 4], [2, 1]));

    // ATRIUM: RGBE, rows from the bottom whatever the resolution line says; 2^(129 - 128) * 128 / 256 = 1.
    let rows: Vec<[u8; 4]> =
        (0..4).flat_map(|y| (0..4).map(move |x| [128, 64 * (y == 0) as u8, x * 32, 129])).collect();
    let picture = radiance("", "+X 4 -Y 4", &rows);
    let names = ["tl000 pl000 tv000 pv000.hdr", "tl015 pl000 tv000 pv000.hdr"];
    std::fs::write(
        at("h.zip"),
        pictures(names, [&picture, &radiance("EXPOSURE=2\nEXPOSURE=2\n", "-Y 4 +X 4", &rows)]),
    )
    .expect("written");
    images::import(&at("h.zip"), &at("h"), &ImportOptions::default(), QUIET).expect("imported");
    let dataset = Dataset::open(&at("h")).expect("opened");
    let image = dataset.image(0, 0).expect("read");
    // A value is (mantissa + 1/2 or 0) / 256 times the power; both are in use, half a step apart.
    let near = |a: f32, b: f32| (a - b).abs() <= 1.0 / 128.0;
    assert!(
        near(image[0][0], 1.0)
            && near(image[0][1], 0.0)
            && near(image[12][1], 0.5)
            && near(image[3][2], 0.75),
        "{image:?}"
    );
    let image = dataset.image(1, 0).expect("read");
    assert!(near(image[0][0], 0.25) && near(image[0][1], 0.125) && near(image[12][1], 0.0), "{image:?}");
    for header in [
        "COLORCORR=1 1 2\n",
        "EXPOSURE=1e30\nEXPOSURE=1e30\n",
        "EXPOSURE=1e-30\nEXPOSURE=1e-30\n",
        "EXPOSURE=-1\n",
    ] {
        let said =
            pixels::open(Box::new(std::io::Cursor::new(radiance(header, "-Y 4 +X 4", &rows))), 1 << 20)
                .err()
                .expect("refused");
        assert!(said.contains("COLORCORR") || said.contains("exposure"), "{said}");
    }
    for (resolution, is_read) in [
        ("+Y 4 +X 4", true),
        ("-X 4 +Y 4", false),
        ("+X 2 -Y 8", false),
        ("-Y 4", false),
        ("-Y four +X 4", false),
    ] {
        let opened = pixels::open(Box::new(std::io::Cursor::new(radiance("", resolution, &rows))), 1 << 20);
        assert_eq!(opened.is_ok(), is_read, "{resolution}");
        if let Err(what) = opened {
            assert!(what.contains(resolution), "{what}");
        }
    }
}

#[test]
fn archives_refuse_what_is_there_twice_damaged_or_too_large() {
    let place = tempfile::tempdir().expect("a folder");
    let at = place.path().join("a.zip");
    let said = |bytes: Vec<u8>, memory: usize| {
        std::fs::write(&at, bytes).expect("written");
        let options = ImportOptions { memory, ..ImportOptions::default() };
        let error =
            images::import(&at, &place.path().join("out"), &options, QUIET).expect_err("refused").to_string();
        assert!(!place.path().join("out").exists());
        error
    };
    let picture = jpeg([8, 4], [1, 2, 3]);
    let [a, b] = ["x/tl000 pl000 tv030 pv030.jpg", "y/tl000 pl000 tv030 pv030.jpg"];
    let twice = said(pictures([a, b], [&picture, &picture]), 1 << 20);
    assert!(twice.contains("same pair") && twice.contains("x/tl000"), "{twice}");
    assert!(
        said(
            pictures([a, "x/tl015 pl000 tv030 pv030.jpg"], [&picture, &picture[..picture.len() / 2]]),
            1 << 20
        )
        .contains("tl015")
    );
    assert!(
        said(pictures([a, "x/tl015 pl000 tv030 pv030.jpg"], [&picture, b"no image at all"]), 1 << 20)
            .contains("no image")
    );
    assert!(said(pictures([a, "x/preview.jpg"], [&picture, &picture]), 1 << 20).contains("preview.jpg"));
    assert!(
        said(pictures([a, "x/tl015 pl000 tv030 pv030.jpg"], [&jpeg([300, 300], [9; 3]), &picture]), 100)
            .contains("--memory")
    );
    assert!(said(zip(&[("readme.txt", b"hello")]), 1 << 20).contains("no images"));
    assert!(said(b"PK\x05\x06".to_vec(), 1 << 20).contains("a.zip"));
}

#[test]
fn folders_of_utia_are_read() {
    use exr::prelude::*;
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path().join("fabric01");
    for (view, name) in ["tv000_pv000", "tv015_pv060"].into_iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).expect("made");
        for light in [0, 30] {
            let path = folder.join(name).join(format!("tl{light:03}_pl000_{name}.exr"));
            // The white of D65, and the second picture a green that sRGB does not have.
            let xyz = if light == 0 { [0.95047f32, 1.0, 1.08883] } else { [0.2, 0.7, 0.1] };
            let pixel = move |_: Vec2<usize>| {
                (
                    f16::from_f32(xyz[0] * (view + 1) as f32),
                    f16::from_f32(xyz[1] * (view + 1) as f32),
                    f16::from_f32(xyz[2] * (view + 1) as f32),
                )
            };
            let channels = SpecificChannels::build()
                .with_channel::<f16>("X")
                .with_channel::<f16>("Y")
                .with_channel::<f16>("Z")
                .with_pixel_fn(pixel);
            Image::from_channels((3, 2), channels).write().to_file(&path).expect("written");
        }
    }
    let output = place.path().join("a");
    let imported = images::import(&folder, &output, &ImportOptions::default(), QUIET).expect("imported");
    assert!(imported.notes.len() == 1 && imported.notes[0].starts_with("24 values"), "{:?}", imported.notes);
    let dataset = Dataset::open(&output).expect("opened");
    for view in 0..2 {
        let white = dataset.image(0, view).expect("read")[0];
        assert!(white.iter().all(|v| (v - (view + 1) as f32).abs() < 2e-3), "{white:?}");
        let green = dataset.image(1, view).expect("read")[0];
        // 0.2, 0.7, 0.1 by the inverse of the sRGB matrix: -0.4778, 1.1235, -0.0260.
        assert!(
            green[0] == 0.0 && (green[1] - 1.1235 * (view + 1) as f32).abs() < 2e-3 && green[2] == 0.0,
            "{green:?}"
        );
    }
    // Taken as RGB, they are what they are.
    images::import(
        &folder,
        &output,
        &ImportOptions { colours: Colours::Rgb, ..ImportOptions::default() },
        QUIET,
    )
    .expect("imported");
    assert!(
        (Dataset::open(&output).expect("opened").image(0, 0).expect("read")[0][2] - 1.08883).abs() < 1e-3
    );
    // The names of the Bonn spectral sets have the view first.
    let set = ImageSet::open(&folder, 1 << 20).expect("opened");
    assert_eq!(set.description().views.len(), 2);
    std::fs::rename(
        folder.join("tv015_pv060/tl030_pl000_tv015_pv060.exr"),
        folder.join("tv015_pv060/tv15.0_pv60.00_tl30.0_pl0.0.exr"),
    )
    .expect("renamed");
    images::import(&folder, &output, &ImportOptions::default(), QUIET).expect("imported");
}

#[test]
fn damaged_files_of_others_do_no_harm() {
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

fn run(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let output = Command::new(program()).args(arguments).current_dir(folder).output().expect("run");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code().expect("a code"), text(output.stdout), text(output.stderr))
}

/// What a user does: a `.btf` in, `info` on all, a file, and out again in every format.
#[test]
fn the_program_brings_materials_in_and_out() {
    let place = tempfile::tempdir().expect("a folder");
    let here = place.path();
    let dataset =
        small(&here.join("a.selvset"), Sample::Half, [8, 8], |n| 0.2 + ((n * 31) % 64) as f32 / 128.0);
    drop(dataset);
    let good = |arguments: &[&str]| {
        let (code, out, error) = run(arguments, here);
        assert_eq!(code, 0, "{arguments:?}: {error}");
        (out, error)
    };
    assert!(good(&["info", "a.selvset"]).0.contains("Linen"));
    let told = good(&["export", "a.selvset", "-o", "a.btf", "--format", "btf", "--components", "19"]).1;
    assert!(told.contains("RMS"), "{told}");
    assert!(good(&["info", "a.btf"]).0.contains("FMF06FC"));
    let json: serde_json::Value = serde_json::from_str(&good(&["info", "a.btf", "--json"]).0).expect("JSON");
    assert_eq!((&json["kind"], &json["btf"]["signature"]), (&"btf".into(), &"!FMF06FC".into()));
    good(&["import", "a.btf", "-o", "b.selvset", "--licence", "CC0"]);
    good(&["compare", "a.selvset", "b.selvset", "--fail", "2e-3", "--warn", "2e-3"]);
    good(&["export", "b.selvset", "-o", "b.zip", "--format", "ubo2003", "--exposure", "0.5"]);
    assert!(good(&["info", "b.zip"]).0.contains("zip archive of images"));
    good(&["import", "b.zip", "-o", "c.selvset"]);
    good(&["encode", "b.selvset", "-o", "b.selv", "--coefficients", "32,16,16"]);
    good(&["validate", "b.selv"]);
    for (format, output) in [("exr", "d"), ("png", "e"), ("ubo2003", "d.zip"), ("btf", "d.btf")] {
        good(&["export", "b.selv", "-o", output, "--format", format]);
        assert!(good(&["info", output]).0.contains("3 light, 2 view"), "{format}");
        good(&["import", output, "-o", "f.selvset", "--float"]);
    }
    // A folder that was packed whole is read by its listing.
    let packed: Vec<(String, Vec<u8>)> = std::fs::read_dir(here.join("d"))
        .expect("read")
        .map(|entry| entry.expect("one"))
        .map(|entry| {
            (format!("d/{}", entry.file_name().to_string_lossy()), std::fs::read(entry.path()).expect("read"))
        })
        .collect();
    let files: Vec<(&str, &[u8])> =
        packed.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    std::fs::write(here.join("packed.zip"), zip(&files)).expect("written");
    good(&["import", "packed.zip", "-o", "packed.selvset", "--float"]);
    good(&["compare", "b.selv", "packed.selvset", "--fail", "1e-30", "--warn", "1e-30"]);
    assert!(good(&["info", "packed.selvset"]).0.contains("CC0"));
    // What came out of the file as EXR has the decoder's bits.
    good(&["import", "d", "-o", "f.selvset", "--float"]);
    good(&["compare", "b.selv", "f.selvset", "--fail", "1e-30", "--warn", "1e-30"]);
    let left: Vec<_> = std::fs::read_dir(here)
        .expect("read")
        .map(|entry| entry.expect("one").file_name())
        .filter(|name| name.to_string_lossy().starts_with(".selvedge"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
    // Refusals: what is no data, and what is there already.
    std::fs::write(here.join("x.btf"), "no btf").expect("written");
    for (arguments, words) in [
        (["info", "x.btf"].as_slice(), "neither"),
        (&["import", "x.btf", "-o", "y.selvset"], "neither"),
        (&["import", "b.selv", "-o", "y.selvset"], "already"),
        (&["import", "a.selvset", "-o", "y.selvset"], "already"),
        (&["import", "b.zip", "-o", "y.selvset", "--height-map", "h.exr"], "height-map"),
        (&["import", "a.btf", "-o", "y.selvset", "--height-map", "h.png"], ".exr"),
        (&["import", "a.btf", "-o", "y.selvset", "--memory", "9"], "--memory"),
        (&["import", "a.btf", "-o", "y.selvset", "--blocks", "2x2"], "--blocks"),
        (&["import", "a.btf", "-o", "y.selvset", "--name", "a\u{200b}"], "not seen"),
        (&["import", "a.btf", "-o", "d"], "folder"),
        (&["import", "a.btf", "-o", "a.btf"], "source"),
        (&["export", "b.selv", "-o", "g", "--format", "png", "--exposure", "2"], "--exposure"),
        (&["import", "a.btf", "-o", "y.selvset", "--height-map", "h.exr"], "no height map"),
    ] {
        let (code, _, error) = run(arguments, here);
        assert!(code != 0 && error.contains(words), "{arguments:?}: {error}");
    }
    assert!(!here.join("y.selvset").exists());
}
