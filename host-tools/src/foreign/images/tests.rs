//! Round trips, names, and what is refused.

use super::listing::LISTING;
use super::names::angles_of;
use super::read::import;
use super::write::{Format, export, to_exr, to_png, to_srgb16};
use crate::data::dataset::{Dataset, Description, Sample};
use crate::data::directions::{from_degrees, grid, to_degrees};
use crate::foreign::ImportOptions;
use crate::foreign::pixels::{self, Colours, from_srgb16};
use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage as _, f16};
use glam::DVec3;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

/// The pixels of an image on disk.
fn decode(path: &Path) -> std::result::Result<Vec<[f32; 3]>, String> {
    let stream = Box::new(BufReader::new(File::open(path).expect("there")));
    pixels::open(stream, 1 << 20)?.pixels(Colours::Auto)
}

const QUIET: &dyn Fn(usize, usize) = &|_, _| {};

fn options(sample: Sample) -> ImportOptions {
    ImportOptions { sample, memory: 1 << 20, ..ImportOptions::default() }
}

fn write_dataset(path: &Path, description: Description, value: impl Fn(usize) -> f32) -> Dataset {
    let length = description.texel_len();
    Dataset::from_fn(path, description, |texel, i| value(texel * length + i)).expect("written")
}

/// Lights and views that differ, of no grid, out of order, with angles that no decimals write.
fn odd(sample: Sample, size: [usize; 2]) -> Description {
    let lights = vec![from_degrees(23.5, 359.9), from_degrees(0.0, 0.0), from_degrees(61.234_567_891, 30.1)];
    let views = vec![DVec3::new(0.3, -0.2, 0.9).normalize(), from_degrees(0.1, 200.0)];
    let texts = ["Linen".into(), "measured".into(), "CC0".into()];
    Description { size, lights, views, sample, cosine_included: true, texel_nm: [70_000, 80_000], texts }
}

#[test]
fn exr_round_trips_have_the_same_bytes() {
    let place = tempfile::tempdir().expect("a folder");
    for sample in [Sample::Half, Sample::Float] {
        let grid = grid(81).expect("known");
        let some = Description {
            size: [3, 2],
            lights: grid[..9].to_vec(),
            views: grid[20..25].to_vec(),
            sample,
            ..Description::default()
        };
        let all = Description {
            size: [1, 1],
            views: grid.clone(),
            lights: grid[..1].to_vec(),
            sample,
            ..Description::default()
        };
        let single = Description {
            size: [4, 4],
            lights: grid[..1].to_vec(),
            views: grid[3..4].to_vec(),
            sample,
            ..Description::default()
        };
        for (i, description) in [odd(sample, [5, 3]), some, all, single].into_iter().enumerate() {
            for black in [false, true] {
                // One image at a time, some, and all.
                for memory in [0, 1000, 1 << 20] {
                    let name =
                        |what: &str| place.path().join(format!("{what}-{sample:?}-{i}-{black}-{memory}"));
                    let value = |n: usize| if black { 0.0 } else { (n % 1999) as f32 * 0.37 };
                    let half = |n: usize| f16::from_f32(value(n)).to_f32();
                    let dataset = write_dataset(&name("a"), description.clone(), half);
                    assert_eq!(
                        export(&dataset, &name("f"), Format::Exr, memory, QUIET).expect("exported"),
                        0
                    );
                    let statistics =
                        import(&name("f"), &name("b"), &ImportOptions { memory, ..options(sample) }, QUIET)
                            .expect("imported");
                    assert_eq!(&statistics.statistics, dataset.statistics());
                    assert!(
                        fs::read(name("a")).expect("read") == fs::read(name("b")).expect("read"),
                        "{:?}",
                        name("b")
                    );
                }
            }
        }
    }
}

#[test]
fn png_round_trips_within_its_steps_and_counts_what_it_clamps() {
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    let dataset = write_dataset(&at("a"), odd(Sample::Float, [7, 5]), |n| n as f32 / 600.0);
    let clamped = export(&dataset, &at("f"), Format::Png, 5000, QUIET).expect("exported");
    assert_eq!(clamped, 7 * 5 * 18 - 601);
    import(&at("f"), &at("b"), &options(Sample::Float), QUIET).expect("imported");
    let back = Dataset::open(&at("b")).expect("opened");
    assert_eq!(back.description(), dataset.description());
    let mut values = [0.0; 7 * 5 * 18];
    back.read(0, 35, &mut Vec::new(), &mut values).expect("read");
    assert!(values.iter().enumerate().all(|(n, v)| (v - (n as f32 / 600.0).min(1.0)).abs() <= 2e-5));
    assert!((0..=u16::MAX).all(|n| to_srgb16(from_srgb16(n)) == n));
    let again = export(&dataset, &at("f"), Format::Png, 5000, QUIET).expect_err("refused").to_string();
    assert!(again.contains("dataset.json"), "{again}");
}

