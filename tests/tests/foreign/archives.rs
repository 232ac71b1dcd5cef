//! Folders and archives of images: UBO2003, ATRIUM and UTIA.

use super::{QUIET, jpeg, pictures, small, values};
use selvedge_tests::foreign::{radiance, zip};
use selvedge_tools::data::dataset::{Dataset, Description, Sample, Writer};
use selvedge_tools::data::directions::from_degrees;
use selvedge_tools::foreign::images::{self, ImageSet};
use selvedge_tools::foreign::pixels::{self, Colours};
use selvedge_tools::foreign::{ImportOptions, Kind, detect, info, ubo};

#[test]
fn an_archive_as_ubo2003_comes_back_within_its_jpegs() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    // Smooth pictures, some values above 1.
    let smooth = |n: usize| 0.6 + 0.5 * ((n / 18 % 16) as f32 * 0.2).sin() * ((n / 288) as f32 * 0.15).cos();
    let dataset = small(&at("a"), Sample::Float, [16, 12], smooth);
    let options = ubo::Options { quality: 100, exposure: 1.0, memory: 5000 };
    let exported = ubo::export(&dataset, &at("a.zip"), &options, QUIET).expect("exported");
    let clipped = values(&dataset).iter().filter(|v| **v > 1.0).count() as u64;
    assert!(clipped > 0 && exported == ubo::Exported { clipped, moved: (0, 0.0) }, "{exported:?}");
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
fn archives_of_ubo2003_are_read() {
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
}

#[test]
fn archives_of_atrium_are_read() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    // RGBE, rows from the bottom whatever the resolution line says; 2^(129 - 128) * 128 / 256 = 1.
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
