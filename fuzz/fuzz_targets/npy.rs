//! Any bytes after a NumPy magic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    monadnock_fuzz::read(
        "a.npy",
        &[b"\x93NUMPY", bytes.strip_prefix(b"\x93NUMPY").unwrap_or(bytes)].concat(),
    );
});
