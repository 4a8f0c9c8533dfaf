//! The foreign member of a sketch file: the map that the strokes are drawn on.

use super::number::metres_per;
use crate::dem::Georeference;
use crate::error::{Error, Result};
use serde_json::{Map, Value};

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

impl HeightUnit {
    /// The word for it in the file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Metres => "metres",
            Self::Normalised => "normalised",
        }
    }
}

/// Key of the [`MapMember`] in the feature collection.
pub(super) const KEY: &str = "monadnock";

/// The map that the strokes are drawn on.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapMember {
    /// Rows and columns of the map; both or none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) rows: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) cols: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) unit: Option<String>,
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
                "allowed: rows, cols, unit (metres, feet or normalised), georeference",
            )
        })?;
        if member.rows.is_some() != member.cols.is_some() {
            return Err(Error::value(
                format!("member `{KEY}`"),
                "a map with only one side",
                "allowed: rows and cols together",
            ));
        }
        member.unit()?;
        Ok(Some(member))
    }

    pub(super) fn size(&self) -> Option<(usize, usize)> {
        self.rows.zip(self.cols)
    }

    /// The unit of the heights, with the metres in one of it.
    pub(super) fn unit(&self) -> Result<Option<(HeightUnit, f64)>> {
        let Some(unit) = &self.unit else { return Ok(None) };
        match unit.trim().to_ascii_lowercase().as_str() {
            "normalised" | "normalized" => Ok(Some((HeightUnit::Normalised, 1.0))),
            length => match metres_per(length) {
                Some(metres) => Ok(Some((HeightUnit::Metres, metres))),
                None => Err(Error::value(
                    format!("unit of the heights in member `{KEY}`"),
                    format!("\"{unit}\""),
                    "allowed: metres, feet, us survey feet, normalised (0 to 1 of the style's range); or leave it out and \
                     give --metres-per-unit",
                )),
            },
        }
    }
}
