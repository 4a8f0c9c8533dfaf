//! Where a GeoTIFF lies: the affine transform, the coordinate system, its units.
//!
//! Source: OGC GeoTIFF 1.1. Coordinates are kept as the file has them, except angles in other units, which become
//! degrees. No projection database is consulted: a projected system's linear unit is what the file states, else metres.

use super::directory::Directory;
use super::{key, tag};
use crate::dem::RasterSpace;
use crate::dem::io::ReadOptions;
use crate::dem::io::ground::{Ellipsoid, MapUnit};
use crate::error::{Error, Result};
use std::path::Path;

/// EPSG codes of web mercator.
const WEB_MERCATOR: [u32; 2] = [3857, 3785];

/// What the tags say.
#[derive(Debug)]
pub(super) struct Location {
    /// Raster (col, row), outer corner at (0, 0), to coordinates; see [`crate::dem::Georeference::transform`].
    pub(super) transform: Option<[f64; 6]>,
    pub(super) epsg: Option<u32>,
    pub(super) raster_space: RasterSpace,
    pub(super) unit: MapUnit,
    /// Metres in a vertical unit.
    pub(super) vertical_unit: Option<f64>,
    /// The coordinate system in words.
    pub(super) words: String,
    pub(super) notes: Vec<String>,
}

impl Location {
    pub(super) fn parse(path: &Path, directory: &Directory<'_>, options: &ReadOptions) -> Result<Self> {
        let keys = Keys::parse(path, directory)?;
        let raster_space = match keys.code(key::RASTER_TYPE) {
            None | Some(key::PIXEL_IS_AREA) => RasterSpace::PixelIsArea,
            Some(key::PIXEL_IS_POINT) => RasterSpace::PixelIsPoint,
            Some(other) => {
                let allowed = "allowed: 1 (pixel is area) or 2 (pixel is point)";
                return Err(Error::file(path, "GTRasterTypeGeoKey", other, allowed));
            }
        };
        let mut notes = Vec::new();
        let transform = transform(path, directory, options, raster_space, &mut notes)?;
        let (epsg, unit, words) = keys.coordinate_system(path, &mut notes)?;
        let (transform, unit) = match (transform, unit) {
            (Some(t), MapUnit::Degrees(factor, ellipsoid)) if factor != 1.0 => {
                (Some(t.map(|v| v * factor)), MapUnit::Degrees(1.0, ellipsoid))
            }
            unchanged => unchanged,
        };
        let vertical_unit = match keys.code(key::VERTICAL_UNITS) {
            Some(code) if options.metres_per_unit.is_none() => {
                Some(linear_unit(path, "VerticalUnitsGeoKey", code)?)
            }
            _ => None,
        };
        let words = if transform.is_none() && epsg.is_none() { "none".to_owned() } else { words };
        Ok(Self { transform, epsg, raster_space, unit, vertical_unit, words, notes })
    }
}

fn transform(
    path: &Path,
    directory: &Directory<'_>,
    options: &ReadOptions,
    space: RasterSpace,
    notes: &mut Vec<String>,
) -> Result<Option<[f64; 6]>> {
    let wrong_count = |t: u16, n: usize, allowed: &str| {
        Error::file(path, tag::name(t), format!("{n} numbers"), allowed.to_owned())
    };
    // In the file's own raster coordinates.
    let [a, b, c, d, e, f] = if let Some(m) = directory.floats(tag::MODEL_TRANSFORMATION)? {
        if m.len() != 16 {
            return Err(wrong_count(tag::MODEL_TRANSFORMATION, m.len(), "allowed: 16"));
        }
        [m[0], m[1], m[3], m[4], m[5], m[7]]
    } else {
        let ties = directory.floats(tag::MODEL_TIEPOINT)?.unwrap_or_default();
        if ties.len() % 6 != 0 {
            return Err(wrong_count(tag::MODEL_TIEPOINT, ties.len(), "allowed: six for each tiepoint"));
        }
        let Some(scale) = directory.floats(tag::MODEL_PIXEL_SCALE)? else {
            if ties.len() > 6 && options.cell_size.is_none() {
                return Err(Error::file(
                    path,
                    "georeference",
                    format!("{} ground control points", ties.len() / 6),
                    "allowed: a pixel scale with a tiepoint, or a transformation; or give the cell size",
                ));
            }
            return Ok(None);
        };
        let [sx, sy, ..] = scale[..] else {
            return Err(wrong_count(tag::MODEL_PIXEL_SCALE, scale.len(), "allowed: 2 or 3"));
        };
        if sx <= 0.0 || sy <= 0.0 {
            let size = format!("{sx} x {sy}");
            return Err(Error::file(path, "ModelPixelScale", size, "allowed: positive numbers"));
        }
        if ties.is_empty() {
            notes.push("a pixel scale without a tiepoint: placed at the origin".to_owned());
        }
        let [i, j, _, x, y, _] = ties.get(..6).and_then(|t| t.try_into().ok()).unwrap_or([0.0; 6]);
        [sx, 0.0, x - sx * i, 0.0, -sy, y + sy * j]
    };
    let half = match space {
        RasterSpace::PixelIsArea => 0.0,
        RasterSpace::PixelIsPoint => 0.5,
    };
    Ok(Some([a, b, c - half * (a + b), d, e, f - half * (d + e)]))
}

