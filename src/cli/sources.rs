//! Where every cell of a terrain comes from, as a file (`generate --sources`).

use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file;
use crate::grid::{Cell, Grid};
use crate::metrics::{Origin, Provenance};
use crate::sketch::Sketch;
use crate::viz;
use ndarray::Array2;
use ndarray_npy::NpzWriter;
use std::io::Cursor;
use std::path::Path;

/// Writes the sources of `terrain` to `path`: arrays (`.npz`) or a picture (`.png`).
///
/// # Errors
/// When the file cannot be written.
pub(super) fn write(
    path: &Path,
    terrain: &Dem,
    provenance: &Provenance,
    sketch: &Sketch,
    exemplar: &Dem,
) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return viz::sources(terrain, provenance, sketch, exemplar)?.write_png(path);
    }
    file::write_bytes(
        path,
        &arrays(provenance, sketch).map_err(|e| Error::file(path, "arrays", e, "plain numbers"))?,
    )
}

/// `row`, `col` and `symmetry` (-1 where a stroke gave the height) and `stroke` (the number of the stroke from 1, 0 elsewhere).
fn arrays(
    provenance: &Provenance,
    sketch: &Sketch,
) -> std::result::Result<Vec<u8>, ndarray_npy::WriteNpzError> {
    let origins = provenance.origins();
    let of = |f: fn(Cell, u8) -> i32| {
        array(origins.map(|origin| match *origin {
            Origin::Exemplar { cell, symmetry } => f(cell, symmetry),
            Origin::Stroke => -1,
        }))
    };
    let mut npz = NpzWriter::new_compressed(Cursor::new(Vec::new()));
    npz.add_array("row", &of(|cell, _| cell.row as i32))?;
    npz.add_array("col", &of(|cell, _| cell.col as i32))?;
    npz.add_array("symmetry", &of(|_, symmetry| symmetry.into()))?;
    npz.add_array("stroke", &array(strokes(origins, sketch)))?;
    Ok(npz.finish()?.into_inner())
}

/// The number of the stroke that gave a cell its height, from 1 as in `--check`; 0 where the exemplar gave the form. Random lines come after
/// the strokes that were drawn.
fn strokes(origins: &Grid<Origin>, sketch: &Sketch) -> Grid<i32> {
    let mut numbers = origins.map(|_| 0);
    for (i, stroke) in sketch.strokes.iter().enumerate() {
        for (cell, _) in stroke.cells(sketch.rows, sketch.cols) {
            if origins[cell] == Origin::Stroke {
                numbers[cell] = i as i32 + 1;
            }
        }
    }
    numbers
}

fn array(numbers: Grid<i32>) -> Array2<i32> {
    Array2::from_shape_fn(numbers.shape(), |(row, col)| numbers[Cell::new(row, col)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{Stroke, StrokeKind, Vertex};
    use ndarray_npy::NpzReader;

    #[test]
    fn arrays_say_the_place_or_the_stroke() {
        let line = |y: f64| Stroke {
            kind: StrokeKind::Valley,
            vertices: [1.0, 4.0].map(|x| Vertex { x, y, z: 2.0 }).to_vec(),
        };
        let sketch = Sketch::new(6, 7, vec![line(0.0), line(3.0)]).unwrap();
        let lines = sketch.rasterize();
        let origins = Grid::from_fn(6, 7, |c| match lines.kinds()[c] {
            Some(_) => Origin::Stroke,
            None => Origin::Exemplar { cell: Cell::new(c.row + 100, 2 * c.col), symmetry: (c.col % 8) as u8 },
        });
        let bytes = arrays(&Provenance::new(origins), &sketch).unwrap();
        let mut npz = NpzReader::new(Cursor::new(bytes)).unwrap();
        let mut read = |name: &str| -> Array2<i32> { npz.by_name(name).unwrap() };
        let [row, col, symmetry, stroke] = ["row", "col", "symmetry", "stroke"].map(&mut read);
        assert_eq!((row[[5, 6]], col[[5, 6]], symmetry[[5, 6]], stroke[[5, 6]]), (105, 12, 6, 0));
        assert_eq!((row[[3, 2]], col[[3, 2]], symmetry[[3, 2]], stroke[[3, 2]]), (-1, -1, -1, 2));
        assert_eq!((stroke[[0, 1]], stroke[[0, 5]]), (1, 0));
    }
}
