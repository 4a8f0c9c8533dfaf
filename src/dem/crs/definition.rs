//! What a coordinate system is: kind, units, projection.

use super::Ellipsoid;
use super::missing;
use super::other::{Other, Text, proj_string};
use super::units::{linear_unit, unit_in_words};
use crate::error::{Error, Result};
use proj_core::{
    CrsDef, Datum, DatumToWgs84, GeographicCrsDef, LinearUnit, ProjectedCrsDef, ProjectionMethod,
};
use std::borrow::Cow;

/// What the coordinates of a system are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CrsKind {
    /// Longitude and latitude in degrees.
    Geographic,
    /// East and north in a plane.
    Projected,
    /// Lengths whose place on the Earth nobody said.
    Local,
}

/// A coordinate system, as far as sizes on the ground and files need it.
#[derive(Clone, Copy, Debug)]
pub struct Crs {
    epsg: Option<u32>,
    name: &'static str,
    ellipsoid: Ellipsoid,
    /// EPSG codes of the geographic system below and of its datum; 0 when unknown.
    base: u32,
    datum: u32,
    map: Map,
    vertical: Option<f64>,
    /// The definition, where only the second library knows the projection.
    text: Option<Text>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Map {
    Geographic,
    /// The projection, when it is one of the first library's; metres in a unit.
    Projected(Option<ProjectionMethod>, f64),
    Local(f64),
}

/// The same to whoever computes with them: names do not count.
impl PartialEq for Crs {
    fn eq(&self, other: &Self) -> bool {
        let facts = |c: &Self| (c.epsg, c.ellipsoid, c.base, c.datum, c.map, c.vertical, c.text);
        facts(self) == facts(other)
    }
}

impl Crs {
    /// The system of an EPSG code (3857, 26911; also a few codes of Esri's that files use like EPSG's, as 102100 and
    /// 54004); `None` when the table does not have it.
    #[must_use]
    pub(crate) fn from_epsg(code: u32) -> Option<Self> {
        let known = match proj_core::lookup_epsg(same_as(code)) {
            Some(known) => Self::of(&known).ok()?,
            None => Self::parse(&missing::definition(code)?).ok()?,
        };
        Some(Self { epsg: Some(code), ..known })
    }

    /// The system that a text defines: WKT (1, 2, Esri's), a PROJ string, PROJJSON, `EPSG:26911`, `EPSG:26911+6360`, an OGC
    /// URN. Where the projection is none of those that are known, its kind and its unit are taken from the WKT.
    ///
    /// # Errors
    /// When the text is none of these, or is in degrees that are not counted from Greenwich.
    pub fn parse(text: &str) -> Result<Self> {
        let text = text.trim().trim_start_matches('\u{feff}').trim_start();
        if let Some(code) =
            text.to_ascii_uppercase().strip_prefix("EPSG:").and_then(|c| c.trim().parse().ok())
        {
            let unknown = || undefined(text, "the code is not in the table of coordinate systems");
            return Self::from_epsg(code).ok_or_else(unknown);
        }
        if text.is_empty() {
            return Err(undefined(text, "it is empty"));
        }
        let first = proj_wkt::parse_crs(&in_words_of_the_library(text));
        // The oblique projection of that name is another one than the library's.
        let is_sure = !text.contains("PROJECTION[\"Stereographic\"]");
        match first.map_err(|e| e.to_string()).and_then(|found| Self::of(&found).map_err(|e| e.to_string())) {
            Ok(found) if is_sure => Ok(found),
            other => {
                let reason = other.err().unwrap_or_default();
                let known = || own_code(text).and_then(Self::from_epsg);
                let found = known().or_else(|| in_other_words(text)).or_else(|| from_wkt_units(text));
                found.ok_or_else(|| undefined(text, &reason))
            }
        }
    }

    /// Lengths in units of so many metres, at no known place.
    ///
    /// # Errors
    /// When the number is not positive and finite.
    pub fn local(metres: f64) -> Result<Self> {
        positive(metres)?;
        Ok(Self { map: Map::Local(metres), ..Self::UNKNOWN })
    }