/// The GeoKeys, each a short code or a double.
struct Keys {
    shorts: Vec<(u16, u16)>,
    doubles: Vec<(u16, f64)>,
}

impl Keys {
    fn parse(path: &Path, directory: &Directory<'_>) -> Result<Self> {
        let mut keys = Self { shorts: Vec::new(), doubles: Vec::new() };
        let Some(raw) = directory.unsigned(tag::GEO_KEY_DIRECTORY)? else { return Ok(keys) };
        let found = raw.len();
        let wrong = |value: String| {
            let allowed = format!("the tag holds {found} numbers: four for the header, four for each key");
            Error::file(path, "GeoKeyDirectory", value, allowed)
        };
        let count = *raw.get(3).ok_or_else(|| wrong("shorter than its header".to_owned()))?;
        let entries = raw[4..].chunks_exact(4);
        if count > entries.len() as u64 {
            return Err(wrong(format!("{count} keys")));
        }
        let values = directory.floats(tag::GEO_DOUBLE_PARAMS)?.unwrap_or_default();
        for entry in entries.take(count as usize) {
            // A SHORT tag by specification; larger numbers from a LONG tag mean nothing.
            let (id, place, value) = (entry[0] as u16, entry[1], entry[3]);
            match place {
                0 => keys.shorts.push((id, value as u16)),
                place if place == u64::from(tag::GEO_DOUBLE_PARAMS) => {
                    let number = usize::try_from(value).ok().and_then(|i| values.get(i));
                    let number = number.ok_or_else(|| wrong(format!("key {id} at double {value}")))?;
                    keys.doubles.push((id, *number));
                }
                _ => {}
            }
        }
        Ok(keys)
    }

    fn code(&self, key: u16) -> Option<u16> {
        self.shorts.iter().find(|(k, _)| *k == key).map(|(_, v)| *v)
    }

    fn double(&self, key: u16) -> Option<f64> {
        self.doubles.iter().find(|(k, _)| *k == key).map(|(_, v)| *v)
    }

    /// An EPSG code, unless it says "undefined" or "user-defined".
    fn epsg(&self, key: u16) -> Option<u32> {
        self.code(key).filter(|&v| v != 0 && v != key::USER_DEFINED).map(u32::from)
    }

