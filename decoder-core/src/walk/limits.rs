//! What the caller is willing to spend (chapter 4).

/// Limits that a file's header is held to before its payload is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the file, and of an external dictionary.
    pub bytes: u32,
    /// Operations of a filtered sample: 32-bit multiplications of values, at worst. A sample between two
    /// levels costs at most twice as much.
    pub operations: u32,
    /// Texels of level 0: what whoever decodes an image has to have room for.
    pub texels: u32,
}

impl Limits {
    /// No limits but those of the format.
    pub const NONE: Limits = Limits { bytes: u32::MAX, operations: u32::MAX, texels: u32::MAX };
}

impl Default for Limits {
    /// 256 MiB, a million operations a sample, 64 Mi texels.
    fn default() -> Self {
        Limits { bytes: 256 << 20, operations: 1_000_000, texels: 64 << 20 }
    }
}
