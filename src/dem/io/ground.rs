//! From map coordinates to metres on the ground.
//!
//! Degrees are converted on the ellipsoid at the raster's middle latitude (meridional radius M north-south, N cos(lat)
//! east-west; Snyder 1987, *Map Projections*, eq. 4-18 and 4-20). Web mercator metres are multiplied by the cosine of
//! the middle latitude. Other projected coordinates are taken as they are, times their linear unit. One cell size
//! stands for the whole raster: over one degree at 45 N the true width changes by 1.7 %.

use super::super::{CellSize, Georeference};
use crate::error::{Error, Result};
use std::path::Path;

/// Radius of the sphere behind web mercator, metres (EPSG 3857: the semi-major axis of WGS 84).
const MERCATOR_RADIUS: f64 = 6_378_137.0;

/// Cells smaller than this, near coordinates that could be degrees, are taken for degrees without a label.
const SUSPICIOUS_CELL: f64 = 0.02;

/// Size and shape of a planet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipsoid {
    /// Equatorial radius, metres.
    pub(super) semi_major: f64,
    /// (a - b) / a.
    pub(super) flattening: f64,
}

impl Ellipsoid {
    pub(super) const WGS84: Self = Self { semi_major: 6_378_137.0, flattening: 1.0 / 298.257_223_563 };

    /// Metres in a degree of longitude and of latitude, at `latitude` degrees.
    pub(super) fn metres_per_degree(self, latitude: f64) -> (f64, f64) {
        let (sin, cos) = latitude.to_radians().sin_cos();
        let e2 = self.flattening * (2.0 - self.flattening);
        let w2 = 1.0 - e2 * sin * sin;
        let prime_vertical = self.semi_major / w2.sqrt();
        let meridional = prime_vertical * (1.0 - e2) / w2;
        let degree = 1f64.to_radians();
        (prime_vertical * cos * degree, meridional * degree)
    }
}

/// What one unit of a file's coordinates is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MapUnit {
    /// This many metres.
    Metres(f64),
    /// Metres of web mercator.
    WebMercator,
    /// This many degrees on an ellipsoid.
    Degrees(f64, Ellipsoid),
    /// The file does not say: taken as metres, unless it looks like degrees.
    Unstated,
}

/// The ground size of a raster's cells.
///
/// Errors when the transformation is degenerate or skewed (cells would not be rectangles on the ground), when the
/// latitude is impossible, or when unlabelled coordinates look like degrees.
pub(super) fn cell_size(
    path: &Path,
    georeference: &Georeference,
    unit: MapUnit,
    (rows, cols): (usize, usize),
) -> Result<CellSize> {
    let (x, y) = georeference.to_model(cols as f64 / 2.0, rows as f64 / 2.0);
    let (east, north) = match unit {
        MapUnit::Metres(factor) => (factor, factor),
        MapUnit::Unstated => (1.0, 1.0),
        MapUnit::WebMercator => {
            let latitude = (y / MERCATOR_RADIUS).sinh().atan();
            (latitude.cos(), latitude.cos())
        }
        MapUnit::Degrees(factor, ellipsoid) => {
            let latitude = y * factor;
            if !(-90.0..=90.0).contains(&latitude) {
                return Err(Error::file(
                    path,
                    "latitude of the centre",
                    latitude,
                    "allowed: -90 to 90 degrees",
                ));
            }
            let (east, north) = ellipsoid.metres_per_degree(latitude);
            (east * factor, north * factor)
        }
    };
    let [a, b, _, d, e, _] = georeference.transform;
    let (across, down) = ((a * east, d * north), (b * east, e * north));
    let (width, height) = (across.0.hypot(across.1), down.0.hypot(down.1));
    let size = CellSize::new(width, height).map_err(|e| e.in_file(path))?;
    let cosine = (across.0 * down.0 + across.1 * down.1) / (width * height);
    if cosine.abs() > 1e-3 {
        return Err(Error::file(
            path,
            "transformation",
            format!("skewed: rows and columns meet at {:.2} degrees", cosine.acos().to_degrees()),
            "allowed: a right angle",
        ));
    }
    let looks_like_degrees = width.max(height) < SUSPICIOUS_CELL && x.abs() <= 360.0 && y.abs() <= 90.0;
    if unit == MapUnit::Unstated && looks_like_degrees {
        return Err(Error::file(
            path,
            "cell size",
            format!("{width} x {height} without a coordinate system"),
            "this looks like degrees, not metres: give the cell size in metres",
        ));
    }
    Ok(size)
}

