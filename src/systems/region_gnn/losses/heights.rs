//! Losses that compare heights cell by cell: l_gt, l_gradient, l_smooth.

use super::Target;
use crate::seed::Seed;
use rand::RngExt;

/// l_gt (Eq. 4, as a mean): squared height difference over valid cells. Adds `weight` times its gradient.
pub(crate) fn ground_truth(y: &[f64], target: &Target, weight: f64, gradient: &mut [f64]) -> f64 {
    let n = target.valid_count().max(1) as f64;
    let mut sum = 0.0;
    for i in (0..y.len()).filter(|&i| target.valid[i]) {
        let difference = y[i] - target.heights[i];
        sum += difference * difference;
        gradient[i] += weight * 2.0 * difference / n;
    }
    sum / n
}

/// l_gradient: mean over cells of the sum over the four neighbours of (squared step - true squared step)^2.
pub(crate) fn slope(y: &[f64], target: &Target, weight: f64, gradient: &mut [f64]) -> f64 {
    let n = target.valid_count().max(1) as f64;
    let (z, valid) = (&target.heights, &target.valid);
    let mut sum = 0.0;
    let mut pair = |a: usize, b: usize| {
        if valid[a] && valid[b] {
            let (step, truth) = (y[b] - y[a], z[b] - z[a]);
            let difference = step * step - truth * truth;
            // Every pair counts from both of its ends.
            sum += 2.0 * difference * difference;
            let g = weight * 8.0 * difference * step / n;
            gradient[b] += g;
            gradient[a] -= g;
        }
    };
    for row in 0..target.rows {
        for col in 0..target.cols {
            let i = row * target.cols + col;
            if col + 1 < target.cols {
                pair(i, i + 1);
            }
            if row + 1 < target.rows {
                pair(i, i + target.cols);
            }
        }
    }
    sum / n
}

/// l_smooth: mean height difference of `pairs` random pairs of cells at offsets up to 2 in each direction.
///
/// The paper's condition, a Hamming distance below 5 between positions, is not defined; offsets up to 2 keep the Manhattan
/// distance below 5. Pairs with a cell that is not `valid` are left out and not drawn again; without a mask all count.
pub(crate) fn smooth(
    y: &[f64],
    (rows, cols): (usize, usize),
    valid: Option<&[bool]>,
    pairs: usize,
    seed: Seed,
    weight: f64,
    gradient: &mut [f64],
) -> f64 {
    let mut stream = seed.stream("smoothness pairs");
    let mut kept = Vec::with_capacity(pairs);
    for _ in 0..pairs {
        let (row, col) = (stream.random_range(0..rows), stream.random_range(0..cols));
        let mut moved = |at: usize, side: usize| {
            at.saturating_add_signed(stream.random_range(-2i32..=2) as isize).min(side - 1)
        };
        let (a, b) = (row * cols + col, moved(row, rows) * cols + moved(col, cols));
        if valid.is_none_or(|valid| valid[a] && valid[b]) {
            kept.push((a, b));
        }
    }
    let n = kept.len().max(1) as f64;
    let mut sum = 0.0;
    for (a, b) in kept {
        let difference = y[a] - y[b];
        sum += difference.abs();
        if difference != 0.0 {
            let g = weight * difference.signum() / n;
            gradient[a] += g;
            gradient[b] -= g;
        }
    }
    sum / n
}

#[cfg(test)]
mod tests {
    use super::super::{bumpy, gradient_error};
    use super::*;

    fn target() -> Target {
        let mut valid = vec![true; 15 * 17];
        valid[40] = false;
        Target { rows: 15, cols: 17, heights: bumpy(15, 17, 0.8), valid }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let (y, t) = (bumpy(15, 17, 0.1), target());
        let cells = || (0..y.len()).step_by(7);
        assert!(gradient_error(&y, 1e-5, |y, g| ground_truth(y, &t, 1.0, g), cells()) < 1e-7);
        assert!(gradient_error(&y, 1e-5, |y, g| slope(y, &t, 1.0, g), cells()) < 1e-6);
        assert!(
            gradient_error(&y, 1e-7, |y, g| smooth(y, (15, 17), None, 500, Seed(2), 1.0, g), cells()) < 1e-6
        );
        let smooth = |y: &[f64], g: &mut [f64]| smooth(y, (15, 17), Some(&t.valid), 500, Seed(2), 1.0, g);
        assert!(gradient_error(&y, 1e-7, smooth, cells()) < 1e-6);
    }

    #[test]
    fn values_are_what_the_definitions_say() {
        let t = Target { rows: 1, cols: 2, heights: vec![0.0, 0.5], valid: vec![true; 2] };
        let mut g = vec![0.0; 2];
        assert!((ground_truth(&[0.5, 0.5], &t, 1.0, &mut g) - 0.125).abs() < 1e-12);
        // Two cells, one neighbour each: (0 - .25)^2 twice over two cells.
        assert!((slope(&[0.5, 0.5], &t, 1.0, &mut g) - 0.0625).abs() < 1e-12);
        assert_eq!(smooth(&[0.5, 0.5], (1, 2), None, 100, Seed(1), 1.0, &mut g), 0.0);
        // Of three cells the last is void: what is left are pairs of the first two, a mean of |0 - 1| and of 0.
        let mut g = vec![0.0; 3];
        let of = |valid, g: &mut [f64]| smooth(&[0.0, 1.0, 9.0], (1, 3), valid, 4000, Seed(1), 1.0, g);
        let (masked, all) = (of(Some(&[true, true, false]), &mut g), of(None, &mut [0.0; 3]));
        assert!(masked > 0.3 && masked < 0.7 && all > 2.0, "{masked} {all}");
        assert!((g[0] + masked).abs() < 1e-9 && (g[1] - masked).abs() < 1e-9 && g[2] == 0.0, "{g:?}");
    }

    #[test]
    fn voids_take_no_part() {
        let t = target();
        let mut y = t.heights.clone();
        y[40] = 1e6;
        let mut g = vec![0.0; y.len()];
        assert_eq!(ground_truth(&y, &t, 1.0, &mut g) + slope(&y, &t, 1.0, &mut g), 0.0);
        assert!(g.iter().all(|g| *g == 0.0));
        let of = |y: &[f64], g: &mut [f64]| smooth(y, (15, 17), Some(&t.valid), 5000, Seed(2), 1.0, g);
        let mut other = vec![0.0; y.len()];
        assert_eq!(of(&y, &mut g), of(&t.heights, &mut other));
        assert_eq!((g[40], &g), (0.0, &other));
    }
}
