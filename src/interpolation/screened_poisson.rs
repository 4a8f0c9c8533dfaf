//! The surface whose gradients are nearest to given ones, held towards heights of its own: screened Poisson.
//!
//! Minimises |grad u - g|^2 + w (u - t)^2 (Perez, Gangnet & Blake 2003, Eq. 3, for the first term; Bhat, Curless, Cohen &
//! Zitnick 2008 for the second), with a weight w and a target t for every cell and free ends at the frame: (L + w) u = w t - div g,
//! solved as the membrane is. Cost: about ten multigrid cycles, fewer from a start that is near.

use super::multigrid::Held;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};

/// Residual at which the surface is done, relative to that of level ground.
const TOLERANCE: f64 = 1e-6;

/// Differences between neighbouring cells, wherever they come from: they need not be those of any surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gradients {
    /// Height of the cell to the east minus that of the cell; the last column is not read.
    pub(crate) east: Grid<f32>,
    /// Height of the cell to the south minus that of the cell; the last row is not read.
    pub(crate) south: Grid<f32>,
}

impl Gradients {
    /// Those of a surface.
    #[must_use]
    pub(crate) fn of(heights: &Grid<f32>) -> Self {
        let (rows, cols) = heights.shape();
        let to = |c: Cell, row: usize, col: usize| {
            if row < rows && col < cols { heights[Cell::new(row, col)] - heights[c] } else { 0.0 }
        };
        Self {
            east: Grid::from_fn(rows, cols, |c| to(c, c.row, c.col + 1)),
            south: Grid::from_fn(rows, cols, |c| to(c, c.row + 1, c.col)),
        }
    }

    /// All of them times `factor`.
    #[must_use]
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        Self { east: self.east.map(|g| factor * g), south: self.south.map(|g| factor * g) }
    }

    /// Mean length over the cells that have both differences; 0 where there is none.
    #[must_use]
    pub(crate) fn mean_length(&self) -> f64 {
        let (rows, cols) = self.east.shape();
        let mut sum = 0.0;
        for row in 0..rows - 1 {
            let line = row * cols..row * cols + cols - 1;
            let pairs = self.east.as_slice()[line.clone()].iter().zip(&self.south.as_slice()[line]);
            sum += pairs.map(|(e, s)| f64::from(e * e + s * s).sqrt()).sum::<f64>();
        }
        sum / ((rows - 1) * (cols - 1)).max(1) as f64
    }
}

/// The equation for fixed weights, ready for any number of gradients and targets.
pub(crate) struct ScreenedPoisson {
    held: Held,
    weights: Grid<f64>,
}

