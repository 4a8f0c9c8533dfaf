//! Cuts one-cell-wide lines into short parts (Liu & Benes 2025, 4.1, "Contour Part Extraction").
//!
//! [`LineMap`] -> [`SketchPart`]s of 5 to 10 cells, or as many as [`PartLengths`] says. Per kind, ridges first: each
//! connected line is walked depth-first from an end point, the walk is cut wherever two consecutive cells do not touch,
//! and each run is cut into random lengths.
//!
//! Departures: (1) the paper drops what is left of a run when it is shorter than the minimum; here the last two pieces
//! of a run share its cells, so that only runs that are short as a whole are lost; (2) short runs can be kept, because a
//! user who draws four pixels expects to see them. Cost: linear in the number of cells of the map.

use super::{LineMap, SketchPart, StrokeKind};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::seed::{Seed, Stream};
use rand::RngExt;

/// How long parts are, in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PartLengths {
    /// Fewest cells of a part; 5 in the paper (3, 4.1).
    pub(crate) min: usize,
    /// Most cells of a part; 10 in the paper (3, 4.1).
    pub(crate) max: usize,
    /// Whether runs shorter than `min` become parts of their own. The paper drops them, which is right for lines
    /// extracted from a DEM, where they are noise; with `true` every line cell belongs to exactly one part, which is
    /// right for what a user drew ([`PartLengths::drawn`]).
    pub(crate) keep_short: bool,
}

impl Default for PartLengths {
    /// The paper's 5 to 10, shorter runs dropped.
    fn default() -> Self {
        Self { min: 5, max: 10, keep_short: false }
    }
}

impl PartLengths {
    /// The longest part that is allowed; alignment compares parts in machine words of 64 steps.
    pub(crate) const LONGEST: usize = 64;

    /// 5 to 10 cells with nothing dropped: for drawn strokes.
    #[must_use]
    pub(crate) fn drawn() -> Self {
        Self { keep_short: true, ..Self::default() }
    }

    /// # Errors
    /// When `min` is 0, above `max`, or `max` above [`LONGEST`](Self::LONGEST).
    pub(crate) fn validate(&self) -> Result<()> {
        if self.min == 0 || self.min > self.max || self.max > Self::LONGEST {
            return Err(Error::value(
                "part lengths",
                format!("{} to {}", self.min, self.max),
                format!("allowed: 1 <= min <= max <= {}", Self::LONGEST),
            ));
        }
        Ok(())
    }
}

/// Cuts `lines` into parts: ridges first, then valleys, each in the order in which their lines are met row by row.
///
/// Heights keep the unit of `lines`. The cuts come from the stream "parts" of `seed`; the same lines with another seed
/// give other parts.
///
/// # Panics
/// When `lengths` is not [valid](PartLengths::validate).
#[must_use]
pub fn split_parts(lines: &LineMap, lengths: PartLengths, seed: Seed) -> Vec<SketchPart> {
    lengths.validate().expect("part lengths are checked at the door");
    let mut stream = seed.stream("parts");
    let mut parts = Vec::new();
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        for run in runs_of(lines, kind) {
            for piece in pieces(run.len(), lengths, &mut stream) {
                let cells = run[piece].to_vec();
                let heights = cells.iter().map(|&cell| lines.heights()[cell]).collect();
                parts.push(SketchPart { kind, cells, heights });
            }
        }
    }
    parts
}

