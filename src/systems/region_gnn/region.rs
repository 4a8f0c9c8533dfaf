//! The parts of a sketch as the regions of the graph: oriented, with a frame of their own.

use crate::grid::Cell;
use crate::sketch::{SketchPart, StrokeKind};

/// A part, oriented from its low to its high end, with the frame in which pixels around it are described.
#[derive(Clone, Debug)]
pub struct Region {
    kind: StrokeKind,
    /// (row, column) of the cells, low end first.
    cells: Vec<[f32; 2]>,
    heights: Vec<f32>,
    centre: [f32; 2],
    /// Unit vector from the low to the high end, (row, column).
    direction: [f32; 2],
}

/// Where a pixel projects on a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Index of the nearest cell, counted from the low end; the first of equally near ones.
    pub(crate) index: usize,
    /// Distance to that cell, in cells.
    pub distance: f32,
}

impl Region {
    /// Orients a part and gives it a frame.
    ///
    /// # Panics
    /// When the part has no cell.
    #[must_use]
    pub(crate) fn new(part: &SketchPart) -> Self {
        let mut cells: Vec<[f32; 2]> = part.cells.iter().map(|c| [c.row as f32, c.col as f32]).collect();
        let mut heights = part.heights.clone();
        if heights[0] > heights[heights.len() - 1] {
            cells.reverse();
            heights.reverse();
        }
        let n = cells.len() as f32;
        let centre = cells.iter().fold([0.0, 0.0], |sum, c| [sum[0] + c[0] / n, sum[1] + c[1] / n]);
        let (first, last) = (cells[0], cells[cells.len() - 1]);
        let (dr, dc) = (last[0] - first[0], last[1] - first[1]);
        let length = dr.hypot(dc);
        let direction = if length > 0.0 { [dr / length, dc / length] } else { [0.0, 1.0] };
        Self { kind: part.kind, cells, heights, centre, direction }
    }

    /// Ridge or valley.
    #[must_use]
    pub(crate) fn kind(&self) -> StrokeKind {
        self.kind
    }

    /// Number of cells.
    #[must_use]
    pub(crate) fn cell_count(&self) -> usize {
        self.cells.len()
    }

    /// Cell `index`, counted from the low end.
    #[must_use]
    pub(crate) fn cell(&self, index: usize) -> Cell {
        let [row, col] = self.cells[index];
        Cell::new(row as usize, col as usize)
    }

    /// Height of cell `index`, counted from the low end.
    #[must_use]
    pub(crate) fn height(&self, index: usize) -> f32 {
        self.heights[index]
    }

    /// Nearest cell of the region to `pixel`.
    #[must_use]
    pub fn project(&self, pixel: Cell) -> Projection {
        let (row, col) = (pixel.row as f32, pixel.col as f32);
        let mut best = Projection { index: 0, distance: f32::INFINITY };
        for (index, c) in self.cells.iter().enumerate() {
            let squared = (c[0] - row).powi(2) + (c[1] - col).powi(2);
            if squared < best.distance {
                best = Projection { index, distance: squared };
            }
        }
        best.distance = best.distance.sqrt();
        best
    }

    /// Projection index scaled to [0, 1] from the low to the high end (paper, A.4).
    #[must_use]
    pub(crate) fn relative_index(&self, index: usize) -> f32 {
        if self.cells.len() < 2 { 0.5 } else { index as f32 / (self.cells.len() - 1) as f32 }
    }

    /// Coordinates of `pixel` along and across the region, in cells from its centre.
    ///
    /// Both turn with the part, so that they describe the same place after any rotation; the sign of the second tells
    /// the left side from the right.
    #[must_use]
    pub(crate) fn along_across(&self, pixel: Cell) -> (f32, f32) {
        let offset = [pixel.row as f32 - self.centre[0], pixel.col as f32 - self.centre[1]];
        let [ur, uc] = self.direction;
        (offset[0] * ur + offset[1] * uc, offset[0] * uc - offset[1] * ur)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(cells: &[(usize, usize)], heights: &[f32]) -> SketchPart {
        let cells = cells.iter().map(|&(r, c)| Cell::new(r, c)).collect();
        SketchPart { kind: StrokeKind::Ridge, cells, heights: heights.to_vec() }
    }

    #[test]
    fn low_end_comes_first_whichever_way_it_was_drawn() {
        let down = Region::new(&part(&[(4, 4), (4, 5), (4, 6)], &[0.9, 0.5, 0.1]));
        let up = Region::new(&part(&[(4, 6), (4, 5), (4, 4)], &[0.1, 0.5, 0.9]));
        for region in [&down, &up] {
            assert_eq!(region.cell(0), Cell::new(4, 6));
            assert_eq!(region.project(Cell::new(7, 4)), Projection { index: 2, distance: 3.0 });
            assert_eq!(region.along_across(Cell::new(4, 4)).0, 1.0);
        }
    }

    #[test]
    fn the_frame_turns_with_the_part() {
        let east = Region::new(&part(&[(5, 3), (5, 4), (5, 5)], &[0.0, 0.1, 0.2]));
        let south = Region::new(&part(&[(3, 5), (4, 5), (5, 5)], &[0.0, 0.1, 0.2]));
        // Two cells to the right of the direction of travel, one ahead of the centre.
        let (a, b) = (east.along_across(Cell::new(7, 5)), south.along_across(Cell::new(5, 3)));
        assert_eq!(a, b);
        assert_eq!(east.along_across(Cell::new(3, 5)).1, -a.1);
    }
}