    /// A projected system of a known projection, on the ellipsoid of `base`.
    ///
    /// # Errors
    /// When the unit is not positive and finite.
    pub(in crate::dem) fn projected(method: ProjectionMethod, metres: f64, base: &Self) -> Result<Self> {
        positive(metres)?;
        let Self { ellipsoid, datum, .. } = *base;
        let base = base.epsg.unwrap_or(base.base);
        Ok(Self { ellipsoid, datum, base, map: Map::Projected(Some(method), metres), ..Self::UNKNOWN })
    }

    /// Metres in a unit of the heights of a vertical system; `None` when the table does not have its EPSG code.
    #[must_use]
    pub(crate) fn metres_per_height(vertical_epsg: u32) -> Option<f64> {
        proj_core::lookup_vertical_epsg(vertical_epsg).map(|v| v.linear_unit_to_meter())
    }

    /// A projected system of which nothing is known but its unit.
    ///
    /// # Errors
    /// When the number is not positive and finite.
    pub(crate) fn projected_in(metres: f64) -> Result<Self> {
        positive(metres)?;
        Ok(Self { map: Map::Projected(None, metres), ..Self::UNKNOWN })
    }

    /// Degrees on an ellipsoid that no code names, as the Moon's.
    #[must_use]
    pub(crate) fn geographic(ellipsoid: Ellipsoid) -> Self {
        Self { ellipsoid, ..Self::UNKNOWN }
    }

    const UNKNOWN: Self = Self {
        epsg: None,
        name: "",
        ellipsoid: Ellipsoid::WGS84,
        base: 0,
        datum: 0,
        map: Map::Geographic,
        vertical: None,
        text: None,
    };

    fn of(definition: &CrsDef) -> Result<Self> {
        let Some(horizontal) = definition.horizontal_crs() else {
            return Err(undefined(definition.name(), "it has no horizontal coordinates"));
        };
        let of_datum = |datum: &Datum| {
            let shape = datum.ellipsoid();
            (Ellipsoid { semi_major: shape.semi_major_axis(), flattening: shape.flattening() }, datum.epsg())
        };
        let (ellipsoid, datum) = of_datum(horizontal.datum());
        let code = |code: u32| (code != 0).then_some(code);
        let (map, base, name) = match (horizontal.as_projected(), horizontal.as_geographic()) {
            (Some(p), _) => {
                let map = Map::Projected(Some(p.method()), p.linear_unit_to_meter());
                (map, p.base_geographic_crs_epsg(), p.name())
            }
            (None, Some(g)) => (Map::Geographic, g.epsg(), g.name()),
            (None, None) => {
                return Err(undefined(definition.name(), "it is neither geographic nor projected"));
            }
        };
        Ok(Self {
            epsg: code(horizontal.epsg()),
            name,
            ellipsoid,
            base,
            datum,
            map,
            vertical: definition.vertical_crs().map(|v| v.linear_unit_to_meter()),
            text: None,
        })
    }

    /// What the coordinates are.
    #[must_use]
    pub(crate) fn kind(&self) -> CrsKind {
        match self.map {
            Map::Geographic => CrsKind::Geographic,
            Map::Projected(..) => CrsKind::Projected,
            Map::Local(_) => CrsKind::Local,
        }
    }

    /// The code that names it.
    #[must_use]
    pub(crate) fn epsg(&self) -> Option<u32> {
        self.epsg
    }

    /// The same system on a datum of an EPSG code, 0 for an unknown one.
    pub(in crate::dem) fn with_datum(self, datum: u32) -> Self {
        Self { datum, ..self }
    }

    /// EPSG code of the datum.
    pub(in crate::dem) fn datum_epsg(&self) -> Option<u32> {
        (self.datum != 0).then_some(self.datum)
    }

    /// EPSG code of the geographic system below it.
    pub(in crate::dem) fn base_epsg(&self) -> Option<u32> {
        (self.base != 0).then_some(self.base)
    }

