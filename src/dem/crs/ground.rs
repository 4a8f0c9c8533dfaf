//! From map coordinates to metres on the ground.
//!
//! Degrees are converted on the ellipsoid at the raster's middle latitude. Web mercator metres are multiplied by the cosine
//! of the middle latitude. Of every other projection the scale at the middle of the raster is measured, by undoing it at
//! four points around the middle: within 1 % of the map (surveyors' systems are within 0.1 %), lengths on the map count as
//! they are, beyond that they are corrected and a note says so. One cell size stands for the whole raster: over one degree
//! at 45 N the true width changes by 1.7 %.

use super::inverse::Inverse;
use super::{Crs, CrsKind};
use crate::dem::{CellSize, Georeference};
use crate::error::{Error, Result};
use proj_core::ProjectionMethod;

/// Radius of the sphere behind web mercator, metres (EPSG 3857: the semi-major axis of WGS 84).
const MERCATOR_RADIUS: f64 = 6_378_137.0;

/// A map whose scale is so near 1 counts as true.
const TRUE_WITHIN: f64 = 0.01;

/// Scales, ground against map, that a place inside a projection can have: mercator has 1/12 at 85 degrees.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// Nobody surveys terrain with cells below this, metres: such numbers are degrees, or kilometres.
const SMALLEST_CELL: f64 = 0.02;

/// Cells of a grid whose corner is (0, 0) are believed to be metres from this size on, although they could be degrees.
const SMALLEST_LOCAL: f64 = 0.1;

/// Cosine of the angle between rows and columns up to which cells count as rectangles.
const SQUARE_ANGLE: f64 = 1e-3;

/// Degrees by which a projection may tilt rows against columns without a word.
const SLANT: f64 = 1.0;

/// How large the cells of a raster are on the ground, and what that rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Sides of a cell, metres.
    pub cell_size: CellSize,
    /// Nothing says what a unit of the coordinates is: metres were assumed, and a note says so.
    pub(crate) assumed: bool,
    /// What a careful reader would like to know: what was assumed, what was corrected.
    pub(crate) notes: Vec<String>,
}

impl Georeference {
    /// The coordinate system, when it is known: the definition, else that of the EPSG code.
    #[must_use]
    pub fn crs(&self) -> Option<Crs> {
        self.definition.or_else(|| self.epsg.and_then(Crs::from_epsg))
    }

    /// The coordinate system in words, with its unit; says so when there is none or its code is not known.
    #[must_use]
    pub(crate) fn coordinates_in_words(&self) -> String {
        match (self.crs(), self.epsg) {
            (Some(crs), _) => crs.in_words(),
            (None, Some(code)) => format!("EPSG:{code}, unknown"),
            (None, None) => "none stated".to_owned(),
        }
    }

    /// The size of a cell on the ground, for a raster of `rows` x `cols`.
    ///
    /// # Errors
    /// When the transform is degenerate or skewed (cells would not be rectangles), a latitude is impossible, the place lies
    /// outside what the projection can show, or coordinates of no stated unit look like degrees.
    pub fn ground(&self, (rows, cols): (usize, usize)) -> Result<Ground> {
        let [a, b, _, d, e, _] = self.transform;
        if !self.transform.iter().all(|v| v.is_finite()) {
            return Err(Error::value(
                "transformation",
                format!("{:?}", self.transform),
                "allowed: finite numbers",
            ));
        }
        let (x, y) = self.to_model(cols as f64 / 2.0, rows as f64 / 2.0);
        let crs = self.crs();
        if let Some(crs) = crs.filter(|crs| crs.kind() == CrsKind::Geographic) {
            return degrees(&crs, self.transform, y);
        }
        check_angle([a, d], [b, e])?;
        let sides = CellSize::new(a.hypot(d), b.hypot(e))?;
        let Some((crs, metres)) = crs.and_then(|crs| Some((crs, crs.metres_per_unit()?))) else {
            return self.without_unit(sides, (rows, cols));
        };
        let on_map = CellSize::new(sides.x() * metres, sides.y() * metres)?;
        self.check_cell(on_map, "in the unit of the coordinate system", (rows, cols))?;
        match crs.method() {
            Some(ProjectionMethod::WebMercator) => {
                let cosine = (y / MERCATOR_RADIUS).sinh().atan().cos();
                let cell_size = CellSize::new(on_map.x() * cosine, on_map.y() * cosine)?;
                let notes = corrected("web mercator", on_map, cell_size);
                Ok(Ground { cell_size, assumed: false, notes })
            }
            _ if crs.can_be_undone() => {
                let (cell_size, angle) = measured(&crs, self.transform, (x, y))?;
                let mut notes = Vec::new();
                if (angle - 90.0).abs() > SLANT {
                    notes.push(format!(
                        "rows and columns meet at {angle:.1} degrees on the ground: cells are taken for rectangles"
                    ));
                }
                let (across, down) = (cell_size.x() / on_map.x(), cell_size.y() / on_map.y());
                if [across, down].iter().all(|scale| (scale - 1.0).abs() <= TRUE_WITHIN) {
                    return Ok(Ground { cell_size: on_map, assumed: false, notes });
                }
                notes.extend(corrected("the projection", on_map, cell_size));
                Ok(Ground { cell_size, assumed: false, notes })
            }
            _ if crs.kind() == CrsKind::Local => {
                Ok(Ground { cell_size: on_map, assumed: false, notes: Vec::new() })
            }
            _ => {
                let note = "the projection is not known: lengths on the map are taken for lengths on the ground \
                            (--cell-size overrules)";
                Ok(Ground { cell_size: on_map, assumed: false, notes: vec![note.to_owned()] })
            }
        }
    }

