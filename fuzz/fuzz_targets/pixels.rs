//! See `selvedge_tests::targets::image_pixels`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| selvedge_tests::targets::image_pixels(data));