    /// Its ellipsoid; WGS 84 when it did not say.
    #[must_use]
    pub(crate) fn ellipsoid(&self) -> Ellipsoid {
        self.ellipsoid
    }

    /// Metres in a unit of the coordinates; `None` for degrees.
    #[must_use]
    pub fn metres_per_unit(&self) -> Option<f64> {
        match self.map {
            Map::Geographic => None,
            Map::Projected(_, metres) | Map::Local(metres) => Some(metres),
        }
    }

    /// Metres in a unit of the heights, when it is a compound system that says so.
    #[must_use]
    pub(crate) fn vertical_metres_per_unit(&self) -> Option<f64> {
        self.vertical
    }

    /// The same system with heights in units of so many metres, or of no stated unit.
    #[must_use]
    pub(crate) fn with_heights(self, metres: Option<f64>) -> Self {
        Self { vertical: metres, ..self }
    }

    /// The same system with its lengths in another unit, and no code therefore.
    ///
    /// # Errors
    /// When the number is not positive and finite.
    pub(crate) fn with_metres_per_unit(self, metres: f64) -> Result<Self> {
        positive(metres)?;
        Ok(match self.map {
            Map::Projected(_, old) if old == metres => self,
            // The text says another unit: nothing is left of it but the unit.
            Map::Projected(None, _) => return Self::projected_in(metres),
            Map::Projected(method, _) => Self { epsg: None, map: Map::Projected(method, metres), ..self },
            Map::Local(_) => Self { map: Map::Local(metres), ..self },
            Map::Geographic => self,
        })
    }

    /// In words: "EPSG:2227, US survey foot (0.3048006096 m)".
    #[must_use]
    pub(crate) fn in_words(&self) -> String {
        let name = match (self.epsg, self.map) {
            (Some(code), _) if self.name.is_empty() => format!("EPSG:{code}"),
            (Some(code), _) => format!("EPSG:{code} ({})", self.name),
            (None, Map::Local(_)) => "local".to_owned(),
            (None, _) => "user-defined".to_owned(),
        };
        let unit = self.metres_per_unit().map_or_else(|| "degrees".to_owned(), unit_in_words);
        format!("{name}, {unit}")
    }

    /// The definition for files: as WKT, or as it was given where only that tells the projection. A projection that is known by
    /// its unit only becomes a local system.
    ///
    /// # Errors
    /// When it has no form as WKT.
    pub fn wkt(&self) -> Result<String> {
        if let Some(text) = self.text {
            return Ok(text.given.to_owned());
        }
        if let Map::Local(metres) | Map::Projected(None, metres) = self.map {
            return Ok(format!("LOCAL_CS[\"local\",UNIT[\"{}\",{metres}]]", unit_word(metres)));
        }
        let unwritable = |reason: &str| undefined(&self.in_words(), reason);
        let definition = self.definition().ok_or_else(|| unwritable("its ellipsoid is impossible"))?;
        let wkt = proj_wkt::to_wkt(&definition).map_err(|e| unwritable(&e.to_string()))?;
        // Of two projections the library's words are not those that GDAL and PROJ know.
        Ok(match self.method() {
            Some(ProjectionMethod::AlbersEqualArea { .. }) => {
                ALBERS.iter().fold(wkt, |wkt, (library, gdal)| wkt.replace(library, gdal))
            }
            // The latitude of true scale takes the place of that of the pole.
            Some(ProjectionMethod::PolarStereographic { .. }) => ["90", "-90"]
                .iter()
                .fold(wkt, |wkt, pole| wkt.replace(&format!("PARAMETER[\"latitude_of_origin\",{pole}],"), ""))
                .replace("\"standard_parallel\"", "\"latitude_of_origin\""),
            _ => wkt,
        })
    }

    /// Its projection, when it can be undone.
    pub(in crate::dem) fn method(&self) -> Option<ProjectionMethod> {
        match self.map {
            Map::Projected(method, _) => method,
            _ => None,
        }
    }

