//! The coordinate system that a sketch file names, in every spelling that programs write.
//!
//! GeoJSON of 2008 had a member `crs`, which GDAL and QGIS still write; RFC 7946 took it away and knows longitude and
//! latitude on WGS 84 alone.

use crate::dem::crs::Crs;
use serde_json::{Map, Value, json};

/// What the `crs` member of a collection says.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NamedSystem {
    /// Of the EPSG register.
    Epsg(u32),
    /// A name that carries no EPSG code.
    Unknown(String),
}

impl std::fmt::Display for NamedSystem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Epsg(code) => write!(f, "EPSG:{code}"),
            Self::Unknown(name) => f.write_str(name),
        }
    }
}

/// EPSG code of longitude and latitude on WGS 84, which is what GeoJSON without a `crs` member is in.
pub(super) const WGS84: u32 = 4326;
/// Codes that have stood for web mercator.
const WEB_MERCATOR: [u32; 5] = [3857, 3785, 900_913, 102_100, 102_113];

/// Whether two codes mean the same coordinates on the ground, as GeoJSON orders them (east first).
pub(super) fn is_same(a: u32, b: u32) -> bool {
    let with_height = |code| if code == 4979 { WGS84 } else { code };
    with_height(a) == with_height(b) || (WEB_MERCATOR.contains(&a) && WEB_MERCATOR.contains(&b))
}

/// The system that a collection names; `None` when it has no `crs` member, or null.
pub(super) fn system_of(collection: &Map<String, Value>) -> Option<NamedSystem> {
    let crs = collection.get("crs").filter(|crs| !crs.is_null())?;
    let name = name_in(crs);
    if let Some(name) = name.as_str() {
        return Some(system_named(name));
    }
    // The older form {"type": "EPSG", "properties": {"code": 4326}}, and a bare number.
    let is_epsg = crs.get("type").and_then(Value::as_str).is_some_and(|t| t.eq_ignore_ascii_case("epsg"));
    let number = if is_epsg { crs.pointer("/properties/code") } else { Some(name) };
    let code = number.and_then(|n| n.as_u64().or_else(|| n.as_str()?.trim().parse().ok()));
    let code = code.and_then(|code| u32::try_from(code).ok());
    Some(code.map_or_else(|| NamedSystem::Unknown(super::number::shown(crs)), NamedSystem::Epsg))
}

fn name_in(crs: &Value) -> &Value {
    crs.pointer("/properties/name").or_else(|| crs.get("name")).unwrap_or(crs)
}

/// Metres in a unit of height, where the `crs` member names a vertical system beside the horizontal one.
pub(super) fn vertical_unit_of(collection: &Map<String, Value>) -> Option<f64> {
    Crs::parse(name_in(collection.get("crs")?).as_str()?).ok()?.vertical_metres_per_unit()
}

/// The system of a name such as `EPSG:2056`, `urn:ogc:def:crs:EPSG::2056`, `http://www.opengis.net/def/crs/EPSG/0/2056` or
/// `OGC:CRS84`.
fn system_named(name: &str) -> NamedSystem {
    let upper = name.trim().to_ascii_uppercase();
    let last = upper.rsplit([':', '/', '#']).next().unwrap_or_default();
    // The registers of OGC order longitude first, as GeoJSON does.
    let code = match last {
        "CRS84" | "CRS84H" | "WGS84" => Some(WGS84),
        "CRS83" => Some(4269),
        "CRS27" => Some(4267),
        _ if upper.contains("EPSG") && !upper.contains(',') => last.parse().ok(),
        _ => None,
    };
    // Compound systems, well-known text and the rest.
    let code = code.or_else(|| Crs::parse(name).ok()?.epsg());
    code.map_or_else(|| NamedSystem::Unknown(format!("`{}`", name.trim())), NamedSystem::Epsg)
}

/// The `crs` member to write; WGS 84 needs none.
pub(super) fn crs_member(epsg: u32) -> Option<Value> {
    let name = format!("urn:ogc:def:crs:EPSG::{epsg}");
    (epsg != WGS84).then(|| json!({"type": "name", "properties": {"name": name}}))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(crs: Value) -> Option<NamedSystem> {
        system_of(json!({"crs": crs}).as_object().unwrap())
    }

    #[test]
    fn systems_are_read_in_every_common_spelling() {
        for (name, code) in [
            ("urn:ogc:def:crs:EPSG::32611", 32611),
            ("urn:ogc:def:crs:EPSG:8.9:32611", 32611),
            ("urn:x-ogc:def:crs:EPSG:32611", 32611),
            ("EPSG:2056", 2056),
            (" epsg:2056 ", 2056),
            ("http://www.opengis.net/def/crs/EPSG/0/2056", 2056),
            ("http://www.opengis.net/gml/srs/epsg.xml#2056", 2056),
            ("urn:ogc:def:crs:OGC:1.3:CRS84", 4326),
            ("urn:ogc:def:crs:OGC::CRS84", 4326),
            ("OGC:CRS84", 4326),
            ("WGS84", 4326),
            ("urn:ogc:def:crs:OGC:1.3:CRS83", 4269),
        ] {
            let expected = Some(NamedSystem::Epsg(code));
            assert_eq!(system(json!({"type": "name", "properties": {"name": name}})), expected, "{name}");
            assert_eq!(system(json!(name)), expected, "{name} alone");
        }
        assert_eq!(
            system(json!({"type": "EPSG", "properties": {"code": 2056}})),
            Some(NamedSystem::Epsg(2056))
        );
        assert_eq!(
            system(json!({"type": "epsg", "properties": {"code": "2056"}})),
            Some(NamedSystem::Epsg(2056))
        );
        let compound = json!("EPSG:26911+6360");
        assert_eq!(system(compound.clone()), Some(NamedSystem::Epsg(26911)));
        let feet = vertical_unit_of(json!({"crs": compound}).as_object().unwrap()).unwrap();
        assert!((feet - 1200.0 / 3937.0).abs() < 1e-12, "{feet}");
        assert_eq!(vertical_unit_of(json!({"crs": "EPSG:26911"}).as_object().unwrap()), None);
        for unknown in ["moon", "ESRI:102003", "EPSG:", "EPSG:x"] {
            let found = system(json!({"type": "name", "properties": {"name": unknown}}));
            assert_eq!(found, Some(NamedSystem::Unknown(format!("`{unknown}`"))), "{unknown}");
        }
        assert!(matches!(
            system(json!({"type": "link", "properties": {"href": "crs.prj"}})),
            Some(NamedSystem::Unknown(text)) if text.contains("crs.prj")
        ));
        assert_eq!(system(Value::Null), None);
        assert!(is_same(3857, 900_913) && is_same(4326, 4979) && !is_same(3857, 4326));
    }
}
