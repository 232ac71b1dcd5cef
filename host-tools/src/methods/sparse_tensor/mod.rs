//! The sparse tensor (chapter 12; Ruiters and Klein 2009).

pub mod encode;
