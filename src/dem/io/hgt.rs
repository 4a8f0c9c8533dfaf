//! SRTM height files (`N36W118.hgt`).
//!
//! In: big-endian 16-bit metres, row by row from the north, -32768 for voids, nothing else in the file; the file's
//! length tells the resolution and its name the place. Out: a DEM in WGS 84 degrees (EPSG 4326) whose first and last
//! rows and columns lie exactly on the tile's border (pixel is point). Source: SRTM documentation, NASA / USGS.

use super::numbers::NumberType;
use super::place::{Place, Said};
use super::reading::Source;
use super::samples::{Rule, Samples};
use super::{Description, Format};
use crate::dem::{Dem, RasterSpace};
use crate::error::{Error, Result};
use std::path::Path;

/// (rows, columns) of the tiles that exist: 1 and 3 arc-seconds, the coarser columns beyond 50 degrees, a third of one.
const SHAPES: [(usize, usize); 4] = [(3601, 3601), (3601, 1801), (1201, 1201), (10_801, 10_801)];

/// Words that may follow the corner in a name: they say who made a tile, or how fine it is, and not where it is.
const PRODUCTS: [&str; 12] = [
    "SRTM", "SRTMGL1", "SRTMGL3", "SRTMGL3S", "NASADEM", "HGT", "DEM", "DTM", "DSM", "AW3D30", "COP30",
    "SWBD",
];

pub(super) fn read(source: &Source<'_>, bytes: &[u8], said: &mut Said) -> Result<(Dem, Description)> {
    let Source { path, options, sidecars } = *source;
    let shape = SHAPES.into_iter().find(|(rows, cols)| rows * cols * 2 == bytes.len());
    let Some((rows, cols)) = shape else {
        return Err(Error::file(
            path,
            "file size",
            format!("{} bytes", bytes.len()),
            "allowed: 25934402 (3601 x 3601), 12970802 (3601 x 1801), 2884802 (1201 x 1201) or 233323202 (10801 x 10801)",
        ));
    };
    let place = match corner(path) {
        Ok((latitude, longitude)) => place(latitude, longitude, rows, cols),
        Err(_) if options.cell_size.is_some() => {
            said.warnings.push("the name says no place: the raster has none".to_owned());
            Place::NOWHERE
        }
        Err(reason) => {
            let name = path.file_name().unwrap_or_default().display();
            let allowed = format!(
                "{reason}; allowed: the south-west corner of a tile of one degree, as in N36W118.hgt; or say how large \
                 cells are with --cell-size M"
            );
            return Err(Error::file(path, "file name", name, allowed));
        }
    };
    let settled = place.settle(path, options, sidecars, (rows, cols), |_| None, said)?;
    let mut samples = Samples::new(rows, cols, Rule::new(path, options, Some(VOID), 1.0)?);
    NumberType::I16.each(bytes, true, |i, value| samples.set(i, value));
    samples.flip(settled.flip_rows, settled.flip_cols);
    let description = Description::new(Format::Hgt, "i16", "", &settled);
    Ok((samples.into_dem(path, settled.cell_size, said)?.at(settled.georeference), description))
}

/// The number that marks missing heights.
const VOID: f64 = -32768.0;

/// Latitude and longitude of the south-west corner, from the file name: all of it must be understood. The error says what
/// is not.
fn corner(path: &Path) -> Result<(f64, f64), String> {
    let name = super::format::unpacked_name(path);
    let name = name.file_stem().and_then(|n| n.to_str()).unwrap_or_default().to_ascii_uppercase();
    let mut words = name.split(['.', '_', '-']);
    // The corner comes first, or after the product: NASADEM_HGT_n37w118.
    let place = words.find(|word| !PRODUCTS.contains(word)).unwrap_or_default();
    let (latitude, longitude, rest) = match (place.get(..3), place.get(3..7), place.get(7..)) {
        (Some(latitude), Some(longitude), Some(rest)) => (latitude, longitude, rest),
        _ => return Err("it names no corner".to_owned()),
    };
    let resolution =
        |word: &str| matches!(word, "1ARC" | "3ARC" | "1" | "3" | "13" | "V1" | "V2" | "V3" | "V4");
    let degrees = |text: &str, negative: char, positive: char, most: u16| {
        let mut letters = text.chars();
        let sign = match letters.next() {
            Some(c) if c == positive => 1.0,
            Some(c) if c == negative => -1.0,
            _ => return None,
        };
        let digits = letters.as_str();
        let value: u16 = digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok()).flatten()?;
        (value <= most).then_some(sign * f64::from(value))
    };
    let latitude =
        degrees(latitude, 'S', 'N', 89).or_else(|| degrees(latitude, 'S', 'N', 90).filter(|l| *l < 0.0));
    let (Some(latitude), Some(longitude)) = (latitude, degrees(longitude, 'W', 'E', 180)) else {
        return Err("it names no corner".to_owned());
    };
    if !rest.is_empty() {
        return Err(format!("{rest:?} after the corner is not understood: perhaps a part of a degree"));
    }
    if let Some(strange) = words.find(|word| !PRODUCTS.contains(word) && !resolution(word)) {
        return Err(format!("{strange:?} after the corner is not understood"));
    }
    Ok((latitude, longitude))
}

fn place(latitude: f64, longitude: f64, rows: usize, cols: usize) -> Place {
    let (dx, dy) = (1.0 / (cols - 1) as f64, 1.0 / (rows - 1) as f64);
    Place {
        transform: Some([dx, 0.0, longitude - dx / 2.0, 0.0, -dy, latitude + 1.0 + dy / 2.0]),
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
        for (name, latitude, longitude) in [
            ("a/N36W118.hgt", 36.0, -118.0),
            ("s01e179.SRTMGL1.hgt", -1.0, 179.0),
            ("n37w118.hgt", 37.0, -118.0),
            ("N37W118.hgt.gz", 37.0, -118.0),
            ("NASADEM_HGT_n37w118.hgt", 37.0, -118.0),
            ("n36_w118_1arc_v3.hgt", 0.0, 0.0),
            ("N36W118_1arc_v3.hgt", 36.0, -118.0),
            ("USGS", 0.0, 0.0),
            ("S90W180.hgt", -90.0, -180.0),
        ] {
            let found = corner(Path::new(name));
            assert_eq!(found.ok().unwrap_or((0.0, 0.0)), (latitude, longitude), "{name}");
        }
        for wrong in [
            "N3W118.hgt",
            "tile.hgt",
            "N99W118.hgt",
            "N36W1+8.hgt",
            "é.hgt",
            "",
            "N45W074T86.hgt",
            "N45W074T86.hgt.gz",
            "N45W074_T86.hgt",
            "N45W0740.hgt",
            "N45W074a.hgt",
            "N90E000.hgt",
            "N45W074.part2.hgt",
        ] {
            assert!(corner(Path::new(wrong)).is_err(), "{wrong}");
        }
    }
}
