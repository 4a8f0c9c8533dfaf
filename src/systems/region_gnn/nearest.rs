//! The k nearest parts of every pixel, exactly (Liu & Benes 2025, 4.2).
//!
//! A part is as near as its nearest cell. A KD-tree over all part cells is asked for more and more neighbours until k
//! different parts are found and the last neighbour lies beyond the k-th of them, so that ties are complete; ties go to
//! the lower part index. n log n in the number of cells, parallel over pixels.

use super::region::Region;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Region indices of the `k` nearest regions of each pixel of a `rows` x `cols` map: (pixels, k), nearest first.
///
/// # Panics
/// When there are fewer than `k` regions.
pub(super) fn nearest_regions(regions: &[Region], rows: usize, cols: usize, k: usize) -> Vec<u32> {
    assert!(k > 0 && k <= regions.len(), "k from 1 to the number of regions");
    let mut points = Vec::new();
    let mut owner = Vec::new();
    for (id, region) in regions.iter().enumerate() {
        for i in 0..region.cell_count() {
            let cell = region.cell(i);
            points.push([cell.row as f64, cell.col as f64]);
            owner.push(id as u32);
        }
    }
    let tree: ImmutableKdTree<f64, 2> =
        ImmutableKdTree::new_from_slice(&points).expect("part cells are distinct points");
    let mut out = vec![0u32; rows * cols * k];
    out.par_chunks_mut(cols * k).enumerate().for_each(|(row, out)| {
        let mut found: Vec<(f64, u32)> = Vec::with_capacity(4 * k);
        for (col, out) in out.chunks_exact_mut(k).enumerate() {
            let pixel = [row as f64, col as f64];
            let mut wanted = 5 * k;
            loop {
                let count = wanted.min(points.len());
                let neighbours = tree
                    .query(&pixel)
                    .nearest_n::<SquaredEuclidean<f64>>(NonZero::new(count).expect("at least one cell"))
                    .execute();
                found.clear();
                for neighbour in &neighbours {
                    let id = owner[neighbour.item as usize];
                    if found.iter().all(|&(_, other)| other != id) {
                        found.push((neighbour.distance, id));
                    }
                }
                let complete = count == points.len()
                    || (found.len() >= k && neighbours.last().is_some_and(|last| last.distance > found[k - 1].0));
                if complete {
                    break;
                }
                wanted *= 2;
            }
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (slot, &(_, id)) in out.iter_mut().zip(&found) {
                *slot = id;
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::sketch::{SketchPart, StrokeKind};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn equals_brute_force(
            starts in prop::collection::btree_set((0usize..20, 0usize..8), 1..40),
            k in 1usize..12,
        ) {
            // Horizontal runs on distinct slots: many exact ties.
            let regions: Vec<Region> = starts
                .iter()
                .map(|&(row, slot)| {
                    let cells: Vec<Cell> = (0..3 + slot % 2).map(|i| Cell::new(row, slot * 4 + i)).collect();
                    let heights = vec![0.5; cells.len()];
                    Region::new(&SketchPart { kind: StrokeKind::Ridge, cells, heights })
                })
                .collect();
            let k = k.min(regions.len());
            let (rows, cols) = (20, 32);
            let found = nearest_regions(&regions, rows, cols, k);
            for pixel in 0..rows * cols {
                let cell = Cell::new(pixel / cols, pixel % cols);
                let mut all: Vec<(f32, u32)> =
                    regions.iter().enumerate().map(|(id, r)| (r.project(cell).distance, id as u32)).collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let expected: Vec<u32> = all[..k].iter().map(|a| a.1).collect();
                prop_assert_eq!(&found[pixel * k..pixel * k + k], &expected[..]);
            }
        }
    }
}