    fn coordinate_system(
        &self,
        path: &Path,
        notes: &mut Vec<String>,
    ) -> Result<(Option<u32>, MapUnit, String)> {
        let model = match self.code(key::MODEL_TYPE) {
            Some(3) => {
                let allowed = "allowed: 1 (projected) or 2 (geographic)";
                return Err(Error::file(path, "GTModelTypeGeoKey", "3 (geocentric)", allowed));
            }
            Some(code @ (key::PROJECTED | key::GEOGRAPHIC)) => code,
            _ if self.code(key::PROJECTED_CRS).is_some() => key::PROJECTED,
            _ if self.code(key::GEODETIC_CRS).is_some() => key::GEOGRAPHIC,
            _ => 0,
        };
        let name = |epsg: Option<u32>| epsg.map_or("user-defined".to_owned(), |code| format!("EPSG:{code}"));
        if model == key::GEOGRAPHIC {
            let epsg = self.epsg(key::GEODETIC_CRS);
            let unit = MapUnit::Degrees(self.degrees_per_unit(path)?, self.ellipsoid(path)?);
            return Ok((epsg, unit, format!("{}, degrees", name(epsg))));
        }
        let epsg = self.epsg(key::PROJECTED_CRS);
        if epsg.is_some_and(|code| WEB_MERCATOR.contains(&code)) {
            let words = format!("{}, web mercator metres", name(epsg));
            return Ok((epsg, MapUnit::WebMercator, words));
        }
        let stated = match self.code(key::LINEAR_UNITS) {
            Some(key::USER_DEFINED) => self.double(key::LINEAR_UNIT_SIZE),
            Some(code) => Some(linear_unit(path, "ProjLinearUnitsGeoKey", code)?),
            None => None,
        };
        match (model, stated) {
            (_, Some(factor)) if !(factor.is_finite() && factor > 0.0) => Err(Error::file(
                path,
                "ProjLinearUnitSizeGeoKey",
                factor,
                "allowed: a positive number of metres",
            )),
            (0, None) => Ok((None, MapUnit::Unstated, "local, metres".to_owned())),
            (0, Some(factor)) => Ok((None, MapUnit::Metres(factor), format!("local, units of {factor} m"))),
            (_, Some(factor)) => {
                Ok((epsg, MapUnit::Metres(factor), format!("{}, units of {factor} m", name(epsg))))
            }
            (_, None) => {
                notes.push("the file states no linear unit: metres assumed".to_owned());
                Ok((epsg, MapUnit::Metres(1.0), format!("{}, metres", name(epsg))))
            }
        }
    }

    fn degrees_per_unit(&self, path: &Path) -> Result<f64> {
        match self.code(key::ANGULAR_UNITS) {
            None | Some(key::DEGREE | 9122) => Ok(1.0),
            Some(9101) => Ok(1f64.to_degrees()),
            Some(9103) => Ok(1.0 / 60.0),
            Some(9104) => Ok(1.0 / 3600.0),
            Some(9105 | 9106) => Ok(0.9),
            Some(other) => Err(Error::file(
                path,
                "GeogAngularUnitsGeoKey",
                other,
                "allowed: 9101 (radian), 9102 (degree), 9103 (minute), 9104 (second), 9105 (grad)",
            )),
        }
    }

    /// The file's own ellipsoid (the Moon's, say), else WGS 84's: on Earth the difference is below 0.02 %.
    fn ellipsoid(&self, path: &Path) -> Result<Ellipsoid> {
        let Some(semi_major) = self.double(key::SEMI_MAJOR_AXIS) else { return Ok(Ellipsoid::WGS84) };
        let flattening = match (self.double(key::INVERSE_FLATTENING), self.double(key::SEMI_MINOR_AXIS)) {
            (Some(0.0), _) | (None, None) => 0.0,
            (Some(inverse), _) => 1.0 / inverse,
            (None, Some(semi_minor)) => 1.0 - semi_minor / semi_major,
        };
        if !(semi_major > 0.0 && (0.0..0.5).contains(&flattening)) {
            let found = format!("semi-major axis {semi_major} m, flattening {flattening}");
            return Err(Error::file(
                path,
                "ellipsoid",
                found,
                "allowed: a positive axis, flattening from 0 to 0.5",
            ));
        }
        Ok(Ellipsoid { semi_major, flattening })
    }
}

/// Metres in an EPSG linear unit.
fn linear_unit(path: &Path, field: &str, code: u16) -> Result<f64> {
    match code {
        key::METRE => Ok(1.0),
        9002 => Ok(0.3048),
        9003 => Ok(1200.0 / 3937.0),
        9036 => Ok(1000.0),
        _ => Err(Error::file(
            path,
            field,
            code,
            "allowed: 9001 (metre), 9002 (foot), 9003 (US survey foot), 9036 (kilometre)",
        )),
    }
}
