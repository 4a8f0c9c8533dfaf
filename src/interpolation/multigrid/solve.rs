//! Conjugate gradients around the V-cycle.
//!
//! The gradients run in `f64`, the cycle in `f32`: it only has to point the way, and half the memory is twice the speed.

use super::cycle::Cycle;
use super::energy::Energy;
use super::plane::{Plane, dot, sum_rows};
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// Residual at which the surface is done, relative to that of the known values alone; and likewise the cycle's estimate of
/// the error in the energy norm, which a small residual does not bound when the operator is badly conditioned.
const TOLERANCE: f64 = 1e-10;

/// The recomputed residual may be this much larger than [`TOLERANCE`]: the recursion drifts by rounding.
const DRIFT: f64 = 10.0;

/// A residual this many roundings large cannot be told from zero. It is the bound where the start is so near the surface
/// that [`TOLERANCE`] of its residual lies below what sums of heights resolve: a single void among its neighbours.
const ROUNDINGS: f64 = 4.0;

/// A membrane needs 8 to 20 steps; a plate 15 to 50 and, over wide empty regions between lines, up to a few hundred.
const MOST_STEPS: usize = 3000;

/// The surface of least `energy` through the known values, at every cell. Known cells keep their value to the bit.
///
/// `known` has at least one true cell, the known values are finite, the shapes agree.
///
/// # Errors
/// When the residual does not fall to the tolerance.
pub(in crate::interpolation) fn solve(energy: Energy, known: &Mask, values: &Grid<f64>) -> Result<Grid<f64>> {
    let (rows, cols) = known.shape();
    let (known, values) = (known.as_slice(), values.as_slice());
    let on_lines = || values.iter().zip(known).filter(|(_, k)| **k).map(|(v, _)| *v);
    let (low, high) = on_lines().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    // Around the middle of the known values, so that the tolerance speaks of their range and not of the sea level.
    let middle = low + 0.5 * (high - low);
    let mut x = Plane::<f64>::from_fn(rows, cols, |row, col| {
        let i = row * cols + col;
        if known[i] { values[i] - middle } else { 0.0 }
    });
    let free = Plane::<f64>::from_fn(rows, cols, |row, col| f64::from(u8::from(!known[row * cols + col])));
    let unknown = known.iter().filter(|k| !**k).count();
    let rounding = ROUNDINGS * f64::EPSILON * energy.row_sum() * (high - middle);
    let mut gradients = Gradients::new(energy, free);
    gradients.descend(&mut x, rounding * rounding * unknown as f64)?;
    let surface =
        (0..rows * cols).map(|i| if known[i] { values[i] } else { x.row(i / cols)[i % cols] + middle });
    Grid::from_vec(rows, cols, surface.collect())
}

/// The state of the descent.
struct Gradients {
    energy: Energy,
    /// 1 at free cells, 0 at known ones.
    free: Plane<f64>,
    residual: Plane<f64>,
    direction: Plane<f64>,
    /// The operator times the direction.
    curvature: Plane<f64>,
}

impl Gradients {
    fn new(energy: Energy, free: Plane<f64>) -> Self {
        let zeros = Plane::zeros(free.rows(), free.cols());
        Self { energy, free, residual: zeros.clone(), direction: zeros.clone(), curvature: zeros }
    }

    /// Sets the residual of `x` and returns its squared norm.
    fn measure(&mut self, x: &Plane<f64>) -> f64 {
        let Self { energy, free, residual, .. } = self;
        residual.sweep(|row, out| {
            energy.apply_row(x, row, free.row(row), out);
            out.iter_mut().for_each(|r| *r = -*r);
            dot(out, out)
        })
    }

    /// Moves the free cells of `x` to the surface. `rounding`: the squared residual that rounding alone can make.
    fn descend(&mut self, x: &mut Plane<f64>, rounding: f64) -> Result<()> {
        let start = self.measure(x);
        if start <= rounding {
            return Ok(());
        }
        let rows = x.rows();
        let free = Plane::from_fn(rows, x.cols(), |row, col| self.free.row(row)[col] as f32);
        let mut cycle = Cycle::<f32>::new(self.energy, free);
        let done = TOLERANCE * TOLERANCE;
        // Below the rounding nothing is left to descend by: neither the slope nor the curvature means anything.
        let enough = (done * start).max(rounding);
        let by_residual_alone = rounding >= done * start;
        let (mut squared, mut first_slope, mut slope) = (start, None, None);
        for _ in 0..MOST_STEPS {
            let scale = squared.sqrt();
            if scale == 0.0 {
                return Ok(());
            }
            let residual = &self.residual;
            cycle.right_side_mut().sweep(|row, out| {
                out.iter_mut().zip(residual.row(row)).for_each(|(out, r)| *out = (r / scale) as f32);
                0.0
            });
            let towards = cycle.run();
            let now = scale * sum_rows(rows, |row| dot(towards.row(row), residual.row(row)));
            let begun = *first_slope.get_or_insert(now);
            if squared <= enough && (by_residual_alone || now <= done * begun) {
                squared = self.measure(x);
                if squared <= DRIFT * DRIFT * enough {
                    return Ok(());
                }
                slope = None;
                continue;
            }
            let keep = slope.map_or(0.0, |before| now / before);
            slope = Some(now);
            self.direction.sweep(|row, direction| {
                for (d, t) in direction.iter_mut().zip(towards.row(row)) {
                    *d = scale * f64::from(*t) + keep * *d;
                }
                0.0
            });
            let Self { energy, free, residual, direction, curvature } = self;
            let bend = curvature.sweep(|row, out| {
                energy.apply_row(direction, row, free.row(row), out);
                dot(out, direction.row(row))
            });
            let step = now / bend;
            squared = residual.sweep_with(x, |row, residual, x| {
                let (direction, curvature) = (direction.row(row), curvature.row(row));
                for i in 0..residual.len() {
                    x[i] += step * direction[i];
                    residual[i] -= step * curvature[i];
                }
                dot(residual, residual)
            });
            if !squared.is_finite() {
                break;
            }
        }
        Err(Error::value(
            "relative residual of the interpolated surface",
            (squared / start).sqrt(),
            format!("allowed: {TOLERANCE:e} within {MOST_STEPS} steps"),
        ))
    }
}
