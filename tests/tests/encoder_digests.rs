//! What `encode` writes stays what it was: digests of files for four datasets, each method and several goals.
//!
//! The digests freeze the encoders while the code around them moves. They are of this processor's arithmetic:
//! matrix products take the widest vectors that there are, and a sum in another order has other bits. A
//! processor without a recorded row is reported loudly and its check skipped.
//! `SELVEDGE_REGENERATE=1` writes the rows of the processor at hand anew; their difference is to be reviewed.

use selvedge::sha256;
use selvedge_tests::program;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name, side in texels and seed of the modelled materials.
const DATASETS: [(&str, &str, &str); 4] =
    [("cloth", "12", "1"), ("hammered", "12", "2"), ("checker", "11x7", "3"), ("knit", "9x8", "4")];

/// What is asked of each method.
const GOALS: [(&str, &[&str]); 8] = [
    ("ensemble-size", &["--method", "sparse-ensemble", "--size", "60k", "--edge", "4"]),
    (
        "ensemble-rmse",
        &["--method", "sparse-ensemble", "--rmse", "0.8", "--levels", "2", "--layers", "2", "--edge", "2"],
    ),
    ("ensemble-psnr", &["--method", "sparse-ensemble", "--psnr", "27", "--transfer", "linear"]),
    ("ensemble-coefficients", &["--method", "sparse-ensemble", "--coefficients", "40,10,10", "--edge", "8"]),
    ("tensor-size", &["--method", "sparse-tensor", "--size", "80k", "--rank", "16"]),
    ("tensor-rmse", &["--method", "sparse-tensor", "--rmse", "1.0", "--levels", "2", "--rank", "16"]),
    ("tensor-psnr", &["--method", "sparse-tensor", "--psnr", "24", "--transfer", "linear", "--rank", "16"]),
    ("tensor-shape", &["--method", "sparse-tensor", "--shape", "16,32,4,4", "--rank", "24"]),
];

/// The architecture, and the vectors that choose the order of sums.
fn processor() -> String {
    let mut name = std::env::consts::ARCH.to_owned();
    #[cfg(target_arch = "x86_64")]
    for (feature, there) in [
        ("avx2", std::is_x86_feature_detected!("avx2")),
        ("fma", std::is_x86_feature_detected!("fma")),
        ("avx512f", std::is_x86_feature_detected!("avx512f")),
    ] {
        if there {
            name += "+";
            name += feature;
        }
    }
    name
}

fn table_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/encoder-digests.tsv")
}

/// Rows by processor, dataset and goal.
fn read_table() -> BTreeMap<[String; 3], String> {
    let text = std::fs::read_to_string(table_path()).unwrap_or_default();
    let rows = text.lines().filter(|line| !line.starts_with('#')).filter_map(|line| {
        let cells: Vec<String> = line.split('\t').map(str::to_owned).collect();
        let [processor, dataset, goal, digest]: [String; 4] = cells.try_into().ok()?;
        Some(([processor, dataset, goal], digest))
    });
    rows.collect()
}

fn write_table(rows: &BTreeMap<[String; 3], String>) {
    let mut text = String::from(
        "# SHA-256 of datasets and of files that `selvedge encode` makes of them: processor, dataset, goal, digest\n",
    );
    for ([processor, dataset, goal], digest) in rows {
        text += &format!("{processor}\t{dataset}\t{goal}\t{digest}\n");
    }
    std::fs::write(table_path(), text).expect("the table is written");
}

fn run(arguments: &[&str]) {
    let output = Command::new(program()).args(arguments).output().expect("the program runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn digest_of(path: &Path) -> String {
    sha256(&std::fs::read(path).expect("a file")).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn hash_of_synth(folder: &Path, (kind, size, seed): (&str, &str, &str)) -> (PathBuf, String) {
    let path = folder.join(format!("{kind}.selvset"));
    let text = path.to_str().expect("UTF-8");
    run(&["synth", kind, "-o", text, "--size", size, "--samples", "1", "--seed", seed]);
    let digest = digest_of(&path);
    (path, digest)
}

#[test]
fn encoders_write_the_bytes_that_they_wrote() {
    let folder = tempfile::tempdir().expect("a folder");
    let processor = processor();
    let regenerate = std::env::var("SELVEDGE_REGENERATE").is_ok_and(|text| text == "1");
    let mut table = read_table();
    if !regenerate && !table.keys().any(|[of, ..]| *of == processor) {
        eprintln!(
            "SKIPPED: NO DIGESTS OF ENCODERS ARE RECORDED FOR {processor}: SELVEDGE_REGENERATE=1 RECORDS THEM"
        );
        return;
    }
    let mut found = BTreeMap::new();
    for dataset in DATASETS {
        let (path, digest) = hash_of_synth(folder.path(), dataset);
        let key = |goal: &str| [processor.clone(), dataset.0.to_owned(), goal.to_owned()];
        let data_differ = !regenerate && table.get(&key("dataset")) != Some(&digest);
        found.insert(key("dataset"), digest);
        assert!(!data_differ, "{}: the data differ, so nothing can be said of the encoders", dataset.0);
        for (goal, options) in GOALS {
            let output = folder.path().join("encoded.selv");
            let mut arguments =
                vec!["encode", path.to_str().expect("UTF-8"), "-o", output.to_str().expect("UTF-8")];
            arguments.extend(options);
            run(&arguments);
            found.insert(key(goal), digest_of(&output));
            std::fs::remove_file(&output).expect("removed");
        }
    }
    if regenerate {
        table.retain(|[of, ..], _| *of != processor);
        table.extend(found);
        write_table(&table);
        return;
    }
    let differ: Vec<_> =
        found.iter().filter(|(key, digest)| table.get(*key) != Some(digest)).map(|(key, _)| key).collect();
    assert!(differ.is_empty(), "other bytes than recorded: {differ:?}");
    println!("{} files of {processor} have the bytes that are recorded", found.len());
}
