//! Roughness by wavelength: the radial power spectrum.
//!
//! The mean is taken away, a Hann window fades the frame out, and the power of the two-dimensional Fourier transform is
//! averaged over rings of one wavenumber, from one wave across the shorter side to the finest that the raster holds (two
//! cells per wave). Voids stand at the mean. The distance of two spectra is the root mean square of their difference in
//! decibels over the rings. Cost: n log n for n cells.

use super::{check_one, check_pair};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};
use rustfft::{FftPlanner, num_complex::Complex};

/// Power below this share of the truth's mean ring power counts as this much, so that flat outputs have a distance at all:
/// 120 dB, far below the rounding of `f32` heights.
const FLOOR: f64 = 1e-12;

/// Mean power by wavenumber 1, 2, ... waves across the shorter side, up to half that side in cells.
///
/// # Errors
/// When the shapes differ, nothing is valid, a valid value is not finite, or the shorter side has fewer than 4 cells.
pub(crate) fn radial_spectrum(terrain: &Grid<f32>, valid: &Mask) -> Result<Vec<f64>> {
    check_one("terrain", terrain, valid)?;
    let (rows, cols) = terrain.shape();
    let shorter = rows.min(cols);
    if shorter < 4 {
        return Err(Error::value("shorter side", shorter, "a spectrum needs at least 4 cells"));
    }
    let (down, across) = (hann(rows), hann(cols));
    let weight = |cell: Cell| if valid[cell] { down[cell.row] * across[cell.col] } else { 0.0 };
    let (mut sum, mut total) = (0.0, 0.0);
    for (cell, &z) in terrain.cells().filter(|(cell, _)| valid[*cell]) {
        sum += weight(cell) * f64::from(z);
        total += weight(cell);
    }
    let mean = sum / total;
    let faded = terrain.cells().map(|(cell, &z)| {
        let w = weight(cell);
        Complex::new(if w > 0.0 { w * (f64::from(z) - mean) } else { 0.0 }, 0.0)
    });
    let transform = transform(faded.collect(), rows, cols);
    let rings = shorter / 2;
    let (mut power, mut count) = (vec![0.0; rings + 1], vec![0usize; rings + 1]);
    let signed = |i: usize, side: usize| i.min(side - i) as f64 / side as f64;
    for (i, value) in transform.iter().enumerate() {
        let frequency = signed(i / cols, rows).hypot(signed(i % cols, cols));
        let ring = (frequency * shorter as f64).round() as usize;
        if ring <= rings {
            power[ring] += value.norm_sqr();
            count[ring] += 1;
        }
    }
    Ok(power.iter().zip(&count).skip(1).map(|(p, &n)| p / n as f64).collect())
}

/// Root mean square over the rings of 10 log10(output / truth), in decibels: 0 for equal spectra, 6 for heights twice as
/// large, 10 for white noise of ten times the power.
///
/// # Errors
/// As [`radial_spectrum`], and when the truth is flat.
pub fn spectrum_distance(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let (output, truth) = (radial_spectrum(output, valid)?, radial_spectrum(truth, valid)?);
    let floor = FLOOR * truth.iter().sum::<f64>() / truth.len() as f64;
    if floor <= 0.0 {
        return Err(Error::value("power of the truth", 0, "flat ground has nothing to compare with"));
    }
    let squares =
        output.iter().zip(&truth).map(|(o, t)| (10.0 * (o.max(floor) / t.max(floor)).log10()).powi(2));
    Ok((squares.sum::<f64>() / truth.len() as f64).sqrt())
}

/// Hann window with its zeros half a cell outside.
fn hann(side: usize) -> Vec<f64> {
    let step = std::f64::consts::TAU / side as f64;
    (0..side).map(|i| 0.5 - 0.5 * ((i as f64 + 0.5) * step).cos()).collect()
}

/// Two-dimensional Fourier transform, rows x cols row-major in and out.
fn transform(mut values: Vec<Complex<f64>>, rows: usize, cols: usize) -> Vec<Complex<f64>> {
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(cols).process(&mut values);
    let mut turned: Vec<Complex<f64>> =
        (0..rows * cols).map(|i| values[i % rows * cols + i / rows]).collect();
    planner.plan_fft_forward(rows).process(&mut turned);
    (0..rows * cols).map(|i| turned[i % cols * rows + i / cols]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_of_waves() {
        let (rows, cols) = (6, 5);
        let values: Vec<Complex<f64>> =
            (0..rows * cols).map(|i| Complex::new((i * i % 7) as f64 - 2.0, 0.0)).collect();
        let got = transform(values.clone(), rows, cols);
        for (k, got) in got.iter().enumerate() {
            let mut want = Complex::new(0.0, 0.0);
            for (i, value) in values.iter().enumerate() {
                let turns = (k / cols * (i / cols)) as f64 / rows as f64
                    + (k % cols * (i % cols)) as f64 / cols as f64;
                want += value * Complex::from_polar(1.0, -std::f64::consts::TAU * turns);
            }
            assert!((got - want).norm() < 1e-9);
        }
    }

    #[test]
    fn a_wave_stands_in_its_own_ring() {
        for waves in [3usize, 10, 20] {
            let terrain =
                Grid::from_fn(64, 96, |c| (c.row as f32 * waves as f32 * std::f32::consts::TAU / 64.0).sin());
            let spectrum = radial_spectrum(&terrain, &terrain.map(|_| true)).unwrap();
            assert_eq!(spectrum.len(), 32);
            let strongest = (0..32).max_by(|&a, &b| spectrum[a].total_cmp(&spectrum[b])).unwrap() + 1;
            assert_eq!(strongest, waves);
        }
    }

    #[test]
    fn distances_are_in_decibels() {
        let truth =
            Grid::from_fn(40, 40, |c| ((c.row * 37 + c.col * 61 + c.row * c.col * 7) % 23) as f32 / 22.0);
        let valid = truth.map(|_| true);
        assert_eq!(spectrum_distance(&truth, &truth, &valid).unwrap(), 0.0);
        let raised = truth.map(|z| z + 5.0);
        assert!(spectrum_distance(&raised, &truth, &valid).unwrap() < 1e-3);
        let doubled = truth.map(|z| 2.0 * z);
        assert!((spectrum_distance(&doubled, &truth, &valid).unwrap() - 20.0 * 2f64.log10()).abs() < 1e-4);
        let flat = Grid::filled(40, 40, 0.5);
        assert!(spectrum_distance(&flat, &truth, &valid).unwrap() > 50.0);
        assert!(spectrum_distance(&truth, &flat, &valid).is_err());
        let mut holed = doubled.clone();
        let mut some = valid.clone();
        (holed[Cell::new(20, 20)], some[Cell::new(20, 20)]) = (1e6, false);
        assert!((spectrum_distance(&holed, &truth, &some).unwrap() - 20.0 * 2f64.log10()).abs() < 1e-4);
    }
}
