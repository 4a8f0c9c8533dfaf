//! Operators on coarse rasters: a 5x5 stencil of its own for every cell, made by the Galerkin product.
//!
//! A coarse raster has half the sides (rounded up). The map from coarse to fine is subdivision of quadratic B-splines:
//! a fine cell takes 3/4 of the coarse cell that holds it and 1/4 of the next nearest one, in each direction, with the
//! mirror at the frame. Splines of degree 2 have finite bending energy, so that one map serves membrane and plate, and
//! they keep the reach of two cells: the Galerkin product P^T A P of 5x5 stencils is again 5x5.
//!
//! Rows of P at known cells are zero. So the coarse surfaces are those that vanish on the lines, whatever the lines' form,
//! and the coarse operators are exact for them.

use super::plane::{MARGIN, Plane, Real};
use super::raster::RasterOperator;
use rayon::prelude::*;

/// Cells of a 5x5 stencil.
const TAPS: usize = 25;

/// An operator as stencils: for each row of cells, tap after tap, the coefficients of that tap along the row.
#[derive(Clone, Debug)]
pub(super) struct Stencils<T> {
    rows: usize,
    cols: usize,
    coefficients: Vec<T>,
}

/// Where the Galerkin product reads the finer operator from.
pub(super) enum Finer<'a, T> {
    /// The raster itself.
    Raster(&'a RasterOperator<T>),
    /// A coarse raster.
    Coarse(&'a Stencils<T>),
}

impl<T: Real> Finer<'_, T> {
    const fn shape(&self) -> (usize, usize) {
        match self {
            Self::Raster(raster) => raster.shape(),
            Self::Coarse(stencils) => (stencils.rows, stencils.cols),
        }
    }

    /// The operator's row at a cell, or `None` when it is zero.
    fn stencil(&self, row: usize, col: usize) -> Option<[[f64; 5]; 5]> {
        match self {
            Self::Raster(raster) => raster.stencil(row, col),
            Self::Coarse(stencils) => {
                let mut stencil = [[0.0; 5]; 5];
                for (tap, weight) in stencil.as_flattened_mut().iter_mut().enumerate() {
                    *weight = stencils.coefficient(row, col, tap);
                }
                (stencil[2][2] != 0.0).then_some(stencil)
            }
        }
    }
}

/// Side of the raster that is coarser than one of `side` cells.
pub(super) const fn coarser(side: usize) -> usize {
    side.div_ceil(2)
}

/// The two coarse cells that the fine cell `i` takes 3/4 and 1/4 of, mirrored at the frame of `side` coarse cells.
pub(super) const fn parents(i: usize, side: usize) -> [(usize, f64); 2] {
    let home = i / 2;
    let next = if i.is_multiple_of(2) {
        home.saturating_sub(1)
    } else if home + 1 < side {
        home + 1
    } else {
        home
    };
    [(home, 0.75), (next, 0.25)]
}

impl<T: Real> Stencils<T> {
    /// The Galerkin product of a finer operator.
    pub(super) fn galerkin(finer: &Finer<'_, T>) -> Self {
        let (fine_rows, fine_cols) = finer.shape();
        let (rows, cols) = (coarser(fine_rows), coarser(fine_cols));
        let mut coefficients = vec![T::default(); rows * cols * TAPS];
        coefficients.par_chunks_mut(cols * TAPS).enumerate().for_each(|(row, out)| {
            let mut sums = vec![[[0.0; 5]; 5]; cols];
            for fine_row in (2 * row).saturating_sub(1)..(2 * row + 3).min(fine_rows) {
                let share: f64 =
                    parents(fine_row, rows).iter().filter(|parent| parent.0 == row).map(|p| p.1).sum();
                for fine_col in 0..fine_cols {
                    if let Some(stencil) = finer.stencil(fine_row, fine_col) {
                        let carried = carry(&stencil, fine_row, fine_col, rows, cols, row);
                        add_to_parents(&mut sums, &carried, share, fine_col, cols);
                    }
                }
            }
            for (col, stencil) in sums.iter().enumerate() {
                for (tap, &sum) in stencil.as_flattened().iter().enumerate() {
                    out[tap * cols + col] = T::of(sum);
                }
            }
        });
        Self { rows, cols, coefficients }
    }

    pub(super) const fn rows(&self) -> usize {
        self.rows
    }

    pub(super) const fn cols(&self) -> usize {
        self.cols
    }

    fn coefficient(&self, row: usize, col: usize, tap: usize) -> f64 {
        self.coefficients[(row * TAPS + tap) * self.cols + col].wide()
    }

