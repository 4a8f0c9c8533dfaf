//! Noise with a power spectrum that falls with frequency, made of octaves.

use crate::grid::Grid;
use crate::grid::resample::resample;
use crate::seed::Seed;
use rand_distr::{Distribution, StandardNormal};

/// Noise of unit standard deviation whose power falls like frequency to the power of `-beta`, at wavelengths from about 4 to
/// `longest` cells and no longer. (rows, columns). Linear in the cells.
pub(super) fn octaves(shape: (usize, usize), beta: f64, longest: f64, seed: Seed) -> Grid<f32> {
    let mut sum = Grid::filled(shape.0, shape.1, 0.0f32);
    let mut spacing = 1;
    while 4.0 * spacing as f64 <= longest.max(4.0) {
        let (rows, cols) = (shape.0.div_ceil(spacing), shape.1.div_ceil(spacing));
        // An octave of half the frequency has 2^(beta - 2) times the power in a quarter of the area of the plane of frequencies.
        let weight = (spacing as f64).powf(0.5 * beta - 1.0) as f32;
        let mut stream = seed.stream(&format!("octave {spacing}"));
        let knots = Grid::from_fn(rows, cols, |_| StandardNormal.sample(&mut stream));
        let octave = resample(&knots, shape.0, shape.1);
        sum.as_mut_slice().iter_mut().zip(octave.as_slice()).for_each(|(s, o)| *s += weight * o);
        spacing *= 2;
    }
    let n = sum.len() as f64;
    let mean = sum.as_slice().iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let variance = sum.as_slice().iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
    sum.map(|&v| ((f64::from(v) - mean) / variance.sqrt().max(1e-9)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    /// Mean squared difference at a lag: what a spectrum says, without one.
    fn variogram(z: &Grid<f32>, lag: usize) -> f64 {
        let pairs = z.cells().filter(|(c, _)| c.col + lag < z.cols());
        let squares = pairs.map(|(c, v)| f64::from(v - z[Cell::new(c.row, c.col + lag)]).powi(2));
        squares.sum::<f64>() / (z.rows() * (z.cols() - lag)) as f64
    }

    #[test]
    fn steeper_spectra_are_smoother_and_deviation_is_one() {
        let noise = |beta| octaves((96, 120), beta, 64.0, Seed(4));
        let (rough, smooth) = (noise(1.0), noise(4.0));
        assert!(variogram(&rough, 1) > 3.0 * variogram(&smooth, 1));
        for z in [&rough, &smooth] {
            let square = z.as_slice().iter().map(|v| f64::from(v * v)).sum::<f64>() / z.len() as f64;
            assert!((square - 1.0).abs() < 1e-4, "{square}");
        }
        assert_eq!(rough, noise(1.0), "the same seed");
        assert!(octaves((1, 1), 2.0, 64.0, Seed(1)).as_slice()[0].is_finite());
    }
}