/// Where a raster lies after turning row 0 to the north, and which turns that takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement {
    /// The transform of the turned raster.
    pub(super) transform: [f64; 6],
    /// Rows must be reversed.
    pub(super) flip_rows: bool,
    /// Columns must be reversed.
    pub(super) flip_cols: bool,
}

impl Placement {
    /// Undoes mirroring (south-up rasters), and a half turn of an axis-parallel raster; a rotated raster that is not
    /// mirrored stays as it is.
    pub(super) fn north_up(transform: [f64; 6], rows: usize, cols: usize) -> Self {
        let [a, b, c, d, e, f] = transform;
        let mut turned = Self { transform, flip_rows: false, flip_cols: false };
        if b == 0.0 && d == 0.0 {
            turned.flip_rows = e > 0.0;
            turned.flip_cols = a < 0.0;
        } else {
            turned.flip_rows = a * e - b * d > 0.0;
        }
        let (mut a, mut b, mut c, mut d, mut e, mut f) = (a, b, c, d, e, f);
        if turned.flip_rows {
            (c, f) = (c + b * rows as f64, f + e * rows as f64);
            (b, e) = (-b, -e);
        }
        if turned.flip_cols {
            (c, f) = (c + a * cols as f64, f + d * cols as f64);
            (a, d) = (-a, -d);
        }
        turned.transform = [a, b, c, d, e, f].map(|v| v + 0.0);
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::RasterSpace;
    use approx::assert_relative_eq;

    fn placed(transform: [f64; 6]) -> Georeference {
        Georeference { transform, epsg: None, definition: None, raster_space: RasterSpace::PixelIsArea }
    }

    #[test]
    fn degrees_on_the_ellipsoid() {
        // Geodesics on WGS 84 by PROJ (tests/oracle/terrain_files.py), metres.
        for (latitude, east, north) in [
            (0.0, 111_319.491, 110_574.276),
            (36.5, 89_591.101, 110_968.296),
            (80.0, 19_393.486, 111_659.940),
        ] {
            let (x, y) = Ellipsoid::WGS84.metres_per_degree(latitude);
            assert_relative_eq!(x, east, epsilon = 0.002);
            assert_relative_eq!(y, north, epsilon = 0.002);
        }
    }

    #[test]
    fn a_skewed_transform_and_a_far_latitude_are_refused() {
        let path = Path::new("x");
        let skewed = placed([30.0, 10.0, 0.0, 0.0, -30.0, 0.0]);
        assert!(cell_size(path, &skewed, MapUnit::Metres(1.0), (4, 4)).is_err());
        let far = placed([0.1, 0.0, 0.0, 0.0, -0.1, 4000.0]);
        assert!(cell_size(path, &far, MapUnit::Degrees(1.0, Ellipsoid::WGS84), (4, 4)).is_err());
        let unlabelled = placed([0.0008, 0.0, 8.0, 0.0, -0.0008, 47.0]);
        assert!(cell_size(path, &unlabelled, MapUnit::Unstated, (4, 4)).is_err());
        let (s, c) = 0.3f64.sin_cos();
        let rotated = placed([30.0 * c, 20.0 * s, 5.0, 30.0 * s, -20.0 * c, 7.0]);
        let size = cell_size(path, &rotated, MapUnit::Metres(1.0), (4, 4)).unwrap();
        assert_relative_eq!(size.x(), 30.0, epsilon = 1e-9);
        assert_relative_eq!(size.y(), 20.0, epsilon = 1e-9);
    }

    #[test]
    fn turning_keeps_every_corner_in_place() {
        for t in [
            [2.0, 0.0, 10.0, 0.0, 3.0, 20.0],
            [-2.0, 0.0, 10.0, 0.0, -3.0, 20.0],
            [-2.0, 0.0, 10.0, 0.0, 3.0, 20.0],
            [2.0, 1.0, 10.0, -1.0, 2.0, 20.0],
        ] {
            let (rows, cols) = (4usize, 6usize);
            let turned = Placement::north_up(t, rows, cols);
            let [a, b, _, d, e, _] = turned.transform;
            assert!(a * e - b * d < 0.0, "mirrored: {turned:?}");
            for (row, col) in [(0, 0), (3, 1), (1, 5)] {
                let new_row = if turned.flip_rows { rows - 1 - row } else { row };
                let new_col = if turned.flip_cols { cols - 1 - col } else { col };
                let old = placed(t).to_model(col as f64 + 0.5, row as f64 + 0.5);
                let new = placed(turned.transform).to_model(new_col as f64 + 0.5, new_row as f64 + 0.5);
                assert_relative_eq!(old.0, new.0);
                assert_relative_eq!(old.1, new.1);
            }
        }
    }
}
