//! Bicubic resampling by constant matrices, to any size, with its adjoint.
//!
//! Along each axis every output is a fixed weighted sum of a few inputs (Keys 1981, a = -1/2), and shrinking widens the
//! kernel by the factor so that nothing aliases. Cells are areas: the frames of input and output coincide. At the frame the
//! kernel is cut and its weights are divided by their sum. Cost: a few multiplications a cell.

use super::Grid;
use rayon::prelude::*;

/// The matrices between two sizes.
#[derive(Clone, Debug)]
pub(crate) struct Resampling {
    rows: Axis,
    cols: Axis,
}

/// The inputs of every output along an axis.
#[derive(Clone, Debug)]
struct Axis {
    from: usize,
    /// First input and the weights from there on.
    taps: Vec<(usize, Vec<f32>)>,
}

impl Axis {
    fn new(from: usize, to: usize) -> Self {
        let step = from as f64 / to as f64;
        let wide = step.max(1.0);
        let taps = (0..to).map(|i| {
            let centre = (i as f64 + 0.5) * step - 0.5;
            let first = (centre - 2.0 * wide).ceil().max(0.0) as usize;
            let last = ((centre + 2.0 * wide).floor() as usize).min(from - 1);
            let weights: Vec<f64> = (first..=last).map(|j| keys((j as f64 - centre) / wide)).collect();
            let sum: f64 = weights.iter().sum();
            (first, weights.iter().map(|w| (w / sum) as f32).collect())
        });
        Self { from, taps: taps.collect() }
    }

    /// Means of `factor` outputs each.
    fn averaged(&self, factor: usize) -> Self {
        let merged = |group: &[(usize, Vec<f32>)]| {
            let first = group.iter().map(|(first, _)| *first).min().unwrap_or(0);
            let last = group.iter().map(|(first, weights)| first + weights.len()).max().unwrap_or(first);
            let mut sums = vec![0.0; last - first];
            for (from, weights) in group {
                for (sum, w) in sums[from - first..].iter_mut().zip(weights) {
                    *sum += w / factor as f32;
                }
            }
            (first, sums)
        };
        Self { from: self.from, taps: self.taps.chunks_exact(factor).map(merged).collect() }
    }
}

/// The cubic convolution kernel with a = -1/2.
fn keys(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        (1.5 * x - 2.5) * x * x + 1.0
    } else if x < 2.0 {
        ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    } else {
        0.0
    }
}

impl Resampling {
    /// From rasters of `from` (rows, columns) to rasters of `to`.
    ///
    /// # Panics
    /// When a side is 0.
    #[must_use]
    pub(crate) fn new(from: (usize, usize), to: (usize, usize)) -> Self {
        assert!(from.0 * from.1 * to.0 * to.1 > 0, "a raster has at least one cell");
        Self { rows: Axis::new(from.0, to.0), cols: Axis::new(from.1, to.1) }
    }

    /// The same followed by the means of `factor` x `factor` cells, as one map.
    ///
    /// # Panics
    /// When `factor` is 0.
    #[must_use]
    pub(crate) fn averaged(&self, factor: usize) -> Self {
        Self { rows: self.rows.averaged(factor), cols: self.cols.averaged(factor) }
    }

    /// The raster in the other size.
    ///
    /// # Panics
    /// When `raster` has not the size to resample from.
    #[must_use]
    pub(crate) fn apply(&self, raster: &Grid<f32>) -> Grid<f32> {
        assert_eq!(raster.shape(), (self.rows.from, self.cols.from), "the size to resample from");
        let (from_cols, cols) = (self.cols.from, self.cols.taps.len());
        let mut wide = vec![0.0; self.rows.from * cols];
        wide.par_chunks_mut(cols).zip(raster.as_slice().par_chunks(from_cols)).for_each(|(out, row)| {
            for (o, (first, weights)) in out.iter_mut().zip(&self.cols.taps) {
                *o = weights.iter().zip(&row[*first..]).map(|(w, v)| w * v).sum();
            }
        });
        let mut out = vec![0.0f32; self.rows.taps.len() * cols];
        out.par_chunks_mut(cols).zip(&self.rows.taps).for_each(|(out, (first, weights))| {
            for (row, w) in wide[first * cols..].chunks_exact(cols).zip(weights) {
                for (o, v) in out.iter_mut().zip(row) {
                    *o += w * v;
                }
            }
        });
        Grid::from_vec(self.rows.taps.len(), cols, out).expect("sides of at least one")
    }

