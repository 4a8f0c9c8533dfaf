//! Terrain on square cells, on which flow, lines and models work.
//!
//! A [`Dem`] whose cells are not square -> the same ground on cells that are. Bicubic (`grid::resample`), about as many
//! cells as before: their side is that of a square of the old cells' area. Voids stay: a new cell is void when the old cell
//! around its centre is. What stands in a void meanwhile, and so reaches two cells around it in the weights of the kernel, is
//! the height of the nearest cell that has one. Cost: some thirty multiplications a cell.

use super::{CellSize, Dem};
use crate::error::Result;
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Mask};
use std::collections::VecDeque;

/// Cells count as square as long as their sides differ by no more than this share.
pub(crate) const SQUARE_WITHIN: f64 = 0.02;

impl CellSize {
    /// Whether the sides differ by at most [`SQUARE_WITHIN`].
    #[must_use]
    pub fn is_square(self) -> bool {
        self.x().max(self.y()) / self.x().min(self.y()) <= 1.0 + SQUARE_WITHIN
    }

    /// The (rows, columns) of square cells that cover the ground of `shape` cells of this size, about as many; `None` when
    /// they are square already.
    #[must_use]
    pub fn square_shape(self, (rows, cols): (usize, usize)) -> Option<(usize, usize)> {
        let count =
            |cells: usize, length: f64| ((cells as f64 * length / self.mean()).round() as usize).max(2);
        let to = (count(rows, self.y()), count(cols, self.x()));
        (!self.is_square() && to != (rows, cols)).then_some(to)
    }
}

impl Dem {
    /// The same ground on square cells, at the same place; `None` when the cells are square already.
    ///
    /// # Errors
    /// When nothing but voids is left, which can be where the few heights of a raster are thinner than a new cell.
    pub fn on_square_cells(&self) -> Result<Option<Self>> {
        let ((rows, cols), size) = (self.shape(), self.cell_size());
        let Some(to) = size.square_shape((rows, cols)) else { return Ok(None) };
        let valid = Mask::from_fn(to.0, to.1, |c| {
            let old = |i: usize, to: usize, from: usize| (2 * i + 1) * from / (2 * to);
            self.valid()[Cell::new(old(c.row, to.0, rows), old(c.col, to.1, cols))]
        });
        let heights = resample(&filled(self), to.0, to.1);
        let (down, across) = (rows as f64 / to.0 as f64, cols as f64 / to.1 as f64);
        let size = CellSize::new(size.x() * across, size.y() * down)?;
        let georeference = self.georeference().map(|g| g.on_raster((rows, cols), to));
        Ok(Some(Self::with_voids(heights, valid, size)?.at(georeference)))
    }
}

/// Heights with every void at the height of a nearest cell that has one, in steps to the four sides.
fn filled(dem: &Dem) -> Grid<f32> {
    let mut heights = dem.heights().clone();
    if dem.void_count() == 0 {
        return heights;
    }
    let (rows, cols) = dem.shape();
    let mut known = dem.valid().clone();
    let mut queue: VecDeque<Cell> = known.cells().filter(|(_, ok)| **ok).map(|(cell, _)| cell).collect();
    while let Some(cell) = queue.pop_front() {
        for (down, right) in [(-1, 0), (0, -1), (0, 1), (1, 0)] {
            let next = (cell.row.checked_add_signed(down), cell.col.checked_add_signed(right));
            let (Some(row), Some(col)) = next else { continue };
            let next = Cell::new(row, col);
            if row < rows && col < cols && !known[next] {
                known[next] = true;
                heights[next] = heights[cell];
                queue.push_back(next);
            }
        }
    }
    heights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::{Georeference, RasterSpace};

    /// A cone of one metre a metre, seen on cells of 20 m by 30 m.
    fn cone(valid: impl Fn(Cell) -> bool) -> Dem {
        let (rows, cols) = (60, 120);
        let at = |c: Cell| (20.0 * (c.col as f64 + 0.5) - 1200.0).hypot(30.0 * (c.row as f64 + 0.5) - 900.0);
        let heights = Grid::from_fn(rows, cols, |c| at(c) as f32);
        let place = Georeference {
            transform: [0.002, 0.0, 8.0, 0.0, -0.003, 47.0],
            epsg: Some(4326),
            definition: None,
            raster_space: RasterSpace::PixelIsPoint,
        };
        let size = CellSize::new(20.0, 30.0).unwrap();
        Dem::with_voids(heights, Mask::from_fn(rows, cols, valid), size).unwrap().at(Some(place))
    }

    #[test]
    fn a_cone_is_round_again_and_stays_in_its_place() {
        let old = cone(|_| true);
        let new = old.on_square_cells().unwrap().unwrap();
        let (rows, cols) = new.shape();
        assert_eq!((rows, cols), (73, 98));
        assert!(new.cell_size().is_square() && (new.cell_size().mean() - 600f64.sqrt()).abs() < 0.2);
        let (dx, dy) = (new.cell_size().x(), new.cell_size().y());
        for (cell, z) in new.heights().cells() {
            let (x, y) = (dx * (cell.col as f64 + 0.5) - 1200.0, dy * (cell.row as f64 + 0.5) - 900.0);
            let inside = cell.row > 3 && cell.row + 4 < rows && cell.col > 3 && cell.col + 4 < cols;
            if inside && x.hypot(y) > 120.0 {
                assert!((f64::from(*z) - x.hypot(y)).abs() < 0.5, "{cell:?} {z} {}", x.hypot(y));
            }
        }
        let (a, b) = (old.georeference().unwrap(), new.georeference().unwrap());
        for (share_x, share_y) in [(0.0, 0.0), (1.0, 1.0), (0.25, 0.5)] {
            let (x, y) = a.to_model(120.0 * share_x, 60.0 * share_y);
            let (u, v) = b.to_model(cols as f64 * share_x, rows as f64 * share_y);
            assert!((x - u).abs() < 1e-9 && (y - v).abs() < 1e-9, "{x} {y} {u} {v}");
        }
        assert_eq!((b.epsg, b.raster_space), (a.epsg, a.raster_space));
    }

    #[test]
    fn voids_stay_and_reach_no_heights() {
        let is_void = |c: Cell| (20..40).contains(&c.row) && (30..50).contains(&c.col);
        let (old, whole) = (cone(|c| !is_void(c)), cone(|_| true).on_square_cells().unwrap().unwrap());
        let new = old.on_square_cells().unwrap().unwrap();
        let share = |dem: &Dem| dem.void_count() as f64 / dem.valid().len() as f64;
        assert!((share(&new) - share(&old)).abs() < 0.006, "{} {}", share(&new), share(&old));
        for (cell, z) in new.heights().cells() {
            // Cells beside the void lean on what fills it, by less than one step of the slope.
            assert!(!new.valid()[cell] || (z - whole.heights()[cell]).abs() < 20.0, "{cell:?} {z}");
        }
    }

    #[test]
    fn square_cells_are_left_alone() {
        let dem = |x, y| Dem::new(Grid::filled(9, 9, 4.0), CellSize::new(x, y).unwrap()).unwrap();
        assert_eq!(dem(30.0, 30.5).on_square_cells().unwrap(), None);
        let thin = dem(1.0, 400.0).on_square_cells().unwrap().unwrap();
        assert_eq!(thin.shape(), (180, 2));
        assert!(thin.heights().as_slice().iter().all(|z| (z - 4.0).abs() < 1e-5));
    }
}
