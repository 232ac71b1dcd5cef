//! See `selvedge_tests::targets::archive`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| selvedge_tests::targets::archive(data));