/// Depth-first walks over the lines of one kind, cut where consecutive cells do not touch.
fn runs_of(lines: &LineMap, kind: StrokeKind) -> Vec<Vec<Cell>> {
    let (rows, cols) = lines.shape();
    let is_line = |cell: Cell| lines.kinds()[cell] == Some(kind);
    let line_cells = || lines.kinds().cells().filter(|(_, k)| **k == Some(kind)).map(|(cell, _)| cell);
    let degree = |cell: Cell| neighbours(cell, rows, cols).filter(|&n| is_line(n)).count();

    let mut visited = Grid::filled(rows, cols, false);
    let mut runs = Vec::new();
    let mut stack = Vec::new();
    // End points first; whatever is left afterwards are lines without an end (rings), which start at their first cell.
    // A whole connected line is taken at a time, so the degrees of the others never change.
    for start in line_cells().filter(|&cell| degree(cell) <= 1).chain(line_cells()) {
        if visited[start] {
            continue;
        }
        let mut run: Vec<Cell> = Vec::new();
        stack.push(start);
        while let Some(cell) = stack.pop() {
            if std::mem::replace(&mut visited[cell], true) {
                continue;
            }
            if run.last().is_some_and(|last| !last.touches(cell)) {
                runs.push(std::mem::take(&mut run));
            }
            run.push(cell);
            let from = stack.len();
            stack.extend(neighbours(cell, rows, cols).filter(|&n| is_line(n) && !visited[n]));
            stack[from..].reverse();
        }
        runs.push(run);
    }
    runs
}

/// The neighbours in walking order: sides before diagonals, so that the walk takes the corner cells of a staircase with
/// it instead of leaving them behind as runs of one cell.
fn neighbours(cell: Cell, rows: usize, cols: usize) -> impl Iterator<Item = Cell> {
    use crate::grid::d8;
    const N_S_W_E_THEN_DIAGONALS: [u8; 8] = [2, 6, 4, 0, 3, 1, 5, 7];
    N_S_W_E_THEN_DIAGONALS.into_iter().filter_map(move |code| d8::neighbour(cell, code, rows, cols))
}

