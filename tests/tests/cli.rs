//! The program as a user meets it: exit codes, silence, whole files.

use selvedge_tests::{excerpt_file, excerpt_folder, program};
use std::path::Path;
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(program()).args(arguments).output().expect("the program runs")
}

fn code(arguments: &[&str]) -> i32 {
    run(arguments).status.code().expect("an exit code")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn import_validate_info_decode() {
    let folder = tempfile::tempdir().expect("folder");
    let excerpt = excerpt_folder();
    let (file, png, exr) =
        (folder.path().join("a.selv"), folder.path().join("a.png"), folder.path().join("a.exr"));
    assert_eq!(code(&["import", text(&excerpt), "--material", "felt05", "-o", text(&file)]), 0);
    let checked = run(&["validate", text(&file)]);
    assert!(
        checked.status.success() && checked.stdout.is_empty() && checked.stderr.is_empty(),
        "silent when good"
    );
    let info: serde_json::Value =
        serde_json::from_slice(&run(&["info", "--json", text(&file)]).stdout).expect("JSON");
    assert_eq!(info["size"], serde_json::json!([60, 60]));
    assert_eq!(info["name"], "felt05");
    assert_eq!(info["decode_digest"].as_str().map(str::len), Some(64));
    assert_eq!(code(&["decode", text(&file), "-o", text(&png), "--light", "40,-30", "--exposure", "3"]), 0);
    assert_eq!(code(&["decode", text(&file), "-o", text(&exr)]), 0);
    assert_eq!(&std::fs::read(&png).expect("png")[1..4], b"PNG");
    assert_eq!(&std::fs::read(&exr).expect("exr")[..4], [0x76, 0x2f, 0x31, 0x01]);
}

#[test]
fn a_dictionary_of_its_own() {
    let folder = tempfile::tempdir().expect("folder");
    let (file, dictionary, whole) =
        (folder.path().join("a.selv"), folder.path().join("a.selvdict"), folder.path().join("b.selv"));
    let excerpt = excerpt_folder();
    assert_eq!(
        code(&[
            "import",
            text(&excerpt),
            "--material",
            "carpet07",
            "-o",
            text(&file),
            "--dictionary",
            text(&dictionary)
        ]),
        0
    );
    assert_eq!(code(&["import", text(&excerpt), "--material", "carpet07", "-o", text(&whole)]), 0);
    assert_eq!(code(&["validate", text(&file)]), 1, "the dictionary is missing");
    assert_eq!(code(&["validate", text(&file), "--dictionary", text(&dictionary)]), 0);
    assert_eq!(code(&["validate", text(&dictionary)]), 0);
    let digest = |arguments: &[&str]| {
        serde_json::from_slice::<serde_json::Value>(&run(arguments).stdout).expect("JSON")["decode_digest"]
            .clone()
    };
    let split = digest(&["info", "--json", text(&file), "--dictionary", text(&dictionary)]);
    assert_eq!(split, digest(&["info", "--json", text(&whole)]));
}

#[test]
fn exit_codes_tell_the_families_apart() {
    let folder = tempfile::tempdir().expect("folder");
    let good = excerpt_file();
    let bytes = std::fs::read(&good).expect("file");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("write");
        path
    };
    let mut newer = bytes.clone();
    newer[8] = 2;
    let mut damaged = bytes.clone();
    damaged[5000] ^= 1;
    assert_eq!(code(&["validate", text(&good)]), 0);
    assert_eq!(code(&["frobnicate"]), 1);
    assert_eq!(code(&["info", "nowhere.selv"]), 2);
    assert_eq!(code(&["validate", text(&write("damaged", &damaged))]), 3);
    assert_eq!(code(&["validate", text(&write("short", &bytes[..77]))]), 3);
    assert_eq!(code(&["validate", text(&good), "--max-operations", "5"]), 4);
    assert_eq!(code(&["validate", text(&write("newer", &newer))]), 5);
    let found = run(&["validate", "--json", text(&folder.path().join("damaged"))]);
    let report: serde_json::Value = serde_json::from_slice(&found.stdout).expect("JSON");
    assert_eq!(report["files"][0]["valid"], false);
    assert_eq!(report["files"][0]["findings"][0]["rule"], "3.2-7");
}

