//! Thinning to lines one cell wide.
//!
//! Mask -> mask. Sequential thinning with directional sub-iterations (Rosenfeld 1975, Hilditch 1969): the cells open to
//! the east, north, west, south are listed in turn, then deleted one at a time as long as each is *simple* at that
//! moment (deleting it changes neither the number of 8-connected pieces nor that of 4-connected holes) and is not the end
//! of a line. Unlike Zhang-Suen, which erases 2 x 2 squares and leaves two-cell staircases, this keeps the topology by
//! construction and stops only when no further cell can go. Time: list of cells times half the greatest width.

use super::{Grid, Mask};

/// The lines along the middle of `mask`: a subset with the same pieces and holes in which no cell is [`is_redundant`].
///
/// Past the frame counts as empty. Turning the input by 90 degrees turns the result up to the choice between two equally
/// central cells.
#[must_use]
pub(crate) fn thin(mask: &Mask) -> Mask {
    let (rows, cols) = mask.shape();
    let stride = cols + 2;
    let mut on = vec![false; (rows + 2) * stride];
    let mut list = Vec::new();
    for (cell, _) in mask.cells().filter(|(_, v)| **v) {
        let i = (cell.row + 1) * stride + cell.col + 1;
        on[i] = true;
        list.push(i);
    }
    let ring = ring_offsets(stride);
    let mut candidates = Vec::new();
    loop {
        let mut changed = false;
        for side in [0, 4, 2, 6] {
            candidates.clear();
            candidates.extend(list.iter().copied().filter(|&i| {
                on[i] && !on[i.wrapping_add_signed(ring[side])] && REDUNDANT[pattern(&on, i, &ring)]
            }));
            // Rosenfeld proved that one side's candidates may even go together; asking again needs no proof.
            for &i in &candidates {
                if REDUNDANT[pattern(&on, i, &ring)] {
                    on[i] = false;
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
        list.retain(|&i| on[i]);
    }
    Grid::from_fn(rows, cols, |c| on[(c.row + 1) * stride + c.col + 1])
}

/// Whether the cell whose neighbours (by D8 code, bit 0 = east) are `neighbours` can go: its going changes no topology and
/// it ends no line.
#[must_use]
#[cfg(test)]
pub(crate) const fn is_redundant(neighbours: u8) -> bool {
    REDUNDANT[neighbours as usize]
}

/// Flat offsets by D8 code in a raster of `stride` columns.
fn ring_offsets(stride: usize) -> [isize; 8] {
    super::d8::OFFSETS.map(|(dr, dc)| dr * stride as isize + dc)
}

fn pattern(on: &[bool], i: usize, ring: &[isize; 8]) -> usize {
    ring.iter().enumerate().fold(0, |bits, (k, &o)| bits | usize::from(on[i.wrapping_add_signed(o)]) << k)
}

/// Simple (Yokoi's 8-connectivity number is 1) with at least two neighbours.
const REDUNDANT: [bool; 256] = {
    let mut table = [false; 256];
    let mut bits = 0;
    while bits < 256 {
        let mut openings = 0;
        let mut k = 0;
        while k < 8 {
            let (a, b, c) = (bits >> k & 1 == 0, bits >> (k + 1) & 1 == 0, bits >> ((k + 2) % 8) & 1 == 0);
            if a && !(b && c) {
                openings += 1;
            }
            k += 2;
        }
        table[bits] = openings == 1 && (bits as u32).count_ones() >= 2;
        bits += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, Components, d8};
    use proptest::prelude::*;

    fn neighbours(mask: &Mask, cell: Cell) -> u8 {
        (0..8u8).fold(0, |bits, code| {
            let there = d8::neighbour(cell, code, mask.rows(), mask.cols());
            bits | u8::from(there.is_some_and(|n| mask[n])) << code
        })
    }

    /// 8-connected pieces, and 4-connected pieces of the background of the mask with an empty rim.
    fn topology(mask: &Mask) -> (usize, usize) {
        let (rows, cols) = (mask.rows() + 2, mask.cols() + 2);
        let empty = |c: Cell| {
            !((1..rows - 1).contains(&c.row)
                && (1..cols - 1).contains(&c.col)
                && mask[Cell::new(c.row - 1, c.col - 1)])
        };
        let mut seen = Grid::filled(rows, cols, false);
        let mut background = 0;
        for row in 0..rows {
            for col in 0..cols {
                let start = Cell::new(row, col);
                if !empty(start) || seen[start] {
                    continue;
                }
                background += 1;
                let mut stack = vec![start];
                while let Some(c) = stack.pop() {
                    if std::mem::replace(&mut seen[c], true) {
                        continue;
                    }
                    for code in [0, 2, 4, 6] {
                        stack.extend(d8::neighbour(c, code, rows, cols).filter(|&n| empty(n) && !seen[n]));
                    }
                }
            }
        }
        (Components::of(mask).count(), background)
    }

    proptest! {
        #[test]
        fn thin_lines_keep_the_topology(
            rows in 1usize..24, cols in 1usize..24,
            values in proptest::collection::vec(any::<u8>(), 24 * 24), density in 1u8..5,
        ) {
            let noise = Grid::from_fn(rows, cols, |c| values[c.row * 24 + c.col] % 5 < density);
            let mask = if density % 2 == 0 { crate::grid::morphology::close(&noise, 1) } else { noise };
            let lines = thin(&mask);
            prop_assert_eq!(topology(&lines), topology(&mask));
            for (cell, &on) in lines.cells() {
                prop_assert!(!on || mask[cell]);
                prop_assert!(!on || !is_redundant(neighbours(&lines, cell)), "{:?} is one too many", cell);
            }
            prop_assert_eq!(&thin(&lines), &lines);
        }
    }

    #[test]
    fn a_bar_becomes_its_middle_line() {
        let bar = Grid::from_fn(15, 40, |c| (5..=9).contains(&c.row) && (5..35).contains(&c.col));
        let line = thin(&bar);
        for col in 8..32 {
            let rows: Vec<usize> = (0..15).filter(|&row| line[Cell::new(row, col)]).collect();
            assert_eq!(rows, [7], "column {col}");
        }
    }

    #[test]
    fn a_square_and_a_staircase() {
        let square = Grid::from_fn(4, 4, |c| (1..3).contains(&c.row) && (1..3).contains(&c.col));
        assert!(thin(&square).as_slice().iter().any(|&v| v), "a square does not vanish");
        let stairs = Grid::from_fn(10, 10, |c| c.row == c.col || c.row == c.col + 1);
        let line = thin(&stairs);
        assert!((1..9).all(|row| (0..10).filter(|&col| line[Cell::new(row, col)]).count() == 1));
    }
}
