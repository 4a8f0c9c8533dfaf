//! What the properties of a feature say of its lines: ridge or valley, and their heights.
//!
//! Names and kinds are read in any case. Whatever was taken from another property than `kind`, or left aside for another,
//! is noted.

use super::notes::Notes;
use super::number::{Number, metres_per, number, shown};
use super::options::ReadOptions;
use crate::error::{Error, Result};
use crate::sketch::StrokeKind;
use serde_json::{Map, Value};

/// Properties that may hold heights, in order of preference; each may end in a unit, as in `elev_ft`.
const HEIGHT_PROPERTIES: [&str; 10] =
    ["z", "elevation", "elev", "ele", "height", "altitude", "alt", "heights", "elevations", "zs"];

/// Heights beyond this many metres are no heights, as in terrain files (`dem::io`), which could not hold them.
const MAX_HEIGHT: f64 = 1e6;
/// Numbers that stand for "no height here" in terrain files, far from every height.
const MARKERS: [f64; 5] = [-9999.0, -32768.0, -32767.0, -99999.0, -999_999.0];
pub(super) const HEIGHTS: &str = "allowed: a finite number, up to 1000000 from 0, or such a number with a unit as in \"2500 m\" or \
                                  \"8200 ft\"; null where it is not known";

/// A height in the file's unit, or in metres where it named its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Height {
    pub(super) value: f64,
    pub(super) in_metres: bool,
}

impl Height {
    /// The height that `value` says, `None` when it is left blank.
    ///
    /// # Errors
    /// When it is no height; `name` says where it stands.
    pub(super) fn read(
        value: &Value,
        name: &str,
        unit: Option<f64>,
        options: &ReadOptions,
    ) -> Result<Option<Self>> {
        let refuse = || Error::value(name, shown(value), HEIGHTS);
        let Some(Number { value: z, metres_per_unit }) = number(value).map_err(|()| refuse())? else {
            return Ok(None);
        };
        if MARKERS.contains(&z) && metres_per_unit.is_none() {
            let allowed =
                "this number stands for \"no height\" in terrain files: write null where it is not known";
            return Err(Error::value(name, shown(value), allowed));
        }
        // What the caller says of the unit overrules the file.
        let own = if options.metres_per_unit.is_some() { None } else { metres_per_unit.or(unit) };
        let height = Self { value: z * own.unwrap_or(1.0), in_metres: own.is_some() };
        if height.value.abs() <= MAX_HEIGHT { Ok(Some(height)) } else { Err(refuse()) }
    }
}

/// The heights that a property gives.
#[derive(Clone, Debug)]
pub(super) enum PropertyHeights {
    /// One for the whole line.
    One(Height),
    /// One for each vertex of the feature, in their order; blank ones are not known.
    Each(Vec<Option<Height>>),
}

/// Heights with the property that they stand in.
#[derive(Clone, Debug)]
pub(super) struct NamedHeights {
    pub(super) property: String,
    pub(super) heights: PropertyHeights,
}

/// The properties of the feature called `name`.
pub(super) struct Properties<'a> {
    pub(super) of: Option<&'a Map<String, Value>>,
    pub(super) name: &'a str,
    pub(super) options: &'a ReadOptions,
}

