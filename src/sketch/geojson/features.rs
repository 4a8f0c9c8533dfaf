//! One feature of the file: its kind and its lines, every complaint naming the feature and the vertex.
//!
//! The positions are taken from the JSON directly: the `geojson` crate refuses a `null` height, which tools do write, and
//! cannot say where it stood.

use super::notes::Notes;
use super::number::{number, shown};
use super::options::ReadOptions;
use super::properties::{Height, NamedHeights, Properties, PropertyHeights};
use crate::error::{Error, Result};
use crate::sketch::StrokeKind;
use serde_json::Value;

/// A line as it stands in the file.
#[derive(Debug)]
pub(super) struct RawLine {
    pub(super) kind: StrokeKind,
    /// Where it stands ("feature 3" or "feature 3, line 2"), counted from 1.
    pub(super) name: String,
    pub(super) points: Vec<RawPoint>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct RawPoint {
    pub(super) x: f64,
    pub(super) y: f64,
    /// As the file gives it; `None` when it does not.
    pub(super) z: Option<Height>,
}

/// A line without its kind.
struct Shape {
    name: String,
    points: Vec<RawPoint>,
}

const GEOMETRIES: &str = "allowed: LineString, MultiLineString, Point, MultiPoint, Polygon, MultiPolygon (their outlines), \
                          GeometryCollection";

/// The lines of the `number`-th feature (from 1); none when its geometry is null or empty.
pub(super) fn lines_of(
    feature: &Value,
    number: usize,
    options: &ReadOptions,
    notes: &mut Notes,
) -> Result<Vec<RawLine>> {
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
    let mut shapes = Vec::new();
    match object.get("geometry") {
        None | Some(Value::Null) => {}
        Some(geometry) => {
            let numbered = geometry.get("type").and_then(Value::as_str) != Some("LineString");
            Reader { name: &name, numbered, options, notes }.geometry(geometry, &mut shapes)?;
        }
    }
    if shapes.is_empty() {
        return Ok(Vec::new());
    }
    if let [only] = shapes.as_mut_slice() {
        only.name.clone_from(&name);
    }
    let properties =
        Properties { of: object.get("properties").and_then(Value::as_object), name: &name, options };
    let kind = properties.kind(notes)?;
    if let Some(heights) = properties.heights(notes)? {
        take_heights(&mut shapes, &heights, &name, options, notes)?;
    }
    Ok(shapes.into_iter().map(|shape| RawLine { kind, name: shape.name, points: shape.points }).collect())
}

/// Gives the heights of a property to the vertices that have none, and to the lines that have only zeros: what drawing
/// programs write where nobody gave a height. A property that the caller named comes before the coordinates.
fn take_heights(
    shapes: &mut [Shape],
    given: &NamedHeights,
    name: &str,
    options: &ReadOptions,
    notes: &mut Notes,
) -> Result<()> {
    let property = &given.property;
    let total: usize = shapes.iter().map(|shape| shape.points.len()).sum();
    let of_vertex: Vec<Option<Height>> = match &given.heights {
        PropertyHeights::One(height) => vec![Some(*height); total],
        PropertyHeights::Each(heights) if heights.len() == total => heights.clone(),
        PropertyHeights::Each(heights) => {
            return Err(Error::value(
                format!("property `{property}` of {name}"),
                format!("a list of {} heights", heights.len()),
                format!("the feature has {total} vertices: allowed: as many, or one height for all"),
            ));
        }
    };
    let mut start = 0;
    for shape in shapes {
        let of_line = &of_vertex[start..start + shape.points.len()];
        start += shape.points.len();
        let zeros = shape.points.iter().all(|p| p.z.is_some_and(|z| z.value == 0.0));
        let overrules = options.height_property.is_some();
        if zeros && of_line.iter().any(|z| z.is_some_and(|z| z.value != 0.0)) && !overrules {
            let what = format!("with z = 0 in the coordinates: the heights of property `{property}` count");
            notes.line(&what, &shape.name);
        } else if !zeros && !overrules && shape.points.iter().zip(of_line).any(|(p, z)| differs(p.z, *z)) {
            let what = format!(
                "with heights in the coordinates and in property `{property}`: those in the coordinates count \
                 (--height-property {property} takes the others)"
            );
            notes.line(&what, &shape.name);
        }
        for (point, &z) in shape.points.iter_mut().zip(of_line) {
            point.z = if zeros || overrules { z.or(point.z) } else { point.z.or(z) };
        }
    }
    Ok(())
}

fn differs(a: Option<Height>, b: Option<Height>) -> bool {
    a.zip(b).is_some_and(|(a, b)| a.value != b.value)
}

/// Reads the geometry of one feature.
struct Reader<'a> {
    name: &'a str,
    /// Whether the feature may hold several lines, which are then counted in messages.
    numbered: bool,
    options: &'a ReadOptions,
    notes: &'a mut Notes,
}

