//! The operator on the raster itself: an energy at the free cells, which may be held towards heights of their own.

use super::energy::Energy;
use super::plane::{MARGIN, Plane, Real};

/// A + diag(w): the energy's operator at free cells, and how strongly each of them is held.
#[derive(Clone, Debug)]
pub(super) struct RasterOperator<T> {
    energy: Energy,
    /// 1 at free cells, 0 at known ones.
    free: Plane<T>,
    /// Weight of (u - t)^2 beside the energy; none for a surface that only known cells hold.
    held: Option<Plane<T>>,
}

impl<T: Real> RasterOperator<T> {
    pub(super) const fn new(energy: Energy, free: Plane<T>, held: Option<Plane<T>>) -> Self {
        Self { energy, free, held }
    }

    /// The same operator in the other precision.
    pub(super) fn narrow(&self) -> RasterOperator<f32> {
        let narrow = |plane: &Plane<T>| {
            Plane::from_fn(plane.rows(), plane.cols(), |row, col| plane.row(row)[col].wide() as f32)
        };
        RasterOperator { energy: self.energy, free: narrow(&self.free), held: self.held.as_ref().map(narrow) }
    }

    pub(super) const fn shape(&self) -> (usize, usize) {
        (self.free.rows(), self.free.cols())
    }

    pub(super) fn free_row(&self, row: usize) -> &[T] {
        self.free.row(row)
    }

    /// One row of the operator times `x`; nothing at known cells.
    pub(super) fn apply_row(&self, x: &Plane<T>, row: usize, out: &mut [T]) {
        self.energy.apply_row(x, row, self.free.row(row), out);
        if let Some(held) = &self.held {
            let (held, free, x) = (held.row(row), self.free.row(row), x.row(row));
            for (i, out) in out.iter_mut().enumerate() {
                *out += free[i] * held[i] * x[i];
            }
        }
    }

    /// The diagonal at a cell; 0 at known ones.
    pub(super) fn diagonal(&self, row: usize, col: usize) -> f64 {
        let (rows, cols) = self.shape();
        let held = self.held.as_ref().map_or(0.0, |held| held.row(row)[col].wide());
        self.free.row(row)[col].wide() * (self.energy.diagonal(row, col, rows, cols) + held)
    }

    /// A bound on the eigenvalues of the operator divided by its diagonal: holding adds the same to both.
    pub(super) const fn spectral_bound(&self) -> f64 {
        self.energy.spectral_bound()
    }

    /// The operator's row at a cell as a 5x5 stencil; `None` at known cells.
    pub(super) fn stencil(&self, row: usize, col: usize) -> Option<[[f64; 5]; 5]> {
        if self.free.row(row)[col].wide() == 0.0 {
            return None;
        }
        let (rows, cols) = self.shape();
        let mut stencil = self.energy.stencil(row, col, rows, cols);
        for (k, line) in stencil.iter_mut().enumerate() {
            let free = &self.free.wide_row(row, k as isize - MARGIN as isize)[col..col + 5];
            for (weight, free) in line.iter_mut().zip(free) {
                *weight *= free.wide();
            }
        }
        if let Some(held) = &self.held {
            stencil[MARGIN][MARGIN] += held.row(row)[col].wide();
        }
        Some(stencil)
    }
}
