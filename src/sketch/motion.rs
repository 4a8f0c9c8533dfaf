//! Lines turned, mirrored and shifted about the middle of their map, and terrain moved back.
//!
//! Turns by 90 degrees, mirrors and whole shifts move cells; other turns move the traced strokes, and terrain is read between
//! cells.

use super::{LineMap, Sketch, SketchPart};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};

/// Cells along the frame that are not compared where the frame cut lines off.
const MARGIN: f64 = 16.0;

/// Where a point (column, row) comes to lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    cos: f64,
    sin: f64,
    mirror: bool,
    /// East, south.
    shift: (f64, f64),
    /// East, south.
    middle: (f64, f64),
    /// Cells stay whole and inside.
    is_exact: bool,
    is_whole: bool,
}

impl Motion {
    /// A mirror (west and east change places), then a turn by `turn` degrees counter-clockwise, then a shift by cells south and
    /// east, on a map of `rows` x `cols`.
    ///
    /// # Errors
    /// When a map that is not square is to be turned by 90 degrees.
    pub(crate) fn new(
        turn: f64,
        mirror: bool,
        shift: [i32; 2],
        (rows, cols): (usize, usize),
    ) -> Result<Self> {
        let quarters = turn % 90.0 == 0.0;
        if quarters && turn % 180.0 != 0.0 && rows != cols {
            return Err(Error::value("turn", turn, "a map turned by 90 degrees must be square"));
        }
        let (mut sin, mut cos) = turn.to_radians().sin_cos();
        if quarters {
            (sin, cos) = (sin.round(), cos.round());
        }
        Ok(Self {
            cos,
            sin,
            mirror,
            shift: (f64::from(shift[1]), f64::from(shift[0])),
            middle: ((cols as f64 - 1.0) / 2.0, (rows as f64 - 1.0) / 2.0),
            is_exact: quarters && shift == [0, 0],
            is_whole: quarters,
        })
    }

    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let (mut x, y) = (x - self.middle.0, y - self.middle.1);
        if self.mirror {
            x = -x;
        }
        // Counter-clockwise as seen: y runs south.
        let (x, y) = (self.cos * x + self.sin * y, self.cos * y - self.sin * x);
        (x + self.middle.0 + self.shift.0, y + self.middle.1 + self.shift.1)
    }

    fn cell(&self, cell: Cell, (rows, cols): (usize, usize)) -> Option<Cell> {
        let (x, y) = self.at(cell.col as f64, cell.row as f64);
        let (x, y) = (x.round(), y.round());
        let inside = x >= 0.0 && y >= 0.0 && x < cols as f64 && y < rows as f64;
        inside.then(|| Cell::new(y as usize, x as usize))
    }

    /// The lines moved, cut off at the frame.
    #[must_use]
    pub(crate) fn lines(&self, lines: &LineMap) -> LineMap {
        let (rows, cols) = lines.shape();
        if self.is_whole {
            let mut moved = LineMap::empty(rows, cols);
            for (cell, kind) in lines.kinds().cells() {
                if let (Some(kind), Some(to)) = (*kind, self.cell(cell, lines.shape())) {
                    moved.set(to, kind, lines.heights()[cell]);
                }
            }
            return moved;
        }
        let mut sketch = Sketch::trace(lines);
        for vertex in sketch.strokes.iter_mut().flat_map(|stroke| &mut stroke.vertices) {
            (vertex.x, vertex.y) = self.at(vertex.x, vertex.y);
        }
        sketch.rasterize()
    }

    /// The parts moved, of maps of `shape`.
    #[must_use]
    pub(crate) fn parts(&self, parts: &[SketchPart], shape: (usize, usize)) -> Vec<SketchPart> {
        let moved = |part: &SketchPart| SketchPart {
            cells: part.cells.iter().filter_map(|&cell| self.cell(cell, shape)).collect(),
            ..part.clone()
        };
        parts.iter().map(moved).collect()
    }

    /// The height of `output`, made of moved lines, for a cell of the lines; none where they are not to be compared.
    #[must_use]
    pub(crate) fn back(&self, output: &Grid<f32>, cell: Cell) -> Option<f64> {
        let (rows, cols) = output.shape();
        let (x, y) = self.at(cell.col as f64, cell.row as f64);
        if self.is_exact {
            return self.cell(cell, output.shape()).map(|to| f64::from(output[to]));
        }
        let is_inner = |x: f64, y: f64| {
            let inside = |v: f64, side: usize| v >= MARGIN && v <= side as f64 - 1.0 - MARGIN;
            inside(x, cols) && inside(y, rows)
        };
        if !is_inner(x, y) || !is_inner(cell.col as f64, cell.row as f64) {
            return None;
        }
        let (col, row) = (x.floor().min(cols as f64 - 2.0), y.floor().min(rows as f64 - 2.0));
        let (u, v) = (x - col, y - row);
        let z = |down: usize, right: usize| {
            f64::from(output[Cell::new(row as usize + down, col as usize + right)])
        };
        let north = z(0, 0) * (1.0 - u) + z(0, 1) * u;
        let south = z(1, 0) * (1.0 - u) + z(1, 1) * u;
        Some(north * (1.0 - v) + south * v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    #[test]
    fn a_quarter_turn_is_counter_clockwise() {
        let mut lines = LineMap::empty(8, 8);
        lines.set(Cell::new(0, 6), StrokeKind::Ridge, 2.0); // north, east of the middle
        let at = |turn, mirror, shift| {
            let moved = Motion::new(turn, mirror, shift, (8, 8)).unwrap().lines(&lines);
            let found = moved.kinds().cells().find(|(_, kind)| kind.is_some()).unwrap().0;
            (found.row, found.col)
        };
        assert_eq!(at(90.0, false, [0, 0]), (1, 0));
        assert_eq!(at(180.0, false, [0, 0]), (7, 1));
        assert_eq!(at(0.0, true, [0, 0]), (0, 1));
        assert_eq!(at(0.0, false, [3, -2]), (3, 4));
    }

    #[test]
    fn terrain_that_moves_with_its_lines_comes_back() {
        // A cone about a point beside the middle, made "from the moved lines".
        let (rows, cols) = (64, 64);
        let height = |x: f64, y: f64| 1.0 - 0.02 * ((x - 35.0).powi(2) + (y - 29.0).powi(2)).sqrt();
        for (turn, mirror, shift) in
            [(90.0, false, [0, 0]), (270.0, true, [0, 0]), (30.0, false, [0, 0]), (0.0, false, [5, -3])]
        {
            let way = Motion::new(turn, mirror, shift, (rows, cols)).unwrap();
            let (px, py) = way.at(35.0, 29.0);
            let turned = Grid::from_fn(rows, cols, |c| {
                (1.0 - 0.02 * ((c.col as f64 - px).powi(2) + (c.row as f64 - py).powi(2)).sqrt()) as f32
            });
            let mut compared = 0;
            for (cell, _) in turned.cells() {
                if let Some(back) = way.back(&turned, cell) {
                    compared += 1;
                    let (x, y) = (cell.col as f64, cell.row as f64);
                    // Between cells: the tip is cut off by at most half a cell's diagonal, the flank hardly.
                    let at_tip = (x - 35.0).hypot(y - 29.0) < 1.5;
                    let (expected, most) = (height(x, y), if at_tip { 0.0142 } else { 0.0025 });
                    assert!((back - expected).abs() < most, "{turn} {cell:?}: {back} {expected}");
                }
            }
            assert!(compared > 500, "{turn}: {compared}");
        }
    }
}
