//! A rectangle of values.

use super::{Cell, Window};
use crate::error::{Error, Result};
use ndarray::{Array2, ArrayView2, s};

/// A raster of `rows` x `cols` values, row-major and contiguous, row 0 north. Never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T>(Array2<T>);

/// Which cells belong to something.
pub type Mask = Grid<bool>;

impl<T> Grid<T> {
    /// Wraps row-major `values` of length `rows * cols`.
    ///
    /// # Errors
    /// When a side is 0 or the length does not fit.
    pub fn from_vec(rows: usize, cols: usize, values: Vec<T>) -> Result<Self> {
        if rows == 0 || cols == 0 {
            return Err(Error::value("raster size", format!("{rows}x{cols}"), "allowed: at least 1x1"));
        }
        let found = values.len();
        match Array2::from_shape_vec((rows, cols), values) {
            Ok(array) => Ok(Self(array)),
            Err(_) => Err(Error::value(
                "number of values",
                found,
                format!("a {rows}x{cols} raster needs {}", rows * cols),
            )),
        }
    }

    /// The value of `f` at every cell.
    ///
    /// # Panics
    /// When a side is 0.
    pub fn from_fn(rows: usize, cols: usize, mut f: impl FnMut(Cell) -> T) -> Self {
        assert!(rows > 0 && cols > 0, "a raster has at least one cell");
        Self(Array2::from_shape_fn((rows, cols), |(row, col)| f(Cell { row, col })))
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.0.nrows()
    }

    /// Number of columns.
    #[must_use]
    pub fn cols(&self) -> usize {
        self.0.ncols()
    }

    /// (rows, columns).
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        self.0.dim()
    }

    /// Number of cells.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "a Grid is never empty")]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// All values, row by row.
    ///
    /// # Panics
    /// Never: the storage is contiguous by construction.
    #[must_use]
    pub fn as_slice(&self) -> &[T] {
        self.0.as_slice().expect("contiguous by construction")
    }

    /// All values, row by row.
    ///
    /// # Panics
    /// Never: the storage is contiguous by construction.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        self.0.as_slice_mut().expect("contiguous by construction")
    }

    /// The values, row by row.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        let (values, _) = self.0.into_raw_vec_and_offset();
        values
    }

    /// The raster as an `ndarray` view.
    #[must_use]
    pub fn view(&self) -> ArrayView2<'_, T> {
        self.0.view()
    }

    /// Position of `cell` in [`as_slice`](Self::as_slice).
    #[must_use]
    pub fn index_of(&self, cell: Cell) -> usize {
        cell.row * self.cols() + cell.col
    }

    /// The cell at position `index` of [`as_slice`](Self::as_slice).
    #[must_use]
    pub fn cell_at(&self, index: usize) -> Cell {
        Cell { row: index / self.cols(), col: index % self.cols() }
    }

    /// Every cell with its value, row by row.
    pub fn cells(&self) -> impl Iterator<Item = (Cell, &T)> {
        self.0.indexed_iter().map(|((row, col), value)| (Cell { row, col }, value))
    }

    /// The value of `f` for every value.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid(self.0.map(f))
    }
}

impl<T: Clone> Grid<T> {
    /// The same value everywhere.
    ///
    /// # Panics
    /// When a side is 0.
    #[must_use]
    pub fn filled(rows: usize, cols: usize, value: T) -> Self {
        assert!(rows > 0 && cols > 0, "a raster has at least one cell");
        Self(Array2::from_elem((rows, cols), value))
    }

    /// What a window shows.
    ///
    /// # Errors
    /// When the window is empty or reaches past the frame.
    pub fn crop(&self, window: Window) -> Result<Self> {
        window.check(self.shape())?;
        let Window { origin: Cell { row, col }, rows, cols } = window;
        let part = self.0.slice(s![row..row + rows, col..col + cols]);
        Ok(Self(part.as_standard_layout().into_owned()))
    }
}

impl<T> std::ops::Index<Cell> for Grid<T> {
    type Output = T;
    fn index(&self, cell: Cell) -> &T {
        &self.0[(cell.row, cell.col)]
    }
}

impl<T> std::ops::IndexMut<Cell> for Grid<T> {
    fn index_mut(&mut self, cell: Cell) -> &mut T {
        &mut self.0[(cell.row, cell.col)]
    }
}
