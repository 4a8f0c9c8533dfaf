//! GeoJSON text -> [`SketchReading`], with a warning for everything that was not taken as it stood.
//!
//! Cost: linear in the text; the JSON tree takes about twenty times its size while it is read.

use super::features::{RawLine, lines_of};

use super::member::{HeightUnit, MapMember, NamedSystem, system_of};
use crate::dem::Georeference;
use crate::error::{Error, Result};
use crate::file::read_whole;
use crate::sketch::{Sketch, Stroke};
use serde_json::{Map, Value};
use std::path::Path;

/// The largest file that is read, in bytes: some ten million vertices.
const LARGEST_FILE: u64 = 1 << 29;

/// What to do with a vertex without a height in a line that has some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MissingHeights {
    /// An error that names the feature and the vertex.
    #[default]
    Refuse,
    /// Linear by length between the given heights of the same line, level beyond them. A line without any is refused.
    Interpolate,
}

/// What the caller knows about the map, beyond what the file says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// (rows, columns) of the map; overrides the file. Without both, the map just holds the strokes.
    pub size: Option<(usize, usize)>,
    /// Place of the map (that of the DEM which the sketch belongs to); overrides the file.
    pub georeference: Option<Georeference>,
    /// Unit of the heights; overrides the file.
    pub unit: Option<HeightUnit>,
    /// What to do about missing heights.
    pub missing_heights: MissingHeights,
}

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

/// Whether the coordinates of a sketch file are model coordinates as soon as its map has a georeference: the file has one
/// itself, or describes no map at all, as what a geographic information system writes.
///
/// # Errors
/// When the file cannot be read, or is not a GeoJSON feature (collection).
pub fn is_placed(path: &Path) -> Result<bool> {
    let root = json(&text_of(path)?).map_err(|e| e.in_file(path))?;
    let member = collection(&root).and_then(|(root, _)| MapMember::of(root)).map_err(|e| e.in_file(path))?;
    Ok(is_model(member.as_ref()))
}

fn text_of(path: &Path) -> Result<String> {
    String::from_utf8(read_whole(path, LARGEST_FILE)?)
        .map_err(|e| Error::file(path, "text", format!("not UTF-8 ({e})"), "allowed: GeoJSON in UTF-8"))
}

fn json(text: &str) -> Result<Value> {
    serde_json::from_str(text.trim_start_matches('\u{feff}'))
        .map_err(|e| Error::value("text", format!("not JSON ({e})"), "allowed: a GeoJSON FeatureCollection"))
}

/// A file that describes its map without a georeference is in pixels, wherever the map lies.
fn is_model(member: Option<&MapMember>) -> bool {
    member.is_none_or(|m| m.georeference.is_some())
}

