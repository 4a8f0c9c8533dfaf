//! Structural similarity.
//!
//! Two rasters -> the similarity of their 11x11 Gaussian windows, 1 for equal ones.
//!
//! Source: Wang, Bovik, Sheikh & Simoncelli 2004, *Image quality assessment*, with their constants (sigma 1.5, K1 .01, K2
//! .03, weighted population moments): scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False)`, which likewise averages only windows that lie inside the raster. Windows that touch a
//! void are left out too. The loss of trainings (`learn::SsimLoss`) is made of the same parts. Cost: 110 multiplications a cell.

use super::check_pair;
use super::error::check_range;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};
use rayon::prelude::*;

/// Side of the window: 3.5 sigma on either side, rounded.
pub(crate) const WINDOW: usize = 11;
const RADIUS: usize = WINDOW / 2;
const SIGMA: f64 = 1.5;
const K1: f64 = 0.01;
const K2: f64 = 0.03;

/// The similarity around every cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SsimMap {
    /// Similarity of the window around each cell; 0 where there is none.
    pub(crate) values: Grid<f64>,
    /// True where the whole window lies inside the raster and holds no void.
    pub(crate) valid: Mask,
}

/// Mean structural similarity over all windows that lie inside the raster and hold no void. `range`: the span of possible
/// heights (1 for unit heights).
///
/// # Errors
/// When the shapes differ, a valid value is not finite, `range` is not positive and finite, or there is no such window.
pub fn ssim(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask, range: f64) -> Result<f64> {
    let map = ssim_map(output, truth, valid, range)?;
    let (mut sum, mut count) = (0.0, 0usize);
    for (&value, _) in map.values.as_slice().iter().zip(map.valid.as_slice()).filter(|(_, ok)| **ok) {
        sum += value;
        count += 1;
    }
    if count == 0 {
        return Err(Error::value(
            "number of 11x11 windows without a void",
            0,
            "structural similarity needs at least one",
        ));
    }
    Ok(sum / count as f64)
}

/// Structural similarity around every cell: see [`ssim`].
///
/// # Errors
/// When the shapes differ, nothing is valid, a valid value is not finite, or `range` is not positive and finite.
pub(crate) fn ssim_map(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask, range: f64) -> Result<SsimMap> {
    check_pair(output, truth, valid)?;
    check_range(range)?;
    let (rows, cols) = truth.shape();
    let mut values = Grid::filled(rows, cols, 0.0);
    let mut windows = Mask::filled(rows, cols, false);
    if rows < WINDOW || cols < WINDOW {
        return Ok(SsimMap { values, valid: windows });
    }
    let known = |map: &Grid<f32>| -> Vec<f64> {
        let cells = map.as_slice().iter().zip(valid.as_slice());
        cells.map(|(z, ok)| if *ok { f64::from(*z) } else { 0.0 }).collect()
    };
    let (a, b) = (known(output), known(truth));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let void: Vec<f64> = valid.as_slice().iter().map(|ok| if *ok { 0.0 } else { 1.0 }).collect();
    let moments: Vec<Vec<f64>> = [product(&a, &a), product(&b, &b), product(&a, &b), a, b, void]
        .par_iter()
        .map(|moment| window_means(moment, rows, cols))
        .collect();
    let [aa, bb, ab, a, b, void] = &moments[..] else { unreachable!("six moments") };
    let inside = cols + 1 - WINDOW;
    for (i, _) in void.iter().enumerate().filter(|(_, share)| **share == 0.0) {
        let at = Cell::new(i / inside + RADIUS, i % inside + RADIUS);
        values[at] = similarity([a[i], b[i], aa[i], bb[i], ab[i]], range).0;
        windows[at] = true;
    }
    Ok(SsimMap { values, valid: windows })
}

