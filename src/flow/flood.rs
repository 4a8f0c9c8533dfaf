//! What both floods share: every valid cell ranked from low to high, on a raster with an empty rim.
//!
//! [`Surface`] -> [`Flood`]. Ranking costs one sort of 64-bit keys (n log n); after it, queues hold ranks.

use super::Surface;
use super::directions::{OUTLET, OUTSIDE};
use super::rank_queue::RankQueue;
use crate::grid::{Grid, d8};
use std::cmp::Reverse;

/// Cell not reached yet.
pub(super) const UNSEEN: u8 = 0x20;
/// Flag: the cell has left the queue.
pub(super) const DONE: u8 = 0x40;

/// A cell's height and its place among all cells by (height, depth inside a flat, row, column).
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub(super) height: f32,
    pub(super) rank: u32,
}

/// The state of a flood from the outlets. Cells are positions in a raster with one more row and column on each side.
pub(super) struct Flood {
    rows: usize,
    cols: usize,
    /// Position steps by D8 code.
    pub(super) steps: [isize; 8],
    pub(super) nodes: Vec<Node>,
    /// Position of each rank.
    pub(super) cells: Vec<u32>,
    /// Direction code, [`OUTLET`], [`OUTSIDE`] or [`UNSEEN`], with [`DONE`].
    pub(super) state: Vec<u8>,
    pub(super) queue: RankQueue,
}

impl Flood {
    /// Ranks the cells and queues all outlets, with those that `is_base` (by position row by row) adds to them.
    pub(super) fn new(surface: &Surface, is_base: impl Fn(usize) -> bool) -> Self {
        let (rows, cols) = surface.shape();
        let stride = cols + 2;
        let steps = d8::OFFSETS.map(|(dr, dc)| dr * stride as isize + dc);
        let sorted = sorted_cells(surface);

        let mut nodes = vec![Node { height: 0.0, rank: 0 }; (rows + 2) * stride];
        let mut state = vec![OUTSIDE; nodes.len()];
        let mut cells = Vec::with_capacity(sorted.len());
        let heights = surface.heights().as_slice();
        for (rank, index) in sorted.into_iter().enumerate() {
            let position = (index as usize / cols + 1) * stride + index as usize % cols + 1;
            nodes[position] = Node { height: heights[index as usize], rank: rank as u32 };
            state[position] = UNSEEN;
            cells.push(position as u32);
        }

        let mut queue = RankQueue::new(2 * cells.len());
        for (rank, &position) in cells.iter().enumerate() {
            let here = position as usize;
            let inner = (here / stride - 1) * cols + here % stride - 1;
            if is_base(inner) || steps.iter().any(|&step| state[here.wrapping_add_signed(step)] == OUTSIDE) {
                state[here] = OUTLET;
                queue.insert(rank as u32);
            }
        }
        Self { rows, cols, steps, nodes, cells, state, queue }
    }

    /// Without the rim.
    pub(super) fn inner<T>(&self, value: impl Fn(usize) -> T) -> Grid<T> {
        let stride = self.cols + 2;
        Grid::from_fn(self.rows, self.cols, |c| value((c.row + 1) * stride + c.col + 1))
    }

    /// The direction codes, once the queue is empty.
    pub(super) fn directions(&self) -> Grid<u8> {
        self.inner(|i| if self.state[i] == OUTSIDE { OUTSIDE } else { self.state[i] & !DONE })
    }
}

/// Indices of the valid cells from low to high.
fn sorted_cells(surface: &Surface) -> Vec<u32> {
    let heights = surface.heights().as_slice();
    let valid = surface.valid().as_slice();
    let mut keys: Vec<u64> = (0..heights.len())
        .filter(|&i| valid[i])
        .map(|i| u64::from(ordered_bits(heights[i])) << 32 | i as u64)
        .collect();
    keys.sort_unstable();
    if let Some(depth) = surface.flat_depth() {
        let depth = depth.as_slice();
        for ties in keys.chunk_by_mut(|a, b| a >> 32 == b >> 32) {
            ties.sort_by_key(|key| Reverse(depth[*key as u32 as usize]));
        }
    }
    keys.into_iter().map(|key| key as u32).collect()
}

/// Bits of a finite height that compare like the height; both zeros alike.
fn ordered_bits(height: f32) -> u32 {
    let bits = (height + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_compare_like_heights() {
        let heights = [f32::MIN, -2.5, -1e-30, -0.0, 0.0, 1e-30, 3.0, f32::MAX];
        for pair in heights.windows(2) {
            assert_eq!(
                ordered_bits(pair[0]).cmp(&ordered_bits(pair[1])),
                pair[0].partial_cmp(&pair[1]).unwrap()
            );
        }
    }
}
