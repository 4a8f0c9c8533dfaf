//! 1 - SSIM (Wang et al. 2004) with its gradient, by separable windows.

use super::Target;

/// Taps of the Gaussian window.
const TAPS: usize = 11;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The loss against one target: Gaussian 11x11 windows (sigma 1.5) that lie wholly inside, K .01 and .03, range 1.
///
/// Windows that touch a void are left out.
#[derive(Clone, Debug)]
pub struct SsimLoss {
    rows: usize,
    cols: usize,
    heights: Vec<f64>,
    mean: Vec<f64>,
    variance: Vec<f64>,
    counts: Vec<bool>,
}

impl SsimLoss {
    /// Prepares the target's half. A map with a side below 11 has no window: the loss is 0.
    #[must_use]
    pub fn new(target: &Target) -> Self {
        let (rows, cols) = (target.rows, target.cols);
        if rows < TAPS || cols < TAPS {
            let empty = Vec::new;
            return Self { rows, cols, heights: empty(), mean: empty(), variance: empty(), counts: Vec::new() };
        }
        let mean = blur(&target.heights, rows, cols);
        let square: Vec<f64> = target.heights.iter().map(|z| z * z).collect();
        let variance = blur(&square, rows, cols).iter().zip(&mean).map(|(s, m)| s - m * m).collect();
        let voids: Vec<f64> = target.valid.iter().map(|&v| if v { 0.0 } else { 1.0 }).collect();
        let counts = blur(&voids, rows, cols).iter().map(|&share| share == 0.0).collect();
        Self { rows, cols, heights: target.heights.clone(), mean, variance, counts }
    }

    /// 1 - mean SSIM of `y`; adds `weight` times its gradient.
    pub fn add(&self, y: &[f64], weight: f64, gradient: &mut [f64]) -> f64 {
        let n = self.counts.iter().filter(|c| **c).count();
        if n == 0 {
            return 0.0;
        }
        let (rows, cols) = (self.rows, self.cols);
        let square: Vec<f64> = y.iter().map(|y| y * y).collect();
        let product: Vec<f64> = y.iter().zip(&self.heights).map(|(y, z)| y * z).collect();
        let (mean, square, product) = (blur(y, rows, cols), blur(&square, rows, cols), blur(&product, rows, cols));
        let scale = -weight / n as f64;
        let mut sum = 0.0;
        let mut d_mean = vec![0.0; mean.len()];
        let mut d_square = vec![0.0; mean.len()];
        let mut d_product = vec![0.0; mean.len()];
        for i in (0..mean.len()).filter(|&i| self.counts[i]) {
            let (mx, my) = (mean[i], self.mean[i]);
            let a1 = 2.0 * mx * my + C1;
            let a2 = 2.0 * (product[i] - mx * my) + C2;
            let b1 = mx * mx + my * my + C1;
            let b2 = square[i] - mx * mx + self.variance[i] + C2;
            let ssim = a1 * a2 / (b1 * b2);
            sum += ssim;
            let by_product = 2.0 * a1 / (b1 * b2);
            let by_square = -ssim / b2;
            let by_mean = 2.0 * my * a2 / (b1 * b2) - 2.0 * mx * ssim / b1 - 2.0 * mx * by_square - my * by_product;
            d_mean[i] = scale * by_mean;
            d_square[i] = scale * by_square;
            d_product[i] = scale * by_product;
        }
        let spread = [d_mean, d_square, d_product].map(|d| spread(&d, rows, cols));
        for (i, g) in gradient.iter_mut().enumerate() {
            *g += spread[0][i] + 2.0 * y[i] * spread[1][i] + self.heights[i] * spread[2][i];
        }
        1.0 - sum / n as f64
    }
}

fn window() -> [f64; TAPS] {
    let mut w: [f64; TAPS] = std::array::from_fn(|i| (-(i as f64 - 5.0).powi(2) / (2.0 * SIGMA * SIGMA)).exp());
    let sum: f64 = w.iter().sum();
    w.iter_mut().for_each(|w| *w /= sum);
    w
}

/// Window means at the positions where the window fits: (rows, cols) -> (rows - 10, cols - 10).
fn blur(x: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let w = window();
    let (out_rows, out_cols) = (rows + 1 - TAPS, cols + 1 - TAPS);
    let mut out = vec![0.0; out_rows * out_cols];
    let mut line = vec![0.0; cols];
    for (row, out) in out.chunks_exact_mut(out_cols).enumerate() {
        line.fill(0.0);
        for (tap, w) in w.iter().enumerate() {
            for (l, x) in line.iter_mut().zip(&x[(row + tap) * cols..]) {
                *l += w * x;
            }
        }
        for (tap, w) in w.iter().enumerate() {
            for (o, l) in out.iter_mut().zip(&line[tap..]) {
                *o += w * l;
            }
        }
    }
    out
}

/// The transpose of [`blur`]: (rows - 10, cols - 10) -> (rows, cols).
fn spread(d: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let w = window();
    let out_cols = cols + 1 - TAPS;
    let mut out = vec![0.0; rows * cols];
    let mut line = vec![0.0; cols];
    for (row, d) in d.chunks_exact(out_cols).enumerate() {
        line.fill(0.0);
        for (tap, w) in w.iter().enumerate() {
            for (l, d) in line[tap..].iter_mut().zip(d) {
                *l += w * d;
            }
        }
        for (tap, w) in w.iter().enumerate() {
            for (o, l) in out[(row + tap) * cols..].iter_mut().zip(&line) {
                *o += w * l;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::{bumpy, gradient_error};
    use super::*;

    fn target(valid: Vec<bool>) -> Target {
        Target { rows: 18, cols: 21, heights: bumpy(18, 21, 0.8), valid }
    }

    #[test]
    fn gradient_equals_finite_differences_with_and_without_voids() {
        let y = bumpy(18, 21, 0.1);
        let mut voids = vec![true; y.len()];
        voids[3] = false;
        for valid in [vec![true; y.len()], voids] {
            let loss = SsimLoss::new(&target(valid));
            let error = gradient_error(&y, 1e-5, |y, g| loss.add(y, 1.0, g), (0..y.len()).step_by(5));
            assert!(error < 1e-6, "{error}");
        }
    }

    #[test]
    fn equal_terrain_has_no_loss_and_voids_are_not_seen() {
        let mut valid = vec![true; 18 * 21];
        valid[3] = false;
        let t = target(valid);
        let mut y = t.heights.clone();
        y[3] = -7.0;
        let mut g = vec![0.0; y.len()];
        assert!(SsimLoss::new(&t).add(&y, 1.0, &mut g).abs() < 1e-12);
        y[200] += 0.1;
        assert!(SsimLoss::new(&t).add(&y, 1.0, &mut g) > 1e-3);
    }
}
