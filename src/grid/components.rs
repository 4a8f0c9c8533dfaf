//! Connected pieces of a mask.
//!
//! Mask -> labels. 8-connected, numbered from 0 in the order of each piece's first cell row by row. Linear in the cells.

use super::{Grid, Mask, d8};

/// The 8-connected pieces of a mask.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Components {
    labels: Grid<Option<u32>>,
    sizes: Vec<usize>,
}

impl Components {
    /// Finds the pieces of `mask`.
    #[must_use]
    pub(crate) fn of(mask: &Mask) -> Self {
        let (rows, cols) = mask.shape();
        let mut labels = Grid::filled(rows, cols, None);
        let mut sizes = Vec::new();
        let mut stack = Vec::new();
        for (start, _) in mask.cells().filter(|(_, v)| **v) {
            if labels[start].is_some() {
                continue;
            }
            let label = sizes.len() as u32;
            let mut size = 0;
            labels[start] = Some(label);
            stack.push(start);
            while let Some(cell) = stack.pop() {
                size += 1;
                for there in (0..8).filter_map(|code| d8::neighbour(cell, code, rows, cols)) {
                    if mask[there] && labels[there].is_none() {
                        labels[there] = Some(label);
                        stack.push(there);
                    }
                }
            }
            sizes.push(size);
        }
        Self { labels, sizes }
    }

    /// The piece of each cell; `None` off the mask.
    #[must_use]
    pub(crate) fn labels(&self) -> &Grid<Option<u32>> {
        &self.labels
    }

    /// Number of pieces.
    #[must_use]
    pub(crate) fn count(&self) -> usize {
        self.sizes.len()
    }

    /// Cells in each piece, by label.
    #[must_use]
    pub(crate) fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// True at the cells of the pieces for which `keep(label)` holds.
    #[must_use]
    pub(crate) fn select(&self, mut keep: impl FnMut(usize) -> bool) -> Mask {
        let kept: Vec<bool> = (0..self.count()).map(&mut keep).collect();
        self.labels.map(|label| label.is_some_and(|l| kept[l as usize]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    #[test]
    fn diagonal_neighbours_belong_together() {
        let art = ["##...", "..#..", "#....", "#...#"];
        let mask = Grid::from_fn(4, 5, |c| art[c.row].as_bytes()[c.col] == b'#');
        let pieces = Components::of(&mask);
        assert_eq!(pieces.sizes(), [3, 2, 1]);
        assert_eq!(pieces.labels()[Cell::new(1, 2)], Some(0));
        assert_eq!(pieces.labels()[Cell::new(1, 1)], None);
        let long = pieces.select(|l| pieces.sizes()[l] > 1);
        assert_eq!(long.as_slice().iter().filter(|&&v| v).count(), 5);
    }
}
