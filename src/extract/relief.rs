//! Terrain made ready for routing: without unit, continued past the frame, smoothed.
//!
//! Heights and mask -> [`Relief`]. Heights become (z - lowest) / (highest - lowest), rounded once, so that lines depend on
//! no unit: exactly, when the change of unit is exact in `f32`; up to that rounding otherwise. Linear.

use super::ExtractionConfig;
use crate::error::Result;
use crate::flow::Surface;
use crate::grid::{Cell, Grid, Mask, Window, gaussian};

/// Unit heights with a margin of continued terrain.
pub(super) struct Relief {
    /// Smoothed; with the margin.
    surface: Surface,
    /// Where the map lies in the surface.
    map: Window,
}

impl Relief {
    /// # Errors
    /// When shapes differ, a valid height is not finite, or no cell is valid.
    pub(super) fn new(heights: &Grid<f32>, valid: &Mask, config: &ExtractionConfig) -> Result<Self> {
        Surface::check(heights, valid)?;
        let shape = heights.shape();
        let unit = to_unit(heights, valid);
        let origin = Cell::new(config.margin.min(shape.0 - 1), config.margin.min(shape.1 - 1));
        let (unit, valid) = continued(unit, valid.clone(), origin);
        let smooth = gaussian::smooth(&unit, &valid, config.smoothing);
        let map = Window::new(origin, shape.0, shape.1);
        Ok(Self { surface: Surface::new(smooth, valid)?, map })
    }

    /// Smoothed unit heights, with the margin.
    pub(super) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// The part of a raster over the surface that shows the map.
    ///
    /// # Panics
    /// When `raster` has not the shape of the surface.
    pub(super) fn crop<T: Clone>(&self, raster: &Grid<T>) -> Grid<T> {
        assert_eq!(raster.shape(), self.surface.shape(), "a raster over the surface");
        raster.crop(self.map).expect("the map lies inside its margin")
    }

    /// Magnitude of the gradient at a cell of the map, per cell: central differences, one-sided at the frame and beside
    /// voids, 0 between two voids.
    pub(super) fn gradient(&self, cell: Cell) -> f64 {
        let (rows, cols) = self.surface.shape();
        let (row, col) = (cell.row + self.map.origin.row, cell.col + self.map.origin.col);
        let height = |r: usize, c: usize| {
            let there = Cell::new(r, c);
            (r < rows && c < cols && self.surface.valid()[there])
                .then(|| f64::from(self.surface.heights()[there]))
        };
        let here = height(row, col);
        let along = |before: Option<f64>, after: Option<f64>| match (before, here, after) {
            (Some(a), _, Some(b)) => (b - a) / 2.0,
            (Some(a), Some(b), None) | (None, Some(a), Some(b)) => b - a,
            _ => 0.0,
        };
        let dy = along(height(row.wrapping_sub(1), col), height(row + 1, col));
        let dx = along(height(row, col.wrapping_sub(1)), height(row, col + 1));
        dx.hypot(dy)
    }
}

/// 0 at the lowest and 1 at the highest valid cell; 0 everywhere on level terrain; 0 at voids.
fn to_unit(heights: &Grid<f32>, valid: &Mask) -> Grid<f32> {
    let known =
        || heights.as_slice().iter().zip(valid.as_slice()).filter(|(_, ok)| **ok).map(|(&z, _)| f64::from(z));
    let (low, high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), z| (lo.min(z), hi.max(z)));
    let range = if high > low { high - low } else { 1.0 };
    Grid::from_fn(heights.rows(), heights.cols(), |c| {
        if valid[c] { ((f64::from(heights[c]) - low) / range) as f32 } else { 0.0 }
    })
}

/// Continues terrain past its frame by `margin` rows and columns, by a half turn about the frame's cells: what lies k
/// cells outside is as far above the frame as what lies k cells inside is below it. Slopes, ridges and valleys go on across
/// the frame in their direction. A cell outside is valid when both cells that it is made from are.
fn continued(heights: Grid<f32>, valid: Mask, margin: Cell) -> (Grid<f32>, Mask) {
    if margin == Cell::new(0, 0) {
        return (heights, valid);
    }
    let (rows, cols) = heights.shape();
    // The cell on the frame and the mirror image of a position outside.
    let sources = |i: usize, margin: usize, n: usize| match i.checked_sub(margin) {
        None => (0, margin - i),
        Some(inside) if inside < n => (inside, inside),
        Some(past) => (n - 1, 2 * (n - 1) - past),
    };
    let turned = |edge: f32, inside: f32| 2.0 * edge - inside;
    let tall = rows + 2 * margin.row;
    let rows_of = |row: usize, col: usize| {
        let (edge, inside) = sources(row, margin.row, rows);
        (Cell::new(edge, col), Cell::new(inside, col))
    };
    let z = Grid::from_fn(tall, cols, |c| {
        let (edge, inside) = rows_of(c.row, c.col);
        turned(heights[edge], heights[inside])
    });
    let ok = Grid::from_fn(tall, cols, |c| {
        let (edge, inside) = rows_of(c.row, c.col);
        valid[edge] && valid[inside]
    });
    let wide = cols + 2 * margin.col;
    let cols_of = |c: Cell| {
        let (edge, inside) = sources(c.col, margin.col, cols);
        (Cell::new(c.row, edge), Cell::new(c.row, inside))
    };
    let z_wide = Grid::from_fn(tall, wide, |c| {
        let (edge, inside) = cols_of(c);
        turned(z[edge], z[inside])
    });
    let ok_wide = Grid::from_fn(tall, wide, |c| {
        let (edge, inside) = cols_of(c);
        ok[edge] && ok[inside]
    });
    (z_wide, ok_wide)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_goes_on_past_the_frame() {
        let plane = |c: Cell, shift: f32| 3.0 * (c.row as f32 - shift) - 2.0 * (c.col as f32 - shift);
        let z = Grid::from_fn(6, 5, |c| plane(c, 0.0));
        let (wide, valid) = continued(z.clone(), z.map(|_| true), Cell::new(4, 4));
        assert_eq!(wide.shape(), (14, 13));
        assert!(valid.as_slice().iter().all(|&v| v));
        for (cell, &found) in wide.cells() {
            assert_eq!(found, plane(cell, 4.0), "{cell:?}");
        }
    }

    #[test]
    fn voids_are_continued_as_voids() {
        let z = Grid::filled(5, 5, 1.0f32);
        let valid = Grid::from_fn(5, 5, |c| c != Cell::new(2, 1));
        let (_, wide) = continued(z, valid, Cell::new(2, 2));
        let voids: Vec<Cell> = wide.cells().filter(|(_, ok)| !**ok).map(|(c, _)| c).collect();
        let expected = [(0, 1), (0, 3), (4, 1), (4, 3), (8, 1), (8, 3)];
        assert_eq!(voids, expected.map(|(row, col)| Cell::new(row, col)));
    }

    #[test]
    fn gradient_of_a_plane() {
        let z = Grid::from_fn(20, 20, |c| 100.0 + 3.0 * c.row as f32 + 4.0 * c.col as f32);
        let valid = Grid::from_fn(20, 20, |c| c != Cell::new(10, 10));
        let config = ExtractionConfig { smoothing: 0.0, ..Default::default() };
        let relief = Relief::new(&z, &valid, &config).unwrap();
        let range = 19.0 * 7.0;
        for cell in [(5, 5), (0, 0), (19, 3), (10, 9), (9, 10)].map(|(r, c)| Cell::new(r, c)) {
            assert!((relief.gradient(cell) * range - 5.0).abs() < 1e-3, "{cell:?}");
        }
    }
}
