//! Line maps with some of their strokes.

use super::{LineMap, Sketch};
use crate::grid::Cell;
use crate::seed::Seed;
use rand::RngExt;

impl LineMap {
    /// The lines of at most `limit` strokes (lines between junctions): those drawn by a seed, or the longest ones.
    #[must_use]
    pub fn with_strokes(&self, limit: usize, random: Option<Seed>) -> Self {
        let strokes = Sketch::trace(self).strokes;
        let mut order: Vec<usize> = (0..strokes.len()).collect();
        match random {
            // Ties keep the order of the trace.
            None => order.sort_by_key(|&i| std::cmp::Reverse(strokes[i].vertices.len())),
            Some(seed) => {
                let mut stream = seed.stream("order");
                for i in (1..order.len()).rev() {
                    order.swap(i, stream.random_range(0..=i));
                }
            }
        }
        order.truncate(limit);
        order.sort_unstable();
        let (rows, cols) = self.shape();
        let mut kept = Self::empty(rows, cols);
        for vertex in order.iter().flat_map(|&i| &strokes[i].vertices) {
            let cell = Cell::new(vertex.y as usize, vertex.x as usize);
            if let Some(kind) = self.kinds()[cell] {
                kept.set(cell, kind, self.heights()[cell]);
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    #[test]
    fn the_longest_or_random_strokes_are_kept() {
        let mut lines = LineMap::empty(30, 30);
        for (row, length) in [(2, 5), (8, 20), (14, 9), (20, 12)] {
            (0..length).for_each(|col| lines.set(Cell::new(row, col), StrokeKind::Ridge, row as f32));
        }
        assert_eq!(lines.with_strokes(9, None), lines);
        let longest = lines.with_strokes(2, None);
        assert_eq!(longest.line_count(), 32);
        assert_eq!(longest.heights()[Cell::new(8, 19)], 8.0);
        let random = |seed| lines.with_strokes(2, Some(Seed(seed)));
        assert_eq!(random(3), random(3));
        let counts: std::collections::BTreeSet<usize> = (0..20).map(|i| random(i).line_count()).collect();
        assert!(counts.len() > 1, "{counts:?}");
    }
}
