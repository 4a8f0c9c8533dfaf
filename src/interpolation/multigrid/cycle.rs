//! The multigrid V-cycle: an approximate inverse of the operator, symmetric and positive, in one pass down the rasters and
//! one up.
//!
//! Smoother: a Chebyshev polynomial of the diagonally scaled operator (Adams, Brezina, Hu & Tuminaro 2003), which is
//! symmetric and runs in parallel without an order. Coarsest raster: Cholesky factors.

use super::plane::{Plane, Real};
use super::raster::RasterOperator;
use super::stencils::{Finer, Stencils, coarser};
use crate::control::Stop;

/// The coarsest raster has at most this many cells.
const COARSEST_CELLS: usize = 64;

/// Steps of the smoother, before and after the coarse correction.
const SMOOTHER_DEGREE: usize = 3;

/// The smoother damps eigenvalues from the bound down to this fraction of it. With [`SMOOTHER_DEGREE`] the fastest of six
/// pairs tried at 1024x1024 on dense, sparse and nearly empty sketches; none was worse by more than half.
const SMOOTHED_RANGE: f64 = 20.0;

/// Hierarchy of operators with their work space.
pub(super) struct Cycle<T> {
    levels: Vec<Level<T>>,
    coarsest: Cholesky,
    stop: Stop,
}

struct Level<T> {
    operator: Operator<T>,
    inverse_diagonal: Plane<T>,
    /// Bound on the eigenvalues of the scaled operator.
    bound: f64,
    right_side: Plane<T>,
    answer: Plane<T>,
    next_answer: Plane<T>,
    /// The smoother's last step; between the smoothings, the residual.
    step: Plane<T>,
}

enum Operator<T> {
    Raster(RasterOperator<T>),
    Coarse(Stencils<T>),
}

impl<T: Real> Operator<T> {
    fn apply_row(&self, x: &Plane<T>, row: usize, out: &mut [T]) {
        match self {
            Self::Raster(raster) => raster.apply_row(x, row, out),
            Self::Coarse(stencils) => stencils.apply_row(x, row, out),
        }
    }

    const fn finer(&self) -> Finer<'_, T> {
        match self {
            Self::Raster(raster) => Finer::Raster(raster),
            Self::Coarse(stencils) => Finer::Coarse(stencils),
        }
    }
}

impl<T: Real> Level<T> {
    fn new(operator: Operator<T>) -> Self {
        let (rows, cols, bound) = match &operator {
            Operator::Raster(raster) => {
                let (rows, cols) = raster.shape();
                (rows, cols, raster.spectral_bound())
            }
            Operator::Coarse(stencils) => (stencils.rows(), stencils.cols(), stencils.spectral_bound()),
        };
        let inverse_diagonal = Plane::from_fn(rows, cols, |row, col| {
            let diagonal = match &operator {
                Operator::Raster(raster) => raster.diagonal(row, col),
                Operator::Coarse(stencils) => stencils.diagonal(row, col),
            };
            T::of(if diagonal > 0.0 { 1.0 / diagonal } else { 0.0 })
        });
        let zeros = Plane::zeros(rows, cols);
        Self {
            operator,
            inverse_diagonal,
            bound,
            right_side: zeros.clone(),
            answer: zeros.clone(),
            next_answer: zeros.clone(),
            step: zeros,
        }
    }

    /// Chebyshev smoothing of `answer` towards `right_side`, from zero or from the answer so far.
    fn smooth(&mut self, from_zero: bool) {
        let (upper, lower) = (self.bound, self.bound / SMOOTHED_RANGE);
        let (centre, half) = (0.5 * (upper + lower), 0.5 * (upper - lower));
        let sigma = centre / half;
        let mut rho = 1.0 / sigma;
        for k in 0..SMOOTHER_DEGREE {
            let (keep, gain) = if k == 0 {
                (0.0, 1.0 / centre)
            } else {
                let next = 1.0 / (2.0 * sigma - rho);
                let factors = (next * rho, 2.0 * next / half);
                rho = next;
                factors
            };
            let (keep, gain) = (T::of(keep), T::of(gain));
            let Self { operator, inverse_diagonal, right_side, answer, next_answer, step, .. } = self;
            if k == 0 && from_zero {
                next_answer.sweep_with(step, |row, next, step| {
                    let (b, inverse) = (right_side.row(row), inverse_diagonal.row(row));
                    for i in 0..next.len() {
                        step[i] = gain * inverse[i] * b[i];
                        next[i] = step[i];
                    }
                    0.0
                });
            } else {
                next_answer.sweep_with(step, |row, next, step| {
                    operator.apply_row(answer, row, next);
                    let (b, inverse, x) = (right_side.row(row), inverse_diagonal.row(row), answer.row(row));
                    let (b, inverse, x) = (&b[..next.len()], &inverse[..next.len()], &x[..next.len()]);
                    let step = &mut step[..next.len()];
                    for i in 0..next.len() {
                        let s = keep * step[i] + gain * inverse[i] * (b[i] - next[i]);
                        step[i] = s;
                        next[i] = x[i] + s;
                    }
                    0.0
                });
            }
            std::mem::swap(&mut self.answer, &mut self.next_answer);
        }
    }

