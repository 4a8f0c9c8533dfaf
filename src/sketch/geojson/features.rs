//! One feature of the file: its kind and its lines, every complaint naming the feature and the vertex.
//!
//! The positions are taken from the JSON directly: the `geojson` crate refuses a `null` height, which tools do write, and
//! cannot say where it stood.

use super::reading::MissingHeights;
use crate::error::{Error, Result};
use crate::sketch::{StrokeKind, Vertex};
use serde_json::{Map, Value};

/// A line as it stands in the file.
#[derive(Debug)]
pub(super) struct RawLine {
    pub(super) kind: StrokeKind,
    /// Where it stands ("feature 3" or "feature 3, line 2"), counted from 1.
    pub(super) name: String,
    pub(super) points: Vec<RawPoint>,
    /// Height of the whole line, from a property.
    height: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct RawPoint {
    pub(super) x: f64,
    pub(super) y: f64,
    z: Option<f64>,
}

/// Heights beyond this many metres are no heights, as in terrain files (`dem::io`), which could not hold them.
const MAX_HEIGHT: f64 = 1e6;
const HEIGHTS: &str = "allowed: a finite number, up to 1000000 from 0";

/// Properties that may hold the height of a whole line, in order of preference.
const HEIGHT_PROPERTIES: [&str; 3] = ["z", "height", "elevation"];

/// The lines of the `number`-th feature (from 1); none when its geometry is null or empty.
pub(super) fn lines_of(feature: &Value, number: usize) -> Result<Vec<RawLine>> {
    let name = format!("feature {number}");
    let wrong = |value: &dyn std::fmt::Display, allowed: &str| {
        Error::value(name.clone(), value, format!("allowed: {allowed}"))
    };
    let object = feature.as_object().ok_or_else(|| wrong(&kind_of_value(feature), "a GeoJSON Feature"))?;
    match object.get("type").and_then(Value::as_str) {
        Some("Feature") => {}
        Some(other) => return Err(wrong(&format!("of type {other}"), "a Feature")),
        None => return Err(wrong(&"without a type", "a Feature")),
    }
    let geometry = match object.get("geometry") {
        None | Some(Value::Null) => return Ok(Vec::new()),
        Some(geometry) => geometry,
    };
    let kind_name = geometry.get("type").and_then(Value::as_str).unwrap_or("missing");
    if !matches!(kind_name, "LineString" | "MultiLineString" | "Point") {
        return Err(Error::value(
            format!("geometry type of {name}"),
            kind_name,
            "allowed: LineString, MultiLineString, Point",
        ));
    }
    let coordinates = geometry.get("coordinates").unwrap_or(&Value::Null);
    let properties = object.get("properties").and_then(Value::as_object);
    let points = match kind_name {
        "Point" if is_empty(coordinates) => Vec::new(),
        "Point" => vec![(name.clone(), vec![position(coordinates, &name)?])],
        "LineString" => vec![(name.clone(), positions(coordinates, &name)?)],
        _ => {
            let lines = array(coordinates, &name)?.iter().enumerate();
            let named = lines.map(|(i, line)| (format!("{name}, line {}", i + 1), line));
            named.map(|(name, line)| Ok((name.clone(), positions(line, &name)?))).collect::<Result<_>>()?
        }
    };
    let points: Vec<_> = points.into_iter().filter(|(_, points)| !points.is_empty()).collect();
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let kind = stroke_kind(properties, &name)?;
    let height = line_height(properties, &name)?;
    Ok(points.into_iter().map(|(name, points)| RawLine { kind, name, points, height }).collect())
}

fn stroke_kind(properties: Option<&Map<String, Value>>, name: &str) -> Result<StrokeKind> {
    let value = properties.and_then(|p| p.get("kind"));
    let text = value.and_then(Value::as_str).unwrap_or_default().trim();
    if text.eq_ignore_ascii_case("ridge") {
        Ok(StrokeKind::Ridge)
    } else if text.eq_ignore_ascii_case("valley") {
        Ok(StrokeKind::Valley)
    } else {
        let found = value.map_or_else(|| "missing".to_owned(), shortened);
        Err(Error::value(format!("property `kind` of {name}"), found, "allowed: ridge, valley"))
    }
}

fn line_height(properties: Option<&Map<String, Value>>, name: &str) -> Result<Option<f64>> {
    let found = HEIGHT_PROPERTIES.iter().find_map(|&key| Some((key, properties?.get(key)?)));
    match found {
        None | Some((_, Value::Null)) => Ok(None),
        Some((key, value)) => match value.as_f64().filter(|z| is_height(*z)) {
            Some(z) => Ok(Some(z)),
            None => Err(Error::value(format!("property `{key}` of {name}"), shortened(value), HEIGHTS)),
        },
    }
}

fn positions(value: &Value, name: &str) -> Result<Vec<RawPoint>> {
    let points = array(value, name)?.iter().enumerate();
    points.map(|(i, p)| position(p, &format!("{name}, vertex {}", i + 1))).collect()
}

fn position(value: &Value, name: &str) -> Result<RawPoint> {
    let numbers = array(value, name)?;
    let wrong = |what: &str, found: &Value| {
        Error::value(format!("{what} of {name}"), shortened(found), "allowed: a finite number")
    };
    let &[ref x, ref y, ref rest @ ..] = numbers.as_slice() else {
        return Err(Error::value(name, shortened(value), "allowed: [x, y, z]"));
    };
    let z = match rest.first() {
        None | Some(Value::Null) => None,
        Some(z) => {
            let refuse = || Error::value(format!("height of {name}"), shortened(z), HEIGHTS);
            Some(z.as_f64().filter(|z| is_height(*z)).ok_or_else(refuse)?)
        }
    };
    let coordinate = |what: &str, v: &Value| v.as_f64().ok_or_else(|| wrong(what, v));
    Ok(RawPoint { x: coordinate("x", x)?, y: coordinate("y", y)?, z })
}

/// Not NaN, and no farther from 0 than a terrain file may hold.
fn is_height(z: f64) -> bool {
    z.abs() <= MAX_HEIGHT
}

fn array<'a>(value: &'a Value, name: &str) -> Result<&'a Vec<Value>> {
    value.as_array().ok_or_else(|| {
        Error::value(
            format!("coordinates of {name}"),
            kind_of_value(value),
            "allowed: an array as deep as the geometry type asks",
        )
    })
}