impl ScreenedPoisson {
    /// `weights`: how strongly each cell is held to its target, per squared difference of a gradient.
    ///
    /// # Errors
    /// When a weight is negative or not finite, or all are 0.
    pub(crate) fn new(weights: Grid<f64>, stop: &Stop) -> Result<Self> {
        if let Some((cell, w)) = weights.cells().find(|(_, w)| !(w.is_finite() && **w >= 0.0)) {
            let name = format!("screen weight at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, w, "allowed: finite, at least 0"));
        }
        if weights.as_slice().iter().all(|w| *w == 0.0) {
            return Err(Error::value("largest screen weight", 0, "at least one cell must be held"));
        }
        Ok(Self { held: Held::new(&weights, TOLERANCE, stop), weights })
    }

    /// The surface. `start` saves steps when it is near; `targets` count where the weight is not 0.
    ///
    /// # Errors
    /// When shapes differ, a gradient or target is not finite, or the work is stopped.
    pub(crate) fn solve(
        &mut self,
        gradients: &Gradients,
        targets: &Grid<f64>,
        start: &Grid<f64>,
    ) -> Result<Grid<f64>> {
        let (rows, cols) = self.weights.shape();
        let shapes = [gradients.east.shape(), gradients.south.shape(), targets.shape(), start.shape()];
        if let Some(other) = shapes.iter().find(|shape| **shape != (rows, cols)) {
            let allowed = format!("the weights are {:?}", (rows, cols));
            return Err(Error::value("raster of the screened surface", format!("{other:?}"), allowed));
        }
        let (east, south) = (gradients.east.as_slice(), gradients.south.as_slice());
        let right_side = Grid::from_fn(rows, cols, |c| {
            let i = c.row * cols + c.col;
            let mut b = self.weights.as_slice()[i] * targets.as_slice()[i];
            if c.col > 0 {
                b += f64::from(east[i - 1]);
            }
            if c.col + 1 < cols {
                b -= f64::from(east[i]);
            }
            if c.row > 0 {
                b += f64::from(south[i - cols]);
            }
            if c.row + 1 < rows {
                b -= f64::from(south[i]);
            }
            b
        });
        if let Some((cell, b)) = right_side.cells().find(|(_, b)| !b.is_finite()) {
            let name = format!("gradient or target at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, b, "allowed: finite"));
        }
        let mut surface = start.clone();
        self.held.solve(&mut surface, &right_side)?;
        Ok(surface)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hills(rows: usize, cols: usize) -> Grid<f32> {
        Grid::from_fn(rows, cols, |c| {
            40.0 * (c.row as f32 * 0.21).sin() + 25.0 * (c.col as f32 * 0.13).cos() + 0.5 * c.row as f32
        })
    }

    #[test]
    fn a_surface_comes_back_from_its_gradients() {
        for (rows, cols) in [(1, 9), (33, 20), (100, 130)] {
            let hills = hills(rows, cols);
            let held = Cell::new(rows / 2, cols / 3);
            let weights = Grid::from_fn(rows, cols, |c| f64::from(u8::from(c == held)));
            let targets = Grid::from_fn(rows, cols, |c| if c == held { 7.0 } else { 999.0 });
            let start = Grid::filled(rows, cols, 0.0);
            let found = ScreenedPoisson::new(weights, &Stop::new()).unwrap().solve(
                &Gradients::of(&hills),
                &targets,
                &start,
            );
            let found = found.unwrap();
            for (cell, z) in found.cells() {
                let want = f64::from(hills[cell] - hills[held]) + 7.0;
                assert!((z - want).abs() < 2e-3, "{rows}x{cols} {cell:?}: {z} {want}");
            }
        }
    }

    /// The optimum: at every cell the energy's derivative is zero.
    #[test]
    fn the_equation_holds_from_any_start() {
        let (rows, cols) = (45, 64);
        let weights = Grid::from_fn(rows, cols, |c| if (c.row + 3 * c.col) % 17 == 0 { 4.0 } else { 1e-3 });
        let targets = Grid::from_fn(rows, cols, |c| ((c.row * 13 + c.col * 7) % 50) as f64);
        let gradients = Gradients {
            east: Grid::from_fn(rows, cols, |c| ((c.row * 5 + c.col * 11) % 9) as f32 - 4.0),
            south: Grid::from_fn(rows, cols, |c| ((c.row * 3 + c.col * 2) % 7) as f32 - 3.0),
        };
        let mut poisson = ScreenedPoisson::new(weights.clone(), &Stop::new()).unwrap();
        let found = poisson.solve(&gradients, &targets, &Grid::filled(rows, cols, 0.0)).unwrap();
        let again = poisson.solve(&gradients, &targets, &Grid::filled(rows, cols, 90.0)).unwrap();
        for (c, z) in found.cells() {
            assert!((z - again[c]).abs() < 1e-2, "{c:?}");
            let mut slope = weights[c] * (z - targets[c]);
            let at = |row: usize, col: usize| found[Cell::new(row, col)];
            if c.col > 0 {
                slope += z - at(c.row, c.col - 1) - f64::from(gradients.east[Cell::new(c.row, c.col - 1)]);
            }
            if c.col + 1 < cols {
                slope -= at(c.row, c.col + 1) - z - f64::from(gradients.east[c]);
            }
            if c.row > 0 {
                slope += z - at(c.row - 1, c.col) - f64::from(gradients.south[Cell::new(c.row - 1, c.col)]);
            }
            if c.row + 1 < rows {
                slope -= at(c.row + 1, c.col) - z - f64::from(gradients.south[c]);
            }
            assert!(slope.abs() < 5e-3, "{c:?}: {slope}");
        }
    }

    #[test]
    fn bad_input_is_named() {
        assert!(ScreenedPoisson::new(Grid::filled(3, 4, 0.0), &Stop::new()).is_err());
        assert!(ScreenedPoisson::new(Grid::filled(3, 4, -1.0), &Stop::new()).is_err());
        let mut poisson = ScreenedPoisson::new(Grid::filled(3, 4, 1.0), &Stop::new()).unwrap();
        let level = Grid::filled(3, 4, 0.0);
        let mut gradients = Gradients::of(&Grid::filled(3, 4, 0.0));
        assert!(poisson.solve(&gradients, &Grid::filled(4, 3, 0.0), &level).is_err());
        gradients.east[Cell::new(1, 1)] = f32::NAN;
        assert!(poisson.solve(&gradients, &level, &level).unwrap_err().to_string().contains("row 1"));
    }
}