/// Cuts `0..len` into random lengths of `min..=max`.
fn pieces(len: usize, lengths: PartLengths, stream: &mut Stream) -> Vec<std::ops::Range<usize>> {
    let PartLengths { min, max, keep_short } = lengths;
    let mut cuts = Vec::new();
    let mut start = 0;
    while len - start >= min {
        let left = len - start;
        let mut take = stream.random_range(min..=max).min(left);
        if left - take < min {
            // What would be left is too short for a part: take it along, or leave it a few of ours.
            take = if left <= max { left } else { take.min(left - min).max(min) };
        }
        cuts.push(start..start + take);
        start += take;
    }
    if keep_short && start < len {
        cuts.push(start..len);
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn map(picture: &[&str]) -> LineMap {
        let mut lines = LineMap::empty(picture.len(), picture[0].len());
        for (row, text) in picture.iter().enumerate() {
            for (col, c) in text.chars().enumerate() {
                let kind = match c {
                    'r' => StrokeKind::Ridge,
                    'v' => StrokeKind::Valley,
                    _ => continue,
                };
                lines.set(Cell::new(row, col), kind, (row * 100 + col) as f32);
            }
        }
        lines
    }

    #[test]
    fn a_line_starts_at_an_end_and_keeps_its_heights() {
        let lines = map(&["....rrr", "...r...", "rrr....", "......."]);
        let parts = split_parts(&lines, PartLengths::default(), Seed(3));
        assert_eq!(parts.len(), 1, "seven cells cannot be two parts");
        let expected = [(0, 6), (0, 5), (0, 4), (1, 3), (2, 2), (2, 1), (2, 0)];
        assert_eq!(parts[0].cells, expected.map(|(r, c)| Cell::new(r, c)));
        assert_eq!(parts[0].heights, expected.map(|(r, c)| (r * 100 + c) as f32));
    }

    #[test]
    fn branches_cut_the_walk_and_short_ones_go() {
        let lines = map(&["rrrrrrrrr", "....r....", "....r....", "........."]);
        let dropped: usize =
            split_parts(&lines, PartLengths::default(), Seed(1)).iter().map(|p| p.cells.len()).sum();
        let kept = split_parts(&lines, PartLengths::drawn(), Seed(1));
        assert!(dropped < 11, "some branch is shorter than five");
        assert_eq!(kept.iter().map(|p| p.cells.len()).sum::<usize>(), 11);
    }

    #[test]
    fn a_point_and_a_short_stroke_survive_only_when_kept() {
        let lines = map(&["r......", "......v", ".....v.", "....v.."]);
        assert!(split_parts(&lines, PartLengths::default(), Seed(1)).is_empty());
        let kept = split_parts(&lines, PartLengths::drawn(), Seed(1));
        assert_eq!(
            kept.iter().map(|p| (p.kind, p.cells.len())).collect::<Vec<_>>(),
            [(StrokeKind::Ridge, 1), (StrokeKind::Valley, 3)]
        );
    }

    #[test]
    fn a_ring_is_walked_whole() {
        let lines = map(&[".vvvv.", "v....v", "v....v", "v....v", ".vvvv."]);
        let parts = split_parts(&lines, PartLengths::default(), Seed(5));
        assert_eq!(parts.iter().map(|p| p.cells.len()).sum::<usize>(), 14);
        assert_eq!(parts[0].cells[0], Cell::new(0, 1));
    }

    #[test]
    fn no_cell_of_a_long_run_is_lost() {
        let mut stream = Seed(1).stream("test");
        let mut seen = [0; 11];
        for len in 5..200 {
            let cuts = pieces(len, PartLengths::default(), &mut stream);
            assert_eq!(cuts.last().map(|c| c.end), Some(len), "a run of {len} is cut without a rest");
            cuts.iter().for_each(|c| seen[c.len()] += 1);
        }
        assert!(seen[..5].iter().all(|&n| n == 0) && seen[5..].iter().all(|&n| n > 0), "{seen:?}");
    }

    #[test]
    fn impossible_lengths_are_refused() {
        for (min, max) in [(0, 3), (6, 5), (5, 65)] {
            let message = PartLengths { min, max, keep_short: false }.validate().unwrap_err().to_string();
            assert!(message.contains("part lengths") && message.contains("allowed"), "{message}");
        }
    }

    /// Runs over lines of real terrain, equal to those of an independent program (tests/oracle/split_runs.py).
    #[test]
    fn runs_equal_the_oracle() {
        #[derive(serde::Deserialize)]
        struct Oracle {
            side: usize,
            runs: Vec<Vec<usize>>,
        }
        let text = include_str!("../../tests/oracle/split_runs.json");
        let Oracle { side, runs } = serde_json::from_str(text).unwrap();
        let cell = |&i: &usize| Cell::new(i / side, i % side);
        let mut lines = LineMap::empty(side, side);
        runs.iter().flatten().for_each(|i| lines.set(cell(i), StrokeKind::Valley, 1.0));
        assert!(lines.line_count() > 200);
        let expected: Vec<Vec<Cell>> = runs.iter().map(|run| run.iter().map(cell).collect()).collect();
        assert_eq!(runs_of(&lines, StrokeKind::Valley), expected);
    }

    proptest! {
        #[test]
        fn parts_are_disjoint_runs_of_one_kind(
            cells in prop::collection::vec(0_u8..6, 15 * 17), seed: u64, keep_short: bool,
        ) {
            let mut lines = LineMap::empty(15, 17);
            for (i, &c) in cells.iter().enumerate().filter(|(_, c)| **c < 2) {
                let kind = if c == 0 { StrokeKind::Ridge } else { StrokeKind::Valley };
                lines.set(Cell::new(i / 17, i % 17), kind, i as f32);
            }
            let lengths = PartLengths { keep_short, ..PartLengths::default() };
            let parts = split_parts(&lines, lengths, Seed(seed));
            prop_assert_eq!(&parts, &split_parts(&lines, lengths, Seed(seed)));
            let mut owner = Grid::filled(15, 17, false);
            for part in &parts {
                prop_assert!(part.cells.len() <= 10 && (keep_short || part.cells.len() >= 5));
                prop_assert!(part.cells.windows(2).all(|w| w[0] != w[1] && w[0].touches(w[1])));
                for (&cell, &z) in part.cells.iter().zip(&part.heights) {
                    prop_assert!(!std::mem::replace(&mut owner[cell], true), "{:?} twice", cell);
                    prop_assert_eq!(lines.kinds()[cell], Some(part.kind));
                    prop_assert_eq!(lines.heights()[cell], z);
                }
            }
            if keep_short {
                prop_assert_eq!(owner, lines.mask());
            }
        }
    }
}
