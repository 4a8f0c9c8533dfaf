//! Sketch arguments: a GeoJSON file, or a sketch that comes with the program, for every verb alike.

use crate::dem::Normalization;
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::sketch::geojson::{self, HeightUnit, ReadOptions, SketchReading};
use crate::sketch::{Sketch, samples};
use std::path::Path;

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
        None if !path.exists() => {
            let known: Vec<_> = samples::names().collect();
            let allowed =
                format!("allowed: a GeoJSON file, or the name of a bundled sketch ({})", known.join(", "));
            Err(Error::file(path, "file", "not there", allowed))
        }
        None => geojson::read(path, options),
    }
}

/// Whether the sketch lies where its coordinates say, on a map with a georeference ([`geojson::is_placed`]); bundled ones
/// do not.
///
/// # Errors
/// As [`read_sketch`], as far as that is seen at its head.
pub(super) fn is_placed(path: &Path) -> Result<bool> {
    // A file that is not there gets its message from the reader.
    if path.exists() { geojson::is_placed(path) } else { Ok(false) }
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
        (Some((rows, cols)), Some(drawn)) if drawn != (rows, cols) => {
            // Before anything is sized by it.
            Sketch::new(rows, cols, Vec::new()).map_err(|e| e.in_file(path))?;
            let sketch = reading.sketch.scaled_to(rows, cols);
            let georeference = reading.georeference.map(|g| g.on_raster(drawn, (rows, cols)));
            Ok((SketchReading { sketch, georeference, ..reading }, Some(drawn)))
        }
        (Some(_), None) => Ok((read_sketch(path, &ReadOptions { size, ..*options })?, None)),
        _ => Ok((reading, None)),
    }
}

/// The sketch with its heights in metres.
pub(super) fn in_metres(reading: &SketchReading, range: Normalization) -> Sketch {
    match reading.unit {
        HeightUnit::Metres => reading.sketch.clone(),
        HeightUnit::Normalised => reading.sketch.map_heights(|z| range.to_metres(z)),
    }
}

/// The part of a drawing that lies in the window of `rows` x `cols` at `origin`, in the window's own columns and rows.
pub(super) fn window_of(sketch: &Sketch, origin: Cell, rows: usize, cols: usize) -> Sketch {
    let mut window = Sketch { rows, cols, ..sketch.clone() };
    for v in window.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
        (v.x, v.y) = (v.x - origin.col as f64, v.y - origin.row as f64);
    }
    window.strokes.retain(|stroke| stroke.lies_on(rows, cols).0);
    window
}
