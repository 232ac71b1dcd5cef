//! The program: materials in and out in every format.

use super::small;
use selvedge_tests::foreign::zip;
use selvedge_tests::program;
use selvedge_tools::data::dataset::Sample;
use std::path::Path;
use std::process::Command;

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
