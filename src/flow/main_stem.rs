//! The one line of water through each part of a region.
//!
//! [`FlowDirections`], [`Accumulation`] and mask -> mask. From every cell where water leaves the region, upstream along
//! the donor that brings the most, until the region ends. Linear in the region.

use super::{Accumulation, FlowDirections};
use crate::grid::{Cell, Grid, Mask, d8};

/// The cells of `region` on a main stem: those that lead, always by the greatest accumulation, to a cell whose receiver is
/// not in the region. Between equal donors the first by D8 code is taken.
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub(crate) fn main_stems(directions: &FlowDirections, accumulation: &Accumulation, region: &Mask) -> Mask {
    let (rows, cols) = directions.shape();
    assert_eq!((rows, cols), region.shape(), "one region cell for each direction");
    let counts = accumulation.counts();
    let main_donor = |cell: Cell| {
        let donors = (0..8u8)
            .filter_map(|code| d8::neighbour(cell, code, rows, cols))
            .filter(|&donor| directions.receiver(donor) == Some(cell));
        donors.reduce(|best, next| if counts[next] > counts[best] { next } else { best })
    };
    let mut stems = Grid::filled(rows, cols, false);
    for (exit, _) in region.cells().filter(|(_, inside)| **inside) {
        if directions.receiver(exit).is_some_and(|r| region[r]) {
            continue;
        }
        let mut next = Some(exit);
        while let Some(cell) = next.filter(|&c| region[c]) {
            stems[cell] = true;
            next = main_donor(cell);
        }
    }
    stems
}
