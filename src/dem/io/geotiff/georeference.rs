//! Where a GeoTIFF lies: the affine transform, the coordinate system, its units.
//!
//! Source: OGC GeoTIFF 1.1. Coordinates are kept as the file has them, except angles in other units, which become degrees.
//! An EPSG code stands for its system (`dem::crs`); a unit that the file states counts before the code's.

use super::directory::Directory;
use super::{key, projection, tag};
use crate::dem::RasterSpace;
use crate::dem::crs::{Crs, CrsKind, Ellipsoid, linear_unit, unit_in_words};
use crate::dem::io::ReadOptions;
use crate::dem::io::place::{Place, Said, unless_given};
use crate::error::{Error, Result};
use std::path::Path;

/// What stands before Esri's WKT in the text of a key.
pub(super) const WORDS: &str = "ESRI PE String = ";

/// Two statements of one unit may differ by this much.
const SAME_UNIT: f64 = 1e-6;

/// The place that the tags say, and metres in a unit of the heights.
pub(super) fn location(
    path: &Path,
    directory: &Directory<'_>,
    options: &ReadOptions,
    said: &mut Said,
) -> Result<(Place, Option<f64>)> {
    let keys = unless_given(Keys::parse(path, directory), options, Keys::default(), said)?;
    let area = RasterSpace::PixelIsArea;
    let raster_space = unless_given(keys.raster_space(path), options, area, said)?;
    let transform = transform(path, directory, options, raster_space, said);
    let mut transform = unless_given(transform, options, None, said)?;
    let system = keys.coordinate_system(path, said);
    let system = unless_given(system, options, System::default(), said)?;
    if system.degrees != 1.0 {
        transform = transform.map(|t| t.map(|v| v * system.degrees));
    }
    let heights = if options.metres_per_unit.is_some() { None } else { keys.vertical_unit(path, said)? };
    Ok((Place { transform, epsg: system.epsg, definition: system.definition, raster_space }, heights))
}

