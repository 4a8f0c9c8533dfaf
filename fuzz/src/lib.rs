//! What every target checks: a reader answers without a panic, and what it accepts is a sound DEM or sketch.

use monadnock::Result;
use monadnock::dem::io::{Description, ReadOptions, Sidecar, read_bytes, read_with_sidecars};
use monadnock::dem::{Dem, Georeference, Normalization, RasterSpace};
use monadnock::sketch::geojson::{self, Coordinates, MissingHeights};
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

/// Reads `bytes` as a sketch on its own map, on one in UTM, and in columns and rows; what is accepted is sound, small maps
/// can be drawn, and what is written of them comes back.
pub fn read_sketch(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let transform = [30.0, 0.0, 500_000.0, 0.0, -30.0, 4_100_000.0];
    let place = Georeference { transform, epsg: Some(32611), definition: None, raster_space: RasterSpace::PixelIsArea };
    let plain = geojson::ReadOptions::default();
    let on_map =
        geojson::ReadOptions { size: Some((64, 48)), georeference: Some(place), epsg: Some(32611), ..plain.clone() };
    let open = geojson::ReadOptions {
        coordinates: Coordinates::Pixels,
        missing_heights: MissingHeights::Leave,
        metres_per_unit: Some(0.3048),
        ..plain.clone()
    };
    let filled = geojson::ReadOptions { missing_heights: MissingHeights::Interpolate, ..plain.clone() };
    for options in [plain, on_map, open, filled] {
        let Ok(reading) = geojson::parse(text, &options) else { continue };
        reading.sketch.validate().expect("a sketch that was read is valid");
        assert!(!reading.sketch.strokes.is_empty());
        assert_eq!(reading.names.len(), reading.sketch.strokes.len());
        for (stroke, given) in reading.sketch.strokes.iter().zip(&reading.given) {
            assert_eq!(stroke.vertices.len(), given.len());
            assert!(options.missing_heights != MissingHeights::Refuse || given.iter().all(|given| *given));
        }
        if reading.sketch.rows * reading.sketch.cols <= 1 << 16 {
            let _ = reading.sketch.rasterize();
        }
        // Numbers that stand for "no height" are written as they are, and not read.
        let markers = [-9999.0, -32768.0, -32767.0, -99999.0, -999_999.0];
        let mut heights = reading.sketch.strokes.iter().flat_map(|stroke| &stroke.vertices).map(|v| v.z);
        if heights.any(|z| markers.contains(&z)) {
            continue;
        }
        if let Ok(again) = geojson::to_text(&reading.sketch, reading.unit, None) {
            // Without a stroke's far vertices nothing changes: it lies as much on the map as before.
            let back = geojson::parse(&again, &geojson::ReadOptions::default()).expect("what was written is read");
            assert_eq!(back.sketch, reading.sketch);
        }
    }
}
