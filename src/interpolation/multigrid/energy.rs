//! What a surface minimises, as an operator on the raster.
//!
//! With L the five-point Laplacian whose boundary at the frame is free (each cell minus the mean of those neighbours that
//! exist, times their number), a membrane solves L u = 0 and a plate L^2 u = 0 at the free cells. On a raster with a
//! mirrored margin both are one stencil for every cell, the frame included.

use super::plane::{MARGIN, Plane, Real};

/// Which surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Energy {
    /// Least slope: Laplace's equation.
    Membrane,
    /// Least curvature: the biharmonic equation.
    Plate,
}

impl Energy {
    /// One row of the operator times `x`; nothing at cells where `free` is 0 (it is 1 elsewhere).
    pub(super) fn apply_row<T: Real>(self, x: &Plane<T>, row: usize, free: &[T], out: &mut [T]) {
        let cols = out.len();
        let tap = |down: isize, right: usize| &x.wide_row(row, down)[right..right + cols];
        let (n, w, c, e, s) = (tap(-1, 2), tap(0, 1), tap(0, 2), tap(0, 3), tap(1, 2));
        let free = &free[..cols];
        match self {
            Self::Membrane => {
                let four = T::of(4.0);
                for i in 0..cols {
                    out[i] = free[i] * (four * c[i] - ((n[i] + s[i]) + (w[i] + e[i])));
                }
            }
            Self::Plate => {
                let (nw, ne, sw, se) = (tap(-1, 1), tap(-1, 3), tap(1, 1), tap(1, 3));
                let (nn, ww, ee, ss) = (tap(-2, 2), tap(0, 0), tap(0, 4), tap(2, 2));
                let (two, eight, twenty) = (T::of(2.0), T::of(8.0), T::of(20.0));
                for i in 0..cols {
                    let sides = (n[i] + s[i]) + (w[i] + e[i]);
                    let corners = (nw[i] + ne[i]) + (sw[i] + se[i]);
                    let far = (nn[i] + ss[i]) + (ww[i] + ee[i]);
                    out[i] = free[i] * (twenty * c[i] - eight * sides + two * corners + far);
                }
            }
        }
    }

    /// The operator's row at a cell as a 5x5 stencil, row-major, without regard to which cells are free.
    pub(super) fn stencil(self, row: usize, col: usize, rows: usize, cols: usize) -> [[f64; 5]; 5] {
        let (down, down2) = second_difference(row, rows);
        let (right, right2) = second_difference(col, cols);
        let mut stencil = [[0.0; 5]; 5];
        match self {
            // L = V x I + I x H for the one-dimensional V (down) and H (right).
            Self::Membrane => {
                for k in 0..5 {
                    stencil[k][MARGIN] += down[k];
                    stencil[MARGIN][k] += right[k];
                }
            }
            // L^2 = V^2 x I + 2 V x H + I x H^2.
            Self::Plate => {
                for k in 0..5 {
                    stencil[k][MARGIN] += down2[k];
                    stencil[MARGIN][k] += right2[k];
                    for l in 0..5 {
                        stencil[k][l] += 2.0 * down[k] * right[l];
                    }
                }
            }
        }
        stencil
    }

    /// The sum of the absolute values of the operator's row at a cell inside.
    pub(super) const fn row_sum(self) -> f64 {
        match self {
            Self::Membrane => 8.0,
            Self::Plate => 64.0,
        }
    }

    /// The operator's diagonal at a cell.
    pub(super) fn diagonal(self, row: usize, col: usize, rows: usize, cols: usize) -> f64 {
        let neighbours = degree(row, rows) + degree(col, cols);
        match self {
            Self::Membrane => neighbours,
            Self::Plate => neighbours * neighbours + neighbours,
        }
    }

    /// A bound on the eigenvalues of the operator divided by its diagonal: the largest sum of absolute values in a row
    /// over that row's diagonal (Gershgorin). 8/4 for the membrane; 20/6, at the corner of the frame, for the plate.
    pub(super) const fn spectral_bound(self) -> f64 {
        match self {
            Self::Membrane => 2.0,
            Self::Plate => 20.0 / 6.0,
        }
    }
}

/// Number of neighbours at position `i` of a line of `side` cells.
fn degree(i: usize, side: usize) -> f64 {
    f64::from(u8::from(i > 0) + u8::from(i + 1 < side))
}

/// Row `i` of the one-dimensional operator with free ends, and of its square, at offsets -2 to 2.
fn second_difference(i: usize, side: usize) -> ([f64; 5], [f64; 5]) {
    let (mut once, mut twice) = ([0.0; 5], [0.0; 5]);
    let here = degree(i, side);
    once[2] = here;
    twice[2] = here * here + here;
    if i > 0 {
        once[1] = -1.0;
        twice[1] = -(here + degree(i - 1, side));
        twice[0] = if i > 1 { 1.0 } else { 0.0 };
    }
    if i + 1 < side {
        once[3] = -1.0;
        twice[3] = -(here + degree(i + 1, side));
        twice[4] = if i + 2 < side { 1.0 } else { 0.0 };
    }
    (once, twice)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mirrored stencil and the written-out rows are the same operator, on every small raster.
    #[test]
    fn the_mirror_is_the_free_boundary() {
        for energy in [Energy::Membrane, Energy::Plate] {
            for (rows, cols) in [(1, 1), (1, 2), (1, 5), (2, 2), (3, 2), (4, 7), (6, 3)] {
                let x =
                    Plane::<f64>::from_fn(rows, cols, |r, c| ((r * 7 + c * 13 + r * c) % 11) as f64 - 4.0);
                for row in 0..rows {
                    let mut got = vec![0.0; cols];
                    energy.apply_row(&x, row, &vec![1.0; cols], &mut got);
                    for (col, got) in got.into_iter().enumerate() {
                        let stencil = energy.stencil(row, col, rows, cols);
                        let mut want = 0.0;
                        for (k, line) in stencil.iter().enumerate() {
                            for (l, &weight) in line.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                                want += weight * x.row(row + k - MARGIN)[col + l - MARGIN];
                            }
                        }
                        assert!((got - want).abs() < 1e-12, "{energy:?} {rows}x{cols} at {row},{col}");
                        let (diagonal, sum) =
                            (stencil[2][2], stencil.as_flattened().iter().map(|w| w.abs()).sum::<f64>());
                        assert!((diagonal - energy.diagonal(row, col, rows, cols)).abs() < 1e-12);
                        assert!(sum <= energy.spectral_bound() * diagonal + 1e-12);
                    }
                }
            }
        }
    }
}