    /// Coordinates whose unit nobody stated: metres, unless that cannot be.
    fn without_unit(&self, cell_size: CellSize, shape: (usize, usize)) -> Result<Ground> {
        self.check_cell(cell_size, "without a known coordinate system", shape)?;
        let why = match self.epsg {
            Some(code) => format!("EPSG:{code} is not in the table of coordinate systems"),
            None => "no coordinate system is stated".to_owned(),
        };
        let note = format!(
            "{why}: its unit is taken for metres, cells for {} (--cell-size overrules)",
            cell_size.in_words()
        );
        Ok(Ground { cell_size, assumed: true, notes: vec![note] })
    }

    /// Refuses lengths that must be degrees.
    fn check_cell(&self, cell_size: CellSize, whence: &str, (rows, cols): (usize, usize)) -> Result<()> {
        let corner = |col: usize, row: usize| self.to_model(col as f64, row as f64);
        let corners = [corner(0, 0), corner(cols, 0), corner(0, rows), corner(cols, rows)];
        let on_globe =
            corners.iter().all(|(x, y)| (-180.5..=360.5).contains(x) && (-90.5..=90.5).contains(y));
        let size = cell_size.x().max(cell_size.y());
        // Local grids begin at (0, 0), and small ones have all their corners within 90 m of it.
        let local = size >= SMALLEST_LOCAL && corners.iter().any(|&(x, y)| x == 0.0 && y == 0.0);
        let doubtful = self.crs().is_none_or(|crs| crs.kind() == CrsKind::Projected && size < 1.0);
        if size >= SMALLEST_CELL && !(on_globe && !local && doubtful) {
            return Ok(());
        }
        let (west, south) = corners[2];
        Err(Error::value(
            "cell size",
            format!("{} x {} m, south-west corner {west}, {south}, {whence}", cell_size.x(), cell_size.y()),
            "this looks like degrees, not metres: say how large cells are with --cell-size M",
        ))
    }
}

fn degrees(crs: &Crs, [a, b, _, d, e, _]: [f64; 6], latitude: f64) -> Result<Ground> {
    if !(-90.0..=90.0).contains(&latitude) {
        return Err(Error::value(
            "latitude of the centre",
            latitude,
            "allowed: -90 to 90 degrees; --cell-size overrules",
        ));
    }
    let (east, north) = crs.ellipsoid().metres_per_degree(latitude);
    let (across, down) = ([a * east, d * north], [b * east, e * north]);
    let cell_size = CellSize::new(across[0].hypot(across[1]), down[0].hypot(down[1]))?;
    check_angle(across, down)?;
    Ok(Ground { cell_size, assumed: false, notes: Vec::new() })
}