impl Properties<'_> {
    fn all(&self) -> impl Iterator<Item = (&String, &Value)> {
        self.of.into_iter().flatten().filter(|(_, value)| !is_blank(value))
    }

    fn called<'b>(&'b self, wanted: &'b str) -> impl Iterator<Item = (&'b String, &'b Value)> {
        self.all().filter(move |(key, _)| key.trim().to_lowercase() == wanted.trim().to_lowercase())
    }

    /// Whether the lines are ridges or valleys.
    pub(super) fn kind(&self, notes: &mut Notes) -> Result<StrokeKind> {
        let wanted = self.options.kind_property.as_deref().unwrap_or("kind");
        let stated: Vec<_> = self.called(wanted).collect();
        for (key, value) in &stated {
            if kind_in(value).is_none() {
                let name = format!("property `{key}` of {}", self.name);
                return Err(Error::value(name, shown(value), "allowed: ridge, valley"));
            }
        }
        let elsewhere = stated.is_empty() && self.options.kind_property.is_none();
        let candidates = if elsewhere { self.all().collect() } else { stated };
        let kinds: Vec<_> = candidates.into_iter().filter_map(|(key, v)| Some((key, kind_in(v)?))).collect();
        let Some(&(key, kind)) = kinds.first() else {
            let others: Vec<_> = self.of.into_iter().flatten().map(|(key, _)| format!("`{key}`")).collect();
            let has = if others.is_empty() { "no properties".to_owned() } else { others.join(", ") };
            let allowed = format!(
                "allowed: ridge, valley (the feature has {has}; --kind-property NAME tells which one)"
            );
            return Err(Error::value(format!("property `{wanted}` of {}", self.name), "missing", allowed));
        };
        if let Some((other, _)) = kinds.iter().find(|(_, k)| *k != kind) {
            let found = format!("both ridge and valley (`{key}` and `{other}`)");
            let allowed = "allowed: one of them; --kind-property NAME tells which property counts";
            return Err(Error::value(format!("kind of {}", self.name), found, allowed));
        }
        if elsewhere {
            notes.line(&format!("without a property `kind`: taken as `{key}` says"), self.name);
        }
        Ok(kind)
    }

    /// The heights that a property holds, if one does.
    pub(super) fn heights(&self, notes: &mut Notes) -> Result<Option<NamedHeights>> {
        if let Some(wanted) = &self.options.height_property {
            let Some((key, value)) = self.called(wanted).next() else { return Ok(None) };
            return self.heights_in(key, value, height_name(key).and_then(|(_, unit)| unit));
        }
        let mut found: Vec<_> = self
            .all()
            .filter_map(|(key, value)| height_name(key).map(|(rank, unit)| (rank, key, value, unit)))
            .collect();
        found.sort_by_key(|(rank, ..)| *rank); // stable: as in the file where names are alike
        let Some(&(_, key, value, unit)) = found.first() else { return Ok(None) };
        for (_, other, left_out, _) in &found[1..] {
            if *left_out != value {
                let what = format!(
                    "with several heights: property `{key}` counts, `{other}` does not (--height-property NAME tells which)"
                );
                notes.line(&what, self.name);
            }
        }
        self.heights_in(key, value, unit)
    }

    fn heights_in(&self, key: &str, value: &Value, unit: Option<f64>) -> Result<Option<NamedHeights>> {
        let name = format!("property `{key}` of {}", self.name);
        let one = |value: &Value| Height::read(value, &name, unit, self.options);
        // Geographic information systems have no lists in a table: they write them as text.
        let list = match value {
            Value::String(text) if text.trim_start().starts_with('[') => serde_json::from_str(text).ok(),
            Value::Array(_) => Some(value.clone()),
            _ => None,
        };
        let heights = match list {
            Some(Value::Array(items)) => {
                let mut heights = Vec::new();
                for item in &items {
                    // Of several lines: a list each.
                    match item {
                        Value::Array(inner) => {
                            for value in inner {
                                heights.push(one(value)?);
                            }
                        }
                        value => heights.push(one(value)?),
                    }
                }
                Some(PropertyHeights::Each(heights))
            }
            _ => one(value)?.map(PropertyHeights::One),
        };
        Ok(heights.map(|heights| NamedHeights { property: key.to_owned(), heights }))
    }
}

/// Whether a property holds nothing: null, or empty text.
fn is_blank(value: &Value) -> bool {
    value.is_null() || value.as_str().is_some_and(|text| text.trim().is_empty())
}

/// Ridge or valley, in any case; plural and "ridge line" too.
fn kind_in(value: &Value) -> Option<StrokeKind> {
    let text = value.as_str()?.to_lowercase();
    let word: String = text.chars().filter(|c| !(c.is_whitespace() || matches!(c, '_' | '-'))).collect();
    match word.trim_end_matches('s').trim_end_matches("line") {
        "ridge" => Some(StrokeKind::Ridge),
        "valley" => Some(StrokeKind::Valley),
        _ => None,
    }
}

/// The rank of a property's name among those of heights, and the metres in the unit that it names.
fn height_name(key: &str) -> Option<(usize, Option<f64>)> {
    let lower = key.trim().to_lowercase();
    let (base, unit) = match lower.split_once(['_', ' ', '(', '[', '-']) {
        None => (lower.as_str(), None),
        Some((base, rest)) => (base, Some(metres_per(rest.trim_matches(['(', ')', '[', ']', ' ']))?)),
    };
    let rank = HEIGHT_PROPERTIES.iter().position(|name| *name == base)?;
    Some((rank, unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_of_heights_may_carry_a_unit_and_nothing_else() {
        assert_eq!(height_name("Z"), Some((0, None)));
        assert_eq!(height_name("Elev_ft"), Some((2, Some(0.3048))));
        assert_eq!(height_name("height (m)"), Some((4, Some(1.0))));
        assert_eq!(height_name("ALTITUDE"), Some((5, None)));
        for other in ["z_mean", "size", "zone", "height_of_tree", "length", ""] {
            assert_eq!(height_name(other), None, "{other}");
        }
    }

    #[test]
    fn kinds_are_words_in_any_case() {
        for word in ["ridge", "RIDGE", " Ridges ", "ridge\n", "ridge line", "Ridge_Lines", "ridgeline"] {
            assert_eq!(kind_in(&json!(word)), Some(StrokeKind::Ridge), "{word}");
        }
        for word in ["Valley", "valleys", "valley-line"] {
            assert_eq!(kind_in(&json!(word)), Some(StrokeKind::Valley), "{word}");
        }
        for other in ["river", "north ridge", "line", "", "ridgevalley"] {
            assert_eq!(kind_in(&json!(other)), None, "{other}");
        }
    }
}
