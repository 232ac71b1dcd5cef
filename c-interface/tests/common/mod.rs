//! What the tests share: the built libraries, the C compiler, the fixture, numbers, and the samples that the
//! examples print.

#![allow(dead_code, reason = "each test file uses a part of this")]

use selvedge::{Direction, Selvedge};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// This crate's folder.
pub fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A measured material of 60 x 60 texels.
pub fn fixture() -> PathBuf {
    here().join("../decoder-core/tests/data/carpet07-excerpt.selv")
}

/// Its bytes.
pub fn fixture_bytes() -> Vec<u8> {
    std::fs::read(fixture()).expect("the fixture is in the repository")
}

/// The folder with the static and the shared library, built if they are not there or not of this source.
///
/// Always asked of Cargo: a test must never run against a library of yesterday.
pub fn libraries() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let test = std::env::current_exe().expect("a test is a file");
        // TARGET/PROFILE/deps/TEST
        let target = test.ancestors().nth(3).expect("tests lie three folders deep in the target folder");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let output = Command::new(cargo)
            .args(["build", "--quiet", "-p", "selvedge-c", "--release", "--target-dir"])
            .arg(target)
            .current_dir(here())
            .output()
            .expect("Cargo runs");
        assert!(output.status.success(), "the library is built: {}", String::from_utf8_lossy(&output.stderr));
        target.join("release")
    })
}

/// The static library.
pub fn static_library() -> PathBuf {
    libraries().join(if cfg!(target_env = "msvc") { "selvedge_c.lib" } else { "libselvedge_c.a" })
}

/// The shared library.
pub fn shared_library() -> PathBuf {
    libraries().join(format!("{}selvedge_c{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX))
}

/// A folder for what a test makes.
pub fn work_folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}

/// Says that something was not tested, and why, where nobody can miss it.
pub fn skip(why: &str) {
    // Straight to the stream: the test harness would keep what a macro prints to itself.
    use std::io::Write as _;
    writeln!(std::io::stderr().lock(), "\nSKIPPED: {why}\n").expect("errors can be told");
}

/// Whether a program can be started; skips loudly if not.
pub fn has_program(program: &str, what: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        skip(&format!("{what}: there is no `{program}`"));
    }
    found
}

/// The C compiler's name: that of `CC`, or `cc`.
pub fn c_compiler() -> String {
    std::env::var("CC").unwrap_or_else(|_| "cc".into())
}

/// Compiles a C program with all warnings as errors and links the static library.
pub fn compile(source: &Path, program: &Path, options: &[&str]) -> Output {
    let mut command = Command::new(c_compiler());
    command.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]).args(options);
    command.arg("-I").arg(here().join("include")).arg(source).arg(static_library());
    if cfg!(target_os = "linux") {
        command.args(["-lpthread", "-ldl"]);
    }
    command.args(["-lm", "-o"]).arg(program);
    command.output().expect("the compiler runs")
}

/// The same; fails with what the compiler says.
pub fn compile_well(source: &Path, program: &Path, options: &[&str]) {
    let output = compile(source, program, options);
    assert!(output.status.success(), "{} compiles: {}", source.display(), text(&output.stderr));
}

/// What a program said.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("programs speak UTF-8")
}

/// Numbers that look random and are the same in every run: xorshift64 of Marsaglia.
pub struct Numbers(u64);

impl Numbers {
    pub fn new(seed: u64) -> Numbers {
        Numbers(seed ^ 0x9e37_79b9_7f4a_7c15)
    }

