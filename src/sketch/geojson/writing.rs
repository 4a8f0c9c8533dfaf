//! [`Sketch`] -> GeoJSON, one feature a line of text.

use super::crs::crs_member;
use super::member::{HeightUnit, KEY, MapMember};
use crate::dem::Georeference;
use crate::error::{Error, Result};
use crate::file::write_atomically;
use crate::sketch::{Sketch, Stroke, StrokeKind};
use ::geojson::{Feature, Geometry, JsonObject};
use std::io::Write as _;
use std::path::Path;

/// Writes a sketch file; `path` appears only when it is complete.
///
/// # Errors
/// As [`to_text`]; when the file cannot be written.
pub fn write(
    path: &Path,
    sketch: &Sketch,
    unit: HeightUnit,
    georeference: Option<&Georeference>,
) -> Result<()> {
    let text = to_text(sketch, unit, georeference).map_err(|e| e.in_file(path))?;
    write_atomically(path, |out| out.write_all(text.as_bytes()).map_err(Error::io(path, "write the sketch")))
}

/// The GeoJSON text of a sketch: model coordinates with a georeference, pixel units without. Reading it back gives the
/// same sketch, in pixel units to the last bit.
///
/// # Errors
/// When the sketch is not valid or has no strokes.
pub fn to_text(sketch: &Sketch, unit: HeightUnit, georeference: Option<&Georeference>) -> Result<String> {
    sketch.validate()?;
    if sketch.strokes.is_empty() {
        return Err(Error::value("number of strokes", 0, "a sketch file needs at least one"));
    }
    let member = MapMember {
        rows: Some(sketch.rows),
        cols: Some(sketch.cols),
        unit: Some(unit.name().to_owned()),
        georeference: georeference.copied(),
    };
    let mut text = String::from("{\"type\":\"FeatureCollection\",\n");
    if let Some(crs) = georeference.and_then(|g| g.epsg).and_then(crs_member) {
        text += &format!("\"crs\":{crs},\n");
    }
    text += &format!("\"{KEY}\":{},\n\"features\":[\n", json_of(&member)?);
    for (i, stroke) in sketch.strokes.iter().enumerate() {
        text += if i == 0 { "" } else { ",\n" };
        text += &json_of(&feature(stroke, georeference)?)?;
    }
    text += "\n]}\n";
    Ok(text)
}

fn json_of(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string(value)
        .map_err(|e| Error::value("sketch", format!("not writable as JSON ({e})"), "allowed: finite numbers"))
}

fn feature(stroke: &Stroke, georeference: Option<&Georeference>) -> Result<Feature> {
    let mut positions = Vec::with_capacity(stroke.vertices.len());
    for v in &stroke.vertices {
        // Georeferences count from the corner of the first cell, vertices from its centre.
        let (x, y) = georeference.map_or((v.x, v.y), |g| g.to_model(v.x + 0.5, v.y + 0.5));
        if !(x.is_finite() && y.is_finite()) {
            let name = format!("model coordinates of column {}, row {}", v.x, v.y);
            return Err(Error::value(name, format!("({x}, {y})"), "allowed: finite"));
        }
        positions.push(vec![x, y, v.z]);
    }
    let geometry = match positions.as_slice() {
        [single] => Geometry::new_point(single.clone()),
        _ => Geometry::new_line_string(positions),
    };
    let kind = match stroke.kind {
        StrokeKind::Ridge => "ridge",
        StrokeKind::Valley => "valley",
    };
    let properties = JsonObject::from_iter([("kind".to_owned(), kind.into())]);
    Ok(Feature { properties: Some(properties), ..Feature::from(geometry) })
}
