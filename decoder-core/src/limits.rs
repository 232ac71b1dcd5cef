//! What the caller is willing to spend (chapter 4).

/// Limits that a file's header is held to before its payload is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the file, and of an external dictionary.
    pub bytes: u32,
    /// Operations of a filtered sample: 32-bit multiplications of values, at worst.
    pub operations: u32,
}

impl Limits {
    /// No limits but those of the format.
    pub const NONE: Limits = Limits { bytes: u32::MAX, operations: u32::MAX };
}

impl Default for Limits {
    /// 256 MiB and a million operations a sample.
    fn default() -> Self {
        Limits { bytes: 256 << 20, operations: 1_000_000 }
    }
}
