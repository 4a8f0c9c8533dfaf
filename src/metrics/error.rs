//! Errors cell by cell.

use super::check_pair;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// Root mean square difference over valid cells, in the unit of the heights.
///
/// # Errors
/// When the shapes differ, nothing is valid, or a valid value is not finite.
pub fn rmse(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let (mut sum, mut count) = (0.0, 0usize);
    let pairs = output.as_slice().iter().zip(truth.as_slice()).zip(valid.as_slice());
    for ((&a, &b), _) in pairs.filter(|(_, ok)| **ok) {
        sum += (f64::from(a) - f64::from(b)).powi(2);
        count += 1;
    }
    Ok((sum / count as f64).sqrt())
}

/// Peak signal-to-noise ratio over valid cells, 10 log10(range^2 / mean squared difference), in decibels; infinite when
/// nothing differs. Equal to scikit-image's `peak_signal_noise_ratio` where nothing is void.
///
/// # Errors
/// As [`rmse`], and when `range` is not positive and finite.
pub fn psnr(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask, range: f64) -> Result<f64> {
    check_range(range)?;
    Ok(20.0 * (range / rmse(output, truth, valid)?).log10())
}

pub(super) fn check_range(range: f64) -> Result<()> {
    if range.is_finite() && range > 0.0 {
        Ok(())
    } else {
        Err(Error::value("range of heights", range, "allowed: positive and finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    #[test]
    fn a_constant_offset_has_a_known_ratio() {
        let truth = Grid::from_fn(9, 7, |c| (c.row * c.col) as f32 / 48.0);
        let valid = truth.map(|_| true);
        for (offset, decibel) in [(0.125, 18.061_799_739_838_87), (0.5, 6.020_599_913_279_624)] {
            let output = truth.map(|&z| z + offset);
            assert!((psnr(&output, &truth, &valid, 1.0).unwrap() - decibel).abs() < 1e-5);
            assert!((psnr(&output, &truth, &valid, 10.0).unwrap() - decibel - 20.0).abs() < 1e-5);
            assert!((rmse(&output, &truth, &valid).unwrap() - f64::from(offset)).abs() < 1e-7);
        }
        assert_eq!(psnr(&truth, &truth, &valid, 1.0).unwrap(), f64::INFINITY);
        assert!(psnr(&truth, &truth, &valid, 0.0).is_err());
    }

    #[test]
    fn voids_do_not_count() {
        let truth = Grid::filled(4, 4, 0.5);
        let mut output = Grid::filled(4, 4, 0.75);
        let mut valid = truth.map(|_| true);
        (output[Cell::new(2, 1)], valid[Cell::new(2, 1)]) = (f32::NAN, false);
        assert_eq!(rmse(&output, &truth, &valid).unwrap(), 0.25);
        valid[Cell::new(2, 1)] = true;
        assert!(rmse(&output, &truth, &valid).unwrap_err().to_string().contains("output at row 2, column 1"));
        assert!(rmse(&output, &truth, &Mask::filled(4, 4, false)).is_err());
        assert!(rmse(&output, &truth, &Mask::filled(4, 5, true)).is_err());
    }
}