    /// Its text, where only that tells the projection.
    pub(super) fn text(&self) -> Option<Text> {
        self.text
    }

    /// The words in which it was given, where they are kept.
    pub(in crate::dem) fn own_words(&self) -> Option<&'static str> {
        self.text.map(|text| text.given)
    }

    /// Whether the projection can be undone.
    pub(super) fn can_be_undone(&self) -> bool {
        self.text.is_some() || self.method().is_some()
    }

    /// As the projection library has it.
    fn definition(&self) -> Option<CrsDef> {
        self.definition_on(self.base_definition(DatumToWgs84::Unknown)?)
    }

    /// The system and the geographic one below it, for transformations between the two: that of a datum without a code is
    /// taken for the Earth's, as the library finds no way from an unknown one even to itself.
    pub(super) fn with_base(&self) -> Option<(CrsDef, CrsDef)> {
        let base = self.base_definition(DatumToWgs84::Identity)?;
        Some((self.definition_on(base.clone())?, base))
    }

    fn definition_on(&self, geographic: CrsDef) -> Option<CrsDef> {
        let datum = geographic.datum().clone();
        match self.map {
            Map::Geographic => Some(geographic),
            Map::Projected(Some(method), metres) => {
                let unit = LinearUnit::from_meters_per_unit(metres).ok()?;
                let (code, base) = (self.epsg.unwrap_or(0), self.base);
                let projected =
                    ProjectedCrsDef::new_with_base_geographic_crs(code, base, datum, method, unit, self.name);
                Some(CrsDef::Projected(projected))
            }
            Map::Projected(None, _) | Map::Local(_) => None,
        }
    }

    /// The geographic system below the projection.
    fn base_definition(&self, to_wgs84: DatumToWgs84) -> Option<CrsDef> {
        let Ellipsoid { semi_major, flattening } = self.ellipsoid;
        let shape = proj_core::Ellipsoid::from_a_f(semi_major, flattening).ok()?;
        let datum = Datum::new(shape, to_wgs84).ok()?.with_epsg(self.datum);
        Some(CrsDef::Geographic(GeographicCrsDef::new(self.base, datum, "")))
    }
}

/// EPSG's own code for one of Esri's that files use like EPSG's.
pub(in crate::dem) const fn same_as(code: u32) -> u32 {
    match code {
        900_913 | 3785 | 41_001 | 102_100 | 102_113 => 3857,
        54_004 => 3395,
        54_001 => 4087,
        other => other,
    }
}

/// Words of WKT for Albers' projection: the library's, and those of GDAL and PROJ.
const ALBERS: [(&str, &str); 3] = [
    ("\"Albers_Equal_Area\"", "\"Albers_Conic_Equal_Area\""),
    ("\"latitude_of_origin\"", "\"latitude_of_center\""),
    ("\"central_meridian\"", "\"longitude_of_center\""),
];

/// WKT of GDAL as the library understands it.
fn in_words_of_the_library(text: &str) -> Cow<'_, str> {
    if text.contains(ALBERS[0].1) {
        ALBERS.iter().fold(text.to_owned(), |text, (library, gdal)| text.replace(gdal, library)).into()
    } else {
        text.into()
    }
}

fn positive(metres: f64) -> Result<()> {
    if metres.is_finite() && metres > 0.0 {
        return Ok(());
    }
    Err(Error::value("metres in a unit of the coordinates", metres, "allowed: positive and finite"))
}

fn undefined(text: &str, reason: &str) -> Error {
    let shown: String = text.chars().take(60).collect();
    let cut = if text.chars().count() > 60 { "..." } else { "" };
    Error::value(
        "coordinate system",
        format!("{:?}{cut}", shown),
        format!("not understood ({reason}); allowed: an EPSG code, WKT, or a PROJ string"),
    )
}

fn unit_word(metres: f64) -> String {
    if metres == 1.0 {
        "metre".to_owned()
    } else {
        unit_in_words(metres).split(" (").next().unwrap_or("unit").to_owned()
    }
}

