//! Terrain files made by other programs, against the numbers that independent readers give
//! (`tests/oracle/terrain_files.py`: tifffile, GDAL, PROJ).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

use monadnock::dem::io::{CellSizeSource, Nodata, ReadOptions, read, read_described};
use monadnock::dem::{CellSize, Dem, Normalization, RasterSpace};
use monadnock::grid::Cell;
use serde_json::Value;
use std::path::{Path, PathBuf};

const ORACLE: &str = include_str!("oracle/terrain_files.json");

fn oracle(group: &str) -> serde_json::Map<String, Value> {
    serde_json::from_str::<Value>(ORACLE).unwrap()[group].as_object().unwrap().clone()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/tiff").join(name)
}

/// The evaluation data, when they lie beside the repository.
fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if !path.exists() {
        eprintln!("skipped: no {}", path.display());
        return None;
    }
    Some(path)
}

/// Heights, voids and shape as the independent reader saw them; `metres` converts its stored numbers.
fn same_raster(name: &str, dem: &Dem, expected: &Value, metres: impl Fn(f64) -> f64) {
    let number = |v: &Value| v.as_f64().unwrap();
    let shape = expected["shape"].as_array().unwrap();
    assert_eq!(dem.shape(), (number(&shape[0]) as usize, number(&shape[1]) as usize), "{name}");
    assert_eq!(dem.void_count() as u64, expected["voids"].as_u64().unwrap(), "{name}: voids");
    let close = |found: f64, stored: f64, what: &str| {
        let wanted = metres(stored);
        assert!(
            (found - wanted).abs() <= 1e-3 + wanted.abs() * 1e-7,
            "{name}: {what} {found} is not {wanted}"
        );
    };
    let (low, high) = dem.range();
    close(low.into(), number(&expected["low"]), "lowest");
    close(high.into(), number(&expected["high"]), "highest");
    let known = dem.heights().as_slice().iter().zip(dem.valid().as_slice()).filter(|(_, ok)| **ok);
    let sum: f64 = known.map(|(&z, _)| f64::from(z)).sum();
    close(sum / (dem.heights().len() - dem.void_count()) as f64, number(&expected["mean"]), "mean");
    for cell in expected["cells"].as_array().unwrap() {
        let at = Cell::new(number(&cell[0]) as usize, number(&cell[1]) as usize);
        match cell[2].as_f64() {
            Some(z) => {
                assert!(dem.valid()[at], "{name}: {at:?} is void");
                close(dem.heights()[at].into(), z, &format!("height at {at:?}"));
            }
            None => assert!(!dem.valid()[at], "{name}: {at:?} is not void"),
        }
    }
}

#[test]
fn every_kind_of_tiff_reads_as_in_gdal() {
    let entries = oracle("fixtures");
    assert!(entries.len() > 50);
    for (name, expected) in &entries {
        if name == "south-up.tif" {
            continue;
        }
        let band = expected["band"].as_u64().unwrap() as usize;
        let options = ReadOptions { band: Some(band), ..Default::default() };
        let dem = read(&fixture(name), &options).unwrap_or_else(|e| panic!("{e}"));
        // Scale 0.1, offset 5, feet.
        let feet = name == "feet-scaled.tif";
        same_raster(name, &dem, expected, |v| if feet { (v * 0.1 + 5.0) * 0.3048 } else { v });

        let place = dem.georeference();
        let epsg = expected["epsg"].as_u64();
        if name != "half.tif" {
            let place = place.unwrap_or_else(|| panic!("{name}: no georeference"));
            assert_eq!(place.epsg.map(u64::from), epsg, "{name}");
            let point = place.raster_space == RasterSpace::PixelIsPoint;
            assert_eq!(point, expected["point"].as_bool().unwrap(), "{name}");
            for (found, wanted) in place.transform.iter().zip(expected["transform"].as_array().unwrap()) {
                let wanted = wanted.as_f64().unwrap();
                assert!((found - wanted).abs() <= 1e-12 * wanted.abs().max(1.0), "{name}: {found} {wanted}");
            }
        }
    }
}

#[test]
fn cell_sizes_are_metres_on_the_ground() {
    let size = |name: &str| read(&fixture(name), &ReadOptions::default()).unwrap().cell_size();
    let near = |found: CellSize, x: f64, y: f64| {
        let ok = (found.x() / x - 1.0).abs() < 1e-9 && (found.y() / y - 1.0).abs() < 1e-9;
        assert!(ok, "{found:?} is not {x} x {y}");
    };
    near(size("utm.tif"), 30.0, 20.0);
    near(size("rotated.tif"), 30.0, 30.0);
    near(size("us-feet.tif"), 100.0 * 1200.0 / 3937.0, 100.0 * 1200.0 / 3937.0);
    let moon_latitude = (47.0 - 18.5 / 1200.0f64).to_radians();
    let moon = 1_737_400.0 / 1200.0 * 1f64.to_radians();
    near(size("moon.tif"), moon * moon_latitude.cos(), moon);
    // On the ellipsoid at 46.98 N: between PROJ's values at 46.5 and 60 N.
    let geographic = size("geographic.tif");
    assert!((geographic.x() * 1200.0 - 76_080.0).abs() < 50.0, "{geographic:?}");
    assert!((geographic.y() * 1200.0 - 111_170.0).abs() < 10.0, "{geographic:?}");
}

#[test]
fn a_south_up_raster_is_turned() {
    let turned = read(&fixture("south-up.tif"), &ReadOptions::default()).unwrap();
    let plain = read(&fixture("rotated.tif"), &ReadOptions::default()).unwrap();
    let (rows, cols) = turned.shape();
    for row in 0..rows {
        for col in 0..cols {
            let mirrored = Cell::new(rows - 1 - row, col);
            assert_eq!(turned.heights()[Cell::new(row, col)], plain.heights()[mirrored]);
        }
    }
    let place = turned.georeference().unwrap();
    assert_eq!(place.transform, [30.0, 0.0, 300_000.0, 0.0, -30.0, 4_000_000.0 + 37.0 * 30.0]);
}

