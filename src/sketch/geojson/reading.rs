//! GeoJSON text -> [`SketchReading`], with a warning for everything that was not taken as it stood.
//!
//! Cost: linear in the text; the JSON tree takes about twenty times its size while it is read.

use super::checks::{Named, apart, name_overlaps, name_steps, on_the_map};
use super::crs::{NamedSystem, system_of, vertical_unit_of};
use super::features::{RawLine, lines_of};
use super::heights::{name_zeros, unit, vertices};
use super::member::{HeightUnit, MapMember};
use super::notes::Notes;
use super::options::ReadOptions;
use super::placing::{Bounds, Place, size};
use crate::dem::Georeference;
use crate::error::{Error, Result};
use crate::file::read_whole;
use crate::sketch::{Sketch, Stroke};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::path::Path;

/// The largest file that is read, in bytes: some ten million vertices.
const LARGEST_FILE: u64 = 1 << 29;

/// A sketch and what was noticed when reading it.
#[derive(Clone, Debug, PartialEq)]
pub struct SketchReading {
    /// The sketch; valid, with at least one stroke, every stroke at least partly on the map.
    pub sketch: Sketch,
    /// Unit of its heights.
    pub unit: HeightUnit,
    /// Place of its map, when known.
    pub georeference: Option<Georeference>,
    /// (rows, columns) of the map that the file states, whatever size was asked for.
    pub stated_size: Option<(usize, usize)>,
    /// For every vertex of every stroke whether the file gives its height; all true unless missing heights were
    /// [left open](super::MissingHeights::Leave) or interpolated.
    pub given: Vec<Vec<bool>>,
    /// Where each stroke stands in the file ("feature 3"), for messages.
    pub names: Vec<String>,
    /// What was not taken as it stood, in whole sentences.
    pub warnings: Vec<String>,
}

/// Reads a sketch file.
///
/// # Errors
/// As [`parse`], with the file's name; when the file cannot be read or is larger than 512 MiB.
pub fn read(path: &Path, options: &ReadOptions) -> Result<SketchReading> {
    parse(&text_of(path)?, options).map_err(|e| e.in_file(path))
}

/// What a file says of its place, whatever map it may lie on.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(crate) struct Outline {
    /// Whether its coordinates are model coordinates as soon as its map has a georeference: the file has one itself, or
    /// describes no map at all, as what a geographic information system writes.
    pub(crate) is_placed: bool,
    /// Whether it has a georeference of its own.
    pub(crate) has_place: bool,
    /// EPSG code of the system that it names, or that of its georeference.
    pub(crate) epsg: Option<u32>,
    /// The rectangle around all vertices, in the file's coordinates; `None` without any.
    pub(crate) bounds: Option<Bounds>,
}

/// What a sketch file says of its place.
///
/// # Errors
/// When the file cannot be read, or is not GeoJSON that [`parse`] understands, wherever it lies.
pub(crate) fn outline(path: &Path, options: &ReadOptions) -> Result<Outline> {
    outline_of(&text_of(path)?, options).map_err(|e| e.in_file(path))
}

fn outline_of(text: &str, options: &ReadOptions) -> Result<Outline> {
    let (root, _) = json(text)?;
    let (root, features) = collection(&root)?;
    let member = MapMember::of(root)?;
    let lines = lines(features, options, &mut Notes::default())?;
    let own = member.as_ref().and_then(|m| m.georeference);
    let named = match system_of(root) {
        Some(NamedSystem::Epsg(code)) => Some(code),
        _ => own.and_then(|g| g.epsg),
    };
    Ok(Outline {
        is_placed: member.is_none() || own.is_some(),
        has_place: own.is_some(),
        epsg: options.epsg.or(named),
        bounds: Bounds::of(&lines),
    })
}

fn text_of(path: &Path) -> Result<String> {
    String::from_utf8(read_whole(path, LARGEST_FILE)?).map_err(|e| {
        let allowed = "allowed: GeoJSON in UTF-8; save layers of other formats as GeoJSON";
        Error::file(path, "text", format!("not UTF-8 ({e})"), allowed)
    })
}

/// The JSON of a text, and whether it held bare NaN, which Python writes and JSON does not know.
fn json(text: &str) -> Result<(Value, bool)> {
    let text = text.trim_start_matches('\u{feff}');
    let repaired = without_nan(text);
    let root = serde_json::from_str(&repaired).map_err(|e| {
        Error::value("text", format!("not JSON ({e})"), "allowed: a GeoJSON FeatureCollection")
    })?;
    Ok((root, matches!(repaired, Cow::Owned(_))))
}

