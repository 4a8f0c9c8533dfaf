//! Projections that no code names, as GeoKeys have them (OGC GeoTIFF 1.1, annex C; codes of `ProjMethodGeoKey`).
//!
//! In: keys. Out: a projection, and back. False eastings and northings are in the file's linear unit there, in metres here.

use super::key;
use crate::dem::crs::Ellipsoid;
use proj_core::ProjectionMethod as Method;

/// Values of `ProjMethodGeoKey`.
mod code {
    pub(super) const TRANSVERSE_MERCATOR: u16 = 1;
    pub(super) const MERCATOR: u16 = 7;
    pub(super) const LAMBERT_2SP: u16 = 8;
    pub(super) const LAMBERT_1SP: u16 = 9;
    pub(super) const LAMBERT_AZIMUTHAL: u16 = 10;
    pub(super) const ALBERS: u16 = 11;
    pub(super) const AZIMUTHAL_EQUIDISTANT: u16 = 12;
    pub(super) const POLAR_STEREOGRAPHIC: u16 = 15;
    pub(super) const OBLIQUE_STEREOGRAPHIC: u16 = 16;
    pub(super) const EQUIRECTANGULAR: u16 = 17;
    pub(super) const CASSINI: u16 = 18;
    pub(super) const POLYCONIC: u16 = 22;
}

/// A projection of which the first library knows nothing, as a PROJ string.
pub(super) fn proj_string(
    projection: u16,
    get: impl Fn(u16) -> Option<f64>,
    metres: f64,
    ellipsoid: Ellipsoid,
) -> Option<String> {
    let (name, parallel) = match projection {
        13 => ("eqdc", "lat_1"),
        14 => ("stere", "lat_ts"),
        19 => ("gnom", "lat_1"),
        20 => ("mill", "lat_1"),
        21 => ("ortho", "lat_1"),
        23 => ("robin", "lat_1"),
        24 => ("sinu", "lat_1"),
        28 => ("cea", "lat_ts"),
        _ => return None,
    };
    let parameters = [
        ("lon_0", &[key::ORIGIN_LONG, key::FALSE_ORIGIN_LONG, key::CENTER_LONG][..], 1.0),
        ("lat_0", &[key::ORIGIN_LAT, key::FALSE_ORIGIN_LAT, key::CENTER_LAT], 1.0),
        (parallel, &[key::PARALLEL_1], 1.0),
        ("lat_2", &[key::PARALLEL_2], 1.0),
        ("k_0", &[key::ORIGIN_SCALE, key::CENTER_SCALE], 1.0),
        ("x_0", &[key::FALSE_EASTING, key::FALSE_ORIGIN_EASTING, key::CENTER_EASTING], metres),
        ("y_0", &[key::FALSE_NORTHING, key::FALSE_ORIGIN_NORTHING, key::CENTER_NORTHING], metres),
    ];
    let mut text = format!("+proj={name}");
    for (parameter, keys, unit) in parameters {
        if let Some(value) = keys.iter().find_map(|&key| get(key)) {
            text += &format!(" +{parameter}={}", value * unit);
        }
    }
    let Ellipsoid { semi_major, flattening } = ellipsoid;
    Some(format!("{text} +a={semi_major} +b={} +to_meter={metres}", semi_major * (1.0 - flattening)))
}

