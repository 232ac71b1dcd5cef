//! The examples, in C and in Python: they print the core's words, and tell the right rule and exit code of
//! broken files.

mod common;

use common::{
    broken_files, c_compiler, compile, compile_well, expected_print, fixture, fixture_bytes, has_program,
    here, shared_library, skip, text, work_folder,
};
use selvedge::{Direction, Family, Limits, open};
use std::path::Path;
use std::process::{Command, Output};

/// The program's exit code and what it said; errors of sanitizers end it otherwise.
fn run(program: &mut Command) -> (i32, String, String) {
    let Output { status, stdout, stderr } = program.output().expect("the program runs");
    (status.code().unwrap_or(-1), text(&stdout), text(&stderr))
}

/// Holds an example to the core, over the good file and over broken ones.
fn hold_to_core(folder: &Path, mut program: impl FnMut() -> Command) {
    let good = fixture_bytes();
    let selvedge = open(&good, &Limits::default()).expect("the fixture is good");
    let (code, out, err) = run(program().arg(fixture()));
    assert_eq!((code, &err[..]), (0, ""), "the fixture opens");
    assert_eq!(out, expected_print(&selvedge), "the same words");

    for (name, bytes) in broken_files() {
        let path = folder.join(name);
        std::fs::write(&path, &bytes).expect("the work folder can be written");
        let finding = open(&bytes, &Limits::default()).expect_err("the file is broken");
        let wanted = match finding.rule.family() {
            Family::Usage => 1,
            Family::Invalid => 3,
            Family::Limits => 4,
            Family::Unsupported => 5,
        };
        let (code, out, err) = run(program().arg(&path));
        assert_eq!((code, &out[..]), (wanted, ""), "{name}: {err}");
        assert_eq!(err, format!("{}: {finding}\n", path.display()), "{name}");
    }

    // A dictionary that nobody asked for.
    let (code, _, err) = run(program().arg(fixture()).arg(fixture()));
    assert!(code == 1 && err.contains("3.5-3 at byte 0"), "{code}: {err}");
    // No file, and no arguments.
    let (code, _, err) = run(program().arg(folder.join("not-there")));
    assert!(code == 2 && err.contains("not-there"), "{code}: {err}");
    assert_eq!(run(&mut program()).0, 1);
}

/// The families that broken files have to show: one of each that needs no dictionary.
#[test]
fn broken_files_are_of_every_kind() {
    let families = broken_files()
        .into_iter()
        .map(|(_, bytes)| open(&bytes, &Limits::default()).expect_err("the file is broken").rule.family());
    let families: Vec<_> = families.collect();
    for family in [Family::Invalid, Family::Limits, Family::Unsupported] {
        assert!(families.contains(&family), "{family:?}");
    }
}

#[test]
fn c_prints_the_words_of_the_core() {
    if !has_program(&c_compiler(), "the example in C") {
        return;
    }
    let folder = work_folder("c");
    let program = folder.join("sample");
    compile_well(&here().join("examples/sample.c"), &program, &["-O2"]);
    hold_to_core(&folder, || Command::new(&program));
    hold_picture_to_core(&folder, &program);
}

/// The picture of the example is that of the core, but for the last step to bytes.
fn hold_picture_to_core(folder: &Path, program: &Path) {
    let picture = folder.join("picture.ppm");
    let (code, _, err) = run(Command::new(program).arg(fixture()).arg("-").arg(&picture));
    assert_eq!((code, &err[..]), (0, ""));
    let good = fixture_bytes();
    let selvedge = open(&good, &Limits::default()).expect("the fixture is good");
    let [width, height] = selvedge.image_size(0);
    let mut texels = vec![selvedge::Rgb::default(); (width * height) as usize];
    let mut scratch = vec![0; selvedge.image_scratch_len()];
    let [light, view] = [[0.6, 0.0, 0.8], [0.0, 0.0, 1.0]].map(Direction::from_unit_vector);
    selvedge.decode_image(0, light, view, &mut scratch, &mut texels).expect("buffers are long enough");
    let told = std::fs::read(picture).expect("the picture is there");
    let head = format!("P6\n{width} {height}\n255\n");
    let bytes = told.strip_prefix(head.as_bytes()).expect("the size is the core's");
    assert_eq!(bytes.len(), texels.len() * 3);
    for (byte, value) in bytes.iter().zip(texels.iter().flat_map(|rgb| rgb.to_f32())) {
        let wanted = (value.sqrt() * 255.0 + 0.5).min(255.0) as i32;
        // Some compilers join the product and the sum.
        assert!((i32::from(*byte) - wanted).abs() <= 1, "{byte} for {value}");
    }
}

#[test]
fn c_is_clean_under_sanitizers() {
    if !has_program(&c_compiler(), "the example under sanitizers") {
        return;
    }
    let folder = work_folder("sanitized");
    let options = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    let probe = folder.join("probe.c");
    std::fs::write(&probe, "int main(void) { return 0; }\n").expect("the work folder can be written");
    let probed = folder.join("probe");
    let works = compile(&probe, &probed, &options).status.success()
        && Command::new(&probed).status().is_ok_and(|status| status.success());
    if !works {
        skip("the example under sanitizers: the compiler has no -fsanitize=address,undefined that runs here");
        return;
    }
    let program = folder.join("sample");
    compile_well(&here().join("examples/sample.c"), &program, &options);
    hold_to_core(&folder, || Command::new(&program));
    hold_picture_to_core(&folder, &program);
}

#[test]
fn python_prints_the_words_of_the_core() {
    if !has_program("python3", "the example in Python") {
        return;
    }
    let library = shared_library();
    hold_to_core(&work_folder("python"), || {
        let mut command = Command::new("python3");
        command.args(["-X", "utf8"]).arg(here().join("examples/sample.py")).arg(&library);
        command
    });
}