    /// The diagonal at a cell; 0 where no free cell is near.
    pub(super) fn diagonal(&self, row: usize, col: usize) -> f64 {
        self.coefficient(row, col, TAPS / 2)
    }

    /// The largest sum of absolute values in a row over that row's diagonal (Gershgorin): a bound on the eigenvalues of
    /// the operator divided by its diagonal.
    pub(super) fn spectral_bound(&self) -> f64 {
        let ratio = |row: usize, col: usize| {
            let diagonal = self.diagonal(row, col);
            if diagonal == 0.0 {
                return 0.0;
            }
            (0..TAPS).map(|tap| self.coefficient(row, col, tap).abs()).sum::<f64>() / diagonal
        };
        let largest = |row: usize| (0..self.cols).map(|col| ratio(row, col)).fold(0.0, f64::max);
        (0..self.rows).into_par_iter().map(largest).reduce(|| 0.0, f64::max)
    }

    /// One row of the operator times `x`.
    pub(super) fn apply_row(&self, x: &Plane<T>, row: usize, out: &mut [T]) {
        let cols = self.cols;
        out.fill(T::default());
        for k in 0..5 {
            let x = x.wide_row(row, k as isize - MARGIN as isize);
            let start = (row * TAPS + k * 5) * cols;
            let (a, rest) = self.coefficients[start..start + 5 * cols].split_at(cols);
            let (b, rest) = rest.split_at(cols);
            let (c, rest) = rest.split_at(cols);
            let (d, e) = rest.split_at(cols);
            let (x0, x1, x2, x3, x4) =
                (&x[..cols], &x[1..cols + 1], &x[2..cols + 2], &x[3..cols + 3], &x[4..cols + 4]);
            let (out, e) = (&mut out[..cols], &e[..cols]);
            for i in 0..cols {
                out[i] += (a[i] * x0[i] + b[i] * x1[i]) + (c[i] * x2[i] + d[i] * x3[i]) + e[i] * x4[i];
            }
        }
    }

    /// The whole matrix, row by row, cells row-major: for the coarsest raster only.
    pub(super) fn dense(&self) -> Vec<Vec<f64>> {
        let cells = self.rows * self.cols;
        let mut matrix = vec![vec![0.0; cells]; cells];
        for row in 0..self.rows {
            for col in 0..self.cols {
                for tap in 0..TAPS {
                    let weight = self.coefficient(row, col, tap);
                    if weight != 0.0 {
                        let (r, c) = (row + tap / 5 - MARGIN, col + tap % 5 - MARGIN);
                        matrix[row * self.cols + col][r * self.cols + c] = weight;
                    }
                }
            }
        }
        matrix
    }
}

/// A fine cell's stencil times P: weights of coarse cells. Rows are offsets -2 to 2 from the coarse row `row`; columns
/// start at the coarse column [`first_column`].
fn carry(
    stencil: &[[f64; 5]; 5],
    fine_row: usize,
    fine_col: usize,
    rows: usize,
    cols: usize,
    row: usize,
) -> [[f64; 4]; 5] {
    let first = first_column(fine_col);
    let mut carried = [[0.0; 4]; 5];
    for (k, line) in stencil.iter().enumerate().filter(|(_, line)| line.iter().any(|&w| w != 0.0)) {
        let mut across = [0.0; 4];
        for (l, &weight) in line.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            for (parent, share) in parents(fine_col + l - MARGIN, cols) {
                across[(parent as isize - first) as usize] += share * weight;
            }
        }
        for (parent, share) in parents(fine_row + k - MARGIN, rows) {
            for (sum, &weight) in carried[parent + MARGIN - row].iter_mut().zip(&across) {
                *sum += share * weight;
            }
        }
    }
    carried
}

/// The westernmost coarse column that the stencil of a fine column can touch; it may lie outside the frame.
const fn first_column(fine_col: usize) -> isize {
    fine_col.div_ceil(2) as isize - 2
}

/// Adds `share` of a fine cell's carried stencil to its coarse parents in one row.
fn add_to_parents(
    sums: &mut [[[f64; 5]; 5]],
    carried: &[[f64; 4]; 5],
    share: f64,
    fine_col: usize,
    cols: usize,
) {
    let first = first_column(fine_col);
    for (parent, across) in parents(fine_col, cols) {
        // The four columns as offsets from this parent: they start at -2 or -1.
        let shift = (first - parent as isize + MARGIN as isize) as usize;
        let weight = share * across;
        for (sums, carried) in sums[parent].iter_mut().zip(carried) {
            for (sum, &c) in sums[shift..shift + 4].iter_mut().zip(carried) {
                *sum += weight * c;
            }
        }
    }
}