/// The projection of a code whose parameters `get` knows by key; `metres`: those in a unit of length.
pub(super) fn method(projection: u16, get: impl Fn(u16) -> Option<f64>, metres: f64) -> Option<Method> {
    // Writers differ in which of the keys of one meaning they use.
    let first = |keys: &[u16]| keys.iter().find_map(|&key| get(key));
    let lon0 =
        first(&[key::ORIGIN_LONG, key::FALSE_ORIGIN_LONG, key::CENTER_LONG, key::POLE_LONG]).unwrap_or(0.0);
    let lat0 = first(&[key::ORIGIN_LAT, key::FALSE_ORIGIN_LAT, key::CENTER_LAT]).unwrap_or(0.0);
    let east = first(&[key::FALSE_EASTING, key::FALSE_ORIGIN_EASTING, key::CENTER_EASTING]);
    let north = first(&[key::FALSE_NORTHING, key::FALSE_ORIGIN_NORTHING, key::CENTER_NORTHING]);
    let (false_easting, false_northing) = (east.unwrap_or(0.0) * metres, north.unwrap_or(0.0) * metres);
    let k0 = first(&[key::ORIGIN_SCALE, key::CENTER_SCALE]).unwrap_or(1.0);
    let (lat1, lat2) = (get(key::PARALLEL_1), get(key::PARALLEL_2));
    Some(match projection {
        code::TRANSVERSE_MERCATOR => {
            Method::TransverseMercator { lon0, lat0, k0, false_easting, false_northing }
        }
        code::MERCATOR if lat0 == 0.0 => {
            Method::Mercator { lon0, lat_ts: lat1.unwrap_or(0.0), k0, false_easting, false_northing }
        }
        code::LAMBERT_2SP => {
            let (lat1, lat2) = (lat1?, lat2?);
            Method::LambertConformalConic { lon0, lat0, lat1, lat2, k0: 1.0, false_easting, false_northing }
        }
        code::LAMBERT_1SP => {
            let (lat1, lat2) = (lat0, lat0);
            Method::LambertConformalConic { lon0, lat0, lat1, lat2, k0, false_easting, false_northing }
        }
        code::LAMBERT_AZIMUTHAL => {
            Method::LambertAzimuthalEqualArea { lon0, lat0, false_easting, false_northing }
        }
        code::ALBERS => {
            let (lat1, lat2) = (lat1?, lat2?);
            Method::AlbersEqualArea { lon0, lat0, lat1, lat2, false_easting, false_northing }
        }
        code::AZIMUTHAL_EQUIDISTANT => {
            Method::AzimuthalEquidistant { lon0, lat0, false_easting, false_northing }
        }
        // At the pole the scale is k0; elsewhere the latitude is that of true scale.
        code::POLAR_STEREOGRAPHIC => {
            Method::PolarStereographic { lon0, lat_ts: lat0, k0, false_easting, false_northing }
        }
        code::OBLIQUE_STEREOGRAPHIC => {
            Method::ObliqueStereographic { lon0, lat0, k0, false_easting, false_northing }
        }
        code::EQUIRECTANGULAR if get(key::ORIGIN_LAT).unwrap_or(0.0) == 0.0 => {
            // Older writers put the standard parallel where the latitude of the centre belongs.
            let lat_ts = lat1.or(get(key::CENTER_LAT)).unwrap_or(0.0);
            Method::EquidistantCylindrical { lon0, lat_ts, false_easting, false_northing }
        }
        code::CASSINI => Method::CassiniSoldner { lon0, lat0, false_easting, false_northing },
        code::POLYCONIC => Method::AmericanPolyconic { lon0, lat0, false_easting, false_northing },
        _ => return None,
    })
}