    /// The transposed map: the gradient by the input, given that by the output.
    ///
    /// # Panics
    /// When `raster` has not the size that [`apply`](Self::apply) gives.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn adjoint(&self, raster: &Grid<f32>) -> Grid<f32> {
        let cols = self.cols.taps.len();
        assert_eq!(raster.shape(), (self.rows.taps.len(), cols), "the size that was resampled to");
        let mut wide = vec![0.0; self.rows.from * cols];
        for (row, (first, weights)) in raster.as_slice().chunks_exact(cols).zip(&self.rows.taps) {
            for (out, w) in wide[first * cols..].chunks_exact_mut(cols).zip(weights) {
                for (o, v) in out.iter_mut().zip(row) {
                    *o += w * v;
                }
            }
        }
        let mut out = vec![0.0; self.rows.from * self.cols.from];
        for (out, row) in out.chunks_exact_mut(self.cols.from).zip(wide.chunks_exact(cols)) {
            for (v, (first, weights)) in row.iter().zip(&self.cols.taps) {
                for (o, w) in out[*first..].iter_mut().zip(weights) {
                    *o += w * v;
                }
            }
        }
        Grid::from_vec(self.rows.from, self.cols.from, out).expect("sides of at least one")
    }
}

/// `raster` in another size.
///
/// # Panics
/// When a side is 0.
#[must_use]
pub(crate) fn resample(raster: &Grid<f32>, rows: usize, cols: usize) -> Grid<f32> {
    Resampling::new(raster.shape(), (rows, cols)).apply(raster)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::grid::pyramid::shrunk;

    #[test]
    fn resampling_keeps_planes_and_the_same_size() {
        let plane = |rows: usize, cols: usize| {
            let at = |i: usize, side: usize| (i as f32 + 0.5) / side as f32;
            Grid::from_fn(rows, cols, |c| 0.3 + 0.5 * at(c.row, rows) - 0.2 * at(c.col, cols))
        };
        let (a, b) = (plane(17, 23), plane(40, 31));
        assert_eq!(resample(&a, 17, 23), a);
        // A widened kernel keeps slopes only nearly: its samples are not the cubic's own.
        for (got, want, tolerance) in [(resample(&a, 40, 31), &b, 1e-5), (resample(&b, 17, 23), &a, 2e-3)] {
            for (cell, z) in got.cells() {
                let inside = |i: usize, side: usize| i > 4 && i + 4 < side;
                if inside(cell.row, got.rows()) && inside(cell.col, got.cols()) {
                    assert!((z - want[cell]).abs() < tolerance, "{cell:?} {z} {}", want[cell]);
                }
            }
        }
        let flat = resample(&Grid::filled(9, 9, 0.7), 33, 4);
        assert!(flat.as_slice().iter().all(|z| (z - 0.7).abs() < 1e-6));
    }

    #[test]
    fn averaging_is_part_of_the_map() {
        let draw = Grid::from_fn(9, 12, |c: Cell| ((c.row * 37 + c.col * 61) % 23) as f32);
        let up = Resampling::new((9, 12), (36, 48));
        let (once, twice) = (up.averaged(4).apply(&draw), shrunk(&up.apply(&draw), 4));
        assert!(once.as_slice().iter().zip(twice.as_slice()).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    #[test]
    fn shrinking_does_not_alias() {
        let checks = Grid::from_fn(64, 64, |c| ((c.row + c.col) % 2) as f32);
        assert!(resample(&checks, 20, 20).as_slice().iter().all(|z| (z - 0.5).abs() < 0.02));
    }

    #[test]
    fn the_adjoint_is_the_transpose() {
        let draw = |rows, cols, k: usize| {
            Grid::from_fn(rows, cols, |c: Cell| ((c.row * 37 + c.col * k + c.row * c.col) % 23) as f32 - 11.0)
        };
        let dot = |a: &Grid<f32>, b: &Grid<f32>| -> f64 {
            a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| f64::from(a * b)).sum()
        };
        for (from, to) in [((13, 9), (20, 31)), ((20, 31), (13, 9)), ((5, 40), (11, 7))] {
            let map = Resampling::new(from, to);
            let (x, y) = (draw(from.0, from.1, 61), draw(to.0, to.1, 29));
            let (a, b) = (dot(&map.apply(&x), &y), dot(&x, &map.adjoint(&y)));
            assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{a} {b}");
        }
    }
}
