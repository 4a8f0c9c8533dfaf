//! Detail without training: every small patch of a coarse map becomes the exemplar's most fitting one (GPNN).
//!
//! Granot, Feinstein, Shocher, Bagon, Irani: *Drop the GAN: In Defense of Patches Nearest Neighbors as Single Image Generative
//! Models*, CVPR 2022. Coarse map -> [`PatchDetail::add`] -> map with detail. Departures: patches are compared and copied without
//! their means, so that the map keeps its elevations; the coarse map is given and no noise is drawn, so that there is one
//! answer; slopes are brought to the exemplar's before and back after, as in the trained model. Cost: at each scale and
//! iteration two exact searches, 98 multiplications for every pair of a map cell and an exemplar cell (about 2 s for 128x128 cells
//! from 128x128 on one core), which is why it is for small maps.

mod search;

use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::grid::resample::resample;
use crate::metrics::mean_square_slope;
use search::{Patches, SIDE, best_keys};

/// Ratio of the sides of two scales (3/4; the paper's code).
const FACTOR: f64 = 0.75;
/// Largest number of pairs of a map cell and an exemplar cell that [`PatchDetail::add`] searches: half an hour.
const MOST_PAIRS: usize = 1 << 38;

/// Settings of the search.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PatchDetailConfig {
    /// Forms smaller than this many cells are the exemplar's, larger ones the map's.
    pub size: f64,
    /// How strongly every exemplar patch wants to be used: small values force all of them to appear (alpha, Eq. 2). The paper
    /// uses .005 for complete and 1 for free answers, in units of squared grey values.
    pub completeness: f32,
    /// Rounds at every scale; after the first one patches are compared with the exemplar's own instead of its blurred ones.
    pub iterations: usize,
}

impl Default for PatchDetailConfig {
    fn default() -> Self {
        Self { size: 2.0, completeness: 0.05, iterations: 2 }
    }
}

/// An exemplar whose patches are the detail.
#[derive(Clone, Debug)]
pub struct PatchDetail {
    exemplar: Grid<f32>,
    config: PatchDetailConfig,
}

impl PatchDetail {
    /// Takes the patches of `exemplar` (heights in any unit).
    ///
    /// # Errors
    /// When the exemplar is smaller than 16 cells, level or not finite, or a setting is out of range.
    pub fn new(exemplar: Grid<f32>, config: PatchDetailConfig) -> Result<Self> {
        let (rows, cols) = exemplar.shape();
        if rows.min(cols) < 16 {
            return Err(Error::value(
                "exemplar for detail",
                format!("{rows}x{cols}"),
                "allowed: at least 16x16",
            ));
        }
        if let Some((_, z)) = exemplar.cells().find(|(_, z)| !z.is_finite()) {
            return Err(Error::value("height of the exemplar", z, "allowed: finite"));
        }
        if mean_square_slope(&exemplar) <= 0.0 {
            return Err(Error::value("relief of the exemplar", 0, "level ground has no detail"));
        }
        if !(1.0..=64.0).contains(&config.size) {
            return Err(Error::value("size", config.size, "allowed: 1 to 64"));
        }
        if !(config.completeness > 0.0 && config.completeness.is_finite()) {
            return Err(Error::value("completeness", config.completeness, "allowed: above 0"));
        }
        if !(1..=100).contains(&config.iterations) {
            return Err(Error::value("iterations", config.iterations, "allowed: 1 to 100"));
        }
        Ok(Self { exemplar, config })
    }

