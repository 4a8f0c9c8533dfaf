//! Where terrain that was made from an exemplar comes from, and how much of it is a copy.
//!
//! A system that lays pieces of its exemplar gives a [`Provenance`]: for every cell the place whose form it has. Its audit needs no
//! search through the exemplar ([`copy_audit`](super::copy_audit) does), and sees a copy however it was turned, stretched or raised.

use crate::grid::{Cell, Grid, d8};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A piece with more cells than this (20x20) is a copy that can be recognised.
const LARGE_PIECE: usize = 20 * 20;

/// What a cell was made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// A stroke gave the height.
    Stroke,
    /// A place of the exemplar gave the form: the gradient there, in one of the eight symmetries.
    Exemplar {
        /// The cell of the exemplar.
        cell: Cell,
        /// Symmetry, 0 to 7; see [`Provenance::step`].
        symmetry: u8,
    },
}

/// The origin of every cell of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance {
    origins: Grid<Origin>,
}

/// What the origins say about copying.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceAudit {
    /// Share of the cells in pieces of more than 400 cells (20x20): cells joined along their sides in which every step on the map is the
    /// same step in the exemplar. Strokes end a piece.
    pub verbatim_share: f64,
    /// Cells of the largest such piece.
    pub largest_piece: usize,
    /// How often the place that is used most is used.
    pub most_uses: usize,
    /// How often a place that is used at all is used, on average; 0 where all is strokes.
    pub mean_uses: f64,
}

impl Provenance {
    /// The origins by cell of the map.
    ///
    /// # Panics
    /// When a symmetry is above 7.
    #[must_use]
    pub(crate) fn new(origins: Grid<Origin>) -> Self {
        let known = |origin: &Origin| !matches!(origin, Origin::Exemplar { symmetry: 8.., .. });
        assert!(origins.as_slice().iter().all(known), "a square has eight symmetries");
        Self { origins }
    }

    /// By cell of the map.
    #[must_use]
    pub(crate) const fn origins(&self) -> &Grid<Origin> {
        &self.origins
    }

    /// The step (down, right) in the exemplar that a step on the map stands for in a symmetry: 0 changes nothing, 1 mirrors north
    /// and south, 2 west and east, 3 both; 4 to 7 are the same after rows and columns are exchanged (5 and 6 turn by a quarter).
    #[must_use]
    pub(crate) const fn step(symmetry: u8, down: i32, right: i32) -> (i32, i32) {
        let (down, right) = if symmetry & 4 == 0 { (down, right) } else { (right, down) };
        (if symmetry & 1 == 0 { down } else { -down }, if symmetry & 2 == 0 { right } else { -right })
    }

    /// Whether the cell at a step of the map, `there`, goes on from `here` in the exemplar.
    fn continues(here: Origin, there: Origin, (down, right): (i32, i32)) -> bool {
        let (Origin::Exemplar { cell, symmetry }, Origin::Exemplar { cell: next, symmetry: other }) =
            (here, there)
        else {
            return false;
        };
        let (down, right) = Self::step(symmetry, down, right);
        let goes_on = |a: usize, step: i32, b: usize| a.checked_add_signed(step as isize) == Some(b);
        symmetry == other && goes_on(cell.row, down, next.row) && goes_on(cell.col, right, next.col)
    }

    /// The number of the piece of every cell, from 0 row by row, and the cells of each piece. A cell of a stroke is a piece of its own.
    #[must_use]
    pub(crate) fn pieces(&self) -> (Grid<usize>, Vec<usize>) {
        let (rows, cols) = self.origins.shape();
        let mut pieces = Grid::filled(rows, cols, usize::MAX);
        let mut sizes = Vec::new();
        for start in self.origins.cells().map(|(cell, _)| cell) {
            if pieces[start] != usize::MAX {
                continue;
            }
            let mut open = vec![start];
            pieces[start] = sizes.len();
            let mut size = 0;
            while let Some(here) = open.pop() {
                size += 1;
                for code in (0..8).step_by(2) {
                    let Some(there) = d8::neighbour(here, code, rows, cols) else { continue };
                    let step = (there.row as i32 - here.row as i32, there.col as i32 - here.col as i32);
                    if pieces[there] == usize::MAX
                        && Self::continues(self.origins[here], self.origins[there], step)
                    {
                        pieces[there] = sizes.len();
                        open.push(there);
                    }
                }
            }
            sizes.push(size);
        }
        (pieces, sizes)
    }

