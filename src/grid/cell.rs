//! One cell of a raster.

/// A cell by row (0 = north) and column (0 = west).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Row, counted from the north.
    pub row: usize,
    /// Column, counted from the west.
    pub col: usize,
}

impl Cell {
    /// The cell at `row`, `col`.
    #[must_use]
    pub const fn new(row: usize, col: usize) -> Self {
        Self { row, col }
    }

    /// Whether `other` is this cell or one of its eight neighbours.
    #[must_use]
    pub const fn touches(self, other: Self) -> bool {
        self.row.abs_diff(other.row) <= 1 && self.col.abs_diff(other.col) <= 1
    }

    /// Squared Euclidean distance between the two centres, in cells.
    #[must_use]
    pub const fn distance_squared(self, other: Self) -> usize {
        let (dr, dc) = (self.row.abs_diff(other.row), self.col.abs_diff(other.col));
        dr * dr + dc * dc
    }
}
