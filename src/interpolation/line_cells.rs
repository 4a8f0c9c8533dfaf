//! The line cells of a sketch in a k-d tree: what stands nearest to a place.

use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::sketch::LineMap;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

/// The line cells of a sketch and a tree to find them.
pub(crate) struct LineCells<'a> {
    lines: &'a LineMap,
    pub(crate) tree: ImmutableKdTree<f64, 2>,
    pub(crate) cells: Vec<Cell>,
    pub(crate) heights: Vec<f32>,
}

impl<'a> LineCells<'a> {
    /// The cells of `lines`, row-major.
    ///
    /// # Errors
    /// When there is no line cell.
    pub(crate) fn of(lines: &'a LineMap) -> Result<Self> {
        let cells: Vec<Cell> =
            lines.kinds().cells().filter(|(_, kind)| kind.is_some()).map(|(c, _)| c).collect();
        if cells.is_empty() {
            return Err(Error::value("number of line cells", 0, "interpolation needs at least one"));
        }
        let positions: Vec<[f64; 2]> = cells.iter().map(|&c| position(c)).collect();
        let tree = ImmutableKdTree::new_from_slice(&positions).map_err(|e| {
            Error::value("line cells", cells.len(), format!("they do not form a k-d tree: {e}"))
        })?;
        let heights = cells.iter().map(|&c| lines.heights()[c]).collect();
        Ok(Self { lines, tree, cells, heights })
    }

    /// Height of the line cell that is nearest to `cell`; the first in row-major order of equally near ones.
    #[must_use]
    pub(crate) fn nearest(&self, cell: Cell) -> f32 {
        let here = position(cell);
        let first = self.tree.query(&here).nearest_one::<SquaredEuclidean<f64>>().execute();
        // Squared distances are whole numbers, so equal ones are equal to the bit.
        let equal =
            self.tree.query(&here).within::<SquaredEuclidean<f64>>(first.distance).unsorted().execute();
        let item = equal.iter().map(|found| found.item).min().unwrap_or(first.item);
        self.heights[item as usize]
    }

    /// Terrain from `f` at every cell that no line passes.
    pub(crate) fn fill(&self, f: impl Fn(&Self, Cell) -> f32 + Sync) -> Result<Grid<f32>> {
        let mut terrain = self.lines.heights().clone();
        let cols = terrain.cols();
        let kinds = self.lines.kinds();
        terrain.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, heights)| {
            for (col, z) in heights.iter_mut().enumerate() {
                let cell = Cell { row, col };
                if kinds[cell].is_none() {
                    *z = f(self, cell);
                }
            }
        });
        Ok(terrain)
    }
}

pub(crate) fn position(cell: Cell) -> [f64; 2] {
    [cell.row as f64, cell.col as f64]
}
