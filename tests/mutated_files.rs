//! Sound terrain files with random damage: the readers must answer, quickly, and never panic.
//!
//! Every case is drawn from a seed, so that a failure names a case that can be repeated. `MONADNOCK_MUTATIONS` sets the
//! number of cases a file (default 150).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

mod crafted;

use monadnock::dem::io::{ReadOptions, WriteOptions, read_bytes, write};
use monadnock::dem::{CellSize, Dem, Normalization};
use monadnock::grid::Grid;
use monadnock::seed::Seed;
use rand::{Rng, RngExt};
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

/// A damaged copy of `sound`; `other` is material for splices.
fn damage(sound: &[u8], other: &[u8], stream: &mut impl Rng) -> Vec<u8> {
    let mut bytes = sound.to_vec();
    for _ in 0..stream.random_range(1..5) {
        if bytes.is_empty() {
            return bytes;
        }
        // Headers are short and decide most, so half of the damage goes to the first and last bytes.
        let at = match stream.random_range(0..4) {
            0 => stream.random_range(0..bytes.len().min(256)),
            1 => bytes.len() - 1 - stream.random_range(0..bytes.len().min(512)),
            _ => stream.random_range(0..bytes.len()),
        };
        match stream.random_range(0..8) {
            0 => bytes[at] ^= 1 << stream.random_range(0..8),
            1 => bytes[at] = stream.random_range(0..=255),
            2 => {
                let extremes =
                    [0u32, 1, 2, 0x7fff, 0xffff, 0x7fff_ffff, 0x8000_0000, u32::MAX, 16_384, 1 << 28];
                let value = extremes[stream.random_range(0..extremes.len())];
                let size = [2, 4][stream.random_range(0..2)];
                let raw = if stream.random() { value.to_le_bytes() } else { value.to_be_bytes() };
                let end = (at + size).min(bytes.len());
                bytes[at..end].copy_from_slice(&raw[..end - at]);
            }
            3 => bytes.truncate(at),
            4 => {
                let length = stream.random_range(0..64).min(bytes.len() - at);
                bytes.drain(at..at + length);
            }
            5 => {
                let start = stream.random_range(0..other.len());
                let length = stream.random_range(0..64).min(other.len() - start);
                bytes.splice(at..at, other[start..start + length].iter().copied());
            }
            6 => {
                let digits = [&b"-1"[..], b"9999999999", b"1e308", b"nan", b"0", b"''", b"((", b" "];
                let text = digits[stream.random_range(0..digits.len())];
                let end = (at + text.len()).min(bytes.len());
                bytes.splice(at..end, text.iter().copied());
            }
            _ => {
                let start = stream.random_range(0..bytes.len());
                let length = stream.random_range(0..64).min(bytes.len() - start.max(at));
                bytes.copy_within(start..start + length, at);
            }
        }
    }
    bytes
}

/// Reads a damaged file; what is accepted must be a sound DEM.
fn survive(name: &str, case: usize, bytes: &[u8]) -> bool {
    let options = ReadOptions {
        elevation: Some(Normalization::new(0.0, 1000.0).unwrap()),
        band: name.contains("band").then_some(2),
        ..Default::default()
    };
    let started = Instant::now();
    let outcome = catch_unwind(|| read_bytes(Path::new(name), bytes, &options));
    let Ok(outcome) = outcome else { panic!("{name}: case {case} panicked") };
    assert!(started.elapsed() < Duration::from_secs(20), "{name}: case {case} took {:?}", started.elapsed());
    match outcome {
        Ok((dem, _)) => {
            let finite = dem.heights().as_slice().iter().all(|z| z.is_finite());
            assert!(finite && dem.void_count() < dem.heights().len(), "{name}: case {case}");
            true
        }
        Err(e) => {
            assert!(e.to_string().contains(name), "{name}: case {case}: {e}");
            false
        }
    }
}

