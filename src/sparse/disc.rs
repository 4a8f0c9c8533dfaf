//! Discs on a regular grid: where primitives lie, what they see of terrain, and how they blend (Guérin et al. 2016, 4.1, 4.2, Fig. 5).
//!
//! Cells are areas, and centres lie on corners of cells: a disc seen at a finer cell size covers the same ground.

use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use std::f64::consts::SQRT_2;

/// Largest radius, cells.
const LARGEST: f64 = 64.0;

/// Discs of one radius whose centres lie `step` cells apart, from corner to corner of a raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Disc {
    radius: f64,
    step: usize,
}

impl Disc {
    /// Discs that leave no point uncovered. Radius and step in cells.
    ///
    /// # Errors
    /// When the radius is not between 1 and 64, or the discs leave gaps.
    pub(crate) fn new(radius: f64, step: usize) -> Result<Self> {
        if !(1.0..=LARGEST).contains(&radius) {
            return Err(Error::value("radius", radius, format!("allowed: 1 to {LARGEST} cells")));
        }
        if step == 0 || step as f64 >= SQRT_2 * radius {
            let allowed =
                format!("allowed: 1 to less than {:.2}, so that discs leave no gap", SQRT_2 * radius);
            return Err(Error::value("step", step, allowed));
        }
        Ok(Self { radius, step })
    }

    /// R, cells.
    pub(crate) const fn radius(self) -> f64 {
        self.radius
    }

    /// Cells from centre to centre.
    pub(crate) const fn step(self) -> usize {
        self.step
    }

    /// Side of the square around a disc, cells; even.
    pub(crate) fn side(self) -> usize {
        2 * self.radius.ceil() as usize
    }

    /// Centres beyond the frame whose discs reach into it, along a row or column.
    pub(crate) fn margin(self) -> usize {
        (self.radius / self.step as f64).ceil() as usize - 1
    }

    /// (rows, columns) of centres over a raster of that shape.
    pub(crate) fn centres(self, (rows, cols): (usize, usize)) -> (usize, usize) {
        let along = |side: usize| side.div_ceil(self.step) + 1 + 2 * self.margin();
        (along(rows), along(cols))
    }

    /// Row or column of the first cell of the square around a centre, by its number along that side; the frame begins at 0.
    pub(crate) fn first(self, centre: usize) -> isize {
        (centre * self.step) as isize - (self.margin() * self.step + self.side() / 2) as isize
    }

    /// The weight alpha = (1 - r^2)^3 of the cells of a square seen at `fine` cells a cell, row by row (4.1).
    pub(crate) fn falloff(self, fine: usize) -> Vec<f32> {
        let side = self.side() * fine;
        let offset = |i: usize| ((i as f64 + 0.5) / fine as f64 - self.side() as f64 / 2.0) / self.radius;
        let cells = (0..side * side).map(|i| falloff(offset(i / side).powi(2) + offset(i % side).powi(2)));
        cells.map(|weight| weight as f32).collect()
    }

    /// The weights alpha over the sum of those of all discs: what every disc gives to the blend.
    pub(crate) fn shares(self, fine: usize) -> Vec<f32> {
        let (side, period) = (self.side() * fine, self.step * fine);
        let mut weights = self.falloff(fine);
        let place = |i: usize| (i / side) % period * period + (i % side) % period;
        let mut sums = vec![0.0f64; period * period];
        for (i, weight) in weights.iter().enumerate() {
            sums[place(i)] += f64::from(*weight);
        }
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = (f64::from(*weight) / sums[place(i)]) as f32;
        }
        weights
    }

    /// Places in the square of the cells inside the disc.
    pub(crate) fn inside(self) -> Vec<usize> {
        let falloff = self.falloff(1);
        (0..falloff.len()).filter(|i| falloff[*i] > 0.0).collect()
    }

    /// The mean of a square's cells inside the disc, and what they are beside it: z_i and T_i (4.2).
    pub(crate) fn signal(square: &[f32], inside: &[usize], signal: &mut [f32]) -> f32 {
        let mean = inside.iter().map(|i| f64::from(square[*i])).sum::<f64>() / inside.len() as f64;
        let mean = mean as f32;
        signal.iter_mut().zip(inside).for_each(|(value, i)| *value = square[*i] - mean);
        mean
    }

    /// The square around a centre. Beyond the frame terrain is continued by turning it around its border cell, which keeps slopes.
    pub(crate) fn square(self, terrain: &Grid<f32>, (row, col): (usize, usize), square: &mut [f32]) {
        let (side, (rows, cols)) = (self.side(), terrain.shape());
        let (first_row, first_col) = (self.first(row), self.first(col));
        let is_inside = |first: isize, all: usize| first >= 0 && first as usize + side <= all;
        if is_inside(first_row, rows) && is_inside(first_col, cols) {
            for (i, out) in square.chunks_exact_mut(side).enumerate() {
                let start = (first_row as usize + i) * cols + first_col as usize;
                out.copy_from_slice(&terrain.as_slice()[start..start + side]);
            }
            return;
        }
        for (i, out) in square.iter_mut().enumerate() {
            let row = turned(first_row + (i / side) as isize, rows);
            let col = turned(first_col + (i % side) as isize, cols);
            let at = |row: usize, col: usize| terrain[Cell::new(row, col)];
            let along = |row: usize| match col {
                (col, None) => at(row, col),
                (col, Some(border)) => 2.0 * at(row, border) - at(row, col),
            };
            *out = match row {
                (row, None) => along(row),
                (row, Some(border)) => 2.0 * along(border) - along(row),
            };
        }
    }
}

/// (1 - r^2)^3 inside the unit disc, by the square of r.
pub(super) fn falloff(squared: f64) -> f64 {
    if squared < 1.0 { (1.0 - squared).powi(3) } else { 0.0 }
}

/// The index that stands for `i` on a side, and the border cell around which it was turned.
fn turned(i: isize, side: usize) -> (usize, Option<usize>) {
    let last = side as isize - 1;
    if i < 0 {
        ((-i).min(last) as usize, Some(0))
    } else if i > last {
        ((2 * last - i).max(0) as usize, Some(last as usize))
    } else {
        (i as usize, None)
    }
}