#[test]
fn what_is_not_supported_says_so() {
    let options = ReadOptions::default();
    let message = |name: &str| read(&fixture(name), &options).unwrap_err().to_string();
    for (name, words) in [
        ("zstd.tif", ["Compression", "Zstandard"]),
        ("jpeg.tif", ["Compression", "JPEG"]),
        ("rgb.tif", ["number of bands", "3"]),
        ("bands-pixel.tif", ["number of bands", "1 to 3"]),
    ] {
        let message = message(name);
        assert!(message.contains(name) && words.iter().all(|w| message.contains(w)), "{message}");
    }
    let fourth = ReadOptions { band: Some(4), ..Default::default() };
    let message = read(&fixture("bands-band.tif"), &fourth).unwrap_err().to_string();
    assert!(message.contains("band is 4") && message.contains("1 to 3"), "{message}");
}

#[test]
fn options_overrule_the_file() {
    let options = ReadOptions {
        cell_size: Some(CellSize::new(5.0, 7.0).unwrap()),
        metres_per_unit: Some(2.0),
        nodata: Nodata::None,
        ..Default::default()
    };
    let (dem, description) = read_described(&fixture("nodata-f32.tif"), &options).unwrap();
    assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (5.0, 7.0));
    assert_eq!(description.cell_size_source, CellSizeSource::Caller);
    assert_eq!((dem.void_count(), dem.range().0), (0, -19998.0));
}

#[test]
fn the_evaluation_areas_are_what_their_manifest_says() {
    let Some(manifest) = shared("manifest.toml") else { return };
    let manifest: toml::Table = std::fs::read_to_string(manifest).unwrap().parse().unwrap();
    let expected = oracle("real");
    let areas = manifest["area"].as_array().unwrap();
    assert_eq!(areas.len(), 9);
    for area in areas {
        let file = area["file"].as_str().unwrap();
        let dem = read(&shared(file).unwrap(), &ReadOptions::default()).unwrap();
        same_raster(file, &dem, &expected[file], |z| z);
        let side = area["metres_per_pixel"].as_float().unwrap();
        assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (side, side), "{file}");
        let (low, high) = dem.range();
        let range = area["elevation"].as_array().unwrap();
        assert!((f64::from(low) - range[0].as_float().unwrap()).abs() < 0.06, "{file}: {low}");
        assert!((f64::from(high) - range[1].as_float().unwrap()).abs() < 0.06, "{file}: {high}");
        assert_eq!(dem.void_count(), 0);
    }
}

#[test]
fn real_files_in_every_format() {
    let expected = oracle("real");
    if let Some(path) = shared("formats/grandcanyon-epsg3857.tif") {
        let dem = read(&path, &ReadOptions::default()).unwrap();
        same_raster("mercator", &dem, &expected["formats/grandcanyon-epsg3857.tif"], |z| z);
        assert_eq!(dem.georeference().unwrap().epsg, Some(3857));
        assert!((dem.cell_size().x() - 61.7).abs() < 0.05, "{:?}", dem.cell_size());
        assert!((dem.cell_size().y() - 61.7).abs() < 0.05, "{:?}", dem.cell_size());
    }
    if let Some(path) = shared("formats/N46E008-with-voids.tif") {
        let dem = read(&path, &ReadOptions::default()).unwrap();
        same_raster("alps", &dem, &expected["formats/N46E008-with-voids.tif"], |z| z);
        let share = dem.void_count() as f64 / dem.heights().len() as f64;
        assert!((share - 0.072).abs() < 0.001, "{share}");
        assert_eq!(dem.georeference().unwrap().epsg, Some(4326));
        // 3 arc-seconds at 46.5 N: PROJ's metres in a degree, over 1200.
        assert!((dem.cell_size().x() - 76_762.593 / 1200.0).abs() < 0.02, "{:?}", dem.cell_size());
        assert!((dem.cell_size().y() - 111_161.084 / 1200.0).abs() < 0.02, "{:?}", dem.cell_size());
    }
    if let Some(path) = shared("formats/N36W118.hgt") {
        let dem = read(&path, &ReadOptions::default()).unwrap();
        same_raster("hgt", &dem, &expected["formats/N36W118.hgt"], |z| z);
        let place = dem.georeference().unwrap();
        let (x, y) = place.to_model(0.5, 0.5);
        assert!((x + 118.0).abs() < 1e-9 && (y - 37.0).abs() < 1e-9, "{x} {y}");
        let (x, y) = place.to_model(1200.5, 1200.5);
        assert!((x + 117.0).abs() < 1e-9 && (y - 36.0).abs() < 1e-9, "{x} {y}");
        assert!((dem.cell_size().x() - 89_591.1 / 1200.0).abs() < 0.01, "{:?}", dem.cell_size());
        assert!((dem.cell_size().y() - 110_968.3 / 1200.0).abs() < 0.01, "{:?}", dem.cell_size());
    }
    if let Some(path) = shared("formats/montblanc-16bit.png") {
        let message = read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("elevation range") && message.contains("65535"), "{message}");
        let options = ReadOptions {
            elevation: Some(Normalization::new(454.0, 4810.0).unwrap()),
            cell_size: Some(CellSize::square(90.0).unwrap()),
            ..Default::default()
        };
        let dem = read(&path, &options).unwrap();
        same_raster("png", &dem, &expected["formats/montblanc-16bit.png"], |z| z);
    }
}