/// Equation 13 of Wang et al. from the means of a, b, aa, bb and ab over a window, and its derivatives by those of a, aa and ab.
pub(crate) fn similarity([a, b, aa, bb, ab]: [f64; 5], range: f64) -> (f64, [f64; 3]) {
    let (c1, c2) = ((K1 * range).powi(2), (K2 * range).powi(2));
    let a1 = 2.0 * a * b + c1;
    let a2 = 2.0 * (ab - a * b) + c2;
    let b1 = a * a + b * b + c1;
    let b2 = (aa - a * a) + (bb - b * b) + c2;
    let ssim = a1 * a2 / (b1 * b2);
    let by_ab = 2.0 * a1 / (b1 * b2);
    let by_aa = -ssim / b2;
    let by_a = 2.0 * b * a2 / (b1 * b2) - 2.0 * a * ssim / b1 - 2.0 * a * by_aa - b * by_ab;
    (ssim, [by_a, by_aa, by_ab])
}

/// Weights of the window along one side.
fn gaussian() -> [f64; WINDOW] {
    let mut weights = std::array::from_fn(|k| {
        let x = k as f64 - RADIUS as f64;
        (-0.5 * (x / SIGMA).powi(2)).exp()
    });
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    weights
}

/// Weighted means over every window that lies inside: (rows, cols) -> (rows - 10, cols - 10).
pub(crate) fn window_means(x: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let w = gaussian();
    let (out_rows, out_cols) = (rows + 1 - WINDOW, cols + 1 - WINDOW);
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

/// The adjoint of [`window_means`]: (rows - 10, cols - 10) -> (rows, cols).
pub(crate) fn window_means_adjoint(d: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let w = gaussian();
    let out_cols = cols + 1 - WINDOW;
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
    use super::*;
    use proptest::prelude::*;

    fn patches() -> impl Strategy<Value = (Grid<f32>, Grid<f32>)> {
        (11usize..20, 11usize..20).prop_flat_map(|(rows, cols)| {
            let heights = || proptest::collection::vec(0.0f32..1.0, rows * cols);
            (heights(), heights()).prop_map(move |(a, b)| {
                (Grid::from_vec(rows, cols, a).unwrap(), Grid::from_vec(rows, cols, b).unwrap())
            })
        })
    }

    proptest! {
        #[test]
        fn equal_is_one_and_the_order_does_not_matter((a, b) in patches()) {
            let valid = a.map(|_| true);
            prop_assert!((ssim(&a, &a, &valid, 1.0).unwrap() - 1.0).abs() < 1e-12);
            let (there, back) = (ssim(&a, &b, &valid, 1.0).unwrap(), ssim(&b, &a, &valid, 1.0).unwrap());
            prop_assert!((there - back).abs() < 1e-12 && there < 1.0);
            // The unit does not matter when the range goes with it.
            let scaled = ssim(&a.map(|z| z * 8.0), &b.map(|z| z * 8.0), &valid, 8.0).unwrap();
            prop_assert!((there - scaled).abs() < 1e-9);
        }
    }

    #[test]
    fn two_flat_patches_differ_by_luminance_alone() {
        let (a, b) = (Grid::filled(11, 13, 0.25f32), Grid::filled(11, 13, 0.75f32));
        let want = (2.0 * 0.25 * 0.75 + 1e-4) / (0.0625 + 0.5625 + 1e-4);
        assert!((ssim(&a, &b, &a.map(|_| true), 1.0).unwrap() - want).abs() < 1e-12);
    }

    #[test]
    fn windows_with_voids_are_left_out() {
        let truth = Grid::from_fn(30, 30, |c| ((c.row * 3 + c.col * 5) % 17) as f32 / 16.0);
        let mut output = truth.clone();
        let mut valid = truth.map(|_| true);
        output[Cell::new(14, 3)] = 9.0;
        assert!(ssim(&output, &truth, &valid, 1.0).unwrap() < 0.99);
        valid[Cell::new(14, 3)] = false;
        assert!((ssim(&output, &truth, &valid, 1.0).unwrap() - 1.0).abs() < 1e-12);
        let map = ssim_map(&output, &truth, &valid, 1.0).unwrap();
        let touching = 11 * 4; // rows 9 to 19, columns 5 to 8
        assert_eq!(map.valid.as_slice().iter().filter(|ok| **ok).count(), 20 * 20 - touching);
        let small = Grid::filled(10, 40, 0.5f32);
        let message = ssim(&small, &small, &small.map(|_| true), 1.0).unwrap_err().to_string();
        assert!(message.contains("11x11 windows"));
    }
}
