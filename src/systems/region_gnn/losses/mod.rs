//! The six losses of Liu & Benes 2025, 6.1, each with its gradient by hand, in f64.
//!
//! A loss reads heights and adds its weighted gradient to a buffer; no tensor of the size of the edge list is made. All are
//! means, so that they do not depend on the size of the map (Table B1 only makes sense so). Voids take no part.

mod further;
mod heights;
mod sketch_order;

use crate::learn::SsimLoss;

pub(crate) use further::further;
pub(crate) use heights::{ground_truth, slope, smooth};
pub(crate) use sketch_order::sketch_order;

/// The terrain to be met.
#[derive(Clone, Debug)]
pub(crate) struct Target {
    /// Rows.
    pub(crate) rows: usize,
    /// Columns.
    pub(crate) cols: usize,
    /// (rows, cols) heights in the unit interval.
    pub(crate) heights: Vec<f64>,
    /// (rows, cols) false at voids.
    pub(crate) valid: Vec<bool>,
}

impl Target {
    /// The same with voids filled by 0, so that not even a NaN there can reach a sum.
    #[must_use]
    pub(crate) fn without_voids(mut self) -> Self {
        self.heights.iter_mut().zip(&self.valid).filter(|(_, ok)| !**ok).for_each(|(z, _)| *z = 0.0);
        self
    }

    /// The SSIM loss against it.
    #[must_use]
    pub(crate) fn ssim(&self) -> SsimLoss {
        SsimLoss::new(self.rows, self.cols, &self.heights, &self.valid)
    }

    /// Number of cells with a height.
    #[must_use]
    pub(crate) fn valid_count(&self) -> usize {
        self.valid.iter().filter(|v| **v).count()
    }
}

/// Largest relative difference between a gradient and central differences of the value at some cells.
#[cfg(test)]
pub(crate) fn gradient_error(
    y: &[f64],
    step: f64,
    mut loss: impl FnMut(&[f64], &mut [f64]) -> f64,
    cells: impl Iterator<Item = usize>,
) -> f64 {
    let mut gradient = vec![0.0; y.len()];
    loss(y, &mut gradient);
    let scale = gradient.iter().fold(0.0f64, |a, g| a.max(g.abs()));
    assert!(scale > 0.0, "a gradient");
    let mut scratch = vec![0.0; y.len()];
    let mut worst = 0.0f64;
    for cell in cells {
        let mut at = |shift: f64| {
            let mut moved = y.to_vec();
            moved[cell] += shift;
            loss(&moved, &mut scratch)
        };
        let difference = (at(step) - at(-step)) / (2.0 * step);
        worst = worst.max((difference - gradient[cell]).abs() / scale);
    }
    worst
}

#[cfg(test)]
pub(crate) fn bumpy(rows: usize, cols: usize, phase: f64) -> Vec<f64> {
    (0..rows * cols)
        .map(|i| {
            let (r, c) = ((i / cols) as f64, (i % cols) as f64);
            0.5 + 0.3 * (0.37 * r + phase).sin() * (0.23 * c - phase).cos()
                + 0.05 * (1.9 * r + 2.3 * c + phase).sin()
        })
        .collect()
}
