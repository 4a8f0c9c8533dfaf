//! The same lines turned, mirrored and shifted: how much of the terrain depends on where north is (Liu & Benes 2025, Fig. 15).
//!
//! A system makes terrain from the lines and from the moved lines; the second is moved back and compared. Turns by 90 degrees,
//! mirrors and whole shifts move cells; other turns move the traced strokes, and the terrain is read between cells. With a
//! sketch that moves nothing the two differ in their seed alone.

use super::measure::{Systems, style_of};
use super::spec::SketchSpec;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::seed::Seed;
use crate::sketch::{LineMap, Sketch, SketchPart, split_parts};
use crate::style::Named;

/// Cells along the frame that are not compared where the frame cut lines off.
const MARGIN: f64 = 16.0;

/// Where a point (column, row) comes to lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
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

impl Move {
    pub(super) fn new(sketch: &SketchSpec, (rows, cols): (usize, usize)) -> Result<Self> {
        let turn = sketch.turn.unwrap_or(0.0);
        let quarters = turn % 90.0 == 0.0;
        if quarters && turn % 180.0 != 0.0 && rows != cols {
            return Err(Error::value("turn", turn, "a map turned by 90 degrees must be square"));
        }
        let (mut sin, mut cos) = turn.to_radians().sin_cos();
        if quarters {
            (sin, cos) = (sin.round(), cos.round());
        }
        let shift = sketch.shift.unwrap_or([0, 0]);
        Ok(Self {
            cos,
            sin,
            mirror: sketch.mirror,
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
    pub(super) fn lines(&self, lines: &LineMap) -> LineMap {
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

    fn parts(&self, parts: &[SketchPart], shape: (usize, usize)) -> Vec<SketchPart> {
        let moved = |part: &SketchPart| SketchPart {
            cells: part.cells.iter().filter_map(|&cell| self.cell(cell, shape)).collect(),
            ..part.clone()
        };
        parts.iter().map(moved).collect()
    }

    /// The height of `output`, made of moved lines, for a cell of the lines; none where they are not to be compared.
    pub(super) fn back(&self, output: &Grid<f32>, cell: Cell) -> Option<f64> {
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

/// Terrain of the lines and of the moved lines, the latter as it came.
pub(super) fn pair(
    (name, system): &Named,
    systems: &Systems<'_>,
    lines: &LineMap,
    sketch: &SketchSpec,
    seed: Seed,
) -> Result<(Grid<f32>, Grid<f32>, Move)> {
    let way = Move::new(sketch, lines.shape())?;
    let is_at_rest = sketch.turn.is_none() && !sketch.mirror && sketch.shift.is_none();
    let moved = way.lines(lines);
    let style = if sketch.same_parts { style_of(name, systems).ok() } else { None };
    let (before, after) = match style {
        Some(style) => {
            let model = style.network()?.model();
            let parts = split_parts(lines, model.config().parts, seed);
            let turned = way.parts(&parts, lines.shape());
            let make = |lines: &LineMap, parts| {
                model.generate_from_parts(lines, parts, &style.config().generation, seed)
            };
            (make(lines, parts)?, make(&moved, turned)?)
        }
        None => {
            let other = if is_at_rest { seed.derive("another seed") } else { seed };
            (system.generate(lines, seed, &Stop::new())?, system.generate(&moved, other, &Stop::new())?)
        }
    };
    Ok((before, after, way))
}

/// Largest and root mean square difference, unit heights.
pub(super) fn differences(
    named: &Named,
    systems: &Systems<'_>,
    lines: &LineMap,
    sketch: &SketchSpec,
    seed: Seed,
) -> Result<[f64; 2]> {
    let (before, after, way) = pair(named, systems, lines, sketch, seed)?;
    let (mut max, mut sum, mut count) = (0.0f64, 0.0, 0usize);
    for (cell, &z) in before.cells() {
        if let Some(back) = way.back(&after, cell) {
            let difference = (back - f64::from(z)).abs();
            max = max.max(difference);
            sum += difference * difference;
            count += 1;
        }
    }
    if count == 0 {
        return Err(Error::value("cells to compare", 0, "a smaller shift is needed"));
    }
    Ok([max, (sum / count as f64).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    fn sketch(turn: Option<f64>, mirror: bool, shift: Option<[i32; 2]>) -> SketchSpec {
        SketchSpec { turn, mirror, shift, ..SketchSpec::default() }
    }

    #[test]
    fn a_quarter_turn_is_counter_clockwise() {
        let mut lines = LineMap::empty(8, 8);
        lines.set(Cell::new(0, 6), StrokeKind::Ridge, 2.0); // north, east of the middle
        let at = |s: &SketchSpec| {
            let moved = Move::new(s, (8, 8)).unwrap().lines(&lines);
            let found = moved.kinds().cells().find(|(_, kind)| kind.is_some()).unwrap().0;
            (found.row, found.col)
        };
        assert_eq!(at(&sketch(Some(90.0), false, None)), (1, 0));
        assert_eq!(at(&sketch(Some(180.0), false, None)), (7, 1));
        assert_eq!(at(&sketch(None, true, None)), (0, 1));
        assert_eq!(at(&sketch(None, false, Some([3, -2]))), (3, 4));
    }

    #[test]
    fn terrain_that_moves_with_its_lines_comes_back() {
        // A cone about a point beside the middle, made "from the moved lines".
        let (rows, cols) = (64, 64);
        let height = |x: f64, y: f64| 1.0 - 0.02 * ((x - 35.0).powi(2) + (y - 29.0).powi(2)).sqrt();
        for s in [
            sketch(Some(90.0), false, None),
            sketch(Some(270.0), true, None),
            sketch(Some(30.0), false, None),
            sketch(None, false, Some([5, -3])),
        ] {
            let way = Move::new(&s, (rows, cols)).unwrap();
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
                    assert!((back - expected).abs() < most, "{s:?} {cell:?}: {back} {expected}");
                }
            }
            assert!(compared > 500, "{s:?}: {compared}");
        }
    }
}
