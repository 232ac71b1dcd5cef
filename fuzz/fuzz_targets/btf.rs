//! See `selvedge_tests::targets::btf`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| selvedge_tests::targets::btf(data));
