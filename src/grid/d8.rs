//! The eight neighbours of a cell, in the one order that the whole program uses.
//!
//! Codes run counter-clockwise from east, in steps of pi/4 with y pointing north:
//! 0 E, 1 NE, 2 N, 3 NW, 4 W, 5 SW, 6 S, 7 SE. Odd codes are the diagonals.

use super::Cell;

/// (row, column) offsets by code.
pub(crate) const OFFSETS: [(isize, isize); 8] =
    [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)];

/// Distance to the neighbour by code, in cells.
pub(crate) const DISTANCES: [f64; 8] = {
    let d = std::f64::consts::SQRT_2;
    [1.0, d, 1.0, d, 1.0, d, 1.0, d]
};

/// The code of the direction that points back.
#[must_use]
pub(crate) const fn opposite(code: u8) -> u8 {
    (code + 4) % 8
}

/// The code of the step from `a` to `b`, or `None` when the cells are equal or not adjacent.
#[must_use]
pub(crate) fn code_between(a: Cell, b: Cell) -> Option<u8> {
    let step = (b.row.wrapping_sub(a.row) as isize, b.col.wrapping_sub(a.col) as isize);
    OFFSETS.iter().position(|&o| o == step).map(|i| i as u8)
}

/// The neighbour of `cell` in direction `code` inside a raster of `rows` x `cols`, or `None` past the frame.
#[must_use]
pub fn neighbour(cell: Cell, code: u8, rows: usize, cols: usize) -> Option<Cell> {
    let (dr, dc) = OFFSETS[code as usize];
    let row = cell.row.checked_add_signed(dr)?;
    let col = cell.col.checked_add_signed(dc)?;
    (row < rows && col < cols).then_some(Cell { row, col })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_step_by_quarter_pi_counter_clockwise() {
        for (code, &(dr, dc)) in OFFSETS.iter().enumerate() {
            let angle = (-(dr as f64)).atan2(dc as f64).rem_euclid(std::f64::consts::TAU);
            assert!((angle - code as f64 * std::f64::consts::FRAC_PI_4).abs() < 1e-12);
            let centre = Cell::new(5, 5);
            let there = neighbour(centre, code as u8, 11, 11).unwrap();
            assert_eq!(code_between(centre, there), Some(code as u8));
            assert_eq!(code_between(there, centre), Some(opposite(code as u8)));
            assert!((DISTANCES[code].powi(2) - centre.distance_squared(there) as f64).abs() < 1e-12);
        }
        assert_eq!(neighbour(Cell::new(0, 0), 2, 3, 3), None);
        assert_eq!(neighbour(Cell::new(2, 2), 7, 3, 3), None);
    }
}
