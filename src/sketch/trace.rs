//! Turns a raster of lines into strokes (the inverse of [`Sketch::rasterize`]).
//!
//! [`LineMap`] -> [`Sketch`] with a vertex at the centre of every line cell. Lines are cut at junctions and the strokes
//! that meet there share the junction's cell, so they stay connected; a closed line repeats its first vertex at the end.
//! Ours; the paper works on pixels throughout. Cost: linear in the cells of the map.

use super::chains::Links;
use super::{LineMap, Sketch, Stroke, StrokeKind, Vertex};

impl Sketch {
    /// The strokes that `lines` consists of, ridges first: `Sketch::trace(&lines).rasterize()` is `lines` again, exactly.
    #[must_use]
    pub fn trace(lines: &LineMap) -> Self {
        let (rows, cols) = lines.shape();
        let mut strokes = Vec::new();
        for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
            for chain in Links::new(lines, kind).chains() {
                let closing = chain.closed.then(|| chain.cells[0]);
                let vertices = chain.cells.iter().copied().chain(closing).map(|cell| Vertex {
                    x: cell.col as f64,
                    y: cell.row as f64,
                    z: f64::from(lines.heights()[cell]),
                });
                strokes.push(Stroke { kind, vertices: vertices.collect() });
            }
        }
        Self { rows, cols, strokes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use proptest::prelude::*;

    #[test]
    fn a_junction_belongs_to_every_stroke_there() {
        let mut lines = LineMap::empty(5, 5);
        for (row, col) in [(0, 0), (1, 1), (2, 2), (1, 3), (0, 4), (3, 2), (4, 2)] {
            lines.set(Cell::new(row, col), StrokeKind::Valley, 1.0);
        }
        let sketch = Sketch::trace(&lines);
        assert_eq!(sketch.strokes.len(), 3, "a Y has three arms");
        for stroke in &sketch.strokes {
            let (first, last) = (stroke.vertices[0], *stroke.vertices.last().unwrap());
            assert!([first, last].iter().any(|v| (v.x, v.y) == (2.0, 2.0)));
        }
    }

    #[test]
    fn the_corner_of_a_staircase_is_no_junction() {
        let mut lines = LineMap::empty(4, 4);
        for (row, col) in [(0, 0), (0, 1), (1, 1), (1, 2), (2, 3)] {
            lines.set(Cell::new(row, col), StrokeKind::Ridge, 1.0);
        }
        assert_eq!(Sketch::trace(&lines).strokes.len(), 1);
    }

    #[test]
    fn a_ring_closes() {
        let mut lines = LineMap::empty(5, 5);
        for (row, col) in [(0, 1), (0, 2), (1, 3), (2, 3), (3, 2), (3, 1), (2, 0), (1, 0)] {
            lines.set(Cell::new(row, col), StrokeKind::Ridge, 1.0);
        }
        let sketch = Sketch::trace(&lines);
        assert_eq!(sketch.strokes.len(), 1);
        assert_eq!(sketch.strokes[0].vertices.first(), sketch.strokes[0].vertices.last());
        assert_eq!(sketch.strokes[0].vertices.len(), 9);
    }

    proptest! {
        #[test]
        fn tracing_and_rasterizing_give_back_the_lines(
            rows in 1_usize..14, cols in 1_usize..14,
            cells in prop::collection::vec((0_u8..5, -500.0_f32..9000.0), 14 * 14),
        ) {
            let mut lines = LineMap::empty(rows, cols);
            for (i, &(c, z)) in cells.iter().take(rows * cols).enumerate().filter(|(_, (c, _))| *c < 3) {
                let kind = if c == 0 { StrokeKind::Ridge } else { StrokeKind::Valley };
                lines.set(Cell::new(i / cols, i % cols), kind, z);
            }
            let sketch = Sketch::trace(&lines);
            prop_assert!(sketch.validate().is_ok());
            prop_assert_eq!(sketch.rasterize(), lines);
        }
    }
}
