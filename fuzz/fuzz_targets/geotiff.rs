//! Any bytes as `a.tif`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| monadnock_fuzz::read("a.tif", bytes));
