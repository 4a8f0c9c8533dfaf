//! The exact search for the best exemplar patch, with the paper's bidirectional normalisation (Granot et al. 2022, Eq. 2).

use crate::grid::Grid;
use rayon::prelude::*;

/// Side of a patch, cells (7 in the paper's code).
pub(super) const SIDE: usize = 7;
/// Values of a patch with zeros up to whole registers.
const PADDED: usize = 64;
/// Queries of one task: their patches stay in the cache while the keys pass by.
const BLOCK: usize = 64;

/// All patches of a raster without their means.
pub(super) struct Patches {
    values: Vec<[f32; PADDED]>,
    means: Vec<f32>,
    squares: Vec<f32>,
}

impl Patches {
    /// Every window, row by row.
    pub(super) fn of(raster: &Grid<f32>) -> Self {
        let (rows, cols) = raster.shape();
        let z = raster.as_slice();
        let (mut values, mut means, mut squares) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..=rows - SIDE {
            for col in 0..=cols - SIDE {
                let mut patch = [0.0; PADDED];
                for i in 0..SIDE {
                    let start = (row + i) * cols + col;
                    patch[i * SIDE..(i + 1) * SIDE].copy_from_slice(&z[start..start + SIDE]);
                }
                let mean = patch.iter().sum::<f32>() / (SIDE * SIDE) as f32;
                patch[..SIDE * SIDE].iter_mut().for_each(|v| *v -= mean);
                squares.push(patch.iter().map(|v| v * v).sum());
                values.push(patch);
                means.push(mean);
            }
        }
        Self { values, means, squares }
    }

    pub(super) fn patch(&self, i: usize) -> &[f32; PADDED] {
        &self.values[i]
    }

    pub(super) fn mean(&self, i: usize) -> f32 {
        self.means[i]
    }

    /// Mean squared norm of the patches.
    pub(super) fn mean_square(&self) -> f32 {
        (self.squares.iter().map(|s| f64::from(*s)).sum::<f64>() / self.squares.len() as f64) as f32
    }

    /// Squared distance to a patch of another raster.
    #[inline]
    fn distance(&self, i: usize, other: &Self, j: usize) -> f32 {
        let (a, b) = (&self.values[i], &other.values[j]);
        let mut lanes = [0.0f32; 8];
        for c in 0..PADDED / 8 {
            for l in 0..8 {
                lanes[l] += a[c * 8 + l] * b[c * 8 + l];
            }
        }
        (self.squares[i] + other.squares[j] - 2.0 * lanes.iter().sum::<f32>()).max(0.0)
    }
}

/// The key of every query with the smallest d(q, k) / (alpha + min over queries of d(., k)); the first of equal ones.
pub(super) fn best_keys(queries: &Patches, keys: &Patches, alpha: f32) -> Vec<usize> {
    let nearest: Vec<f32> = (0..keys.values.len())
        .into_par_iter()
        .map(|k| {
            (0..queries.values.len()).map(|q| keys.distance(k, queries, q)).fold(f32::INFINITY, f32::min)
        })
        .collect();
    let wants: Vec<f32> = nearest.iter().map(|d| (alpha + d).recip()).collect();
    let blocks: Vec<Vec<usize>> = (0..queries.values.len().div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let range = block * BLOCK..queries.values.len().min((block + 1) * BLOCK);
            let mut best = vec![(f32::INFINITY, 0); range.len()];
            for (k, want) in wants.iter().enumerate() {
                for (best, q) in best.iter_mut().zip(range.clone()) {
                    let cost = queries.distance(q, keys, k) * want;
                    if cost < best.0 {
                        *best = (cost, k);
                    }
                }
            }
            best.into_iter().map(|(_, k)| k).collect()
        })
        .collect();
    blocks.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_windows() {
        let a = Grid::from_fn(9, 10, |c| ((c.row * 37 + c.col * 61) % 23) as f32);
        let b = Grid::from_fn(8, 9, |c| ((c.row * 17 + c.col * 29 + c.row * c.col) % 19) as f32);
        let (p, q) = (Patches::of(&a), Patches::of(&b));
        assert_eq!((p.values.len(), q.values.len()), (3 * 4, 2 * 3));
        for i in 0..12 {
            for j in 0..6 {
                let want: f32 = p.values[i].iter().zip(&q.values[j]).map(|(a, b)| (a - b) * (a - b)).sum();
                assert!((p.distance(i, &q, j) - want).abs() < 1e-2 * (1.0 + want));
            }
        }
        let free = best_keys(&p, &q, 1e12);
        for (i, &k) in free.iter().enumerate() {
            assert!((0..6).all(|j| p.distance(i, &q, k) <= p.distance(i, &q, j) + 1e-3));
        }
    }

    /// Keys that no query resembles are wanted more: with a small alpha more of them are used.
    #[test]
    fn completeness_uses_more_of_the_exemplar() {
        let map = Grid::from_fn(30, 30, |c| (c.row as f32 * 0.3).sin());
        let exemplar = Grid::from_fn(24, 24, |c| (c.row as f32 * 0.3).sin() + (c.col as f32 * 0.05).powi(3));
        let (queries, keys) = (Patches::of(&map), Patches::of(&exemplar));
        let used = |alpha: f32| {
            let mut used = best_keys(&queries, &keys, alpha);
            used.sort_unstable();
            used.dedup();
            used.len()
        };
        assert!(used(1e-3) > used(1e6), "{} {}", used(1e-3), used(1e6));
    }
}
