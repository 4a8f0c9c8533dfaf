//! Places of the exemplar, and the eight symmetries in which it is laid.

use crate::grid::{Cell, Grid};
use rayon::prelude::*;

/// Symmetries of the square.
pub(super) const TURNS: u8 = 8;

/// (a, b, c, d) of each symmetry: the step (down, right) on the map is (a down + b right, c down + d right) in the exemplar.
const STEPS: [[i32; 4]; TURNS as usize] = [
    [1, 0, 0, 1],
    [-1, 0, 0, 1],
    [1, 0, 0, -1],
    [-1, 0, 0, -1],
    [0, 1, 1, 0],
    [0, -1, 1, 0],
    [0, 1, -1, 0],
    [0, -1, -1, 0],
];

/// The step in the exemplar for a step on the map.
#[inline(always)]
pub(super) const fn step(turn: u8, down: i32, right: i32) -> (i32, i32) {
    let [a, b, c, d] = STEPS[turn as usize];
    (a * down + b * right, c * down + d * right)
}

/// The step on the map for a step in the exemplar.
#[inline(always)]
pub(super) const fn step_back(turn: u8, down: i32, right: i32) -> (i32, i32) {
    let [a, b, c, d] = STEPS[turn as usize];
    (a * down + c * right, b * down + d * right)
}

/// Where a cell of the map comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Source {
    pub(super) row: u16,
    pub(super) col: u16,
    /// Symmetry, 0 to 7.
    pub(super) turn: u8,
    /// Self-sketch whose guide stood for the place.
    pub(super) set: u8,
}

impl Source {
    #[inline(always)]
    pub(super) const fn new(row: usize, col: usize, turn: u8, set: u8) -> Self {
        Self { row: row as u16, col: col as u16, turn, set }
    }

    pub(super) const fn cell(self) -> Cell {
        Cell { row: self.row as usize, col: self.col as usize }
    }

    /// The source that goes on from this one at a step on the map; it may lie outside the exemplar (then wrapped or negative
    /// places never pass the mask of centres).
    #[inline(always)]
    pub(super) const fn moved(self, down: i32, right: i32) -> (i32, i32) {
        let (row, col) = step(self.turn, down, right);
        (self.row as i32 + row, self.col as i32 + col)
    }

    /// Whether `other`, a step away on the map, goes on from this source.
    #[inline(always)]
    pub(super) fn continues(self, other: Self, down: i32, right: i32) -> bool {
        let (row, col) = self.moved(down, right);
        self.turn == other.turn && i32::from(other.row) == row && i32::from(other.col) == col
    }

    /// The source of each of the four cells that this cell is made of, at twice the size: (down, right) 0 or 1.
    pub(super) const fn finer(self, down: usize, right: usize) -> (usize, usize) {
        let (row, col) = step(self.turn, 2 * down as i32 - 1, 2 * right as i32 - 1);
        (2 * self.row as usize + (row > 0) as usize, 2 * self.col as usize + (col > 0) as usize)
    }
}

/// Which cells of a map of the exemplar may be the centre of a patch, with the nearest such cell for all others.
#[derive(Clone, Debug)]
pub(super) struct Centres {
    allowed: Grid<bool>,
    /// All of them, row by row.
    list: Vec<(u16, u16)>,
}

impl Centres {
    /// Those whose patch of `radius` holds valid cells only; none when there is no such cell.
    pub(super) fn new(valid: &Grid<bool>, radius: usize) -> Option<Self> {
        let (rows, cols) = valid.shape();
        let whole = crate::grid::morphology::erode(valid, radius);
        let inside = |i: usize, side: usize| i >= radius && i + radius < side;
        let allowed = Grid::from_fn(rows, cols, |c| inside(c.row, rows) && inside(c.col, cols) && whole[c]);
        let list: Vec<(u16, u16)> =
            allowed.cells().filter(|(_, on)| **on).map(|(c, _)| (c.row as u16, c.col as u16)).collect();
        (!list.is_empty()).then_some(Self { allowed, list })
    }

    pub(super) fn shape(&self) -> (usize, usize) {
        self.allowed.shape()
    }

    pub(super) fn list(&self) -> &[(u16, u16)] {
        &self.list
    }

    #[inline(always)]
    pub(super) fn allows(&self, row: i32, col: i32) -> bool {
        let (rows, cols) = self.allowed.shape();
        row >= 0
            && col >= 0
            && (row as usize) < rows
            && (col as usize) < cols
            && self.allowed.as_slice()[row as usize * cols + col as usize]
    }