/// The sides of a cell, and the angle between them in degrees, by undoing the projection around (`x`, `y`).
fn measured(crs: &Crs, [a, b, _, d, e, _]: [f64; 6], (x, y): (f64, f64)) -> Result<(CellSize, f64)> {
    let outside = |reason: &dyn std::fmt::Display| {
        Error::value(
            "middle of the raster",
            format!("{x}, {y} in {}", crs.in_words()),
            format!("not a place of that system ({reason}): say how large cells are with --cell-size M"),
        )
    };
    let inverse = Inverse::of(crs).map_err(|e| outside(&e))?;
    // A kilometre: far above the error of the inverse (below a millimetre), far below where curvature counts.
    let step = 1000.0 / crs.metres_per_unit().unwrap_or(1.0);
    let point = |x: f64, y: f64| -> Result<[f64; 3]> {
        let (longitude, latitude) = inverse.degrees((x, y)).map_err(|e| outside(&e))?;
        Ok(crs.ellipsoid().point(longitude, latitude))
    };
    // The way of one cell along (dx, dy), as a vector in space: at a pole longitudes have no derivative, places do.
    let along = |dx: f64, dy: f64| -> Result<[f64; 3]> {
        let length = dx.hypot(dy);
        let (ux, uy) = (dx / length * step, dy / length * step);
        let (p, q) = (point(x + ux, y + uy)?, point(x - ux, y - uy)?);
        Ok(std::array::from_fn(|i| (p[i] - q[i]) / (2.0 * step) * length))
    };
    let (across, down) = (along(a, d)?, along(b, e)?);
    let dot = |p: [f64; 3], q: [f64; 3]| p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>();
    let (width, height) = (dot(across, across).sqrt(), dot(down, down).sqrt());
    let size = CellSize::new(width, height).map_err(|e| outside(&e))?;
    let scales =
        [width / (a.hypot(d)), height / (b.hypot(e))].map(|s| s / crs.metres_per_unit().unwrap_or(1.0));
    if !scales.iter().all(|scale| PLAUSIBLE.contains(scale)) {
        return Err(outside(&format_args!("a metre on the map would be {:.2e} m on the ground", scales[0])));
    }
    Ok((size, (dot(across, down) / (width * height)).acos().to_degrees()))
}

fn corrected(what: &str, on_map: CellSize, on_ground: CellSize) -> Vec<String> {
    let (map, ground) = (on_map.in_words(), on_ground.in_words());
    if map == ground {
        return Vec::new();
    }
    vec![format!("{what} stretches the map here: cells of {map} on it are {ground} on the ground")]
}

