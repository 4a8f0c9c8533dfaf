//! Conjugate gradients around the V-cycle.
//!
//! The gradients run in `f64`, the cycle in `f32`: it only has to point the way, and half the memory is twice the speed.

use super::cycle::Cycle;
use super::energy::Energy;
use super::plane::{Plane, dot, sum_rows};
use super::raster::RasterOperator;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// Residual at which the surface is done, relative to that of the known values alone; and likewise the cycle's estimate of
/// the error in the energy norm, which a small residual does not bound when the operator is badly conditioned.
const TOLERANCE: f64 = 1e-10;

/// The recomputed residual may be this much larger than the tolerance: the recursion drifts by rounding.
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
/// When the residual does not fall to the tolerance, or it is stopped.
pub(in crate::interpolation) fn solve(
    energy: Energy,
    known: &Mask,
    values: &Grid<f64>,
    stop: &Stop,
) -> Result<Grid<f64>> {
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
    let mut gradients = Gradients::new(RasterOperator::new(energy, free, None), TOLERANCE, stop);
    let start = gradients.residual_of(&x, None);
    gradients.descend(&mut x, None, start, rounding * rounding * unknown as f64)?;
    let surface =
        (0..rows * cols).map(|i| if known[i] { values[i] } else { x.row(i / cols)[i % cols] + middle });
    Grid::from_vec(rows, cols, surface.collect())
}

/// The operator of a membrane that is held, ready for any number of right sides.
pub(in crate::interpolation) struct Held {
    gradients: Gradients,
}

impl Held {
    /// L + diag(`weights`); the weights are finite and at least 0, not all of them 0.
    pub(in crate::interpolation) fn new(weights: &Grid<f64>, tolerance: f64, stop: &Stop) -> Self {
        let (rows, cols) = weights.shape();
        let free = Plane::from_fn(rows, cols, |_, _| 1.0);
        let held = Plane::from_fn(rows, cols, |row, col| weights.as_slice()[row * cols + col]);
        let operator = RasterOperator::new(Energy::Membrane, free, Some(held));
        Self { gradients: Gradients::new(operator, tolerance, stop) }
    }

    /// Moves `x` to where the operator gives `right_side`.
    ///
    /// # Errors
    /// When the residual does not fall to the tolerance, or it is stopped.
    pub(in crate::interpolation) fn solve(
        &mut self,
        x: &mut Grid<f64>,
        right_side: &Grid<f64>,
    ) -> Result<()> {
        let (rows, cols) = x.shape();
        let plane = |grid: &Grid<f64>| {
            let values = grid.as_slice();
            Plane::from_fn(rows, cols, |row, col| values[row * cols + col])
        };
        let (mut answer, right_side) = (plane(x), plane(right_side));
        // The tolerance counts from a level surface, however near `x` is already.
        let start = sum_rows(rows, |row| dot(right_side.row(row), right_side.row(row)));
        self.gradients.descend(&mut answer, Some(&right_side), start, 0.0)?;
        for (row, out) in x.as_mut_slice().chunks_exact_mut(cols).enumerate() {
            out.copy_from_slice(answer.row(row));
        }
        Ok(())
    }
}

/// The state of the descent.
struct Gradients {
    operator: RasterOperator<f64>,
    cycle: Option<Cycle<f32>>,
    tolerance: f64,
    stop: Stop,
    residual: Plane<f64>,
    direction: Plane<f64>,
    /// The operator times the direction.
    curvature: Plane<f64>,
}

impl Gradients {
    fn new(operator: RasterOperator<f64>, tolerance: f64, stop: &Stop) -> Self {
        let (rows, cols) = operator.shape();
        let zeros = Plane::zeros(rows, cols);
        Self {
            operator,
            cycle: None,
            tolerance,
            stop: stop.clone(),
            residual: zeros.clone(),
            direction: zeros.clone(),
            curvature: zeros,
        }
    }

    /// Sets the residual of `x` and returns its squared norm.
    fn residual_of(&mut self, x: &Plane<f64>, right_side: Option<&Plane<f64>>) -> f64 {
        let Self { operator, residual, .. } = self;
        residual.sweep(|row, out| {
            operator.apply_row(x, row, out);
            match right_side {
                Some(b) => out.iter_mut().zip(b.row(row)).for_each(|(r, b)| *r = b - *r),
                None => out.iter_mut().for_each(|r| *r = -*r),
            }
            dot(out, out)
        })
    }

    /// Moves the free cells of `x` to the surface. `start`: squared norm from which the tolerance counts; `rounding`: the squared
    /// residual that rounding alone can make.
    fn descend(
        &mut self,
        x: &mut Plane<f64>,
        right_side: Option<&Plane<f64>>,
        start: f64,
        rounding: f64,
    ) -> Result<()> {
        let mut squared = self.residual_of(x, right_side);
        if squared <= rounding {
            return Ok(());
        }
        let start = if start > 0.0 { start } else { squared };
        let rows = x.rows();
        let mut cycle = self.cycle.take().unwrap_or_else(|| Cycle::new(self.operator.narrow(), &self.stop));
        let done = self.tolerance * self.tolerance;
        // Below the rounding nothing is left to descend by: neither the slope nor the curvature means anything.
        let enough = (done * start).max(rounding);
        let by_residual_alone = rounding >= done * start;
        let (mut first_slope, mut slope) = (None, None);
        let mut reached = false;
        for _ in 0..MOST_STEPS {
            self.stop.check()?;
            let scale = squared.sqrt();
            if scale == 0.0 {
                reached = true;
                break;
            }
            let residual = &self.residual;
            cycle.right_side_mut().sweep(|row, out| {
                out.iter_mut().zip(residual.row(row)).for_each(|(out, r)| *out = (r / scale) as f32);
                0.0
            });
            let towards = cycle.run();
            self.stop.check()?;
            let now = scale * sum_rows(rows, |row| dot(towards.row(row), residual.row(row)));
            // From where the descent began, or from as far as the whole of `start` would be in the same direction.
            let begun = *first_slope.get_or_insert(now * (start / squared).max(1.0));
            if squared <= enough && (by_residual_alone || now <= done * begun) {
                squared = self.residual_of(x, right_side);
                if squared <= DRIFT * DRIFT * enough {
                    reached = true;
                    break;
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
            let Self { operator, residual, direction, curvature, .. } = self;
            let bend = curvature.sweep(|row, out| {
                operator.apply_row(direction, row, out);
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
        self.cycle = Some(cycle);
        if reached {
            return Ok(());
        }
        Err(Error::value(
            "relative residual of the interpolated surface",
            (squared / start).sqrt(),
            format!("allowed: {:e} within {MOST_STEPS} steps", self.tolerance),
        ))
    }
}
