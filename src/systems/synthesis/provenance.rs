//! Where every cell of a synthesis comes from.

use super::source::{Source, step};
use crate::grid::{Cell, Grid};
use crate::sketch::LineMap;

/// What a cell was made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
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

impl Provenance {
    /// `own`: the cell of the exemplar that was given for a cell of the one that was searched.
    pub(super) fn new(sources: &Grid<Source>, lines: &LineMap, own: impl Fn(Cell) -> Cell) -> Self {
        let (rows, cols) = sources.shape();
        let origin = |c: Cell| {
            if lines.kinds()[c].is_some() {
                return Origin::Stroke;
            }
            let source = sources[c];
            Origin::Exemplar { cell: own(source.cell()), symmetry: source.turn }
        };
        Self { origins: Grid::from_fn(rows, cols, origin) }
    }

    /// By cell of the map.
    #[must_use]
    pub const fn origins(&self) -> &Grid<Origin> {
        &self.origins
    }

    /// The step (down, right) in the exemplar that a step on the map stands for in a symmetry: 0 changes nothing, 1 mirrors north
    /// and south, 2 west and east, 3 both; 4 to 7 are the same after rows and columns are exchanged (5 and 6 turn by a quarter).
    ///
    /// # Panics
    /// When `symmetry` is above 7.
    #[must_use]
    pub const fn step(symmetry: u8, down: i32, right: i32) -> (i32, i32) {
        step(symmetry, down, right)
    }
}
