//! The sparse ensemble (chapter 10; SparseBTF, Kavoosighafi et al. 2023).

pub mod basis;
pub mod blend;
pub mod blocks;
pub mod dictionary;
pub mod dictionary_file;
pub mod encode;
pub mod quantise;
pub mod sparsebtf;
pub mod train;
