//! Sketch arguments: a GeoJSON file, or a sketch that comes with the program, for every verb alike.

use crate::dem::{Georeference, Normalization};
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
            let georeference = reading.georeference.map(|g| scaled(&g, drawn, (rows, cols)));
            Ok((SketchReading { sketch, georeference, ..reading }, Some(drawn)))
        }
        (Some(_), None) => Ok((read_sketch(path, &ReadOptions { size, ..*options })?, None)),
        _ => Ok((reading, None)),
    }
}

/// The place of the same ground on a raster of another shape.
fn scaled(georeference: &Georeference, from: (usize, usize), to: (usize, usize)) -> Georeference {
    let (down, across) = (from.0 as f64 / to.0 as f64, from.1 as f64 / to.1 as f64);
    let [a, b, c, d, e, f] = georeference.transform;
    Georeference { transform: [a * across, b * down, c, d * across, e * down, f], ..*georeference }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::RasterSpace;

    #[test]
    fn a_scaled_georeference_covers_the_same_ground() {
        let g = Georeference {
            transform: [30.0, 2.0, 500.0, -1.0, -40.0, 900.0],
            epsg: Some(32611),
            raster_space: RasterSpace::PixelIsArea,
        };
        let fine = scaled(&g, (64, 80), (128, 40));
        for (col, row) in [(0.0, 0.0), (80.0, 64.0), (80.0, 0.0), (12.0, 20.0)] {
            assert_eq!(fine.to_model(col / 2.0, row * 2.0), g.to_model(col, row));
        }
    }
}