/// A failure leaves the old file as it was and nothing beside it.
#[test]
fn no_output_is_left_half_written() {
    let folder = tempfile::tempdir().expect("folder");
    let old = folder.path().join("old.selv");
    std::fs::write(&old, b"precious").expect("write");
    let broken = folder.path().join("broken");
    std::fs::create_dir(&broken).expect("folder");
    for entry in std::fs::read_dir(excerpt_folder()).expect("excerpt") {
        let path = entry.expect("entry").path();
        let bytes = std::fs::read(&path).expect("file");
        let name = path.file_name().expect("name");
        let keep = if name == "DictEnsOrth4DV.bin" { bytes.len() - 2 } else { bytes.len() };
        std::fs::write(broken.join(name), &bytes[..keep]).expect("write");
    }
    assert_eq!(code(&["import", text(&broken), "--material", "carpet07", "-o", text(&old)]), 3);
    assert_eq!(std::fs::read(&old).expect("still there"), b"precious");
    assert_eq!(code(&["decode", text(&excerpt_file()), "-o", text(&folder.path().join("picture.gif"))]), 1);
    let names: Vec<_> =
        std::fs::read_dir(folder.path()).expect("folder").map(|e| e.expect("entry").file_name()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

/// Truncated and damaged foreign files: a typed error, never a panic (which would be code 101).
#[test]
fn damaged_foreign_files_are_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let names = [
        "Coeffs_BTF_carpet07_1e-05_U.bin",
        "Coeffs_BTF_carpet07_1e-05_V.bin",
        "DictEnsOrth4DU.bin",
        "DictEnsOrth4DV.bin",
        "carpet07_mean_std.bin",
        "xyz_loc.bin",
    ];
    for name in names {
        std::fs::copy(excerpt_folder().join(name), folder.path().join(name)).expect("copy");
    }
    let mut random = selvedge_tools::math::random::Random::new(4);
    for name in names {
        let path = folder.path().join(name);
        let bytes = std::fs::read(&path).expect("file");
        for cut in [0, 1, 7, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..cut]).expect("write");
            let result = selvedge_tools::methods::sparse_ensemble::sparsebtf::read_material(
                folder.path(),
                "carpet07",
                None,
            );
            assert!(result.is_err(), "{name} cut to {cut}");
        }
        for _ in 0..12 {
            let mut damaged = bytes.clone();
            for _ in 0..4 {
                let at = random.range(0, damaged.len() as i64 - 1) as usize;
                damaged[at] = random.word() as u8;
            }
            std::fs::write(&path, &damaged).expect("write");
            if let Ok(model) = selvedge_tools::methods::sparse_ensemble::sparsebtf::read_material(
                folder.path(),
                "carpet07",
                None,
            )
            .and_then(|m| m.to_model(8))
            {
                selvedge::open(
                    &selvedge_tools::format::write::write_material(&model),
                    &selvedge::Limits::NONE,
                )
                .expect("what is written is legal");
            }
        }
        std::fs::write(&path, &bytes).expect("write");
    }
}

#[test]
fn the_kernel_is_translated() {
    let folder = tempfile::tempdir().expect("folder");
    assert_eq!(code(&["kernel", "--out", text(folder.path())]), 0);
    let spirv = std::fs::read(folder.path().join("selvedge.spv")).expect("SPIR-V");
    assert_eq!(spirv[..4], [0x03, 0x02, 0x23, 0x07]);
    for (name, sign) in [
        ("selvedge.wgsl", "@compute"),
        ("selvedge.metal", "kernel void filtered"),
        ("selvedge.hlsl", "numthreads"),
        ("selvedge_image.comp", "#version 310 es"),
        ("README.txt", "Bindings"),
    ] {
        assert!(std::fs::read_to_string(folder.path().join(name)).expect(name).contains(sign), "{name}");
    }
    assert!(
        !std::fs::read_to_string(folder.path().join("selvedge_functions.wgsl"))
            .expect("WGSL")
            .contains("@compute")
    );
}

