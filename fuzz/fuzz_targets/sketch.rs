//! Any text as a sketch.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| monadnock_fuzz::read_sketch(bytes));