    /// Adds detail to `heights`, in any unit.
    ///
    /// # Errors
    /// When a height is not finite, or the map is too large for an exact search.
    pub fn add(&self, heights: &Grid<f32>) -> Result<Grid<f32>> {
        if let Some((cell, z)) = heights.cells().find(|(_, z)| !z.is_finite()) {
            let name = format!("height at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, z, "allowed: finite"));
        }
        if heights.len().saturating_mul(self.exemplar.len()) > MOST_PAIRS {
            let allowed = format!("allowed: {} cells with this exemplar", MOST_PAIRS / self.exemplar.len());
            return Err(Error::value("cells of the map", heights.len(), allowed));
        }
        let start = (1..).take_while(|&n| FACTOR.powi(-n) <= self.config.size).last().unwrap_or(1);
        let at = |grid: &Grid<f32>, n: i32| {
            let side = |s: usize| ((s as f64 * FACTOR.powi(n)).round() as usize).max(SIDE);
            resample(grid, side(grid.rows()), side(grid.cols()))
        };
        let mut map = at(heights, start);
        let exemplar_slope = mean_square_slope(&at(&self.exemplar, start)).sqrt() as f32;
        let slope = mean_square_slope(&map).sqrt() as f32;
        if slope <= 0.0 || exemplar_slope <= 0.0 || heights.rows().min(heights.cols()) < SIDE {
            return Ok(heights.clone());
        }
        let ratio = exemplar_slope / slope;
        map = map.map(|z| z * ratio);
        for n in (0..start).rev() {
            let values = at(&self.exemplar, n);
            let blurred = resample(&at(&self.exemplar, n + 1), values.rows(), values.cols());
            let size = at(heights, n).shape();
            map = resample(&map, size.0, size.1);
            for iteration in 0..self.config.iterations {
                let keys = if iteration == 0 { &blurred } else { &values };
                map = self.round(&map, keys, &values);
            }
        }
        Ok(map.map(|z| z / ratio))
    }

    /// Every patch of `map` becomes the value at its best key; overlapping patches are averaged.
    fn round(&self, map: &Grid<f32>, keys: &Grid<f32>, values: &Grid<f32>) -> Grid<f32> {
        let (queries, keys, values) = (Patches::of(map), Patches::of(keys), Patches::of(values));
        let alpha = self.config.completeness * keys.mean_square();
        let best = best_keys(&queries, &keys, alpha);
        let (rows, cols) = map.shape();
        let (mut sum, mut count) = (vec![0.0f32; rows * cols], vec![0.0f32; rows * cols]);
        let across = cols - SIDE + 1;
        for (q, &key) in best.iter().enumerate() {
            let (row, col) = (q / across, q % across);
            // The value's own mean over its key's: what the patch adds to its elevation.
            let mean = queries.mean(q) + values.mean(key) - keys.mean(key);
            for (i, v) in values.patch(key).iter().enumerate().take(SIDE * SIDE) {
                let at = (row + i / SIDE) * cols + col + i % SIDE;
                sum[at] += v + mean;
                count[at] += 1.0;
            }
        }
        let cells = sum.iter().zip(&count).map(|(s, n)| s / n).collect();
        Grid::from_vec(rows, cols, cells).expect("the map's shape")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::copy_audit;

    fn ground(side: usize) -> Grid<f32> {
        Grid::from_fn(side, side, |c| {
            let (y, x) = (c.row as f32 * 0.35, c.col as f32 * 0.28);
            0.5 + 0.2 * (0.5 * y).sin()
                + 0.15 * (0.4 * x + y).cos()
                + 0.04 * (4.3 * x).sin() * (3.9 * y).cos()
        })
    }

    fn model() -> PatchDetail {
        PatchDetail::new(ground(40), PatchDetailConfig::default()).unwrap()
    }

    #[test]
    fn the_exemplar_gets_its_own_detail_back() {
        let exemplar = ground(40);
        let smooth = resample(&resample(&exemplar, 22, 22), 40, 40);
        let rebuilt = model().add(&smooth).unwrap();
        let miss = |map: &Grid<f32>| -> f32 {
            map.as_slice().iter().zip(exemplar.as_slice()).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        assert!(miss(&rebuilt) < 0.1 * miss(&smooth), "{} {}", miss(&rebuilt), miss(&smooth));
        assert!(copy_audit(&rebuilt, &exemplar).unwrap().copied_share > 0.5);
    }

    #[test]
    fn elevation_and_unit_do_not_matter_and_threads_neither() {
        let map = Grid::from_fn(30, 34, |c| (c.row as f32 * 0.2).sin() + (c.col as f32 * 0.15).cos());
        let one = model().add(&map).unwrap();
        assert_ne!(one, map);
        let moved = model().add(&map.map(|z| 100.0 * z)).unwrap();
        for (a, b) in one.as_slice().iter().zip(moved.as_slice()) {
            assert!((100.0 * a - b).abs() < 0.5, "{a} {b}");
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| model().add(&map).unwrap()), one);
    }

    #[test]
    fn bad_input_is_named() {
        assert!(PatchDetail::new(ground(12), PatchDetailConfig::default()).is_err());
        assert!(PatchDetail::new(Grid::filled(20, 20, 1.0), PatchDetailConfig::default()).is_err());
        let config = PatchDetailConfig { completeness: 0.0, ..Default::default() };
        assert!(PatchDetail::new(ground(20), config).unwrap_err().to_string().contains("completeness"));
        let flat = Grid::filled(20, 20, 0.3);
        assert_eq!(model().add(&flat).unwrap(), flat);
    }
}