/// The code of a projection and its parameters by key, where there are such; the inverse of [`method`].
pub(super) fn keys(method: Method, metres: f64) -> Option<(u16, Vec<(u16, f64)>)> {
    let with = |projection, mut parameters: Vec<(u16, f64)>, east: f64, north: f64| {
        parameters.extend([(key::FALSE_EASTING, east / metres), (key::FALSE_NORTHING, north / metres)]);
        Some((projection, parameters))
    };
    let origin = |lon: f64, lat: f64| vec![(key::ORIGIN_LONG, lon), (key::ORIGIN_LAT, lat)];
    let centre = |lon: f64, lat: f64| vec![(key::CENTER_LONG, lon), (key::CENTER_LAT, lat)];
    let scaled = |mut parameters: Vec<(u16, f64)>, k0: f64| {
        parameters.push((key::ORIGIN_SCALE, k0));
        parameters
    };
    match method {
        Method::TransverseMercator { lon0, lat0, k0, false_easting, false_northing } => {
            with(code::TRANSVERSE_MERCATOR, scaled(origin(lon0, lat0), k0), false_easting, false_northing)
        }
        Method::Mercator { lon0, lat_ts, k0, false_easting, false_northing } => {
            let mut parameters = scaled(origin(lon0, 0.0), k0);
            if lat_ts != 0.0 {
                parameters.push((key::PARALLEL_1, lat_ts));
            }
            with(code::MERCATOR, parameters, false_easting, false_northing)
        }
        Method::LambertConformalConic { lon0, lat0, lat1, lat2, k0, false_easting, false_northing } => {
            if lat1 == lat2 && lat1 == lat0 {
                return with(
                    code::LAMBERT_1SP,
                    scaled(origin(lon0, lat0), k0),
                    false_easting,
                    false_northing,
                );
            }
            let (east, north) = (false_easting / metres, false_northing / metres);
            (k0 == 1.0).then(|| {
                let parameters = vec![
                    (key::PARALLEL_1, lat1),
                    (key::PARALLEL_2, lat2),
                    (key::FALSE_ORIGIN_LONG, lon0),
                    (key::FALSE_ORIGIN_LAT, lat0),
                    (key::FALSE_ORIGIN_EASTING, east),
                    (key::FALSE_ORIGIN_NORTHING, north),
                ];
                (code::LAMBERT_2SP, parameters)
            })
        }
        Method::LambertAzimuthalEqualArea { lon0, lat0, false_easting, false_northing } => {
            with(code::LAMBERT_AZIMUTHAL, centre(lon0, lat0), false_easting, false_northing)
        }
        Method::AlbersEqualArea { lon0, lat0, lat1, lat2, false_easting, false_northing } => {
            let mut parameters = origin(lon0, lat0);
            parameters.extend([(key::PARALLEL_1, lat1), (key::PARALLEL_2, lat2)]);
            with(code::ALBERS, parameters, false_easting, false_northing)
        }
        Method::AzimuthalEquidistant { lon0, lat0, false_easting, false_northing } => {
            with(code::AZIMUTHAL_EQUIDISTANT, centre(lon0, lat0), false_easting, false_northing)
        }
        Method::PolarStereographic { lon0, lat_ts, k0, false_easting, false_northing } => {
            let parameters = scaled(vec![(key::POLE_LONG, lon0), (key::ORIGIN_LAT, lat_ts)], k0);
            with(code::POLAR_STEREOGRAPHIC, parameters, false_easting, false_northing)
        }
        Method::ObliqueStereographic { lon0, lat0, k0, false_easting, false_northing } => {
            with(code::OBLIQUE_STEREOGRAPHIC, scaled(origin(lon0, lat0), k0), false_easting, false_northing)
        }
        Method::EquidistantCylindrical { lon0, lat_ts, false_easting, false_northing } => {
            let parameters =
                vec![(key::CENTER_LONG, lon0), (key::CENTER_LAT, 0.0), (key::PARALLEL_1, lat_ts)];
            with(code::EQUIRECTANGULAR, parameters, false_easting, false_northing)
        }
        Method::CassiniSoldner { lon0, lat0, false_easting, false_northing } => {
            with(code::CASSINI, origin(lon0, lat0), false_easting, false_northing)
        }
        Method::AmericanPolyconic { lon0, lat0, false_easting, false_northing } => {
            with(code::POLYCONIC, origin(lon0, lat0), false_easting, false_northing)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_back() {
        let (lon0, lat0, k0, false_easting, false_northing) = (10.0, 40.0, 0.9996, 1000.0, -50.0);
        let (lat1, lat2, lat_ts) = (33.0, 45.0, 60.0);
        for wanted in [
            Method::TransverseMercator { lon0, lat0, k0, false_easting, false_northing },
            Method::Mercator { lon0, lat_ts: 0.0, k0, false_easting, false_northing },
            Method::Mercator { lon0, lat_ts, k0: 1.0, false_easting, false_northing },
            Method::LambertConformalConic { lon0, lat0, lat1, lat2, k0: 1.0, false_easting, false_northing },
            Method::LambertConformalConic {
                lon0,
                lat0,
                lat1: lat0,
                lat2: lat0,
                k0,
                false_easting,
                false_northing,
            },
            Method::LambertAzimuthalEqualArea { lon0, lat0, false_easting, false_northing },
            Method::AlbersEqualArea { lon0, lat0, lat1, lat2, false_easting, false_northing },
            Method::AzimuthalEquidistant { lon0, lat0, false_easting, false_northing },
            Method::PolarStereographic { lon0, lat_ts, k0: 1.0, false_easting, false_northing },
            Method::ObliqueStereographic { lon0, lat0, k0, false_easting, false_northing },
            Method::EquidistantCylindrical { lon0, lat_ts, false_easting, false_northing },
            Method::CassiniSoldner { lon0, lat0, false_easting, false_northing },
            Method::AmericanPolyconic { lon0, lat0, false_easting, false_northing },
        ] {
            let (projection, parameters) = keys(wanted, 0.5).unwrap();
            let get = |key: u16| parameters.iter().find(|(k, _)| *k == key).map(|(_, v)| *v);
            assert_eq!(method(projection, get, 0.5), Some(wanted));
        }
        assert_eq!(keys(Method::EqualEarth { lon0, false_easting, false_northing }, 1.0), None);
        assert_eq!(method(27, |_| Some(1.0), 1.0), None);
    }
}
