//! See `selvedge_tests::targets::generate`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| selvedge_tests::targets::generate(data));
