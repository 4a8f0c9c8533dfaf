//! Where the landscape is solved: the map with a pad around it, at one of several resolutions.
//!
//! Lines -> [`Domain`] -> [`Ground`]. The frame of a map is no coast, so base levels lie beyond it: the pad's outer cells. A
//! valley that ends at the frame goes on straight through the pad.

use crate::flow::Role;
use crate::grid::{Cell, Grid, d8};
use crate::sketch::{LineMap, StrokeKind};

/// Cells between the map's frame and the outer base levels.
pub(super) const PAD: usize = 32;
/// The pad and the domain are multiples of this.
pub(super) const COARSEST: usize = 4;
/// A valley that ends within this many cells of the frame goes on beyond it.
const REACH: usize = 9;
/// Cells of a valley that its direction at the end is taken from.
const TANGENT: usize = 8;

/// The padded map with what is drawn on it.
pub(super) struct Domain {
    rows: usize,
    cols: usize,
    marks: Vec<Mark>,
}

struct Mark {
    row: usize,
    col: usize,
    kind: StrokeKind,
    height: f32,
}

impl Domain {
    pub(super) fn new(lines: &LineMap) -> Self {
        let padded = |side: usize| (side + 2 * PAD).next_multiple_of(COARSEST);
        let (rows, cols) = (padded(lines.shape().0), padded(lines.shape().1));
        let marks = lines.kinds().cells().filter_map(|(c, &kind)| {
            Some(Mark { row: c.row + PAD, col: c.col + PAD, kind: kind?, height: lines.heights()[c] })
        });
        let mut domain = Self { rows, cols, marks: marks.collect() };
        let valley = |c: Cell| lines.kinds()[c] == Some(StrokeKind::Valley);
        for (end, _) in lines.kinds().cells().filter(|(c, _)| valley(*c)) {
            domain.extend(lines, end);
        }
        domain
    }

    /// Continues a valley that ends at `end`, close to the frame.
    fn extend(&mut self, lines: &LineMap, end: Cell) {
        let (rows, cols) = lines.shape();
        let neighbours = |cell: Cell| (0..8).filter_map(move |code| d8::neighbour(cell, code, rows, cols));
        let valley = |c: &Cell| lines.kinds()[*c] == Some(StrokeKind::Valley);
        let gaps = [end.row, rows - 1 - end.row, end.col, cols - 1 - end.col];
        let Some(side) = (0..4).min_by_key(|&side| gaps[side]).filter(|&side| gaps[side] <= REACH) else {
            return;
        };
        // One neighbour, or two that touch each other: the corner of a staircase.
        let near: Vec<Cell> = neighbours(end).filter(valley).collect();
        match near[..] {
            [_] => {}
            [a, b] if a.touches(b) => {}
            _ => return,
        }
        let mut inner = vec![end];
        while inner.len() <= TANGENT {
            let here = inner[inner.len() - 1];
            let from = end;
            let next = neighbours(here).filter(valley).filter(|c| !inner.contains(c));
            let Some(next) = next.max_by_key(|c| (c.distance_squared(from), c.row, c.col)) else { break };
            inner.push(next);
        }
        let back = inner[inner.len() - 1];
        let normal = [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)][side];
        let way = (end.row as f64 - back.row as f64, end.col as f64 - back.col as f64);
        let unit = |v: (f64, f64)| {
            let length = v.0.hypot(v.1).max(1e-9);
            (v.0 / length, v.1 / length)
        };
        let along = |v: (f64, f64)| v.0 * normal.0 + v.1 * normal.1;
        let mut way = unit(way);
        if along(way) < 0.35 {
            way = unit((way.0 + normal.0, way.1 + normal.1));
        }
        if along(way) < 0.2 {
            way = normal;
        }
        let length = ((PAD + COARSEST + gaps[side]) as f64 / along(way).max(0.3)).ceil() as usize;
        for step in 1..=length {
            let row = (end.row + PAD) as f64 + step as f64 * way.0;
            let col = (end.col + PAD) as f64 + step as f64 * way.1;
            let (row, col) = (row.round(), col.round());
            if row < 0.0 || col < 0.0 || row >= self.rows as f64 || col >= self.cols as f64 {
                break;
            }
            let mark = Mark {
                row: row as usize,
                col: col as usize,
                kind: StrokeKind::Valley,
                height: lines.heights()[end],
            };
            self.marks.push(mark);
        }
    }

    /// (rows, columns) at cells `factor` times as large as the map's.
    pub(super) const fn shape(&self, factor: usize) -> (usize, usize) {
        (self.rows / factor, self.cols / factor)
    }

    /// What is drawn, at cells `factor` times as large as the map's. A cell with a valley is a valley's.
    pub(super) fn ground(&self, factor: usize) -> Ground {
        let (rows, cols) = self.shape(factor);
        let mut sums = Grid::filled(rows, cols, [(0.0f64, 0u32); 2]);
        for mark in &self.marks {
            let (sum, count) = &mut sums[Cell::new(mark.row / factor, mark.col / factor)]
                [usize::from(mark.kind == StrokeKind::Valley)];
            *sum += f64::from(mark.height);
            *count += 1;
        }
        let drawn = sums.map(|&[ridge, valley]| match (ridge, valley) {
            (_, (sum, count)) if count > 0 => Some((StrokeKind::Valley, (sum / f64::from(count)) as f32)),
            ((sum, count), _) if count > 0 => Some((StrokeKind::Ridge, (sum / f64::from(count)) as f32)),
            _ => None,
        });
        Ground { drawn }
    }
}

