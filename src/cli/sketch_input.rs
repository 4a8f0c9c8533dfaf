//! Sketch arguments: a GeoJSON file, or a sketch that comes with the program, for every verb alike; what the file leaves
//! open, and the map that it lies on.

use crate::dem::{Georeference, Normalization};
use crate::error::{Error, Result};
use crate::grid::Window;
use crate::sketch::geojson::{self, Coordinates, HeightUnit, Outline, ReadOptions, SketchReading};
use crate::sketch::{Sketch, samples};
use std::path::Path;

/// Heading in the help.
const READING: &str = "Reading the sketch";

// What the file may leave open or say wrongly. No doc comment, see args.rs.
#[derive(clap::Args, Clone, Debug, Default)]
pub(super) struct SketchOptions {
    /// Take x and y as columns and rows, counted from the north-west cell, whatever the file names
    #[arg(long, help_heading = READING)]
    pub(super) pixels: bool,
    /// EPSG code of the system that x and y are in; overrules the file
    #[arg(long, help_heading = READING, value_name = "CODE", value_parser = epsg)]
    crs: Option<u32>,
    /// The property that says ridge or valley [default: kind, or whichever does]
    #[arg(long, help_heading = READING, value_name = "NAME")]
    kind_property: Option<String>,
    /// The property with the heights; overrules z [default: z, elevation, elev, ele, height, altitude, alt, where z is
    /// missing or 0]
    #[arg(long, help_heading = READING, value_name = "NAME")]
    height_property: Option<String>,
    /// Take a line whose heights are all 0 for one without heights, as drawing tools write it
    #[arg(long, help_heading = READING)]
    zero_unknown: bool,
    /// What the heights are; overrules the file
    #[arg(long, help_heading = READING, value_enum, value_name = "UNIT")]
    heights: Option<HeightUnitName>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum HeightUnitName {
    /// Metres
    Metres,
    /// 0 to 1 of the style's range
    Normalised,
}

/// The code in `32612` or `EPSG:32612`.
fn epsg(text: &str) -> Result<u32, String> {
    let code = text.trim().to_ascii_uppercase();
    let code = code.strip_prefix("EPSG:").unwrap_or(&code).parse().ok().filter(|code| *code > 0);
    code.ok_or_else(|| "allowed: an EPSG code, as in 32612 or EPSG:32612".to_owned())
}

impl SketchOptions {
    /// The options for the reader.
    pub(super) fn options(&self) -> ReadOptions {
        ReadOptions {
            coordinates: if self.pixels { Coordinates::Pixels } else { Coordinates::AsStated },
            epsg: self.crs,
            unit: self.heights.map(|unit| match unit {
                HeightUnitName::Metres => HeightUnit::Metres,
                HeightUnitName::Normalised => HeightUnit::Normalised,
            }),
            kind_property: self.kind_property.clone(),
            height_property: self.height_property.clone(),
            zero_unknown: self.zero_unknown,
            ..ReadOptions::default()
        }
    }
}

/// The bundled sketch that a sketch argument means: a file of the same name comes first.
pub(super) fn bundled_sketch(path: &Path) -> Option<&'static str> {
    let name = path.to_str().filter(|_| !path.exists())?;
    samples::names().find(|known| *known == name)
}

/// The sketch in the file `path`, or when there is no such file the bundled sketch of that name.
///
/// # Errors
/// As [`geojson::read`]; a name that is neither file nor bundled sketch.
pub(super) fn read_sketch(path: &Path, options: &ReadOptions) -> Result<SketchReading> {
    match bundled_sketch(path) {
        Some(name) => geojson::parse(samples::text(name)?, options).map_err(|e| e.in_file(path)),
        None if !path.exists() => Err(no_such_sketch(path)),
        None => geojson::read(path, options),
    }
}

fn no_such_sketch(path: &Path) -> Error {
    let known: Vec<_> = samples::names().collect();
    let allowed = format!("allowed: a GeoJSON file, or the name of a bundled sketch ({})", known.join(", "));
    Error::file(path, "file", "not there", allowed)
}

