//! Structural similarity.
//!
//! Two rasters -> the similarity of their 11x11 Gaussian windows, 1 for equal ones.
//!
//! Source: Wang, Bovik, Sheikh & Simoncelli 2004, *Image quality assessment*, with their constants (sigma 1.5, K1 .01, K2
//! .03, weighted population moments): scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False)`, which likewise averages only windows that lie inside the raster. Windows that touch a
//! void are left out too. Cost: 110 multiplications a cell, rows in parallel.

use super::check_pair;
use super::error::check_range;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use rayon::prelude::*;

/// Side of the window: 3.5 sigma on either side, rounded.
const WINDOW: usize = 11;
const RADIUS: usize = WINDOW / 2;
const SIGMA: f64 = 1.5;
const K1: f64 = 0.01;
const K2: f64 = 0.03;

/// The similarity around every cell.
#[derive(Clone, Debug, PartialEq)]
pub struct SsimMap {
    /// Similarity of the window around each cell; 0 where there is none.
    pub values: Grid<f64>,
    /// True where the whole window lies inside the raster and holds no void.
    pub valid: Mask,
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
pub fn ssim_map(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask, range: f64) -> Result<SsimMap> {
    check_pair(output, truth, valid)?;
    check_range(range)?;
    let (rows, cols) = truth.shape();
    let weights = gaussian();
    let mut values = Grid::filled(rows, cols, 0.0);
    let mut windows = Mask::filled(rows, cols, false);
    values
        .as_mut_slice()
        .par_chunks_mut(cols)
        .zip(windows.as_mut_slice().par_chunks_mut(cols))
        .enumerate()
        .filter(|(row, _)| (RADIUS..rows.saturating_sub(RADIUS)).contains(row))
        .for_each(|(row, (values, windows))| {
            // Five moments blurred down the columns, and the voids that each column brings into the window.
            let mut columns = vec![[0.0; 5]; cols];
            let mut voids = vec![0usize; cols];
            for (k, weight) in weights.iter().enumerate() {
                let start = (row + k - RADIUS) * cols;
                for col in 0..cols {
                    if valid.as_slice()[start + col] {
                        let a = f64::from(output.as_slice()[start + col]);
                        let b = f64::from(truth.as_slice()[start + col]);
                        for (sum, moment) in columns[col].iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *sum += weight * moment;
                        }
                    } else {
                        voids[col] += 1;
                    }
                }
            }
            for col in RADIUS..cols.saturating_sub(RADIUS) {
                let window = col - RADIUS..=col + RADIUS;
                if voids[window.clone()].iter().sum::<usize>() == 0 {
                    let mut moments = [0.0; 5];
                    for (weight, column) in weights.iter().zip(&columns[window]) {
                        for (sum, moment) in moments.iter_mut().zip(column) {
                            *sum += weight * moment;
                        }
                    }
                    values[col] = similarity(moments, range);
                    windows[col] = true;
                }
            }
        });
    Ok(SsimMap { values, valid: windows })
}

/// Equation 13 of Wang et al. from the means of a, b, aa, bb and ab.
fn similarity([a, b, aa, bb, ab]: [f64; 5], range: f64) -> f64 {
    let (c1, c2) = ((K1 * range).powi(2), (K2 * range).powi(2));
    let (var_a, var_b, cov) = (aa - a * a, bb - b * b, ab - a * b);
    (2.0 * a * b + c1) * (2.0 * cov + c2) / ((a * a + b * b + c1) * (var_a + var_b + c2))
}

fn gaussian() -> [f64; WINDOW] {
    let mut weights = std::array::from_fn(|k| {
        let x = k as f64 - RADIUS as f64;
        (-0.5 * (x / SIGMA).powi(2)).exp()
    });
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
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
