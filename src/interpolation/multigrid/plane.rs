//! Rasters with a margin of two cells that mirrors the inside, and sweeps over their rows.
//!
//! The mirror is the free (Neumann) boundary: a difference stencil that reads past the frame meets the cell's own
//! reflection. Sweeps run in parallel over rows and add what the rows return in the order of the rows, so that sums do
//! not depend on the number of threads.

use rayon::prelude::*;
use std::ops::{Add, AddAssign, Mul, Sub};

/// The two precisions in which the solver runs.
pub(super) trait Real:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
{
    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn wide(self) -> f64 {
        self
    }
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

/// Width of the margin: the reach of the widest stencil.
pub(super) const MARGIN: usize = 2;

/// Below this many cells a sweep is shorter than waking another thread.
const CELLS_WORTH_SHARING: usize = 1 << 15;

/// A raster of `rows` x `cols` inside a mirrored margin.
#[derive(Clone, Debug)]
pub(super) struct Plane<T> {
    rows: usize,
    cols: usize,
    values: Vec<T>,
}

impl<T: Real> Plane<T> {
    pub(super) fn zeros(rows: usize, cols: usize) -> Self {
        Self { rows, cols, values: vec![T::default(); (rows + 2 * MARGIN) * (cols + 2 * MARGIN)] }
    }

    /// The value of `f` at every (row, column), mirrored into the margin.
    pub(super) fn from_fn(rows: usize, cols: usize, f: impl Fn(usize, usize) -> T + Sync) -> Self {
        let mut plane = Self::zeros(rows, cols);
        plane.sweep(|row, out| {
            out.iter_mut().enumerate().for_each(|(col, out)| *out = f(row, col));
            0.0
        });
        plane
    }

    pub(super) const fn rows(&self) -> usize {
        self.rows
    }

    pub(super) const fn cols(&self) -> usize {
        self.cols
    }

    const fn stride(&self) -> usize {
        self.cols + 2 * MARGIN
    }

    /// The cells of one row without the margin.
    pub(super) fn row(&self, row: usize) -> &[T] {
        let start = (row + MARGIN) * self.stride() + MARGIN;
        &self.values[start..start + self.cols]
    }

    /// The row at `row + offset`, which may lie in the margin, with the margin on both sides.
    pub(super) fn wide_row(&self, row: usize, offset: isize) -> &[T] {
        let start = (row + MARGIN).wrapping_add_signed(offset) * self.stride();
        &self.values[start..start + self.stride()]
    }

    /// Lets `f` rewrite every row (row, cells); returns the sum of what it returned.
    pub(super) fn sweep(&mut self, f: impl Fn(usize, &mut [T]) -> f64 + Sync) -> f64 {
        let (rows, cols, stride) = (self.rows, self.cols, self.stride());
        let body = |(row, out): (usize, &mut [T])| {
            let sum = f(row, &mut out[MARGIN..MARGIN + cols]);
            mirror_columns(out, cols);
            sum
        };
        let inside = &mut self.values[MARGIN * stride..(MARGIN + rows) * stride];
        let sum = if rows * cols < CELLS_WORTH_SHARING {
            inside.chunks_mut(stride).enumerate().map(body).sum()
        } else {
            let sums: Vec<f64> = inside.par_chunks_mut(stride).enumerate().map(body).collect();
            sums.iter().sum()
        };
        self.mirror_rows();
        sum
    }

    /// Lets `f` rewrite every row of two planes of one size; returns the sum of what it returned.
    pub(super) fn sweep_with<U: Real>(
        &mut self,
        other: &mut Plane<U>,
        f: impl Fn(usize, &mut [T], &mut [U]) -> f64 + Sync,
    ) -> f64 {
        assert_eq!((self.rows, self.cols), (other.rows, other.cols), "planes of one size");
        let (rows, cols, stride) = (self.rows, self.cols, self.stride());
        let body = |(row, (a, b)): (usize, (&mut [T], &mut [U]))| {
            let sum = f(row, &mut a[MARGIN..MARGIN + cols], &mut b[MARGIN..MARGIN + cols]);
            mirror_columns(a, cols);
            mirror_columns(b, cols);
            sum
        };
        let inside = MARGIN * stride..(MARGIN + rows) * stride;
        let (a, b) = (&mut self.values[inside.clone()], &mut other.values[inside]);
        let sum = if rows * cols < CELLS_WORTH_SHARING {
            a.chunks_mut(stride).zip(b.chunks_mut(stride)).enumerate().map(body).sum()
        } else {
            let pairs = a.par_chunks_mut(stride).zip(b.par_chunks_mut(stride));
            let sums: Vec<f64> = pairs.enumerate().map(body).collect();
            sums.iter().sum()
        };
        self.mirror_rows();
        other.mirror_rows();
        sum
    }

    fn mirror_rows(&mut self) {
        let stride = self.stride();
        for depth in 0..MARGIN {
            let above = reflected(depth, self.rows);
            let below = self.rows - 1 - above;
            let (above, below) = ((above + MARGIN) * stride, (below + MARGIN) * stride);
            self.values.copy_within(above..above + stride, (MARGIN - 1 - depth) * stride);
            self.values.copy_within(below..below + stride, (MARGIN + self.rows + depth) * stride);
        }
    }
}

/// The cell that a mirror at the edge shows `depth` cells behind it: in a side of one cell always that cell.
const fn reflected(depth: usize, side: usize) -> usize {
    let period = depth % (2 * side);
    if period < side { period } else { 2 * side - 1 - period }
}

fn mirror_columns<T: Copy>(row: &mut [T], cols: usize) {
    for depth in 0..MARGIN {
        let inner = reflected(depth, cols);
        row[MARGIN - 1 - depth] = row[MARGIN + inner];
        row[MARGIN + cols + depth] = row[MARGIN + cols - 1 - inner];
    }
}

/// The sum over rows of what `f` returns, in the order of the rows.
pub(super) fn sum_rows(rows: usize, f: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    let sums: Vec<f64> = (0..rows).into_par_iter().with_min_len(64).map(f).collect();
    sums.iter().sum()
}

/// Inner product of two rows, in four interleaved sums.
pub(super) fn dot<T: Real, U: Real>(a: &[T], b: &[U]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x.wide() * y.wide()).sum();
    for (x, y) in a4.zip(b4) {
        for lane in 0..4 {
            lanes[lane] += x[lane].wide() * y[lane].wide();
        }
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_mirrors_the_inside() {
        let plane = Plane::<f64>::from_fn(3, 1, |row, col| (10 * row + col) as f64);
        let shown: Vec<f64> = (-2..5).map(|offset| plane.wide_row(0, offset)[MARGIN]).collect();
        assert_eq!(shown, [10.0, 0.0, 0.0, 10.0, 20.0, 20.0, 10.0]);
        assert_eq!(plane.wide_row(1, 0), [10.0; 5]);
    }

    #[test]
    fn sums_are_those_of_the_rows() {
        let mut plane = Plane::<f32>::from_fn(300, 200, |row, col| (row * col % 7) as f32);
        let want: f64 = (0..300).flat_map(|r| (0..200).map(move |c| (r * c % 7) as f64)).sum();
        assert_eq!(plane.sweep(|_, row| row.iter().map(|v| v.wide()).sum()), want);
        assert_eq!(sum_rows(300, |r| dot(plane.row(r), &vec![1.0f64; 200])), want);
    }
}