fn exr(path: &Path, size: [usize; 2], value: impl Fn(usize, usize) -> f32 + Sync) {
    fs::write(path, to_exr(size, Sample::Float, value).expect("encoded")).expect("written");
}

#[test]
fn names_decide_and_known_grids_are_found() {
    let place = tempfile::tempdir().expect("a folder");
    let known = grid(81).expect("known");
    for (i, direction) in known.iter().enumerate().rev() {
        let [polar, azimuth] = to_degrees(*direction);
        let name = if i % 2 == 0 {
            format!("bottle7_TL{polar:.0}-pl{:.3}.tv0 PV45.eXr", azimuth - 360.0)
        } else {
            format!("tl{polar:.1}pl{azimuth:.2}tv0pv0.exr")
        };
        exr(&place.path().join(name), [2, 1], |texel, _| (i * 2 + texel) as f32);
    }
    fs::write(place.path().join("read me.txt"), "").expect("written");
    let output = place.path().join("a.selvset");
    import(place.path(), &output, &options(Sample::Float), QUIET).expect("imported");
    let dataset = Dataset::open(&output).expect("opened");
    assert_eq!(dataset.description().views, [DVec3::Z]);
    assert_eq!(dataset.description().lights, known);
    assert!(
        (0..81)
            .all(|i| dataset.image(i, 0).expect("read") == [[i as f32 * 2.0; 3], [i as f32 * 2.0 + 1.0; 3]])
    );
    assert_eq!(
        dataset.description().lights[0].to_array().map(f64::to_bits),
        DVec3::Z.to_array().map(f64::to_bits)
    );
    assert_eq!(angles_of("x-tl023.5_pl030_tv000_pv007.25"), Some([[23.5, 30.0], [0.0, 7.25]]));
    for none in ["", "tl1", "tl1pl2tv3pv", "tl1pl2tv3pv4b", "tl1xpl2tv3pv4", "tl1pl2pv4tv3", "tl--1pl2tv3pv4"]
    {
        assert_eq!(angles_of(none), None, "{none}");
    }
}

#[test]
fn grey_and_alpha_are_read_and_palettes_refused() {
    let place = tempfile::tempdir().expect("a folder");
    let path = place.path().join("tl0pl0tv0pv0.png");
    let write = |colour: png::ColorType, depth: png::BitDepth, data: &[u8]| {
        let mut encoder = png::Encoder::new(File::create(&path).expect("created"), 1, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_palette(vec![0; 6]);
        encoder.write_header().expect("head").write_image_data(data).expect("data");
        decode(&path)
    };
    let grey = from_srgb16(257 * 100);
    assert_eq!(write(png::ColorType::Grayscale, png::BitDepth::Eight, &[100]).expect("read"), [[grey; 3]]);
    assert_eq!(
        write(png::ColorType::GrayscaleAlpha, png::BitDepth::Sixteen, &[100, 100, 0, 0]).expect("read"),
        [[grey; 3]]
    );
    assert_eq!(
        write(png::ColorType::Rgba, png::BitDepth::Eight, &[255, 0, 100, 7]).expect("read"),
        [[1.0, 0.0, grey]]
    );
    assert!(
        write(png::ColorType::Indexed, png::BitDepth::Eight, &[1])
            .expect_err("refused")
            .to_string()
            .contains("Indexed")
    );
    let path = place.path().join("grey.exr");
    let channels = SpecificChannels::build()
        .with_channel::<f32>("Y")
        .with_channel::<f32>("Z")
        .with_pixel_fn(|_| (0.25, -1.0));
    Image::from_channels((2, 1), channels).write().to_file(&path).expect("written");
    assert_eq!(decode(&path).expect("read"), [[0.25; 3]; 2]);
    // Elsewhere on the canvas, and written from the last row on.
    let encoding = exr::image::Encoding {
        line_order: exr::meta::attribute::LineOrder::Decreasing,
        ..exr::image::Encoding::UNCOMPRESSED
    };
    let attributes = exr::meta::header::LayerAttributes::named("a").with_position(Vec2(5, -3));
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.0f32));
    let layer = exr::image::Layer::new((2, 3), attributes, encoding, channels);
    Image::from_layer(layer).write().to_file(&path).expect("written");
    let wanted: Vec<[f32; 3]> = (0..6).map(|i| [(i % 2) as f32, (i / 2) as f32, 0.0]).collect();
    assert_eq!(decode(&path).expect("read"), wanted);
    let channels = SpecificChannels::build().with_channel::<f32>("Z").with_pixel_fn(|_| (0.25f32,));
    Image::from_channels((2, 1), channels).write().to_file(&path).expect("written");
    assert!(decode(&path).expect_err("refused").to_string().contains("neither"));
}

