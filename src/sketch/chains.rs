//! The cells of one kind as chains between end points and junctions: what tracing and the graph of a sketch share.
//!
//! Two line cells are linked when they share a side, or a corner with neither of the two cells between them on the line:
//! the corner of a staircase is then a point to pass, not a junction. A cell with two links lies inside a chain; any
//! other cell ends chains. Cost: linear in the cells of the map.

use super::{LineMap, StrokeKind};
use crate::grid::{Cell, Grid, d8};

/// Linked cells in order.
#[derive(Debug)]
pub(super) struct Chain {
    /// At least one; a ring does not repeat its first cell.
    pub(super) cells: Vec<Cell>,
    /// Whether the last cell is linked to the first (a ring without junctions).
    pub(super) closed: bool,
}

/// The lines of one kind and how their cells are linked.
pub(super) struct Links<'a> {
    lines: &'a LineMap,
    kind: StrokeKind,
}

impl<'a> Links<'a> {
    pub(super) fn new(lines: &'a LineMap, kind: StrokeKind) -> Self {
        Self { lines, kind }
    }

    fn at(&self, cell: Cell, code: u8) -> Option<Cell> {
        let (rows, cols) = self.lines.shape();
        d8::neighbour(cell, code, rows, cols).filter(|&n| self.lines.kinds()[n] == Some(self.kind))
    }

    /// The cell linked to `cell` in direction `code`.
    fn link(&self, cell: Cell, code: u8) -> Option<Cell> {
        let other = self.at(cell, code)?;
        let is_diagonal = code % 2 == 1;
        let bridged = || self.at(cell, code - 1).is_some() || self.at(cell, (code + 1) % 8).is_some();
        (!(is_diagonal && bridged())).then_some(other)
    }

    /// The cells linked to `cell`, by code.
    pub(super) fn linked(&self, cell: Cell) -> impl Iterator<Item = (u8, Cell)> + '_ {
        (0..8).filter_map(move |code| Some((code, self.link(cell, code)?)))
    }

    /// Whether chains end at `cell`: it has not exactly two links.
    pub(super) fn is_end(&self, cell: Cell) -> bool {
        self.linked(cell).count() != 2
    }

    /// The line cells, row by row.
    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> + '_ {
        let kind = self.kind;
        self.lines.kinds().cells().filter(move |(_, k)| **k == Some(kind)).map(|(cell, _)| cell)
    }

    /// Every link as part of exactly one chain, and cells without links as chains of one cell.
    pub(super) fn chains(&self) -> Vec<Chain> {
        let (rows, cols) = self.lines.shape();
        let mut used = Grid::filled(rows, cols, 0_u8); // a bit for each direction whose link is walked
        let mut chains = Vec::new();
        // Chains from end to end first; what is left has no end at all.
        for closed in [false, true] {
            for start in self.cells().filter(|&cell| closed != self.is_end(cell)) {
                if self.linked(start).next().is_none() {
                    chains.push(Chain { cells: vec![start], closed: false });
                }
                for (code, next) in self.linked(start) {
                    if used[start] & (1 << code) == 0 {
                        let mut cells = self.walk(start, code, next, &mut used);
                        if closed {
                            cells.pop();
                        }
                        chains.push(Chain { cells, closed });
                    }
                }
            }
        }
        chains
    }

    /// Walks from `start` until an end cell, or `start` itself, is reached; both are in the answer.
    fn walk(&self, start: Cell, code: u8, next: Cell, used: &mut Grid<u8>) -> Vec<Cell> {
        let mut cells = vec![start];
        let (mut from, mut code, mut to) = (start, code, next);
        loop {
            used[from] |= 1 << code;
            used[to] |= 1 << d8::opposite(code);
            cells.push(to);
            if to == start || self.is_end(to) {
                return cells;
            }
            let back = d8::opposite(code);
            let Some((onward, beyond)) = self.linked(to).find(|&(c, _)| c != back) else {
                return cells; // unreachable: a cell that is no end has two links
            };
            (from, code, to) = (to, onward, beyond);
        }
    }
}