/// What is drawn on the padded map at one resolution.
pub(super) struct Ground {
    /// Kind and mean height of the lines in each cell.
    pub(super) drawn: Grid<Option<(StrokeKind, f32)>>,
}

/// A cell whose height the lines speak of: a ridge's own, or one beside a line that is not to pass it.
pub(super) struct Witness {
    pub(super) index: usize,
    /// Lowest and highest height allowed, metres.
    pub(super) allowed: (f32, f32),
}

impl Ground {
    pub(super) fn mask_of(&self, kind: StrokeKind) -> Grid<bool> {
        self.drawn.map(|drawn| drawn.is_some_and(|(k, _)| k == kind))
    }

    pub(super) fn heights(&self) -> Grid<f64> {
        self.drawn.map(|drawn| drawn.map_or(0.0, |(_, z)| f64::from(z)))
    }

    pub(super) fn is_outer(&self, index: usize) -> bool {
        let (rows, cols) = self.drawn.shape();
        let (row, col) = (index / cols, index % cols);
        row == 0 || col == 0 || row + 1 == rows || col + 1 == cols
    }

    /// Valleys and the outer cells are bases, ridges divides.
    pub(super) fn roles(&self) -> Grid<Role> {
        let (rows, cols) = self.drawn.shape();
        Grid::from_fn(rows, cols, |c| match self.drawn[c] {
            _ if self.is_outer(c.row * cols + c.col) => Role::Base,
            Some((StrokeKind::Valley, _)) => Role::Base,
            Some((StrokeKind::Ridge, _)) => Role::Divide,
            None => Role::Ground,
        })
    }

    /// Ridge cells, and the cells beside a line: none of these lies below a valley that it touches, nor, else, above a ridge.
    pub(super) fn witnesses(&self) -> Vec<Witness> {
        let (rows, cols) = self.drawn.shape();
        let witness = |(cell, drawn): (Cell, &Option<(StrokeKind, f32)>)| {
            let index = cell.row * cols + cell.col;
            let allowed = match drawn {
                _ if self.is_outer(index) => return None,
                Some((StrokeKind::Valley, _)) => return None,
                Some((StrokeKind::Ridge, z)) => (*z, *z),
                None => {
                    let around = (0..8).filter_map(|code| self.drawn[d8::neighbour(cell, code, rows, cols)?]);
                    around.fold((f32::NEG_INFINITY, f32::INFINITY), |(low, high), (kind, z)| match kind {
                        StrokeKind::Valley => (low.max(z), high),
                        StrokeKind::Ridge => (low, high.min(z)),
                    })
                }
            };
            allowed.0.max(-allowed.1).is_finite().then_some(Witness { index, allowed })
        };
        self.drawn.cells().filter_map(witness).collect()
    }
}
