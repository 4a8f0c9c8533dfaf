//! A rectangle of cells.

use super::Cell;
use crate::error::{Error, Result};
use std::fmt;

/// A rectangle of cells of a raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// Its north-west cell.
    pub origin: Cell,
    /// Rows, at least 1.
    pub rows: usize,
    /// Columns, at least 1.
    pub cols: usize,
}

impl Window {
    /// `rows` x `cols` cells, the north-west one of them at `origin`.
    #[must_use]
    pub const fn new(origin: Cell, rows: usize, cols: usize) -> Self {
        Self { origin, rows, cols }
    }

    /// `side` x `side` cells, the north-west one of them at `origin`.
    #[must_use]
    pub const fn square(origin: Cell, side: usize) -> Self {
        Self::new(origin, side, side)
    }

    /// The whole of a raster of (rows, columns).
    #[must_use]
    pub const fn whole((rows, cols): (usize, usize)) -> Self {
        Self::new(Cell::new(0, 0), rows, cols)
    }

    /// (rows, columns).
    #[must_use]
    pub const fn shape(self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    /// Checks that the window has cells and lies inside a raster of (rows, columns).
    ///
    /// # Errors
    /// When it does not.
    pub fn check(self, (rows, cols): (usize, usize)) -> Result<()> {
        let fits = |start: usize, len: usize, side: usize| {
            len > 0 && start.checked_add(len).is_some_and(|end| end <= side)
        };
        if fits(self.origin.row, self.rows, rows) && fits(self.origin.col, self.cols, cols) {
            return Ok(());
        }
        Err(Error::value("window", self, format!("it must lie inside the raster of {rows}x{cols}")))
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{} at row {}, column {}", self.rows, self.cols, self.origin.row, self.origin.col)
    }
}