impl Reader<'_> {
    /// Appends the lines of `geometry`, without those that are empty.
    fn geometry(&mut self, geometry: &Value, shapes: &mut Vec<Shape>) -> Result<()> {
        let kind = geometry.get("type").and_then(Value::as_str).unwrap_or("missing");
        let coordinates = geometry.get("coordinates").unwrap_or(&Value::Null);
        match kind {
            "Point" if is_empty(coordinates) => {}
            "Point" => {
                let name = self.name.to_owned();
                let points = vec![self.position(coordinates, &name)?];
                shapes.push(Shape { name, points });
            }
            "MultiPoint" => {
                for (i, position) in self.array(coordinates, self.name)?.iter().enumerate() {
                    let name = format!("{}, point {}", self.name, i + 1);
                    let points = vec![self.position(position, &name)?];
                    shapes.push(Shape { name, points });
                }
            }
            "LineString" => self.line(coordinates, false, shapes)?,
            "MultiLineString" => {
                for line in self.array(coordinates, self.name)? {
                    self.line(line, false, shapes)?;
                }
            }
            "Polygon" => self.rings(coordinates, shapes)?,
            "MultiPolygon" => {
                for polygon in self.array(coordinates, self.name)? {
                    self.rings(polygon, shapes)?;
                }
            }
            "GeometryCollection" => {
                let members = geometry.get("geometries").unwrap_or(&Value::Null);
                for member in self.array(members, self.name)? {
                    self.geometry(member, shapes)?;
                }
            }
            other => {
                return Err(Error::value(format!("geometry type of {}", self.name), other, GEOMETRIES));
            }
        }
        Ok(())
    }

    /// The rings of a polygon, as closed lines.
    fn rings(&mut self, polygon: &Value, shapes: &mut Vec<Shape>) -> Result<()> {
        let before = shapes.len();
        for ring in self.array(polygon, self.name)? {
            self.line(ring, true, shapes)?;
        }
        if shapes.len() > before {
            self.notes.line("drawn as a polygon: taken as its outline", self.name);
        }
        Ok(())
    }

    fn line(&mut self, coordinates: &Value, closed: bool, shapes: &mut Vec<Shape>) -> Result<()> {
        // Lines of one feature are counted over all its parts.
        let name = match self.numbered {
            true => format!("{}, line {}", self.name, shapes.len() + 1),
            false => self.name.to_owned(),
        };
        let positions = self.array(coordinates, self.name)?;
        let mut points = Vec::with_capacity(positions.len());
        for (i, position) in positions.iter().enumerate() {
            points.push(self.position(position, &format!("{name}, vertex {}", i + 1))?);
        }
        if let (true, [first, .., last]) = (closed, points.as_slice())
            && (first.x, first.y) != (last.x, last.y)
        {
            points.push(*first);
        }
        if !points.is_empty() {
            shapes.push(Shape { name, points });
        }
        Ok(())
    }

    fn position(&mut self, value: &Value, name: &str) -> Result<RawPoint> {
        let numbers = self.array(value, name)?;
        let &[ref x, ref y, ref rest @ ..] = numbers.as_slice() else {
            return Err(Error::value(name, shown(value), "allowed: [x, y, z]"));
        };
        if rest.len() > 1 {
            self.notes.line(
                "with more than three numbers at a vertex: those after the height are not read",
                self.name,
            );
        }
        let coordinate = |what: &str, v: &Value| match number(v) {
            Ok(Some(found)) if found.metres_per_unit.is_none() => Ok(found.value),
            _ => Err(Error::value(format!("{what} of {name}"), shown(v), "allowed: a finite number")),
        };
        let z = match rest.first() {
            None => None,
            Some(z) => Height::read(z, &format!("height of {name}"), None, self.options)?,
        };
        Ok(RawPoint { x: coordinate("x", x)?, y: coordinate("y", y)?, z })
    }

    fn array<'v>(&self, value: &'v Value, name: &str) -> Result<&'v Vec<Value>> {
        value.as_array().ok_or_else(|| {
            Error::value(
                format!("coordinates of {name}"),
                kind_of_value(value),
                "allowed: an array as deep as the geometry type asks",
            )
        })
    }
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
