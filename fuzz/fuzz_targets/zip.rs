//! Any bytes after the magic of a zip archive.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    monadnock_fuzz::read("a.zip", &[b"PK\x03\x04", bytes.strip_prefix(b"PK\x03\x04").unwrap_or(bytes)].concat());
});
