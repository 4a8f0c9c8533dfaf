//! What every target checks: a reader answers without a panic, and what it accepts is a sound DEM.

use monadnock::Result;
use monadnock::dem::io::{Description, ReadOptions, Sidecar, read_bytes, read_with_sidecars};
use monadnock::dem::{Dem, Normalization};
use std::path::Path;

/// Reads `bytes` as a file called `name`; `band` and a PNG range are always given, so that more code is reached.
pub fn read(name: &str, bytes: &[u8]) {
    let options =
        ReadOptions { elevation: Normalization::new(0.0, 1000.0).ok(), band: Some(1), ..Default::default() };
    check(name, read_bytes(Path::new(name), bytes, &options));
}

/// Reads a small array called `a.npy` with `files` beside it: they may not make it unreadable, except a mask or a unit.
pub fn read_beside(files: &[Sidecar]) {
    let mut array = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 3), }";
    array.extend(format!("{header:<117}\n").bytes());
    array.extend((0..12u8).flat_map(|i| (100.0 + f32::from(i)).to_le_bytes()));
    check("a.npy", read_with_sidecars(Path::new("a.npy"), &array, files, &ReadOptions::default()));
}

fn check(name: &str, read: Result<(Dem, Description)>) {
    match read {
        Ok((dem, _)) => {
            assert!(dem.heights().as_slice().iter().all(|z| z.is_finite()));
            assert!(dem.void_count() < dem.heights().len());
            assert!(dem.cell_size().x() > 0.0 && dem.cell_size().y() > 0.0);
        }
        Err(e) => assert!(e.to_string().contains(name), "{e}"),
    }
}