/// Refuses cells that are no rectangles.
fn check_angle(across: [f64; 2], down: [f64; 2]) -> Result<()> {
    let lengths = across[0].hypot(across[1]) * down[0].hypot(down[1]);
    let cosine = (across[0] * down[0] + across[1] * down[1]) / lengths;
    if lengths == 0.0 || cosine.abs() <= SQUARE_ANGLE {
        return Ok(());
    }
    Err(Error::value(
        "transformation",
        format!("skewed: rows and columns meet at {:.2} degrees", cosine.acos().to_degrees()),
        "allowed: a right angle; --cell-size says how large cells are",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::RasterSpace;
    use approx::assert_relative_eq;

    fn placed(transform: [f64; 6], epsg: Option<u32>) -> Georeference {
        Georeference { transform, epsg, definition: None, raster_space: RasterSpace::PixelIsArea }
    }

    /// Square cells of `side`, the middle of a 10 x 10 raster at (x, y).
    fn around(epsg: u32, side: f64, (x, y): (f64, f64)) -> Ground {
        let transform = [side, 0.0, x - 5.0 * side, 0.0, -side, y + 5.0 * side];
        placed(transform, Some(epsg)).ground((10, 10)).unwrap()
    }

    #[test]
    fn units_and_scales_of_projections() {
        // Scales by PROJ 9.5 (pyproj.Proj.get_factors), of the map against the ground.
        for (epsg, side, middle, width, height, corrected) in [
            (32611, 30.0, (5e5, 4.1e6), 30.0, 30.0, false),
            (2227, 100.0, (6_561_666.667, 1_640_416.667), 30.480_061, 30.480_061, false),
            (3395, 60.0, (1e6, 8_362_698.5), 30.075_597, 30.075_597, true),
            (54_004, 60.0, (1e6, 8_362_698.5), 30.075_597, 30.075_597, true),
            (3413, 1000.0, (0.0, -2e6), 1000.0, 1000.0, false),
            (3413, 1000.0, (0.0, 0.0), 1_031.078_573, 1_031.078_573, true),
            (3031, 500.0, (1e6, 1e6), 507.448_580, 507.448_580, true),
            (3035, 25.0, (2.9e6, 1.6e6), 25.0, 25.0, false),
            // Equidistant on the ellipsoid (EPSG method 1028), which PROJ has from 9.8 on: N cos(lat) / a.
            (4087, 1000.0, (1_113_194.9, 6_654_072.8), 501.26, 1000.0, true),
            // Web mercator by the cosine of its own latitude: within 0.3 % of the ellipsoid (30.076 x 30.025).
            (3857, 60.0, (1e6, 8_399_737.89), 30.0, 30.0, true),
        ] {
            let ground = around(epsg, side, middle);
            let (size, notes) = (ground.cell_size, ground.notes.join("; "));
            assert_relative_eq!(size.x(), width, max_relative = 1e-5);
            assert_relative_eq!(size.y(), height, max_relative = 1e-5);
            assert_eq!(notes.contains("stretches the map"), corrected, "{epsg}: {notes}");
            assert!(!ground.assumed);
        }
    }

    /// Systems that no code names, on ellipsoids with and without a known datum.
    #[test]
    fn definitions_without_a_code_are_measured() {
        for text in [
            "+proj=merc +lon_0=10 +datum=WGS84",
            "+proj=merc +lon_0=10 +ellps=bessel",
            "+proj=merc +lon_0=10 +R=6371000",
            "+proj=merc +lon_0=10 +a=6378000 +rf=299",
        ] {
            let definition = Crs::parse(text).ok();
            let place = Georeference { definition, ..placed([60.0, 0.0, 0.0, 0.0, -60.0, 8.36e6], None) };
            let ground = place.ground((9, 9)).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert!((29.8..30.4).contains(&ground.cell_size.x()), "{text}: {ground:?}");
        }
    }

    #[test]
    fn a_skewed_transform_and_a_far_latitude_are_refused() {
        let skewed = placed([30.0, 10.0, 0.0, 0.0, -30.0, 0.0], Some(32611));
        assert!(skewed.ground((4, 4)).unwrap_err().to_string().contains("71.57 degrees"));
        let far = placed([0.1, 0.0, 0.0, 0.0, -0.1, 4000.0], Some(4326));
        assert!(far.ground((4, 4)).unwrap_err().to_string().contains("latitude"));
        let (s, c) = 0.3f64.sin_cos();
        let rotated = placed([30.0 * c, 20.0 * s, 5e5, 30.0 * s, -20.0 * c, 4e6], Some(32611));
        let size = rotated.ground((4, 4)).unwrap().cell_size;
        assert_relative_eq!(size.x(), 30.0, epsilon = 1e-9);
        assert_relative_eq!(size.y(), 20.0, epsilon = 1e-9);
    }

    #[test]
    fn coordinates_like_degrees_are_refused() {
        let degrees = [
            ([0.0008, 0.0, 8.0, 0.0, -0.0008, 47.0], (1201, 1201)),
            ([0.05, 0.0, -118.5, 0.0, -0.05, 39.7], (64, 72)),
            ([1.0, 0.0, -180.0, 0.0, -1.0, 90.0], (180, 360)),
            ([5.0, 0.0, 0.0, 0.0, -5.0, 90.0], (36, 72)),
            // Degrees for the cell, metres for the place.
            ([0.000833, 0.0, 5e5, 0.0, -0.000833, 4e6], (64, 64)),
        ];
        for (transform, shape) in degrees {
            let message = placed(transform, None).ground(shape).unwrap_err().to_string();
            assert!(message.contains("degrees") && message.contains("--cell-size"), "{message}");
            assert!(placed(transform, Some(32_767)).ground(shape).is_err(), "{transform:?}");
        }
        let metres = [
            ([30.0, 0.0, 5e5, 0.0, -30.0, 4e6], (64, 64)),
            ([1.0, 0.0, 0.0, 0.0, -1.0, 64.0], (64, 64)),
            ([0.25, 0.0, 0.0, 0.0, -0.25, 16.0], (64, 64)),
            ([2.0, 0.0, -20.0, 0.0, -2.0, 400.0], (64, 64)),
        ];
        for (transform, shape) in metres {
            let ground = placed(transform, None).ground(shape).unwrap();
            assert!(ground.assumed && ground.notes[0].contains("taken for metres"), "{ground:?}");
            assert_eq!(ground.cell_size.x(), transform[0]);
        }
        // A projected label on degrees.
        let wrong = placed([0.05, 0.0, -118.5, 0.0, -0.05, 39.7], Some(32611));
        assert!(wrong.ground((64, 72)).is_err());
    }

    #[test]
    fn an_unknown_code_is_named() {
        let ground = placed([30.0, 0.0, 5e5, 0.0, -30.0, 4e6], Some(29_999)).ground((9, 9)).unwrap();
        assert!(ground.assumed && ground.notes[0].contains("EPSG:29999"), "{ground:?}");
        let local = Crs::local(0.3048).unwrap();
        let feet =
            Georeference { definition: Some(local), ..placed([100.0, 0.0, 5e5, 0.0, -100.0, 4e6], None) };
        let ground = feet.ground((9, 9)).unwrap();
        assert_eq!((ground.cell_size.x(), ground.assumed, ground.notes.len()), (30.48, false, 0));
    }
}
