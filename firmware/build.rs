//! Tables of the vectors for the program, from the manifest of the suite; and the linker script of the target.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let suite = root.join("../spec/vectors");
    let manifest = std::fs::read_to_string(suite.join("manifest.tsv")).expect("the suite's manifest");
    println!("cargo:rerun-if-changed={}", suite.display());
    let bytes = |file: &str| format!("include_bytes!({:?})", suite.join(file));
    let optional =
        |file: &str| if file == "-" { "None".to_owned() } else { format!("Some({})", bytes(file)) };
    let mut table = String::from("&[\n");
    for line in manifest.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        let columns: Vec<&str> = line.split('\t').collect();
        let (limits, answer) = if columns[0] == "valid" {
            let digest = columns[3];
            let octets = (0..digest.len() / 2)
                .map(|i| format!("0x{}", &digest[2 * i..2 * i + 2]))
                .collect::<Vec<_>>()
                .join(", ");
            (
                "None".to_owned(),
                if digest == "-" {
                    "Answer::Legal".to_owned()
                } else {
                    format!("Answer::Digest([{octets}])")
                },
            )
        } else {
            let limits =
                if columns[3] == "-" { "None".to_owned() } else { format!("Some([{}])", columns[3]) };
            (
                limits,
                format!(
                    "Answer::Broken({:?}, {}, {}, {})",
                    columns[4],
                    columns[5] == "dictionary",
                    columns[6],
                    columns[7]
                ),
            )
        };
        writeln!(
            table,
            "    Vector {{ file: {}, dictionary: {}, limits: {limits}, answer: {answer} }},",
            bytes(columns[1]),
            optional(columns[2])
        )
        .expect("text");
    }
    table.push_str("]\n");
    let out = std::env::var("OUT_DIR").expect("set by cargo");
    std::fs::write(Path::new(&out).join("table.rs"), table).expect("the table is written");

    write_methods(&root, Path::new(&out));

    let target = std::env::var("TARGET").expect("set by cargo");
    let script = if target.starts_with("thumb") {
        Some("cortex-m.ld")
    } else if target.starts_with("riscv") {
        Some("riscv-virt.ld")
    } else {
        None
    };
    if let Some(script) = script {
        println!("cargo:rustc-link-arg-bins=-T{}", root.join(script).display());
        println!("cargo:rerun-if-changed={script}");
    } else if !target.starts_with("wasm") {
        println!("cargo:rustc-link-arg-bins=-e_start");
    }
}

/// A module for each file of `proof/methods`, and a function that calls them all.
fn write_methods(root: &Path, out: &Path) {
    let folder = root.join("src/proof/methods");
    println!("cargo:rerun-if-changed={}", folder.display());
    let entries = std::fs::read_dir(&folder).expect("a folder").flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort();
    let (mut text, mut calls) = (String::new(), String::new());
    for file in files {
        let name = file.file_stem().expect("a name").to_string_lossy().into_owned();
        writeln!(text, "#[path = {file:?}]\nmod {name};").expect("text");
        writeln!(calls, "    {name}::call(files);").expect("text");
    }
    write!(text, "/// Every method's functions.\nfn call_methods(files: Words<'_>) {{\n{calls}}}\n")
        .expect("text");
    std::fs::write(out.join("methods.rs"), text).expect("the list is written");
}
