//! What every target checks: a reader answers without a panic, and what it accepts is a sound DEM.

use monadnock::dem::Normalization;
use monadnock::dem::io::{ReadOptions, read_bytes};
use std::path::Path;

/// Reads `bytes` as a file called `name`; `band` and a PNG range are always given, so that more code is reached.
pub fn read(name: &str, bytes: &[u8]) {
    let options =
        ReadOptions { elevation: Normalization::new(0.0, 1000.0).ok(), band: Some(1), ..Default::default() };
    match read_bytes(Path::new(name), bytes, &options) {
        Ok((dem, _)) => {
            assert!(dem.heights().as_slice().iter().all(|z| z.is_finite()));
            assert!(dem.void_count() < dem.heights().len());
            assert!(dem.cell_size().x() > 0.0 && dem.cell_size().y() > 0.0);
        }
        Err(e) => assert!(e.to_string().contains(name), "{e}"),
    }
}
