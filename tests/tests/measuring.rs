//! The commands that measure and choose, as a user meets them: `report`, `bench`, `encode --method auto`.

use selvedge_tests::program;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(program()).args(arguments).output().expect("the program runs")
}

fn succeed(arguments: &[&str]) -> Output {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

fn material(folder: &Path) -> PathBuf {
    let data = folder.join("rings.selvset");
    succeed(&["synth", "rings", "--size", "12", "--seed", "3", "-o", text(&data)]);
    data
}

#[test]
fn a_report_has_every_method_and_goes_on_where_it_was() {
    let folder = tempfile::tempdir().expect("folder");
    let (data, out) = (material(folder.path()), folder.path().join("report"));
    let arguments = ["report", text(&data), "--ratios", "60,40", "--rank", "24", "--out", text(&out)];
    succeed(&arguments);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect("written");
    let (lines, held) = (read("measured.jsonl"), read("held-out.jsonl"));
    let json: Value = serde_json::from_str(&read("report.json")).expect("JSON");
    let all = json["lines"].as_array().expect("lines");
    for method in [
        "ensemble 2, log",
        "ensemble 4, linear",
        "tensor, log",
        "tensor, linear",
        "PCA, log",
        "local PCA, linear",
        "Tucker, linear",
        "SparseBTF as published",
        "uncompressed",
    ] {
        let of: Vec<&Value> = all.iter().filter(|line| line["method"] == method).collect();
        // A dozen texels a side: some budgets are below what a method's tables take, which the run says.
        assert!(!of.is_empty() || method.starts_with("SparseBTF"), "{method}");
        for line in of {
            let number = |path: &str| {
                line.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{method}: {path}"))
            };
            assert!(
                number("/bytes") > 0.0
                    && number("/speed/random/median") > 0.0
                    && number("/operations/mean") > 100.0
            );
            assert!(number("/metrics/linear_rms") > 0.0 || method == "uncompressed");
            assert!((-1.0..=1.0).contains(&number("/ssim")) && (0.0..=1.0).contains(&number("/flip")));
            if let Some(stated) = line["operations"]["stated"].as_f64() {
                assert!(number("/operations/largest") <= stated, "{method}");
            }
        }
    }
    // The uncompressed data lose nothing but between directions that they do not have.
    let whole = json["held_out"]
        .as_array()
        .expect("lines")
        .iter()
        .find(|line| line["method"] == "uncompressed")
        .expect("held out")
        .clone();
    assert!(
        whole["seen"]["linear_rms"] == 0.0 && whole["unseen"]["linear_rms"].as_f64().is_some_and(|e| e > 0.0),
        "{whole}"
    );
    let html = read("report.html");
    assert!(html.contains("<svg") && html.contains("data:image/png;base64,") && !html.contains("<script"));
    assert_eq!(read("report.csv").lines().count(), all.len() + 1);
    for entry in std::fs::read_dir(out.join("files")).expect("files") {
        assert!(run(&["validate", text(&entry.expect("a file").path())]).stdout.is_empty());
    }
    // A line that was cut off is measured again; the others are left as they are.
    let cut = lines.lines().count() - 1;
    let kept: String = lines.lines().take(cut).map(|line| format!("{line}\n")).collect();
    std::fs::write(out.join("measured.jsonl"), format!("{kept}{{\"key\":")).expect("written");
    succeed(&arguments);
    let again = read("measured.jsonl");
    assert!(
        again.starts_with(&kept) && again.lines().count() == cut + 1,
        "{} lines, then {}",
        cut,
        again.lines().count()
    );
    assert!(read("held-out.jsonl") == held);
}

#[test]
fn the_method_auto_takes_the_best_of_those_that_reach_the_goal() {
    let folder = tempfile::tempdir().expect("folder");
    let (data, file) = (material(folder.path()), folder.path().join("a.selv"));
    let encode = |more: &[&str]| {
        let fixed = ["encode", text(&data), "-o", text(&file), "--method", "auto", "--rank", "24", "--json"];
        serde_json::from_slice::<Value>(&succeed(&[&fixed, more].concat()).stdout).expect("JSON")
    };
    let number = |told: &Value, path: &str| told.pointer(path).and_then(Value::as_f64).expect("a number");
    let by_size = encode(&["--size", "90k"]);
    let tried = by_size["tried"].as_array().expect("others");
    assert!(tried.len() >= 5, "{by_size}");
    assert!(
        tried.iter().all(|other| number(other, "/metrics/log_rms") >= number(&by_size, "/metrics/log_rms")
            && number(other, "/bytes") <= 90_000.0)
    );
    assert_eq!(std::fs::metadata(&file).expect("written").len() as f64, number(&by_size, "/bytes"));
    assert!(run(&["validate", text(&file)]).stdout.is_empty());
    let cheap = encode(&["--size", "90k", "--prefer", "operations"]);
    assert!(
        cheap["tried"]
            .as_array()
            .expect("others")
            .iter()
            .all(|other| number(other, "/operations") >= number(&cheap, "/operations"))
    );
    assert!(number(&cheap, "/operations") <= number(&by_size, "/operations"));
    let goal = number(&by_size, "/metrics/linear_rms") * 1.2;
    let by_error = encode(&["--rmse", &goal.to_string(), "--domain", "linear"]);
    assert!(number(&by_error, "/metrics/linear_rms") <= goal, "{by_error}");
    assert!(
        by_error["tried"]
            .as_array()
            .expect("others")
            .iter()
            .all(|other| number(other, "/bytes") >= number(&by_error, "/bytes"))
    );
    assert_eq!(
        run(&["encode", text(&data), "-o", text(&file), "--method", "auto", "--size", "90k", "--edge", "4"])
            .status
            .code(),
        Some(1)
    );
    assert_eq!(
        run(&["encode", text(&data), "-o", text(&file), "--size", "90k", "--prefer", "bytes"]).status.code(),
        Some(1)
    );
}

#[test]
fn bench_tells_rates_of_a_file() {
    let file = selvedge_tests::excerpt_file();
    let told: Value =
        serde_json::from_slice(&succeed(&["bench", "--json", text(&file)]).stdout).expect("JSON");
    let first = &told[0];
    assert!(first["speed"]["random_all"]["median"].as_f64().is_some_and(|rate| rate > 0.0), "{first}");
    assert!(first["operations"]["largest"].as_f64() <= first["operations"]["stated"].as_f64());
    let words = String::from_utf8(succeed(&["bench", text(&file)]).stdout).expect("text");
    assert!(words.contains("M/s") && words.contains("kernel"), "{words}");
    assert_eq!(run(&["bench", "nothing.selv"]).status.code(), Some(2));
}