/// What the sketch says of its place; bundled ones have none.
///
/// # Errors
/// As [`read_sketch`].
pub(super) fn outline(path: &Path, options: &ReadOptions) -> Result<Outline> {
    if path.exists() {
        return geojson::outline(path, options);
    }
    bundled_sketch(path).ok_or_else(|| no_such_sketch(path))?;
    Ok(Outline { is_placed: false, has_place: false, epsg: None, bounds: None })
}

/// The sketch in `path` on a map of `size`, and the size from which it was scaled if it was.
///
/// A sketch that states the size of its map is scaled to `size` frame to frame, its georeference too; one that does not is
/// taken to be drawn on a map of that size.
///
/// # Errors
/// As [`read_sketch`]; when the map is too large.
pub(super) fn read_sized(
    path: &Path,
    size: Option<(usize, usize)>,
    options: &ReadOptions,
) -> Result<(SketchReading, Option<(usize, usize)>)> {
    let reading = read_sketch(path, options)?;
    match (size, reading.stated_size) {
        (Some(size), Some(drawn)) if drawn != size => Ok((scaled(path, reading, size)?, Some(drawn))),
        (Some(_), None) => Ok((read_sketch(path, &ReadOptions { size, ..options.clone() })?, None)),
        _ => Ok((reading, None)),
    }
}

/// The same drawing on a map of another size, frame to frame.
///
/// # Errors
/// When the map is too large.
pub(super) fn scaled(
    path: &Path,
    reading: SketchReading,
    (rows, cols): (usize, usize),
) -> Result<SketchReading> {
    // Before anything is sized by it.
    Sketch::new(rows, cols, Vec::new()).map_err(|e| e.in_file(path))?;
    let drawn = (reading.sketch.rows, reading.sketch.cols);
    let sketch = reading.sketch.scaled_to(rows, cols);
    let georeference = reading.georeference.map(|g| g.on_raster(drawn, (rows, cols)));
    Ok(SketchReading { sketch, georeference, ..reading })
}

/// The raster that a sketch is to lie on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    /// (rows, columns).
    pub(super) size: (usize, usize),
    /// Its place.
    pub(super) georeference: Option<Georeference>,
}

/// The sketch in `path` as it lies on `map`, and the size from which it was stretched if it was.
///
/// What is in model coordinates lies where these say, wherever it was drawn. What is in columns and rows is stretched from
/// the map that the file describes; without one it is taken as drawn on a map of `unstated` (rows, columns), and stays on
/// that. The same goes for everything where the map has no place.
///
/// # Errors
/// As [`read_sketch`].
pub(super) fn read_on_map(
    path: &Path,
    map: Map,
    unstated: (usize, usize),
    options: &ReadOptions,
) -> Result<(SketchReading, Option<(usize, usize)>)> {
    let outline = outline(path, options)?;
    let in_pixels = options.coordinates == Coordinates::Pixels;
    if map.georeference.is_some() && outline.is_placed && !in_pixels {
        let placed = ReadOptions { size: Some(map.size), georeference: map.georeference, ..options.clone() };
        return Ok((read_sketch(path, &placed)?, None));
    }
    // Without a map of its own the file's numbers can only be columns and rows, whatever system it names.
    let coordinates =
        if outline.is_placed && !outline.has_place { Coordinates::Pixels } else { options.coordinates };
    let options = ReadOptions { coordinates, ..options.clone() };
    let own = read_sketch(path, &options)?;
    match own.stated_size {
        Some(drawn) => Ok((own, Some(drawn).filter(|drawn| *drawn != map.size))),
        None => Ok((read_sketch(path, &ReadOptions { size: Some(unstated), ..options })?, None)),
    }
}

/// The sketch with its heights in metres.
pub(super) fn in_metres(reading: &SketchReading, range: Normalization) -> Sketch {
    match reading.unit {
        HeightUnit::Metres => reading.sketch.clone(),
        HeightUnit::Normalised => reading.sketch.map_heights(|z| range.to_metres(z)),
    }
}

/// The part of a drawing that lies in a window, in the window's own columns and rows.
pub(super) fn window_of(sketch: &Sketch, Window { origin, rows, cols }: Window) -> Sketch {
    let mut window = Sketch { rows, cols, ..sketch.clone() };
    for v in window.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
        (v.x, v.y) = (v.x - origin.col as f64, v.y - origin.row as f64);
    }
    window.strokes.retain(|stroke| stroke.lies_on(rows, cols).0);
    window
}
