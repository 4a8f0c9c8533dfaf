//! Any bytes as `a.npy`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| monadnock_fuzz::read("a.npy", bytes));
