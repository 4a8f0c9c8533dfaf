//! What terrain files say, half say, or say beside themselves: place, units, ground size, validity. Nothing is guessed in
//! silence; what the caller says comes first.
//!
//! Each situation of the collection in `../shared/cases` that is about terrain, where that is there, and two more of its
//! kind that are made here.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

#[path = "../crafted/mod.rs"]
mod crafted;

mod beside;
mod ground;
mod heights;
mod names;
mod validity;

use crafted::Tiff;
use monadnock::dem::Dem;
use monadnock::dem::io::{Description, Nodata, ReadOptions, read_described};
use std::path::{Path, PathBuf};

type Read = monadnock::Result<(Dem, Description)>;

const DEFAULT: ReadOptions = ReadOptions {
    elevation: None,
    cell_size: None,
    band: None,
    nodata: Nodata::AsDeclared,
    metres_per_unit: None,
};

const US_FOOT: f64 = 1200.0 / 3937.0;

/// A file of the collection.
fn case(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases").join(name);
    if !path.exists() {
        eprintln!("skipped: no {}", path.display());
        return None;
    }
    Some(path)
}

/// Reads the first of `files`, the others beside it.
fn read_files(files: &[(&str, &[u8])], options: &ReadOptions) -> Read {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    read_described(&folder.path().join(files[0].0), options)
}

#[track_caller]
fn refused(read: Read, words: &[&str]) {
    let message = read.map(|(dem, said)| (dem.range(), said)).expect_err("must be refused").to_string();
    for word in words {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
    assert!(message.len() < 420, "too long: {message}");
}

#[track_caller]
fn told(said: &Description, words: &[&str]) {
    let all = [said.notes.join("\n"), said.warnings.join("\n")].join("\n");
    for word in words {
        assert!(all.contains(word), "{word:?} is not in: {all}");
    }
}

#[track_caller]
fn cells(dem: &Dem, x: f64, y: f64) {
    let (found, near) = (dem.cell_size(), |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3);
    assert!(near(found.x(), x) && near(found.y(), y), "{found:?} is not {x} x {y}");
}

/// Heights from 1500 m on, 12 x 10 cells.
fn slope() -> Vec<f32> {
    (0..120u16).map(|i| 1500.0 + f32::from(i)).collect()
}

fn tiff() -> Tiff {
    Tiff::f32(12, 10, &slope())
}

/// Places the raster's north-west corner.
fn at(tiff: Tiff, side: f64, x: f64, y: f64) -> Tiff {
    tiff.doubles(33550, &[side, side, 0.0]).doubles(33922, &[0.0, 0.0, 0.0, x, y, 0.0])
}

/// GeoKeys of short codes.
fn keys(tiff: Tiff, keys: &[(u32, u32)]) -> Tiff {
    let mut directory = vec![1, 1, 0, keys.len() as u32];
    directory.extend(keys.iter().flat_map(|&(key, value)| [key, 0, 1, value]));
    tiff.short(34735, &directory)
}

/// In the projected system of an EPSG code, 30 units a cell.
fn projected(code: u32) -> Tiff {
    keys(at(tiff(), 30.0, 500_000.0, 4_100_000.0), &[(1024, 1), (1025, 1), (3072, code)])
}

fn asc(header: &str) -> Vec<u8> {
    let heights: Vec<String> = slope().iter().map(f32::to_string).collect();
    format!("ncols 10\nnrows 12\n{header}\n{}\n", heights.join(" ")).into_bytes()
}

const METRES: &str = "xllcorner 500000\nyllcorner 4100000\ncellsize 30";

const FEET_PRJ: &[u8] = br#"PROJCS["NAD_1983_StatePlane_California_III_FIPS_0403_Feet",GEOGCS["GCS_North_American_1983",
    DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],
    UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic"],PARAMETER["False_Easting",6561666.666666666],
    PARAMETER["False_Northing",1640416.666666667],PARAMETER["Central_Meridian",-120.5],
    PARAMETER["Standard_Parallel_1",37.06666666666667],PARAMETER["Standard_Parallel_2",38.43333333333333],
    PARAMETER["Latitude_Of_Origin",36.5],UNIT["Foot_US",0.3048006096012192]]"#;
