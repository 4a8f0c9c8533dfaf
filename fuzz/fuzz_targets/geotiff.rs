//! Any bytes after a TIFF's byte order mark.
#![no_main]

use libfuzzer_sys::Corpus;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    if !bytes.starts_with(b"II") && !bytes.starts_with(b"MM") {
        return Corpus::Reject;
    }
    monadnock_fuzz::read("a.tif", bytes);
    Corpus::Keep
});