fn cases() -> usize {
    std::env::var("MONADNOCK_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(150)
}

fn mutate(files: &[(String, Vec<u8>)], cases: usize) {
    let mut accepted = 0;
    for (i, (name, sound)) in files.iter().enumerate() {
        assert!(survive(name, usize::MAX, sound), "{name} is sound");
        let mut stream = Seed(7).stream(name);
        let other = &files[(i + 1) % files.len()].1;
        for case in 0..cases {
            accepted += usize::from(survive(name, case, &damage(sound, other, &mut stream)));
        }
    }
    // Damage that is always noticed, or never, tests nothing.
    let share = accepted as f64 / (cases * files.len()) as f64;
    assert!((0.001..0.95).contains(&share), "{share} of the damaged files were accepted");
    eprintln!("{} files, {cases} cases each, {:.0} % still readable", files.len(), share * 100.0);
}

fn small_dem() -> Dem {
    let heights = Grid::from_fn(13, 17, |c| 100.0 + c.row as f32 * 3.0 - c.col as f32);
    let valid = Grid::from_fn(13, 17, |c| c.row != c.col);
    Dem::with_voids(heights, valid, CellSize::square(30.0).unwrap()).unwrap()
}

fn written(extension: &str) -> (String, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let name = format!("ours.{extension}");
    let path = dir.path().join(&name);
    write(&small_dem(), &path, &WriteOptions::default()).unwrap();
    (name, std::fs::read(path).unwrap())
}

#[test]
fn damaged_tiffs() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/tiff");
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| !["zstd", "jpeg", "rgb"].iter().any(|n| path.file_stem().unwrap() == *n))
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(path).unwrap()))
        .collect();
    files.push(written("tif"));
    files.sort();
    mutate(&files, cases());
}

#[test]
fn damaged_pngs() {
    use png::{BitDepth, ColorType};
    let grey: Vec<u8> = (0..=255).collect();
    let files = [
        written("png"),
        ("grey16.png".to_owned(), crafted::png(8, 16, ColorType::Grayscale, BitDepth::Sixteen, &grey)),
        ("grey8.png".to_owned(), crafted::png(16, 16, ColorType::Grayscale, BitDepth::Eight, &grey)),
    ];
    // Nearly all damage breaks a checksum; so mend them for half of the cases.
    mutate(&files, cases() * 4);
    let mended: Vec<_> = files.iter().map(|(name, bytes)| (name.clone(), bytes.clone())).collect();
    for (name, sound) in &mended {
        let mut stream = Seed(8).stream(name);
        for case in 0..cases() * 4 {
            survive(name, case, &mend(damage(sound, sound, &mut stream)));
        }
    }
}

/// Corrects the checksums of a PNG's chunks as far as its lengths can be followed.
fn mend(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes(head.try_into().unwrap()) as usize;
        let end = at + 8 + length;
        if end + 4 > bytes.len() {
            break;
        }
        let mut crc = flate2::Crc::new();
        crc.update(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&crc.sum().to_be_bytes());
        at = end + 4;
    }
    bytes
}

#[test]
fn damaged_arrays_and_grids() {
    let header = |descr: &str, order: &str| {
        format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': (5, 4), }}\n")
    };
    let arrays = [
        written("npy"),
        ("f8.npy".to_owned(), crafted::npy(&header("<f8", "True"), &[1; 160])),
        ("i2.npy".to_owned(), crafted::npy(&header(">i2", "False"), &[1; 40])),
    ];
    mutate(&arrays, cases() * 8);
    let centred =
        "NROWS 2\r\nNCOLS 3\r\nXLLCENTER 1000\r\nYLLCENTER 2000\r\nDX 2\r\nDY 4\r\nnan 2 5\r\n-3e1 4 inf\r\n";
    let grids = [written("asc"), ("centred.asc".to_owned(), centred.as_bytes().to_vec())];
    mutate(&grids, cases() * 12);
}

#[test]
fn damaged_hgt() {
    let sound: Vec<u8> = (0..4321u16).cycle().take(1201 * 1201).flat_map(u16::to_be_bytes).collect();
    mutate(&[("N36W118.hgt".to_owned(), sound)], 20);
}