    pub fn word(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 32) as u32
    }

    pub fn below(&mut self, end: u32) -> u32 {
        ((u64::from(self.word()) * u64::from(end)) >> 32) as u32
    }

    /// A fraction from -1 to 1.
    pub fn signed(&mut self) -> f32 {
        (self.word() as i32) as f32 / 2_147_483_648.0
    }

    /// Mostly unit vectors above the horizon, now and then any bits.
    pub fn vector(&mut self) -> [f32; 3] {
        if self.below(16) == 0 {
            return [0; 3].map(|_| f32::from_bits(self.word()));
        }
        let [x, y, z] = [0; 3].map(|_| self.signed());
        let length = (x * x + y * y + z * z).sqrt().max(1e-6);
        [x / length, y / length, z.abs() / length]
    }

    /// Mostly the directions of such vectors, now and then any words.
    pub fn direction(&mut self) -> Direction {
        if self.below(16) == 0 {
            let [x_q18, y_q18, z_q15] = [0; 3].map(|_| self.word() as i32);
            return Direction { x_q18, y_q18, z_q15 };
        }
        Direction::from_unit_vector(self.vector())
    }
}

/// What both examples print of an open material, by the core alone.
pub fn expected_print(selvedge: &Selvedge<'_>) -> String {
    let lights = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.28, 0.96, 0.0]].map(Direction::from_unit_vector);
    let views = [[0.0, 0.6, 0.8], [0.0, 0.0, 1.0], [-0.48, -0.36, 0.8]].map(Direction::from_unit_vector);
    let header = selvedge.header();
    let mut out =
        format!("name: {}\ntexels: {} x {}\n", selvedge.metadata().name, header.width, header.height);
    writeln!(out, "directions: {} light, {} view", header.light_count, header.view_count)
        .expect("a string takes all");
    for (n, (light, view)) in (0u32..).zip(lights.into_iter().zip(views)) {
        let u_q32 = 0x1234_5678u32.wrapping_add(n.wrapping_mul(0x5000_0000));
        let v_q32 = 0x0fed_cba9u32.wrapping_add(n.wrapping_mul(0x7000_0000));
        let samples = [
            ("point", selvedge.point(n * 7, n * 11, n * 13, n * 17)),
            ("filtered", selvedge.filtered(u_q32, v_q32, light, view)),
            ("trilinear", selvedge.trilinear(n * 0x8000, u_q32, v_q32, light, view)),
        ];
        for (label, rgb) in samples {
            writeln!(out, "{label}: {:08x} {:08x} {:08x}", rgb.r, rgb.g, rgb.b).expect("a string takes all");
        }
    }
    let digest: String = selvedge.decode_digest().iter().map(|byte| format!("{byte:02x}")).collect();
    out + "digest: " + &digest + "\n"
}

/// Files that break rules, by name: truncated, and damaged in header, directory and payload.
pub fn broken_files() -> Vec<(&'static str, Vec<u8>)> {
    let good = fixture_bytes();
    let flip = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    let mut costly = good.clone();
    // The stated operations at byte 28, beyond the default limit; the checksum is made to fit again.
    costly[28..32].copy_from_slice(&2_000_000u32.to_le_bytes());
    reseal(&mut costly);
    let mut later = good.clone();
    later[8..12].copy_from_slice(&2u32.to_le_bytes());
    reseal(&mut later);
    vec![
        ("empty", Vec::new()),
        ("one-byte", good[..1].to_vec()),
        ("header-cut", good[..127].to_vec()),
        ("header-alone", good[..128].to_vec()),
        ("half", good[..good.len() / 2].to_vec()),
        ("last-byte-cut", good[..good.len() - 1].to_vec()),
        ("one-byte-more", [&good[..], &[0]].concat()),
        ("magic", flip(0)),
        ("width", flip(33)),
        ("directory", flip(130)),
        ("payload", flip(good.len() / 2)),
        ("costly", costly),
        ("later-version", later),
    ]
}

/// Makes the header's checksum at byte 124 fit the fields before it and the directory behind it.
fn reseal(bytes: &mut [u8]) {
    let sections = u32::from_le_bytes(*bytes[24..].first_chunk().expect("a header has 128 bytes")) as usize;
    let checksum = selvedge::crc32(selvedge::crc32(0, &bytes[..124]), &bytes[128..128 + sections * 16]);
    bytes[124..128].copy_from_slice(&checksum.to_le_bytes());
}