    /// The allowed place that is nearest, searched in growing squares.
    pub(super) fn nearest(&self, row: usize, col: usize) -> (usize, usize) {
        let (row, col) = (row as i32, col as i32);
        if self.allows(row, col) {
            return (row as usize, col as usize);
        }
        let (rows, cols) = self.allowed.shape();
        for reach in 1..rows.max(cols) as i32 {
            let mut best: Option<(i32, i32, i32)> = None;
            for down in -reach..=reach {
                let stride = if down.abs() == reach { 1 } else { 2 * reach };
                for right in (-reach..=reach).step_by(stride as usize) {
                    if self.allows(row + down, col + right) {
                        let candidate = (down * down + right * right, row + down, col + right);
                        best = Some(best.map_or(candidate, |b| b.min(candidate)));
                    }
                }
            }
            if let Some((_, row, col)) = best {
                return (row as usize, col as usize);
            }
        }
        let (row, col) = self.list[0];
        (row as usize, col as usize)
    }
}

/// How often each place of an exemplar of `shape` is used within a patch of `radius` around it, relative to even use.
pub(super) fn usage(sources: &Grid<Source>, shape: (usize, usize), radius: usize) -> Grid<f32> {
    let (rows, cols) = shape;
    let mut sums = vec![0u32; (rows + 1) * (cols + 1)];
    for source in sources.as_slice() {
        sums[(source.row as usize + 1) * (cols + 1) + source.col as usize + 1] += 1;
    }
    // Summed area.
    for row in 1..=rows {
        let mut along = 0;
        for col in 1..=cols {
            let i = row * (cols + 1) + col;
            along += sums[i];
            sums[i] = along + sums[i - cols - 1];
        }
    }
    let side = (2 * radius + 1) as f32;
    let even = (rows * cols) as f32 / sources.len() as f32 / (side * side);
    let mut out = Grid::filled(rows, cols, 0.0);
    out.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, out)| {
        let (top, bottom) = (row.saturating_sub(radius), (row + radius + 1).min(rows));
        for (col, out) in out.iter_mut().enumerate() {
            let (left, right) = (col.saturating_sub(radius), (col + radius + 1).min(cols));
            let at = |row: usize, col: usize| sums[row * (cols + 1) + col];
            *out = even * (at(bottom, right) + at(top, left) - at(bottom, left) - at(top, right)) as f32;
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_there_and_back_and_differ() {
        let mut seen = Vec::new();
        for turn in 0..TURNS {
            let there = step(turn, 2, 1);
            assert_eq!(step_back(turn, there.0, there.1), (2, 1));
            assert!(!seen.contains(&there));
            seen.push(there);
        }
    }

    #[test]
    fn children_of_continuing_sources_continue() {
        for turn in 0..TURNS {
            let source = Source::new(10, 12, turn, 0);
            let child = |down, right| {
                let (row, col) = source.finer(down, right);
                Source::new(row, col, turn, 0)
            };
            assert!(child(0, 0).continues(child(1, 0), 1, 0), "turn {turn}");
            assert!(child(0, 0).continues(child(0, 1), 0, 1));
            let (row, col) = source.moved(0, 1);
            let beside = Source::new(row as usize, col as usize, turn, 0);
            let (row, col) = beside.finer(1, 0);
            assert!(child(1, 1).continues(Source::new(row, col, turn, 0), 0, 1), "turn {turn}");
        }
    }

    #[test]
    fn centres_keep_away_from_voids_and_frame() {
        let valid = Grid::from_fn(12, 15, |c| c != Cell::new(5, 6));
        let centres = Centres::new(&valid, 2).unwrap();
        assert!(
            !centres.allows(5, 8) && centres.allows(5, 9) && !centres.allows(1, 9) && centres.allows(2, 12)
        );
        assert!(!centres.allows(-1, 5) && !centres.allows(5, 15));
        assert_eq!(centres.nearest(5, 8), (5, 9));
        assert_eq!(centres.nearest(0, 0), (2, 2));
        assert!(Centres::new(&Grid::filled(4, 9, true), 2).is_none());
    }

    #[test]
    fn even_use_is_one() {
        let sources = Grid::from_fn(8, 8, |c| Source::new(c.row, c.col, 0, 0));
        let used = usage(&sources, (8, 8), 1);
        assert_eq!(used[Cell::new(4, 4)], 1.0);
        let one_place = Grid::filled(8, 8, Source::new(4, 4, 0, 0));
        let used = usage(&one_place, (8, 8), 1);
        assert!((used[Cell::new(5, 5)] - 64.0 / 9.0).abs() < 1e-5 && used[Cell::new(6, 4)] == 0.0);
    }
}