/// The text with `null` for every `NaN` outside of quotes.
fn without_nan(text: &str) -> Cow<'_, str> {
    if !text.contains("NaN") {
        return Cow::Borrowed(text);
    }
    let (mut out, mut rest, mut quoted, mut any) =
        (String::with_capacity(text.len() + 16), text, false, false);
    while let Some(at) = rest.find(['"', '\\', 'N']) {
        out.push_str(&rest[..at]);
        let tail = &rest[at..];
        let taken = match tail.as_bytes() {
            [b'\\', ..] if quoted => tail.char_indices().nth(2).map_or(tail.len(), |(i, _)| i),
            [b'"', ..] => {
                quoted = !quoted;
                1
            }
            [b'N', b'a', b'N', ..] if !quoted => {
                out.push_str("null");
                any = true;
                rest = &tail[3..];
                continue;
            }
            _ => 1,
        };
        out.push_str(&tail[..taken]);
        rest = &tail[taken..];
    }
    out.push_str(rest);
    if any { Cow::Owned(out) } else { Cow::Borrowed(text) }
}

/// Reads a sketch from GeoJSON text. Features, lines and vertices are counted from 1 in every message.
///
/// # Errors
/// When the text is not JSON or not a feature (collection); a geometry is none that lines can be taken from; a kind is
/// unknown; a height is missing, or not a finite number; the file is in another coordinate system than the map, or in one
/// while no map is known; no stroke is left.
pub fn parse(text: &str, options: &ReadOptions) -> Result<SketchReading> {
    let (root, had_nan) = json(text)?;
    let (root, features) = collection(&root)?;
    let mut notes = Notes::default();
    if had_nan {
        notes.say("The file holds NaN, which JSON does not know: taken as null, not known.");
    }
    let member = MapMember::of(root)?;
    let lines = lines(features, options, &mut notes)?;
    if lines.is_empty() {
        return Err(Error::value(
            "number of strokes",
            0,
            "allowed: at least one feature with a line or point",
        ));
    }
    let place = Place::of(root, member.as_ref(), &lines, options, &mut notes)?;
    let (unit, per_unit) = unit(member.as_ref(), options, &lines, vertical_unit_of(root), &mut notes)?;
    let mut strokes = Vec::with_capacity(lines.len());
    for line in &lines {
        let (vertices, given) =
            vertices(line, options.missing_heights, per_unit, |x, y| place.to_raster(x, y))?;
        strokes.push(Named { name: line.name.clone(), stroke: Stroke { kind: line.kind, vertices }, given });
    }
    name_steps(&strokes, &mut notes);
    name_zeros(unit, &lines, &mut notes);
    let plain = || strokes.iter().map(|named| &named.stroke);
    let size = size(member.as_ref(), options, place.is_model, plain(), &mut notes)?;
    let strokes = on_the_map(strokes, size, || place.advice(&lines, size), &mut notes)?;
    name_overlaps(&strokes, size, &mut notes);
    let (sketch, given, names) = apart(strokes, size.0, size.1)?;
    Ok(SketchReading {
        sketch,
        unit,
        georeference: place.target,
        stated_size: member.as_ref().and_then(MapMember::size),
        given,
        names,
        warnings: notes.into_sentences(),
    })
}

fn lines(features: &[Value], options: &ReadOptions, notes: &mut Notes) -> Result<Vec<RawLine>> {
    let mut lines: Vec<RawLine> = Vec::new();
    for (i, feature) in features.iter().enumerate() {
        let found = lines_of(feature, i + 1, options, notes)?;
        if found.is_empty() {
            notes.line("without any point: left out", &format!("feature {}", i + 1));
        }
        lines.extend(found);
    }
    Ok(lines)
}

/// The root object and its features; a single feature is a collection of one.
fn collection(root: &Value) -> Result<(&Map<String, Value>, &[Value])> {
    let kind = root.get("type").and_then(Value::as_str).unwrap_or("missing");
    let allowed = "allowed: FeatureCollection, Feature";
    match (root.as_object(), kind) {
        (Some(object), "FeatureCollection") => match object.get("features").and_then(Value::as_array) {
            Some(features) => Ok((object, features)),
            None => {
                Err(Error::value("member `features`", "missing or no array", "allowed: an array of features"))
            }
        },
        (Some(object), "Feature") => Ok((object, std::slice::from_ref(root))),
        _ => Err(Error::value("GeoJSON type", kind, allowed)),
    }
}
