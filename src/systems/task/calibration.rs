//! How much of a model's detail suits the exemplar.

use crate::error::Result;
use crate::grid::Grid;
use crate::metrics::{curvature_distance, slope_distance, spectrum_distance};
use rayon::prelude::*;

/// Gains that are tried: twentieths.
const STEPS: usize = 60;
const STEP: f32 = 0.05;

/// The gain with which `ground` + gain x `residual` is nearest to `truth`: the least sum of the distances of slopes, curvatures
/// and spectra, each over that of the ground alone.
///
/// # Errors
/// When the shapes differ or the truth is level.
pub(super) fn best_gain(ground: &Grid<f32>, residual: &Grid<f32>, truth: &Grid<f32>) -> Result<f32> {
    let valid = truth.map(|_| true);
    let distances = |gain: f32| -> Result<[f64; 3]> {
        let mut map = ground.clone();
        for (z, r) in map.as_mut_slice().iter_mut().zip(residual.as_slice()) {
            *z += gain * r;
        }
        Ok([
            slope_distance(&map, truth, &valid)?,
            curvature_distance(&map, truth, &valid)?,
            spectrum_distance(&map, truth, &valid)?,
        ])
    };
    let bare = distances(0.0)?;
    let costs: Vec<f64> = (0..=STEPS)
        .into_par_iter()
        .map(|i| {
            let found = distances(i as f32 * STEP)?;
            Ok(found.iter().zip(bare).map(|(d, bare)| d / bare.max(1e-9)).sum())
        })
        .collect::<Result<_>>()?;
    let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    Ok(best as f32 * STEP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    #[test]
    fn the_gain_that_made_the_truth_is_found() {
        let ground =
            Grid::from_fn(40, 44, |c| 0.3 * (c.row as f32 * 0.2).sin() + 0.2 * (c.col as f32 * 0.1).cos());
        let residual =
            Grid::from_fn(40, 44, |c: Cell| ((c.row * 37 + c.col * 61 + c.row * c.col) % 23) as f32 / 900.0);
        for gain in [0.0, 0.7, 1.6] {
            let mut truth = ground.clone();
            for (z, r) in truth.as_mut_slice().iter_mut().zip(residual.as_slice()) {
                *z += gain * r;
            }
            let found = best_gain(&ground, &residual, &truth).unwrap();
            assert!((found - gain).abs() < 0.06, "{found} {gain}");
        }
        assert!(best_gain(&ground, &residual, &Grid::filled(40, 44, 1.0)).is_err());
    }
}