    /// Puts the residual into `step`.
    fn residual(&mut self) {
        let Self { operator, right_side, answer, step, .. } = self;
        step.sweep(|row, out| {
            operator.apply_row(answer, row, out);
            for (out, b) in out.iter_mut().zip(right_side.row(row)) {
                *out = *b - *out;
            }
            0.0
        });
    }

    /// Adds the coarse answer, carried up, to `answer`.
    fn add_from(&mut self, coarse: &Plane<T>) {
        let (near, far) = (T::of(0.75), T::of(0.25));
        let operator = &self.operator;
        self.answer.sweep(|row, out| {
            let (above, below) =
                (coarse.wide_row(row / 2, 0), coarse.wide_row(row / 2, if row % 2 == 0 { -1 } else { 1 }));
            let free = match operator {
                Operator::Raster(raster) => Some(raster.free_row(row)),
                Operator::Coarse(_) => None,
            };
            let blend = |c: usize| near * above[c] + far * below[c];
            let (mut west, mut here) = (blend(1), blend(2));
            for c in 0..out.len().div_ceil(2) {
                let east = blend(c + 3);
                let (i, even, odd) = (2 * c, near * here + far * west, near * here + far * east);
                match free {
                    Some(free) => {
                        out[i] += free[i] * even;
                        if i + 1 < out.len() {
                            out[i + 1] += free[i + 1] * odd;
                        }
                    }
                    None => {
                        out[i] += even;
                        if i + 1 < out.len() {
                            out[i + 1] += odd;
                        }
                    }
                }
                (west, here) = (here, east);
            }
            0.0
        });
    }
}

/// `coarse` = P^T `fine`, for `fine` that is zero at known cells.
fn restrict<T: Real>(fine: &Plane<T>, coarse: &mut Plane<T>) {
    let (near, far, zero) = (T::of(0.75), T::of(0.25), T::default());
    let (rows, cols) = (fine.rows(), fine.cols());
    coarse.sweep(|row, out| {
        // The shares of the four fine rows in this coarse one; a mirrored parent gives back its share.
        let first = 2 * row;
        let north = if row == 0 { near + far } else { near };
        let last_row = row + 1 == coarser(rows);
        let south = if last_row { near + far } else { near };
        let here = fine.row(first);
        let above = if first > 0 { fine.row(first - 1) } else { here };
        let above_share = if first > 0 { far } else { zero };
        let (below, below_share) = if first + 1 < rows { (fine.row(first + 1), south) } else { (here, zero) };
        let (under, under_share) = if first + 2 < rows { (fine.row(first + 2), far) } else { (here, zero) };
        let blend = |c: usize| {
            (north * here[c] + above_share * above[c]) + (below_share * below[c] + under_share * under[c])
        };
        let count = out.len();
        let mut before = zero;
        let mut now = blend(0);
        for (c, out) in out.iter_mut().enumerate() {
            let i = 2 * c;
            let odd = if i + 1 < cols { blend(i + 1) } else { zero };
            let after = if i + 2 < cols { blend(i + 2) } else { zero };
            let mut sum = near * (now + odd) + far * (before + after);
            if c == 0 {
                sum += far * now;
            }
            if c + 1 == count {
                sum += far * odd;
            }
            *out = sum;
            (before, now) = (odd, after);
        }
        0.0
    });
}

impl<T: Real> Cycle<T> {
    /// Builds the hierarchy for an operator on the raster.
    pub(super) fn new(raster: RasterOperator<T>, stop: &Stop) -> Self {
        let mut levels = vec![Level::new(Operator::Raster(raster))];
        loop {
            let finest = levels.len() == 1;
            let last = &levels[levels.len() - 1];
            let cells = last.answer.rows() * last.answer.cols();
            if cells <= COARSEST_CELLS && !finest {
                break;
            }
            let stencils = Stencils::galerkin(&last.operator.finer());
            levels.push(Level::new(Operator::Coarse(stencils)));
        }
        let coarsest = match levels.last().map(|level| &level.operator) {
            Some(Operator::Coarse(stencils)) => Cholesky::new(stencils.dense()),
            _ => unreachable!("the loop makes at least one coarse raster"),
        };
        Self { levels, coarsest, stop: stop.clone() }
    }

