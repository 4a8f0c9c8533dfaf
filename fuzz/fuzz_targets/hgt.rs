//! Any text as the name of an SRTM tile (the content has no structure), and any bytes as its content.
#![no_main]

use libfuzzer_sys::Corpus;
use std::sync::LazyLock;

static TILE: LazyLock<Vec<u8>> = LazyLock::new(|| vec![1; 2 * 1201 * 1201]);

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(name) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    if name.contains(['/', '\0']) || name.is_empty() {
        return Corpus::Reject;
    }
    monadnock_fuzz::read(&format!("{name}.hgt"), &TILE);
    monadnock_fuzz::read("N36W118.hgt", bytes);
    Corpus::Keep
});
