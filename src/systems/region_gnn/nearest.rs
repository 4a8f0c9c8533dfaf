//! The k nearest parts of every pixel, exactly (Liu & Benes 2025, 4.2).
//!
//! A part is as near as its nearest cell; ties go to the lower part index. The map is cut into small tiles. A KD-tree over all
//! part cells is asked once a tile for the distance d of the k-th part from the tile's centre, and once for all cells within
//! d + 2r of it, r being the way from the centre to the tile's farthest pixel: no pixel of the tile has its k-th part beyond
//! d + r, so that all cells on which its k parts project are among them. Each pixel then looks through these few cells. Where
//! they are many, far from dense lines, each pixel asks the tree itself. Parallel over rows of tiles.

use super::region::{Projection, Region};
use crate::control::Stop;
use crate::grid::Cell;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Side of a tile, in pixels.
const TILE: usize = 8;
/// With more cells around a tile than this, its pixels ask the tree one by one.
const MOST_CANDIDATES: usize = 1500;

/// The part cells of all regions in a tree.
struct PartCells {
    tree: ImmutableKdTree<f64, 2>,
    /// (row, column) of the cells, region by region and from low to high.
    points: Vec<[f64; 2]>,
    /// Region of each cell.
    owner: Vec<u32>,
    /// First cell of each region.
    first: Vec<u32>,
}

/// A region and where a pixel projects on it.
type Tie = (u32, Projection);

/// The `k` nearest regions of each pixel of a `rows` x `cols` map, nearest first, with the projections on them: (pixels, k).
/// Anything once it is stopped.
///
/// # Panics
/// When there are fewer than `k` regions.
pub(super) fn nearest_regions(
    regions: &[Region],
    rows: usize,
    cols: usize,
    k: usize,
    stop: &Stop,
) -> Vec<Tie> {
    assert!(k > 0 && k <= regions.len(), "k from 1 to the number of regions");
    let cells = PartCells::of(regions);
    let mut out = vec![(0, Projection { index: 0, distance: 0.0 }); rows * cols * k];
    out.par_chunks_mut(TILE * cols * k).enumerate().for_each(|(band, out)| {
        let mut scratch = Scratch::default();
        let height = out.len() / (cols * k);
        for left in (0..cols).step_by(TILE) {
            if stop.is_raised() {
                return;
            }
            let tile = Tile { row: band * TILE, col: left, height, width: TILE.min(cols - left) };
            let candidates = cells.around(&tile, k);
            for row in 0..height {
                for col in left..left + tile.width {
                    let out = &mut out[(row * cols + col) * k..][..k];
                    let pixel = Cell::new(tile.row + row, col);
                    match &candidates {
                        Some(candidates) => scratch.choose(&cells, candidates, pixel, out),
                        None => cells.ask(regions, pixel, out),
                    }
                }
            }
        }
    });
    out
}

/// Some pixels in a rectangle.
struct Tile {
    row: usize,
    col: usize,
    height: usize,
    width: usize,
}

impl Tile {
    /// A pixel in the middle, and the way to the farthest of the others.
    fn centre(&self) -> (Cell, f64) {
        let (down, right) = (self.height / 2, self.width / 2);
        let reach = down.max(self.height - 1 - down) as f64;
        let across = right.max(self.width - 1 - right) as f64;
        (Cell::new(self.row + down, self.col + right), reach.hypot(across))
    }
}

fn position(cell: Cell) -> [f64; 2] {
    [cell.row as f64, cell.col as f64]
}

impl PartCells {
    fn of(regions: &[Region]) -> Self {
        let (mut points, mut owner, mut first) = (Vec::new(), Vec::new(), Vec::new());
        for (id, region) in regions.iter().enumerate() {
            first.push(points.len() as u32);
            points.extend((0..region.cell_count()).map(|i| position(region.cell(i))));
            owner.resize(points.len(), id as u32);
        }
        let tree = ImmutableKdTree::new_from_slice(&points).expect("part cells are distinct points");
        Self { tree, points, owner, first }
    }