    /// Where the right side goes before [`run`](Self::run): zero at known cells.
    pub(super) fn right_side_mut(&mut self) -> &mut Plane<T> {
        &mut self.levels[0].right_side
    }

    /// One V-cycle; the approximate solution, or anything once it is stopped.
    pub(super) fn run(&mut self) -> &Plane<T> {
        let last = self.levels.len() - 1;
        for l in 0..last {
            if self.stop.is_raised() {
                break;
            }
            let (fine, coarse) = self.levels.split_at_mut(l + 1);
            let (fine, coarse) = (&mut fine[l], &mut coarse[0]);
            fine.smooth(true);
            fine.residual();
            restrict(&fine.step, &mut coarse.right_side);
        }
        let Level { right_side, answer, .. } = &mut self.levels[last];
        self.coarsest.solve(right_side, answer);
        for l in (0..last).rev() {
            if self.stop.is_raised() {
                break;
            }
            let (fine, coarse) = self.levels.split_at_mut(l + 1);
            fine[l].add_from(&coarse[0].answer);
            fine[l].smooth(false);
        }
        &self.levels[0].answer
    }
}

/// A pivot this small beside its diagonal is rounding: the coefficients are 32-bit floats, sums of a few dozen products.
const DEPENDENT: f64 = 1e-6;

/// Cholesky factors of the coarsest operator.
struct Cholesky {
    factor: Vec<Vec<f64>>,
}

impl Cholesky {
    /// Where lines lie so densely that coarse surfaces are linearly dependent on the free cells, the matrix is singular
    /// but the system consistent: a relative shift of the diagonal makes it definite and leaves a preconditioner.
    fn new(mut a: Vec<Vec<f64>>) -> Self {
        let n = a.len();
        let largest = (0..n).map(|i| a[i][i]).fold(f64::MIN_POSITIVE, f64::max);
        for (i, row) in a.iter_mut().enumerate() {
            row[i] = if row[i] > 0.0 { row[i] * (1.0 + 1e-9) + largest * 1e-12 } else { largest };
        }
        let diagonal: Vec<f64> = (0..n).map(|i| a[i][i]).collect();
        for j in 0..n {
            for k in 0..j {
                let a_jk = a[j][k];
                for row in &mut a[j..] {
                    row[j] -= row[k] * a_jk;
                }
            }
            // Of a dependent direction only rounding is left, also below the diagonal, where dividing by a small pivot would
            // blow it up: a single free cell spreads over four coarse ones that are multiples of each other.
            if a[j][j] <= DEPENDENT * diagonal[j] {
                a[j..].iter_mut().for_each(|row| row[j] = 0.0);
                a[j][j] = diagonal[j].sqrt();
                continue;
            }
            let pivot = a[j][j].sqrt();
            for row in &mut a[j..] {
                row[j] /= pivot;
            }
            a[j][j] = pivot;
        }
        Self { factor: a }
    }

