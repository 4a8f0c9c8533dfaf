//! SRTM height files (`N36W118.hgt`).
//!
//! In: big-endian 16-bit metres, row by row from the north, -32768 for voids, nothing else in the file; the file's
//! length tells the resolution and its name the place. Out: a DEM in WGS 84 degrees (EPSG 4326) whose first and last
//! rows and columns lie exactly on the tile's border (pixel is point). Source: SRTM documentation, NASA / USGS.

use super::ground::{self, Ellipsoid, MapUnit};
use super::numbers::NumberType;
use super::samples::{Rule, Samples};
use super::{CellSizeSource, Description, Format, Nodata, ReadOptions};
use crate::dem::{Dem, Georeference, RasterSpace};
use crate::error::{Error, Result};
use std::path::Path;

/// (rows, columns) of the tiles that exist: 1 and 3 arc-seconds, and the coarser columns beyond 50 degrees.
const SHAPES: [(usize, usize); 3] = [(3601, 3601), (3601, 1801), (1201, 1201)];

pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    let shape = SHAPES.into_iter().find(|(rows, cols)| rows * cols * 2 == bytes.len());
    let Some((rows, cols)) = shape else {
        return Err(Error::file(
            path,
            "file size",
            format!("{} bytes", bytes.len()),
            "allowed: 25934402 (3601 x 3601), 12970802 (3601 x 1801) or 2884802 (1201 x 1201)",
        ));
    };
    let georeference = match (corner(path), options.cell_size) {
        (Some((latitude, longitude)), _) => Some(place(latitude, longitude, rows, cols)),
        (None, Some(_)) => None,
        (None, None) => {
            return Err(Error::file(
                path,
                "file name",
                path.file_name().unwrap_or_default().display(),
                "it must begin with the south-west corner, as in N36W118.hgt; or give the cell size",
            ));
        }
    };
    let (cell_size, cell_size_source) = match (options.cell_size, &georeference) {
        (Some(given), _) => (given, CellSizeSource::Caller),
        (None, Some(g)) => {
            let unit = MapUnit::Degrees(1.0, Ellipsoid::WGS84);
            (ground::cell_size(path, g, unit, (rows, cols))?, CellSizeSource::File)
        }
        (None, None) => unreachable!("refused above"),
    };
    let options = match options.nodata {
        Nodata::AsDeclared => ReadOptions { nodata: Nodata::Value(-32768.0), ..*options },
        _ => *options,
    };
    let mut samples = Samples::new(rows, cols, Rule::new(path, &options, None, 1.0)?);
    NumberType::I16.each(bytes, true, |i, value| samples.set(i, value));
    let description = Description {
        format: Format::Hgt,
        sample: "i16",
        packing: String::new(),
        coordinates: match georeference {
            Some(_) => "EPSG:4326, degrees".to_owned(),
            None => "none".to_owned(),
        },
        cell_size_source,
        notes: Vec::new(),
    };
    Ok((samples.into_dem(path, cell_size)?.at(georeference), description))
}

/// Latitude and longitude of the south-west corner, from the file name.
fn corner(path: &Path) -> Option<(f64, f64)> {
    let name = path.file_name()?.to_str()?.as_bytes();
    let (latitude, longitude) = (name.get(..3)?, name.get(3..7)?);
    let degrees = |text: &[u8], negative: u8, positive: u8, most: u16| {
        let sign = match text[0].to_ascii_uppercase() {
            c if c == positive => 1.0,
            c if c == negative => -1.0,
            _ => return None,
        };
        if !text[1..].iter().all(u8::is_ascii_digit) {
            return None;
        }
        let value: u16 = std::str::from_utf8(&text[1..]).ok()?.parse().ok()?;
        (value <= most).then_some(sign * f64::from(value))
    };
    Some((degrees(latitude, b'S', b'N', 90)?, degrees(longitude, b'W', b'E', 180)?))
}

fn place(latitude: f64, longitude: f64, rows: usize, cols: usize) -> Georeference {
    let (dx, dy) = (1.0 / (cols - 1) as f64, 1.0 / (rows - 1) as f64);
    Georeference {
        transform: [dx, 0.0, longitude - dx / 2.0, 0.0, -dy, latitude + 1.0 + dy / 2.0],
        epsg: Some(4326),
        definition: None,
        raster_space: RasterSpace::PixelIsPoint,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_from_names() {
        assert_eq!(corner(Path::new("a/N36W118.hgt")), Some((36.0, -118.0)));
        assert_eq!(corner(Path::new("s01e179.SRTMGL1.hgt")), Some((-1.0, 179.0)));
        for wrong in ["N3W118.hgt", "tile.hgt", "N99W118.hgt", "N36W1+8.hgt", "é.hgt", ""] {
            assert_eq!(corner(Path::new(wrong)), None, "{wrong}");
        }
    }
}