/// From a model to a file and on, as a user would do it: every new command once, and its exit codes.
/// A folder in which one command's result is the next one's source.
struct Place(tempfile::TempDir);

impl Place {
    fn at(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("UTF-8").to_owned()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.path().join(name)).expect("a file")
    }
}

#[test]
fn synth_train_encode_compare_trim_blend_export_import() {
    let place = Place(tempfile::tempdir().expect("folder"));
    synthesise(&place);
    train(&place);
    encode(&place);
    compare(&place);
    trim_and_blend(&place);
    export_and_import(&place);
}

/// Two checkers, whatever the number of threads.
fn synthesise(place: &Place) {
    let at = |name: &str| place.at(name);
    let (data, other) = (at("checker.selvset"), at("other.selvset"));
    assert_eq!(code(&["synth", "checker", "--size", "12x10", "--samples", "1", "-o", &data]), 0);
    assert_eq!(
        code(&["synth", "checker", "--size", "12x10", "--samples", "1", "--seed", "2", "-o", &other]),
        0
    );
    let again = at("again.selvset");
    assert_eq!(
        code(&["synth", "checker", "--size", "12x10", "--samples", "1", "--threads", "1", "-o", &again]),
        0
    );
    assert!(place.bytes("checker.selvset") == place.bytes("again.selvset"), "threads change no byte");
    assert_eq!(code(&["synth", "marble", "-o", &at("x")]), 1);
}

/// A dictionary, also by a training that is killed in the middle and resumed.
fn train(place: &Place) {
    let at = |name: &str| place.at(name);
    let (other, dictionary) = (at("other.selvset"), at("d.selvdict"));
    let training =
        ["--dictionaries", "2", "--edge", "4", "--iterations", "3", "--sparsity", "16,4,4", "--quiet"];
    assert_eq!(code(&[["train", &other, "-o", &dictionary].as_slice(), &training].concat()), 0);
    // A training that is killed in the middle is resumed and writes the same file.
    std::fs::create_dir(at("killed")).expect("a folder");
    let killed = at("killed/d.selvdict");
    let mut child = Command::new(program())
        .args([["train", &other, "-o", &killed].as_slice(), &training].concat())
        .spawn()
        .expect("runs");
    let state = place.0.path().join("killed/d.selvdict.training");
    while !state.exists() && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let _ = child.kill();
    let _ = child.wait();
    assert_eq!(code(&[["train", &other, "-o", &killed].as_slice(), &training].concat()), 0);
    assert!(place.bytes("killed/d.selvdict") == place.bytes("d.selvdict"), "the same file after all");
}

/// With columns of its own, with trained ones inside and outside of the file, and for goals that are none.
fn encode(place: &Place) {
    let at = |name: &str| place.at(name);
    let (data, dictionary) = (at("checker.selvset"), at("d.selvdict"));
    let (own, trained, external) = (at("own.selv"), at("trained.selv"), at("external.selv"));
    let report = run(&[
        "encode", &data, "-o", &own, "--rmse", "0.7", "--edge", "4", "--layers", "2", "--levels", "2",
        "--json",
    ]);
    assert!(report.status.success());
    let report: serde_json::Value = serde_json::from_slice(&report.stdout).expect("JSON");
    assert!(report["metrics"]["log_rms"].as_f64().expect("a number") <= 0.7);
    assert_eq!(
        code(&["encode", &data, "-o", &trained, "--dictionary", &dictionary, "--edge", "4", "--size", "70k"]),
        0
    );
    assert_eq!(
        code(&["encode", &data, "-o", &external, "--dictionary", &dictionary, "--external", "--size", "70k"]),
        0
    );
    assert_eq!(code(&["validate", &own, &trained]), 0);
    assert_eq!(code(&["validate", &external, "--dictionary", &dictionary]), 0);
    assert_eq!(code(&["encode", &data, "-o", &at("x.selv")]), 1, "a goal is missing");
    assert_eq!(code(&["encode", &data, "-o", &at("x.selv"), "--size", "10"]), 1, "too small");
    assert!(!place.0.path().join("x.selv").exists());
}

