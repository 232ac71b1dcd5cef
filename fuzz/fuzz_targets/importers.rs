//! See `selvedge_tests::targets::importers`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| selvedge_tests::targets::importers(data));