fn is_empty(value: &Value) -> bool {
    value.as_array().is_some_and(Vec::is_empty)
}

fn kind_of_value(value: &Value) -> &'static str {
    match value {
        Value::Null => "null or missing",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

/// A value fit to be shown in a message.
fn shortened(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    if text.chars().count() <= LONGEST {
        text
    } else {
        text.chars().take(LONGEST).chain("...".chars()).collect()
    }
}

impl RawLine {
    /// The vertices of the line after `place` has moved its points onto the raster, every one with a height.
    pub(super) fn vertices(
        &self,
        missing: MissingHeights,
        place: impl Fn(f64, f64) -> (f64, f64),
    ) -> Result<Vec<Vertex>> {
        let given = |p: &RawPoint| p.z.or(self.height);
        if let Some(i) = self.points.iter().position(|p| given(p).is_none()) {
            let without_any = self.points.iter().all(|p| given(p).is_none());
            if missing == MissingHeights::Refuse || without_any {
                let allowed = if without_any {
                    "allowed: [x, y, z], or the height of the whole line as property `z`"
                } else {
                    "allowed: [x, y, z], or missing heights interpolated along the line by option"
                };
                let name = format!("height of {}, vertex {}", self.name, i + 1);
                return Err(Error::value(name, "missing", allowed));
            }
        }
        let placed: Vec<(f64, f64)> = self.points.iter().map(|p| place(p.x, p.y)).collect();
        if let Some(i) = placed.iter().position(|(x, y)| !(x.is_finite() && y.is_finite())) {
            return Err(Error::value(
                format!("position of {}, vertex {}", self.name, i + 1),
                format!("({}, {})", self.points[i].x, self.points[i].y),
                "allowed: coordinates that the map's georeference can place",
            ));
        }
        let heights = interpolated(&placed, &self.points.iter().map(given).collect::<Vec<_>>());
        Ok(placed.into_iter().zip(heights).map(|((x, y), z)| Vertex { x, y, z }).collect())
    }
}

/// Fills the gaps between given heights linearly by the length along the line; beyond the first and the last given
/// height the line is level. At least one is given.
fn interpolated(points: &[(f64, f64)], heights: &[Option<f64>]) -> Vec<f64> {
    let mut along = vec![0.0];
    for w in points.windows(2) {
        along.push(along[along.len() - 1] + (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1));
    }
    let known: Vec<(usize, f64)> = heights.iter().enumerate().filter_map(|(i, z)| Some((i, (*z)?))).collect();
    let at = |i: usize| {
        let after = known.partition_point(|&(j, _)| j < i);
        match (after.checked_sub(1).map(|b| known[b]), known.get(after)) {
            (_, Some(&(j, z))) if j == i => z,
            (Some((a, from)), Some(&(b, to))) => {
                let share = (along[i] - along[a]) / (along[b] - along[a]);
                // Not a number when the whole gap has no length, or a length beyond all numbers.
                from + (to - from) * if share.is_finite() { share } else { 0.0 }
            }
            (Some((_, z)), None) | (None, Some(&(_, z))) => z,
            (None, None) => unreachable!("a line without any height was refused"),
        }
    };
    (0..points.len()).map(at).collect()
}
