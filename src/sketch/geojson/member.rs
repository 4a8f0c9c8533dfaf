//! The foreign members of a sketch file: the map that the strokes are drawn on, and the name of its coordinate system.

use crate::dem::Georeference;
use crate::error::{Error, Result};
use serde_json::{Map, Value, json};

/// What the heights of a sketch file mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeightUnit {
    /// Metres above the DEM's datum.
    #[default]
    Metres,
    /// 0 to 1 of the range of elevations of whichever style the sketch is used with.
    #[serde(alias = "normalized")]
    Normalised,
}

/// Key of the [`MapMember`] in the feature collection.
pub(super) const KEY: &str = "monadnock";

/// The map that the strokes are drawn on.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapMember {
    /// Rows and columns of the map; both or none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rows: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) cols: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) unit: Option<HeightUnit>,
    /// When present, coordinates are model coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) georeference: Option<Georeference>,
}

impl MapMember {
    /// The member of a collection, if it has one.
    pub(super) fn of(collection: &Map<String, Value>) -> Result<Option<Self>> {
        let Some(value) = collection.get(KEY) else { return Ok(None) };
        let member: Self = serde_json::from_value(value.clone()).map_err(|e| {
            Error::value(
                format!("member `{KEY}`"),
                format!("not readable ({e})"),
                "allowed: rows, cols, unit (metres or normalised), georeference",
            )
        })?;
        if member.rows.is_some() != member.cols.is_some() {
            return Err(Error::value(
                format!("member `{KEY}`"),
                "a map with only one side",
                "allowed: rows and cols together",
            ));
        }
        Ok(Some(member))
    }

    pub(super) fn size(&self) -> Option<(usize, usize)> {
        self.rows.zip(self.cols)
    }
}

/// What the `crs` member of a collection says.
#[derive(Debug, PartialEq)]
pub(super) enum NamedSystem {
    Epsg(u32),
    /// A name that carries no EPSG code.
    Unknown(String),
}

/// EPSG code of longitude and latitude on WGS 84, which is what GeoJSON without a `crs` member is in.
pub(super) const WGS84: u32 = 4326;

pub(super) fn system_of(collection: &Map<String, Value>) -> Option<NamedSystem> {
    let crs = collection.get("crs").filter(|crs| !crs.is_null())?;
    let name = crs.pointer("/properties/name").and_then(Value::as_str);
    let Some(name) = name else { return Some(NamedSystem::Unknown(crs.to_string())) };
    if name.ends_with("CRS84") {
        return Some(NamedSystem::Epsg(WGS84));
    }
    let code = name.contains("EPSG").then(|| name.rsplit(':').next()?.parse().ok()).flatten();
    Some(code.map_or_else(|| NamedSystem::Unknown(name.to_owned()), NamedSystem::Epsg))
}

/// The `crs` member to write; WGS 84 needs none.
pub(super) fn crs_member(epsg: u32) -> Option<Value> {
    let name = format!("urn:ogc:def:crs:EPSG::{epsg}");
    (epsg != WGS84).then(|| json!({"type": "name", "properties": {"name": name}}))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_read_in_every_common_spelling() {
        let system = |name: &str| {
            let crs = json!({"crs": {"type": "name", "properties": {"name": name}}});
            system_of(crs.as_object().unwrap())
        };
        assert_eq!(system("urn:ogc:def:crs:EPSG::32611"), Some(NamedSystem::Epsg(32611)));
        assert_eq!(system("EPSG:2056"), Some(NamedSystem::Epsg(2056)));
        assert_eq!(system("urn:ogc:def:crs:OGC:1.3:CRS84"), Some(NamedSystem::Epsg(WGS84)));
        assert_eq!(system("moon"), Some(NamedSystem::Unknown("moon".to_owned())));
        assert_eq!(system_of(json!({"crs": null}).as_object().unwrap()), None);
    }
}