    /// How much of the map is large pieces of the exemplar, and how often places are used.
    #[must_use]
    pub(crate) fn audit(&self) -> SourceAudit {
        let (_, sizes) = self.pieces();
        let copied: usize = sizes.iter().filter(|size| **size > LARGE_PIECE).sum();
        let mut uses: BTreeMap<Cell, usize> = BTreeMap::new();
        for origin in self.origins.as_slice() {
            if let Origin::Exemplar { cell, .. } = origin {
                *uses.entry(*cell).or_default() += 1;
            }
        }
        SourceAudit {
            verbatim_share: copied as f64 / self.origins.len().max(1) as f64,
            largest_piece: sizes.into_iter().max().unwrap_or(0),
            most_uses: uses.values().copied().max().unwrap_or(0),
            mean_uses: uses.values().sum::<usize>() as f64 / uses.len().max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(symmetry: u8, start: (i32, i32), rows: usize, cols: usize) -> Grid<Origin> {
        Grid::from_fn(rows, cols, |c| {
            let (down, right) = Provenance::step(symmetry, c.row as i32, c.col as i32);
            let cell = Cell::new((start.0 + down) as usize, (start.1 + right) as usize);
            Origin::Exemplar { cell, symmetry }
        })
    }

    #[test]
    fn one_piece_is_a_copy_in_every_symmetry() {
        for symmetry in 0..8 {
            let audit = Provenance::new(from(symmetry, (40, 40), 24, 30)).audit();
            assert_eq!((audit.verbatim_share, audit.largest_piece), (1.0, 24 * 30), "symmetry {symmetry}");
            assert_eq!((audit.most_uses, audit.mean_uses), (1, 1.0));
        }
    }

    #[test]
    fn pieces_of_400_cells_are_no_copies_yet() {
        // Two halves from apart, of 20x20 and 20x21 cells.
        let (left, right) = (from(0, (0, 0), 20, 41), from(0, (50, 0), 20, 41));
        let both = Grid::from_fn(20, 41, |c| if c.col < 20 { left[c] } else { right[c] });
        let audit = Provenance::new(both).audit();
        assert_eq!((audit.verbatim_share, audit.largest_piece), (21.0 / 41.0, 420));
        // The same places in another symmetry are no piece.
        let turned = Grid::from_fn(24, 24, |c| match from(0, (30, 30), 24, 24)[c] {
            Origin::Exemplar { cell, .. } => Origin::Exemplar { cell, symmetry: 3 },
            stroke => stroke,
        });
        assert_eq!(Provenance::new(turned).audit().largest_piece, 1);
    }

    #[test]
    fn strokes_end_a_piece_and_uses_are_counted() {
        let mut origins = from(0, (0, 0), 30, 30);
        for row in 0..30 {
            origins[Cell::new(row, 14)] = Origin::Stroke;
        }
        let audit = Provenance::new(origins.clone()).audit();
        assert_eq!(audit.largest_piece, 15 * 30);
        assert_eq!(audit.verbatim_share, 870.0 / 900.0);
        for col in 0..7 {
            origins[Cell::new(3, col)] = Origin::Exemplar { cell: Cell::new(29, 29), symmetry: 0 };
        }
        let audit = Provenance::new(origins).audit();
        assert_eq!(audit.most_uses, 8);
        assert!((audit.mean_uses - 870.0 / 863.0).abs() < 1e-12, "{audit:?}");
    }
}