/// The EPSG code that a projected system of WKT names as its own: the last thing in it.
fn own_code(text: &str) -> Option<u32> {
    let upper = text.to_ascii_uppercase();
    if !upper.starts_with("PROJ") {
        return None;
    }
    let words: String = upper.chars().filter(|c| !c.is_whitespace() && *c != '"').collect();
    let (before, code) = words.strip_suffix("]]")?.rsplit_once(',')?;
    let names = ["AUTHORITY[EPSG", "ID[EPSG"].iter().any(|mark| before.ends_with(mark));
    code.parse().ok().filter(|_| names)
}

/// A definition that the first library does not take as it stands: as a PROJ string, else by the second library.
fn in_other_words(text: &str) -> Option<Crs> {
    let proj = proj_string(text)?;
    let vertical = from_wkt_units(text).and_then(|crs| crs.vertical);
    let first =
        proj_wkt::parse_crs(&proj).ok().filter(|_| proj != text).and_then(|found| Crs::of(&found).ok());
    if let Some(found) = first.filter(|found| found.kind() == CrsKind::Projected) {
        return Some(found.with_heights(vertical));
    }
    let Other { text, ellipsoid, metres } = Other::new(text, &proj)?;
    positive(metres).ok()?;
    Some(Crs { ellipsoid, map: Map::Projected(None, metres), vertical, text: Some(text), ..Crs::UNKNOWN })
}

/// Kind and unit of a WKT whose projection is not known: the last unit of length before the heights.
fn from_wkt_units(text: &str) -> Option<Crs> {
    let upper = text.to_ascii_uppercase();
    let keyword = upper.split('[').next()?.trim();
    let local = matches!(keyword, "LOCAL_CS" | "ENGCRS" | "ENGINEERINGCRS");
    let compound = matches!(keyword, "COMPD_CS" | "COMPOUNDCRS");
    let projected = ["PROJCS[", "PROJCRS[", "PROJECTEDCRS["].iter().any(|k| upper.contains(k));
    if !(local || projected && (compound || upper.starts_with("PROJ") || upper.starts_with("BOUNDCRS"))) {
        return None;
    }
    let heights = ["VERT_CS[", "VERTCRS[", "VERTICALCRS["].iter().filter_map(|k| upper.find(k)).min();
    let (plane, heights) = upper.split_at(heights.unwrap_or(upper.len()));
    let metres = last_unit(plane)?;
    let vertical = last_unit(heights);
    let crs = if local { Crs::local(metres) } else { Crs::projected_in(metres) };
    Some(Crs { vertical, ..crs.ok()? })
}

/// Metres in the last unit of length in a piece of WKT, upper case.
fn last_unit(wkt: &str) -> Option<f64> {
    let lengths = wkt.rmatch_indices("UNIT[").filter(|(at, _)| {
        let before = &wkt[..*at];
        !(before.ends_with("ANGLE") || before.ends_with("SCALE") || before.ends_with("TIME"))
    });
    let (at, _) = lengths.into_iter().next()?;
    let inside = wkt[at + "UNIT[".len()..].split(']').next()?;
    // `"metre",1` or `"metre",1,AUTHORITY["EPSG","9001"`; a name may hold no comma.
    let mut fields = inside.split(',');
    let name = fields.next()?;
    let number =
        fields.next().and_then(|n| n.trim().parse::<f64>().ok()).filter(|m| m.is_finite() && *m > 0.0);
    let code = inside.split("\"EPSG\",").nth(1).and_then(|c| c.trim_matches('"').parse().ok());
    number
        .or_else(|| code.and_then(linear_unit))
        .or_else(|| super::vertical_unit(name.trim().trim_matches('"')))
}

impl serde::Serialize for Crs {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.wkt().map_err(serde::ser::Error::custom)?)
    }
}

impl<'de> serde::Deserialize<'de> for Crs {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
        Self::parse(&text).map_err(serde::de::Error::custom)
    }
}
