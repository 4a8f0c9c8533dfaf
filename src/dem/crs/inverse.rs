//! From map coordinates to longitude and latitude, whichever library knows the projection: `proj-core`, else `proj4rs`.

use super::Crs;
use super::other::degrees_below;
use proj_core::Transform;
use proj4rs::Proj;
use proj4rs::transform::transform;

/// The way back from a map.
pub(super) enum Inverse {
    First(Box<Transform>),
    Second(Box<[Proj; 2]>),
}

impl Inverse {
    /// The way back from the map of `crs`.
    ///
    /// # Errors
    /// Says why there is none.
    pub(super) fn of(crs: &Crs) -> Result<Self, String> {
        if let Some(text) = crs.text() {
            let of = |definition: &str| Proj::from_proj_string(definition).map_err(|e| e.to_string());
            return Ok(Self::Second(Box::new([of(text.proj)?, of(&degrees_below(text.proj))?])));
        }
        let (from, to) = crs.with_base().ok_or("its definition is incomplete")?;
        let way = Transform::from_crs_defs(&from, &to).map_err(|e| e.to_string())?;
        Ok(Self::First(Box::new(way)))
    }

    /// Longitude and latitude, degrees.
    ///
    /// # Errors
    /// When the map does not have the place.
    pub(super) fn degrees(&self, (x, y): (f64, f64)) -> Result<(f64, f64), String> {
        match self {
            Self::First(way) => way.convert((x, y)).map_err(|e| e.to_string()),
            Self::Second(ends) => {
                let mut point = (x, y, 0.0);
                transform(&ends[0], &ends[1], &mut point).map_err(|e| e.to_string())?;
                let (longitude, latitude) = (point.0.to_degrees(), point.1.to_degrees());
                if longitude.is_finite() && latitude.is_finite() {
                    Ok((longitude, latitude))
                } else {
                    Err("the map does not have it".to_owned())
                }
            }
        }
    }
}