/// The exit codes of idiff.
fn compare(place: &Place) {
    let at = |name: &str| place.at(name);
    let (data, own) = (at("checker.selvset"), at("own.selv"));
    assert_eq!(code(&["compare", &data, &data]), 0);
    let picture = at("compare.png");
    assert_eq!(
        code(&[
            "compare",
            &data,
            &own,
            "--by",
            "log-rms",
            "--fail",
            "0.7",
            "--warn",
            "0.7",
            "--picture",
            &picture
        ]),
        0
    );
    assert_eq!(code(&["compare", &data, &own, "--by", "log-rms", "--fail", "0.9", "--warn", "0.01"]), 1);
    assert_eq!(code(&["compare", &data, &own]), 2);
    assert_eq!(code(&["compare", &data, "does-not-exist"]), 4);
    assert_eq!(&std::fs::read(&picture).expect("png")[1..4], b"PNG");
}

fn trim_and_blend(place: &Place) {
    let at = |name: &str| place.at(name);
    let (data, other, own) = (at("checker.selvset"), at("other.selvset"), at("own.selv"));
    let (trimmed, blended) = (at("trimmed.selv"), at("blended.selv"));
    assert_eq!(
        code(&[
            "trim",
            &own,
            "-o",
            &trimmed,
            "--layers",
            "1",
            "--levels",
            "1",
            "--unused",
            "--channels",
            "texture,mean,mean",
            "--lights",
            "50"
        ]),
        0
    );
    assert_eq!(code(&["validate", &trimmed]), 0);
    assert!(std::fs::metadata(&trimmed).expect("file").len() < std::fs::metadata(&own).expect("file").len());
    let second = at("second.selv");
    let encode_alike = |data: &str, file: &str| {
        code(&["encode", data, "-o", file, "--rmse", "0.7", "--edge", "4", "--offset", "0.001"])
    };
    assert_eq!((encode_alike(&data, &own), encode_alike(&other, &second)), (0, 0));
    assert_eq!(code(&["blend", &own, &second, "--alpha", "0.3", "-o", &blended]), 0);
    assert_eq!(code(&["blend", &own, &second, "--alpha", "0", "-o", &blended]), 0);
    assert_eq!(code(&["compare", &own, &blended]), 0);
    assert_eq!(code(&["blend", &own, &second, "--alpha", "2", "-o", &blended]), 1);
    assert_eq!(code(&["compare", &data, &at("images")]), 4);
}

fn export_and_import(place: &Place) {
    let at = |name: &str| place.at(name);
    let data = at("checker.selvset");
    let small = at("small.selvset");
    assert_eq!(code(&["synth", "checker", "--size", "2", "--samples", "1", "-o", &small]), 0);
    assert_eq!(code(&["export", &small, "-o", &at("images")]), 0);
    assert_eq!(code(&["import", &at("images"), "-o", &at("back.selvset")]), 0);
    assert_eq!(code(&["compare", &small, &at("back.selvset")]), 0);
    assert_eq!(code(&["compare", &small, &data]), 3, "other sizes");
    // One image fewer, and the import says which is missing.
    let gone = std::fs::read_dir(at("images"))
        .expect("folder")
        .filter_map(|e| e.ok())
        .map(|e| e.path())
        .find(|p| p.extension().is_some_and(|e| e == "exr"));
    std::fs::remove_file(gone.expect("an image")).expect("removed");
    assert_ne!(code(&["import", &at("images"), "-o", &at("broken.selvset")]), 0);
    assert!(!place.0.path().join("broken.selvset").exists());
}