    /// Nearest regions of a pixel with their squared distances, sorted: the `k` nearest and all that are as near as the k-th,
    /// perhaps more.
    fn nearest(&self, pixel: Cell, k: usize) -> Vec<(f64, u32)> {
        let pixel = position(pixel);
        let mut found: Vec<(f64, u32)> = Vec::with_capacity(4 * k);
        let mut wanted = 5 * k;
        loop {
            let count = wanted.min(self.points.len());
            let neighbours = self
                .tree
                .query(&pixel)
                .nearest_n::<SquaredEuclidean<f64>>(NonZero::new(count).expect("at least one cell"))
                .execute();
            found.clear();
            for neighbour in &neighbours {
                let id = self.owner[neighbour.item as usize];
                if found.iter().all(|&(_, other)| other != id) {
                    found.push((neighbour.distance, id));
                }
            }
            let complete = count == self.points.len()
                || (found.len() >= k && neighbours.last().is_some_and(|last| last.distance > found[k - 1].0));
            if complete {
                break;
            }
            wanted *= 2;
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found
    }

    /// All cells on which the pixels of a tile may project, in order; `None` when they are too many.
    fn around(&self, tile: &Tile, k: usize) -> Option<Vec<u32>> {
        let (centre, reach) = tile.centre();
        // Beyond what rounding of roots and squares can do.
        let radius = self.nearest(centre, k)[k - 1].0.sqrt() + 2.0 * reach + 1e-3;
        let most = NonZero::new(MOST_CANDIDATES + 1).expect("positive");
        let found = self
            .tree
            .query(&position(centre))
            .nearest_n::<SquaredEuclidean<f64>>(most)
            .within::<SquaredEuclidean<f64>>(radius * radius)
            .unsorted()
            .execute();
        if found.len() > MOST_CANDIDATES {
            return None;
        }
        let mut cells: Vec<u32> = found.iter().map(|n| n.item).collect();
        cells.sort_unstable();
        Some(cells)
    }

    /// Fills `out` for one pixel by asking the tree.
    fn ask(&self, regions: &[Region], pixel: Cell, out: &mut [Tie]) {
        let found = self.nearest(pixel, out.len());
        for (slot, &(_, id)) in out.iter_mut().zip(&found) {
            *slot = (id, regions[id as usize].project(pixel));
        }
    }
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    /// Squared distance of each candidate.
    squares: Vec<f64>,
    /// Squared distance, region and cell, nearest first.
    chosen: Vec<(f64, u32, u32)>,
}

impl Scratch {
    /// Fills `out` for one pixel from the cells around it.
    fn choose(&mut self, cells: &PartCells, candidates: &[u32], pixel: Cell, out: &mut [Tie]) {
        let [row, col] = position(pixel);
        let k = out.len();
        self.squares.clear();
        self.squares.extend(candidates.iter().map(|&cell| {
            let [r, c] = cells.points[cell as usize];
            (r - row) * (r - row) + (c - col) * (c - col)
        }));
        self.chosen.clear();
        let mut at = 0;
        while at < candidates.len() {
            let region = cells.owner[candidates[at] as usize];
            // The first of equally near cells, as `Region::project` has it.
            let mut best = (self.squares[at], region, candidates[at]);
            at += 1;
            while at < candidates.len() && cells.owner[candidates[at] as usize] == region {
                if self.squares[at] < best.0 {
                    best = (self.squares[at], region, candidates[at]);
                }
                at += 1;
            }
            // Regions come in order, so that of equally near ones the lower index stays ahead.
            if self.chosen.len() < k || best.0 < self.chosen[k - 1].0 {
                self.chosen.truncate(k - 1);
                let place = self.chosen.iter().rposition(|c| c.0 <= best.0).map_or(0, |i| i + 1);
                self.chosen.insert(place, best);
            }
        }
        for (slot, &(square, region, cell)) in out.iter_mut().zip(&self.chosen) {
            let index = (cell - cells.first[region as usize]) as usize;
            *slot = (region, Projection { index, distance: (square as f32).sqrt() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{SketchPart, StrokeKind};
    use proptest::prelude::*;

    fn run(row: usize, col: usize, length: usize) -> Region {
        let cells: Vec<Cell> = (0..length).map(|i| Cell::new(row, col + i)).collect();
        let heights = vec![0.5; cells.len()];
        Region::new(&SketchPart { kind: StrokeKind::Ridge, cells, heights })
    }

    fn brute_force(regions: &[Region], pixel: Cell, k: usize) -> Vec<Tie> {
        let mut all: Vec<Tie> =
            regions.iter().enumerate().map(|(id, r)| (id as u32, r.project(pixel))).collect();
        all.sort_by(|a, b| a.1.distance.total_cmp(&b.1.distance).then(a.0.cmp(&b.0)));
        all.truncate(k);
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn equals_brute_force(
            starts in prop::collection::btree_set((0usize..20, 0usize..8), 1..40),
            k in 1usize..12,
            (rows, cols) in (20usize..30, 32usize..50),
        ) {
            // Horizontal runs on distinct slots: many exact ties.
            let regions: Vec<Region> =
                starts.iter().map(|&(row, slot)| run(row, slot * 4, 3 + slot % 2)).collect();
            let k = k.min(regions.len());
            let found = nearest_regions(&regions, rows, cols, k, &Stop::new());
            for pixel in 0..rows * cols {
                let expected = brute_force(&regions, Cell::new(pixel / cols, pixel % cols), k);
                prop_assert_eq!(&found[pixel * k..pixel * k + k], &expected[..]);
            }
        }
    }

    /// A corner full of lines and a wide empty rest, where the cells around a tile are too many.
    #[test]
    fn far_from_dense_lines_too() {
        let regions: Vec<Region> =
            (0..200).flat_map(|row| (0..8).map(move |slot| run(row, slot * 6, 6))).collect();
        let (rows, cols, k) = (200, 1000, 7);
        let cells = PartCells::of(&regions);
        let tile = |col| Tile { row: 96, col, height: 8, width: 8 };
        assert!(cells.around(&tile(984), k).is_none() && cells.around(&tile(16), k).is_some(), "both ways");
        let found = nearest_regions(&regions, rows, cols, k, &Stop::new());
        for pixel in (0..rows * cols).step_by(499) {
            let expected = brute_force(&regions, Cell::new(pixel / cols, pixel % cols), k);
            assert_eq!(&found[pixel * k..pixel * k + k], &expected[..], "{pixel}");
        }
    }
}