fn transform(
    path: &Path,
    directory: &Directory<'_>,
    options: &ReadOptions,
    space: RasterSpace,
    said: &mut Said,
) -> Result<Option<[f64; 6]>> {
    let wrong_count = |t: u16, n: usize, allowed: &str| {
        Error::file(
            path,
            tag::name(t),
            format!("{n} numbers"),
            format!("allowed: {allowed}; or give --cell-size M"),
        )
    };
    // In the file's own raster coordinates.
    let [a, b, c, d, e, f] = if let Some(m) = directory.floats(tag::MODEL_TRANSFORMATION)? {
        if m.len() != 16 {
            return Err(wrong_count(tag::MODEL_TRANSFORMATION, m.len(), "16"));
        }
        [m[0], m[1], m[3], m[4], m[5], m[7]]
    } else {
        let ties = directory.floats(tag::MODEL_TIEPOINT)?.unwrap_or_default();
        if ties.len() % 6 != 0 {
            return Err(wrong_count(tag::MODEL_TIEPOINT, ties.len(), "six for each tiepoint"));
        }
        let Some(scale) = directory.floats(tag::MODEL_PIXEL_SCALE)? else {
            if ties.len() > 6 && options.cell_size.is_none() {
                return Err(Error::file(
                    path,
                    "georeference",
                    format!("{} ground control points", ties.len() / 6),
                    "allowed: a pixel scale with a tiepoint, or a transformation; or give --cell-size M",
                ));
            }
            return Ok(None);
        };
        let [sx, sy, ..] = scale[..] else {
            return Err(wrong_count(tag::MODEL_PIXEL_SCALE, scale.len(), "2 or 3"));
        };
        if sx <= 0.0 || sy <= 0.0 {
            let allowed = "allowed: positive numbers; or give --cell-size M";
            return Err(Error::file(path, "ModelPixelScale", format!("{sx} x {sy}"), allowed));
        }
        if ties.is_empty() {
            said.notes.push("a pixel scale without a tiepoint: placed at the origin".to_owned());
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

/// The coordinate system of a file.
struct System {
    epsg: Option<u32>,
    definition: Option<Crs>,
    /// Degrees in an angular unit; 1 for other systems.
    degrees: f64,
}

impl Default for System {
    fn default() -> Self {
        Self { epsg: None, definition: None, degrees: 1.0 }
    }
}

/// The GeoKeys, each a short code, a double or a text.
#[derive(Default)]
struct Keys {
    shorts: Vec<(u16, u16)>,
    doubles: Vec<(u16, f64)>,
    /// All texts of the file.
    text: String,
}

impl Keys {
    fn parse(path: &Path, directory: &Directory<'_>) -> Result<Self> {
        let mut keys = Self::default();
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
        keys.text = directory.text(tag::GEO_ASCII_PARAMS)?.unwrap_or_default();
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

    fn raster_space(&self, path: &Path) -> Result<RasterSpace> {
        match self.code(key::RASTER_TYPE) {
            None | Some(key::PIXEL_IS_AREA) => Ok(RasterSpace::PixelIsArea),
            Some(key::PIXEL_IS_POINT) => Ok(RasterSpace::PixelIsPoint),
            Some(other) => {
                let allowed = "allowed: 1 (pixel is area) or 2 (pixel is point); or give --cell-size M";
                Err(Error::file(path, "GTRasterTypeGeoKey", other, allowed))
            }
        }
    }

    fn coordinate_system(&self, path: &Path, said: &mut Said) -> Result<System> {
        let model = match self.code(key::MODEL_TYPE) {
            Some(3) => {
                let allowed = "allowed: 1 (projected) or 2 (geographic); or give --cell-size M";
                return Err(Error::file(path, "GTModelTypeGeoKey", "3 (geocentric)", allowed));
            }
            Some(code @ (key::PROJECTED | key::GEOGRAPHIC)) => code,
            _ if self.code(key::PROJECTED_CRS).is_some() => key::PROJECTED,
            // User-defined systems in lengths name the one below them too.
            _ if self.code(key::GEODETIC_CRS).is_some() && self.code(key::LINEAR_UNITS).is_none() => {
                key::GEOGRAPHIC
            }
            _ => 0,
        };
        if model == key::GEOGRAPHIC {
            let epsg = self.epsg(key::GEODETIC_CRS);
            let definition = self.geographic(path, epsg)?;
            return Ok(System { epsg, definition, degrees: self.degrees_per_unit(path)? });
        }
        let stated =
            self.linear_unit(path, key::LINEAR_UNITS, Some(key::LINEAR_UNIT_SIZE), "--cell-size M")?;
        if model == 0 {
            let definition = match self.words() {
                Some(crs) => Some(crs),
                None => stated.map(Crs::local).transpose().map_err(|e| e.in_file(path))?,
            };
            return Ok(System { definition, ..System::default() });
        }
        let (epsg, definition) = self.projected(path, stated, said)?;
        Ok(System { epsg, definition, degrees: 1.0 })
    }

    /// What must be said of a geographic system beside its code; nothing when the code says it all.
    fn geographic(&self, path: &Path, epsg: Option<u32>) -> Result<Option<Crs>> {
        let known = epsg.and_then(Crs::from_epsg).filter(|crs| crs.kind() == CrsKind::Geographic);
        match known {
            Some(_) => Ok(None),
            None => Ok(Some(self.own_geographic(path)?)),
        }
    }

    /// Code and definition of a projected system.
    fn projected(
        &self,
        path: &Path,
        stated: Option<f64>,
        said: &mut Said,
    ) -> Result<(Option<u32>, Option<Crs>)> {
        let mut epsg = self.epsg(key::PROJECTED_CRS);
        // Esri's web mercator has the keys of an ellipsoidal one.
        if epsg.is_none()
            && ["Mercator_Auxiliary_Sphere", "Pseudo-Mercator"].iter().any(|n| self.text.contains(n))
        {
            epsg = Some(3857);
        }
        let known = epsg.and_then(Crs::from_epsg);
        let of_code = known.and_then(|crs| crs.metres_per_unit());
        match (epsg, of_code, stated) {
            (Some(_), Some(_), None) => Ok((epsg, None)),
            (Some(_), Some(own), Some(stated)) if (own / stated - 1.0).abs() < SAME_UNIT => Ok((epsg, None)),
            (Some(code), Some(own), Some(stated)) => {
                said.notes.push(format!(
                    "EPSG:{code} is in units of {}, the file says {}: the file counts",
                    unit_in_words(own),
                    unit_in_words(stated)
                ));
                let crs = known.map(|crs| crs.with_metres_per_unit(stated)).transpose();
                Ok((epsg, crs.map_err(|e| e.in_file(path))?))
            }
            (Some(code), None, Some(stated)) => {
                said.notes.push(format!(
                    "EPSG:{code} is not in the table of coordinate systems; the file states its unit: {}",
                    unit_in_words(stated)
                ));
                Ok((epsg, Some(Crs::projected_in(stated).map_err(|e| e.in_file(path))?)))
            }
            (Some(_), None, None) => Ok((epsg, None)),
            (None, ..) => {
                let metres = stated.unwrap_or_else(|| {
                    said.notes.push("the file states no linear unit: metres assumed".to_owned());
                    1.0
                });
                let code = self.code(key::PROJECTION).unwrap_or(0);
                let get = |key| self.double(key);
                if let Some(method) = projection::method(code, get, metres) {
                    let crs = Crs::projected(method, metres, &self.base(path)?);
                    return Ok((None, Some(crs.map_err(|e| e.in_file(path))?)));
                }
                let other = projection::proj_string(code, get, metres, self.base(path)?.ellipsoid());
                let crs = self.words().or_else(|| Crs::parse(&other?).ok());
                Ok((
                    None,
                    Some(crs.map_or_else(|| Crs::projected_in(metres), Ok).map_err(|e| e.in_file(path))?),
                ))
            }
        }
    }

    /// The system that the file's texts define: Esri's WKT, as GDAL writes it where no keys say what a projection is, or a
    /// PROJ string.
    fn words(&self) -> Option<Crs> {
        let of =
            |mark: &str| self.text.split('|').find_map(|text| text.split_once(mark).map(|(_, words)| words));
        let found = of(WORDS).and_then(|wkt| Crs::parse(wkt).ok());
        let found =
            found.or_else(|| Crs::parse(self.text.split('|').find(|text| text.starts_with("+proj="))?).ok());
        found.filter(|crs| crs.kind() == CrsKind::Projected)
    }

    /// The geographic system below a projection that no code names.
    fn base(&self, path: &Path) -> Result<Crs> {
        let known = self.epsg(key::GEODETIC_CRS).and_then(Crs::from_epsg);
        match known.filter(|crs| crs.kind() == CrsKind::Geographic) {
            Some(crs) => Ok(crs),
            None => Ok(self.own_geographic(path)?),
        }
    }

    /// The geographic system that the file describes without a code.
    fn own_geographic(&self, path: &Path) -> Result<Crs> {
        let datum = self.epsg(key::GEODETIC_DATUM).unwrap_or(0);
        Ok(Crs::geographic(self.ellipsoid(path)?).with_datum(datum))
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
                "allowed: 9101 (radian), 9102 (degree), 9103 (minute), 9104 (second), 9105 (grad); or give --cell-size M",
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
            let allowed = "allowed: a positive axis, flattening from 0 to 0.5; or give --cell-size M";
            return Err(Error::file(path, "ellipsoid", found, allowed));
        }
        Ok(Ellipsoid { semi_major, flattening })
    }

    /// Metres in the linear unit that a key names, or the key beside it defines.
    fn linear_unit(&self, path: &Path, key: u16, size: Option<u16>, option: &str) -> Result<Option<f64>> {
        let Some(code) = self.code(key).filter(|code| *code != 0) else { return Ok(None) };
        let metres = if code == key::USER_DEFINED {
            size.and_then(|size| self.double(size))
        } else {
            linear_unit(code.into())
        };
        match metres {
            Some(metres) if metres.is_finite() && metres > 0.0 => Ok(Some(metres)),
            Some(metres) => {
                let allowed = format!("allowed: a positive number of metres; or give {option}");
                Err(Error::file(path, key::name(size.unwrap_or(key)), metres, allowed))
            }
            None if code == key::USER_DEFINED => Ok(None),
            None => {
                let allowed = format!(
                    "allowed: the EPSG code of a unit of length, as 9001 (metre), 9002 (foot), 9003 (US survey foot); or give \
                     {option}"
                );
                Err(Error::file(path, key::name(key), code, allowed))
            }
        }
    }

    /// Metres in a unit of the heights: the file's key, else that of the vertical system.
    fn vertical_unit(&self, path: &Path, said: &mut Said) -> Result<Option<f64>> {
        let stated = self.linear_unit(path, key::VERTICAL_UNITS, None, "--metres-per-unit M")?;
        if stated.is_some() {
            return Ok(stated);
        }
        let Some(code) = self.epsg(key::VERTICAL_CRS) else { return Ok(None) };
        let metres = Crs::metres_per_height(code);
        if metres.is_none() {
            said.notes.push(format!(
                "the vertical system EPSG:{code} is not in the table: heights are taken for metres (--metres-per-unit overrules)"
            ));
        }
        Ok(metres)
    }
}
