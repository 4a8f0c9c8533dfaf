//! 1 - SSIM (Wang et al. 2004) with its gradient, made of the parts of the metric ([`crate::metrics::ssim`]).

use crate::metrics::{WINDOW, similarity, window_means, window_means_adjoint};

/// The loss against one target in the unit interval: Gaussian 11x11 windows (sigma 1.5) that lie wholly inside, K .01 and .03,
/// range 1.
///
/// Windows that touch a void are left out.
#[derive(Clone, Debug)]
pub(crate) struct SsimLoss {
    rows: usize,
    cols: usize,
    heights: Vec<f64>,
    mean: Vec<f64>,
    square: Vec<f64>,
    counts: Vec<bool>,
}

impl SsimLoss {
    /// Prepares the target's half, (rows, cols) heights and which of them are none. A map with a side below 11 has no window:
    /// the loss is 0.
    ///
    /// # Panics
    /// When the numbers of values differ.
    #[must_use]
    pub(crate) fn new(rows: usize, cols: usize, heights: &[f64], valid: &[bool]) -> Self {
        assert_eq!((heights.len(), valid.len()), (rows * cols, rows * cols), "a map of {rows}x{cols}");
        let mut loss = Self {
            rows,
            cols,
            heights: heights.to_vec(),
            mean: Vec::new(),
            square: Vec::new(),
            counts: Vec::new(),
        };
        if rows >= WINDOW && cols >= WINDOW {
            let means = |x: Vec<f64>| window_means(&x, rows, cols);
            loss.mean = means(heights.to_vec());
            loss.square = means(heights.iter().map(|z| z * z).collect());
            let voids = means(valid.iter().map(|&v| if v { 0.0 } else { 1.0 }).collect());
            loss.counts = voids.iter().map(|&share| share == 0.0).collect();
        }
        loss
    }

    /// 1 - mean SSIM of `y`; adds `weight` times its gradient.
    pub(crate) fn add(&self, y: &[f64], weight: f64, gradient: &mut [f64]) -> f64 {
        let n = self.counts.iter().filter(|c| **c).count();
        if n == 0 {
            return 0.0;
        }
        let (rows, cols) = (self.rows, self.cols);
        let square: Vec<f64> = y.iter().map(|y| y * y).collect();
        let product: Vec<f64> = y.iter().zip(&self.heights).map(|(y, z)| y * z).collect();
        let [mean, square, product] = [y, &square, &product].map(|x| window_means(x, rows, cols));
        let scale = -weight / n as f64;
        let mut sum = 0.0;
        let mut d = [(); 3].map(|()| vec![0.0; mean.len()]);
        for i in (0..mean.len()).filter(|&i| self.counts[i]) {
            let moments = [mean[i], self.mean[i], square[i], self.square[i], product[i]];
            let (ssim, slopes) = similarity(moments, 1.0);
            sum += ssim;
            for (d, slope) in d.iter_mut().zip(slopes) {
                d[i] = scale * slope;
            }
        }
        let spread = d.map(|d| window_means_adjoint(&d, rows, cols));
        for (i, g) in gradient.iter_mut().enumerate() {
            *g += spread[0][i] + 2.0 * y[i] * spread[1][i] + self.heights[i] * spread[2][i];
        }
        1.0 - sum / n as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Grid, Mask};
    use crate::metrics::ssim;

    const ROWS: usize = 18;
    const COLS: usize = 21;

    fn bumpy(phase: f64) -> Vec<f64> {
        let at = |i: usize| {
            let (r, c) = ((i / COLS) as f64, (i % COLS) as f64);
            0.5 + 0.3 * (0.37 * r + phase).sin() * (0.23 * c - phase).cos()
                + 0.05 * (1.9 * r + 2.3 * c + phase).sin()
        };
        (0..ROWS * COLS).map(at).collect()
    }

    fn voids() -> [Vec<bool>; 2] {
        let whole = vec![true; ROWS * COLS];
        let mut one = whole.clone();
        one[3] = false;
        [whole, one]
    }

    #[test]
    fn gradient_equals_finite_differences_beside_voids() {
        let y = bumpy(0.1);
        for valid in voids() {
            let loss = SsimLoss::new(ROWS, COLS, &bumpy(0.8), &valid);
            let mut gradient = vec![0.0; y.len()];
            loss.add(&y, 1.0, &mut gradient);
            let scale = gradient.iter().fold(0.0f64, |a, g| a.max(g.abs()));
            assert!(scale > 0.0);
            for i in (0..y.len()).step_by(5) {
                let shifted = |by: f64| {
                    let mut moved = y.clone();
                    moved[i] += by;
                    loss.add(&moved, 1.0, &mut vec![0.0; y.len()])
                };
                let difference = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                assert!((difference - gradient[i]).abs() < 1e-6 * scale, "{i}: {difference} {}", gradient[i]);
            }
        }
    }

    #[test]
    fn it_is_what_the_metric_leaves_of_one() {
        let (y, z) = (bumpy(0.1), bumpy(0.8));
        let grid = |v: &[f64]| Grid::from_vec(ROWS, COLS, v.iter().map(|z| *z as f32).collect()).unwrap();
        let exact = |v: &[f64]| v.iter().map(|z| f64::from(*z as f32)).collect::<Vec<f64>>();
        for valid in voids() {
            let loss = SsimLoss::new(ROWS, COLS, &exact(&z), &valid);
            let mask = Mask::from_vec(ROWS, COLS, valid).unwrap();
            let want = 1.0 - ssim(&grid(&y), &grid(&z), &mask, 1.0).unwrap();
            let got = loss.add(&exact(&y), 1.0, &mut vec![0.0; y.len()]);
            assert!((got - want).abs() < 1e-12, "{got} {want}");
        }
    }

    #[test]
    fn equal_terrain_has_no_loss_and_voids_are_not_seen() {
        let [_, valid] = voids();
        let mut y = bumpy(0.8);
        let loss = SsimLoss::new(ROWS, COLS, &y, &valid);
        y[3] = -7.0;
        let mut g = vec![0.0; y.len()];
        assert!(loss.add(&y, 1.0, &mut g).abs() < 1e-12);
        y[200] += 0.1;
        assert!(loss.add(&y, 1.0, &mut g) > 1e-3);
    }
}
