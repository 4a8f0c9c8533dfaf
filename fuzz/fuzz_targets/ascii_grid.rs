//! Any bytes that no other reader claims by their first ones.
#![no_main]

use libfuzzer_sys::Corpus;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    if [&b"II"[..], b"MM", b"\x89", b"\x93"].iter().any(|magic| bytes.starts_with(magic)) {
        return Corpus::Reject;
    }
    monadnock_fuzz::read("a.asc", bytes);
    Corpus::Keep
});