/// Reads a sketch from GeoJSON text. Features, lines and vertices are counted from 1 in every message.
///
/// # Errors
/// When the text is not JSON or not a feature (collection); a geometry is no line or point; a kind is unknown; a height
/// is missing, or not a finite number; the file is in another coordinate system than the map; no stroke is left.
pub fn parse(text: &str, options: &ReadOptions) -> Result<SketchReading> {
    let root = json(text)?;
    let (root, features) = collection(&root)?;
    let mut warnings = Vec::new();
    let member = MapMember::of(root)?;
    let place = Place::of(root, member.as_ref(), options, &mut warnings)?;

    let mut lines: Vec<RawLine> = Vec::new();
    let mut empty = Vec::new();
    for (i, feature) in features.iter().enumerate() {
        let found = lines_of(feature, i + 1)?;
        if found.is_empty() {
            empty.push(format!("feature {}", i + 1));
        }
        lines.extend(found);
    }
    note(&mut warnings, &empty, "without any point: left out");
    let mut strokes = Vec::with_capacity(lines.len());
    for line in &lines {
        let vertices = line.vertices(options.missing_heights, |x, y| place.to_raster(x, y))?;
        strokes.push(Stroke { kind: line.kind, vertices });
    }
    if strokes.is_empty() {
        return Err(Error::value(
            "number of strokes",
            0,
            "allowed: at least one feature with a line or point",
        ));
    }
    let steps = lines.iter().zip(&strokes).filter(|(_, s)| {
        s.vertices.windows(2).any(|w| (w[0].x, w[0].y) == (w[1].x, w[1].y) && w[0].z != w[1].z)
    });
    let steps: Vec<_> = steps.map(|(line, _)| line.name.clone()).collect();
    note(&mut warnings, &steps, "with two heights at one point: the later one counts");

    let (rows, cols) = size(member.as_ref(), options, place.is_model, &strokes, &mut warnings)?;
    let unit = unit(member.as_ref(), options, &strokes, &mut warnings);
    let strokes = on_the_map(strokes, &lines, (rows, cols), &mut warnings)?;
    let sketch = Sketch::new(rows, cols, strokes)?;
    let stated_size = member.as_ref().and_then(MapMember::size);
    Ok(SketchReading { sketch, unit, georeference: place.target, stated_size, warnings })
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

/// How coordinates in the file become positions on the raster.
struct Place {
    /// Whether coordinates are model coordinates of `target`.
    is_model: bool,
    /// The map's place.
    target: Option<Georeference>,
}

impl Place {
    fn of(
        root: &Map<String, Value>,
        member: Option<&MapMember>,
        options: &ReadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let own = member.and_then(|m| m.georeference);
        let target = options.georeference.or(own);
        let is_model = target.is_some() && is_model(member);
        let named = match system_of(root) {
            Some(NamedSystem::Epsg(code)) => Some(code),
            Some(NamedSystem::Unknown(name)) => {
                warnings.push(format!("The file names the coordinate system {name}, which was not checked."));
                None
            }
            None => own.and_then(|g| g.epsg),
        };
        if is_model {
            let expected = target.and_then(|g| g.epsg);
            if let (Some(found), Some(expected)) = (named, expected)
                && found != expected
            {
                return Err(Error::value(
                    "coordinate system of the sketch",
                    format!("EPSG:{found}"),
                    format!("the map is in EPSG:{expected}: save the sketch in that system"),
                ));
            }
            if named.is_none() && own.is_none() {
                let system = expected.map_or_else(String::new, |code| format!(" (EPSG:{code})"));
                warnings.push(format!(
                    "The file names no coordinate system; its coordinates are taken as those of the map{system}."
                ));
            }
        } else if let Some(found) = named {
            warnings.push(format!(
                "The file names the coordinate system EPSG:{found} but no map lies in it; its coordinates are taken as \
                 pixels."
            ));
        }
        let singular = |g: &Georeference| g.to_raster(0.0, 0.0).is_none();
        if let Some(g) = target.filter(singular) {
            return Err(Error::value(
                "georeference transform",
                format!("{:?}", g.transform),
                "allowed: one that can be inverted",
            ));
        }
        Ok(Self { is_model, target })
    }

    /// Raster position with cell centres at whole numbers; not finite where the numbers do not suffice.
    fn to_raster(&self, x: f64, y: f64) -> (f64, f64) {
        match self.target.filter(|_| self.is_model) {
            None => (x, y),
            Some(g) => g.to_raster(x, y).map_or((f64::NAN, f64::NAN), |(col, row)| (col - 0.5, row - 0.5)),
        }
    }
}

fn size(
    member: Option<&MapMember>,
    options: &ReadOptions,
    is_model: bool,
    strokes: &[Stroke],
    warnings: &mut Vec<String>,
) -> Result<(usize, usize)> {
    let own = member.and_then(MapMember::size);
    let (rows, cols) = match (options.size, own) {
        (Some(given), own) => {
            // Model coordinates mean the same place on every map.
            if let Some((r, c)) = own.filter(|own| *own != given && !is_model) {
                warnings.push(format!(
                    "The sketch was drawn on a map of {r}x{c}; it is used as it is on {}x{}.",
                    given.0, given.1
                ));
            }
            given
        }
        (None, Some(own)) => own,
        (None, None) => {
            let vertices = || strokes.iter().flat_map(|s| &s.vertices);
            let side = |furthest: f64| (furthest + 0.5).floor().max(0.0) as usize; // saturates
            let rows = side(vertices().map(|v| v.y).fold(0.0, f64::max)).saturating_add(1);
            let cols = side(vertices().map(|v| v.x).fold(0.0, f64::max)).saturating_add(1);
            warnings.push(format!(
                "The file states no map size; {rows}x{cols} cells from (0, 0) hold all its strokes."
            ));
            (rows, cols)
        }
    };
    // Before anything is sized by it.
    Sketch::new(rows, cols, Vec::new())?;
    Ok((rows, cols))
}

fn unit(
    member: Option<&MapMember>,
    options: &ReadOptions,
    strokes: &[Stroke],
    warnings: &mut Vec<String>,
) -> HeightUnit {
    let heights = || strokes.iter().flat_map(|s| &s.vertices).map(|v| v.z);
    if heights().all(|z| z == 0.0) {
        warnings.push(
            "Every height of the sketch is 0: drawing tools write that when none was given.".to_owned(),
        );
    }
    if let Some(stated) = options.unit.or(member.and_then(|m| m.unit)) {
        return stated;
    }
    let (unit, why) = if heights().all(|z| (0.0..=1.0).contains(&z)) {
        (HeightUnit::Normalised, "0 to 1 of the style's range, because all lie between 0 and 1")
    } else {
        (HeightUnit::Metres, "metres, because some lie outside 0 to 1")
    };
    warnings.push(format!("The file states no height unit; its heights are taken as {why}."));
    unit
}

/// Leaves out strokes that lie wholly off the map.
fn on_the_map(
    strokes: Vec<Stroke>,
    lines: &[RawLine],
    (rows, cols): (usize, usize),
    warnings: &mut Vec<String>,
) -> Result<Vec<Stroke>> {
    let mut kept = Vec::with_capacity(strokes.len());
    let (mut off, mut cut) = (Vec::new(), Vec::new());
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for (stroke, line) in strokes.into_iter().zip(lines) {
        for v in &stroke.vertices {
            reach = [reach[0].min(v.x), reach[1].max(v.x), reach[2].min(v.y), reach[3].max(v.y)];
        }
        match stroke.lies_on(rows, cols) {
            (false, _) => off.push(line.name.clone()),
            (true, all) => {
                if !all {
                    cut.push(line.name.clone());
                }
                kept.push(stroke);
            }
        }
    }
    if kept.is_empty() {
        let [west, east, north, south] = reach;
        return Err(Error::value(
            "number of strokes on the map",
            0,
            format!(
                "the map has columns 0 to {}, rows 0 to {}; the strokes reach from column {west:.6} to {east:.6}, row \
                 {north:.6} to {south:.6}",
                cols - 1,
                rows - 1
            ),
        ));
    }
    note(warnings, &off, &format!("off the map of {rows}x{cols}: left out"));
    note(warnings, &cut, &format!("partly off the map of {rows}x{cols}: cut at its frame"));
    Ok(kept)
}

/// One warning for all lines that share a peculiarity, naming the first few.
fn note(warnings: &mut Vec<String>, names: &[String], what: &str) {
    const SHOWN: usize = 5;
    if names.is_empty() {
        return;
    }
    let shown = names[..names.len().min(SHOWN)].join("; ");
    let more =
        if names.len() > SHOWN { format!("; and {} more", names.len() - SHOWN) } else { String::new() };
    let count = if names.len() == 1 { "1 line".to_owned() } else { format!("{} lines", names.len()) };
    warnings.push(format!("{count} {what} ({shown}{more})."));
}
