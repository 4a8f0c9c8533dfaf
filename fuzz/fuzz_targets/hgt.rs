//! Any bytes as an SRTM tile: its start, and repeated to the length of a tile.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    monadnock_fuzz::read("N36W118.hgt", bytes);
    let tile: Vec<u8> = bytes.iter().copied().cycle().take(2 * 1201 * 1201).collect();
    monadnock_fuzz::read("N36W118.hgt", &tile);
});