    fn solve<T: Real>(&self, right_side: &Plane<T>, answer: &mut Plane<T>) {
        let l = &self.factor;
        let n = l.len();
        let mut x: Vec<f64> =
            (0..right_side.rows()).flat_map(|r| right_side.row(r).iter().map(|v| v.wide())).collect();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
            x[i] = (x[i] - known) / l[i][i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| l[k][i] * x[k]).sum();
            x[i] = (x[i] - known) / l[i][i];
        }
        let cols = answer.cols();
        answer.sweep(|row, out| {
            out.iter_mut().zip(&x[row * cols..]).for_each(|(out, &x)| *out = T::of(x));
            0.0
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolation::multigrid::energy::Energy;
    use crate::interpolation::multigrid::plane::{dot, sum_rows};

    const SIDES: [(usize, usize); 6] = [(1, 9), (9, 1), (12, 17), (13, 8), (40, 21), (33, 64)];

    /// Numbers without a pattern, from -1 to 1, by cell and seed.
    fn scatter(rows: usize, cols: usize, seed: usize) -> Plane<f64> {
        Plane::from_fn(rows, cols, |r, c| {
            let mixed = (r * 7919 + c * 104_729 + seed * 1_299_709 + 12_345) as u64;
            (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / (1u64 << 23) as f64 - 1.0
        })
    }

    /// About a tenth of the cells known, at least one.
    fn free(rows: usize, cols: usize) -> Plane<f64> {
        let draw = scatter(rows, cols, 99);
        Plane::from_fn(rows, cols, |r, c| f64::from(u8::from(draw.row(r)[c] > -0.8 && (r, c) != (0, 0))))
    }

    fn inner(a: &Plane<f64>, b: &Plane<f64>) -> f64 {
        sum_rows(a.rows(), |row| dot(a.row(row), b.row(row)))
    }

    fn masked(plane: &Plane<f64>, free: &Plane<f64>) -> Plane<f64> {
        Plane::from_fn(plane.rows(), plane.cols(), |r, c| plane.row(r)[c] * free.row(r)[c])
    }

    /// The coarse plane carried to the raster of `free`.
    fn carried(coarse: &Plane<f64>, free: &Plane<f64>) -> Plane<f64> {
        let raster = RasterOperator::new(Energy::Membrane, free.clone(), None);
        let mut level = Level::new(Operator::Raster(raster));
        level.add_from(coarse);
        level.answer
    }

    #[test]
    fn restriction_is_the_transpose_of_carrying_up() {
        for (rows, cols) in SIDES {
            let free = free(rows, cols);
            let coarse = scatter(coarser(rows), coarser(cols), 1);
            let fine = masked(&scatter(rows, cols, 2), &free);
            let mut restricted = Plane::zeros(coarser(rows), coarser(cols));
            restrict(&fine, &mut restricted);
            let (up, down) = (inner(&carried(&coarse, &free), &fine), inner(&coarse, &restricted));
            assert!((up - down).abs() < 1e-12 * (1.0 + up.abs()), "{rows}x{cols}: {up} and {down}");
        }
    }

    /// Both energies, free and held.
    fn operators(rows: usize, cols: usize) -> Vec<(&'static str, RasterOperator<f64>, f64)> {
        let held = Plane::from_fn(rows, cols, |r, c| scatter(rows, cols, 7).row(r)[c].abs() * 3.0);
        let of = |energy, held| RasterOperator::new(energy, free(rows, cols), held);
        vec![
            ("membrane", of(Energy::Membrane, None), 0.7),
            ("plate", of(Energy::Plate, None), 0.05),
            ("held membrane", of(Energy::Membrane, Some(held)), 0.7),
        ]
    }

    #[test]
    fn coarse_operators_are_galerkin_products() {
        for (rows, cols) in SIDES {
            for (name, raster, _) in operators(rows, cols) {
                let free = free(rows, cols);
                let coarse = scatter(coarser(rows), coarser(cols), 3);
                let stencils = Stencils::galerkin(&Finer::Raster(&raster));
                let up = carried(&coarse, &free);
                let mut bent = Plane::zeros(rows, cols);
                bent.sweep(|row, out| {
                    raster.apply_row(&up, row, out);
                    0.0
                });
                let mut want = Plane::zeros(coarser(rows), coarser(cols));
                restrict(&bent, &mut want);
                for row in 0..want.rows() {
                    let mut got = vec![0.0; want.cols()];
                    stencils.apply_row(&coarse, row, &mut got);
                    for (got, want) in got.iter().zip(want.row(row)) {
                        assert!((got - want).abs() < 1e-12 * 64.0, "{name} {rows}x{cols}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_cycle_is_a_symmetric_positive_near_inverse() {
        for (rows, cols) in SIDES {
            for (name, raster, weakest) in operators(rows, cols) {
                let free = free(rows, cols);
                let mut cycle = Cycle::<f64>::new(raster.clone(), &Stop::new());
                let mut apply = |b: &Plane<f64>| {
                    *cycle.right_side_mut() = b.clone();
                    cycle.run().clone()
                };
                let (u, v) = (masked(&scatter(rows, cols, 4), &free), masked(&scatter(rows, cols, 5), &free));
                let (mu, mv) = (apply(&u), apply(&v));
                let (there, back) = (inner(&u, &mv), inner(&v, &mu));
                assert!((there - back).abs() < 1e-9 * inner(&u, &mu), "{name} {rows}x{cols}");
                // The operator after the cycle: its Rayleigh quotient lies between `weakest` and a little over 1.
                let mut amu = Plane::zeros(rows, cols);
                amu.sweep(|row, out| {
                    raster.apply_row(&mu, row, out);
                    0.0
                });
                let quotient = inner(&mu, &amu) / inner(&u, &mu);
                assert!((weakest..1.0 + 1e-6).contains(&quotient), "{name} {rows}x{cols}: {quotient}");
            }
        }
    }
}
