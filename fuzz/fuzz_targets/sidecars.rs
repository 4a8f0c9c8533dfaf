//! Any bytes as a file beside terrain: the first byte says which kind.
#![no_main]

use libfuzzer_sys::Corpus;
use monadnock::dem::io::Sidecar;

const NAMES: [&str; 6] = ["a.wld", "a.prj", "a.npy.aux.xml", "a.npy.msk", "a.npyw", "a.hdr"];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Some((&kind, content)) = bytes.split_first() else { return Corpus::Reject };
    let Some(name) = NAMES.get(usize::from(kind.wrapping_sub(b'0'))) else { return Corpus::Reject };
    let beside = Sidecar { name: (*name).to_owned(), bytes: content.to_vec() };
    // A place besides, so that a coordinate system has something to say.
    let world = Sidecar { name: "a.wld".to_owned(), bytes: b"30 0 0 -30 500015 4099985".to_vec() };
    monadnock_fuzz::read_beside(&[beside.clone()]);
    monadnock_fuzz::read_beside(&[beside, world]);
    Corpus::Keep
});