/// What an import says of two lights and one view after `spoil`, with everything that must be in it.
fn refused(wanted: &[&str], spoil: impl Fn(&Path)) {
    let place = tempfile::tempdir().expect("a folder");
    for light in [0, 30] {
        exr(&place.path().join(format!("tl{light:03}_pl000_tv000_pv000.exr")), [3, 2], |_, _| 0.5);
    }
    let output = place.path().join("a.selvset");
    import(place.path(), &output, &options(Sample::Half), QUIET).expect("good as it is");
    fs::remove_file(&output).expect("removed");
    spoil(place.path());
    let said = import(place.path(), &output, &options(Sample::Half), QUIET).expect_err("refused").to_string();
    assert!(wanted.iter().all(|part| said.contains(part)), "{said}");
    assert!(!output.exists());
}

#[test]
fn bad_folders_are_refused_with_the_file_and_the_place() {
    const BAD: &str = "tl030_pl000_tv000_pv000.exr";
    for (value, text) in [
        (f32::NAN, "NaN"),
        (f32::INFINITY, "inf"),
        (f32::NEG_INFINITY, "-inf"),
        (70_000.0, "--float holds it"),
    ] {
        let spoil = |texel, c| if (texel, c) == (4, 2) { value } else { 0.5 };
        refused(&[BAD, "pixel (1, 1), blue", text], |folder| exr(&folder.join(BAD), [3, 2], spoil));
    }
    refused(&[BAD, "tl000_pl000", "2 x 3", "3 x 2"], |folder| exr(&folder.join(BAD), [2, 3], |_, _| 0.5));
    refused(&["1 of 4 pairs", "tl000_pl000_tv060_pv000"], |folder| {
        exr(&folder.join("tl30pl0tv60pv0.exr"), [3, 2], |_, _| 0.5)
    });
    refused(&[BAD, "TL30.004pl359.999tv0pv9.exr"], |folder| {
        exr(&folder.join("TL30.004pl359.999tv0pv9.exr"), [3, 2], |_, _| 0.5)
    });
    refused(&["preview.png", "name"], |folder| fs::write(folder.join("preview.png"), "").expect("written"));
    refused(&["tl91", "polar"], |folder| exr(&folder.join("tl91pl0tv0pv0.exr"), [3, 2], |_, _| 0.5));
    refused(&["no EXR, PNG"], |folder| {
        fs::read_dir(folder)
            .expect("read")
            .for_each(|file| fs::remove_file(file.expect("one").path()).expect("removed"))
    });
    refused(&[BAD], |folder| fs::write(folder.join(BAD), "no image").expect("written"));
    refused(&["tl60"], |folder| fs::write(folder.join("tl60pl0tv0pv0.png"), "no image").expect("written"));
    let json =
        |text: &'static str| move |folder: &Path| fs::write(folder.join(LISTING), text).expect("written");
    refused(&[LISTING], json("{"));
    refused(&[LISTING, "colour"], json(r#"{"colour": 1}"#));
    refused(&["no EXR, PNG"], json(r#"{"images": []}"#));
    refused(
        &["missing.exr"],
        json(r#"{"images": [{"file": "missing.exr", "light": [0, 0], "view": [0, 0]}]}"#),
    );
    refused(
        &["../a.exr", "inside"],
        json(r#"{"images": [{"file": "../a.exr", "light": [0, 0], "view": [0, 0]}]}"#),
    );
    refused(&[BAD, "none of those"], json(r#"{"lights": [[0, 0, 1]]}"#));
    refused(
        &[BAD, "none of those"],
        json(
            r#"{"lights": [[0, 0, 0]], "images": [{"file": "tl030_pl000_tv000_pv000.exr", "light": [0, 0], "view": [0, 0]}]}"#,
        ),
    );
}

#[test]
fn damaged_images_are_errors_and_no_panics() {
    let place = tempfile::tempdir().expect("a folder");
    let value = |texel: usize, c: usize| (texel * 3 + c) as f32 / 100.0;
    let good = [
        ("a.exr", to_exr([6, 5], Sample::Half, value).expect("encoded")),
        ("a.png", to_png([6, 5], value).expect("encoded").0),
    ];
    for (name, good) in good {
        let path = place.path().join(name);
        for at in 0..good.len() {
            for damaged in [good[..at].to_vec(), [&good[..at], &[good[at] ^ 0x81], &good[at + 1..]].concat()]
            {
                fs::write(&path, damaged).expect("written");
                if let Ok(pixels) = decode(&path) {
                    assert_eq!(pixels.len(), 30);
                }
            }
        }
    }
}
