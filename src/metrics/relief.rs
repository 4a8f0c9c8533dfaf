//! What the eye sees and cell-by-cell errors do not: slopes, curvatures and pits.
//!
//! Slopes are differences of neighbouring heights in the unit of the heights per cell, as numpy's `gradient` takes them:
//! central, and one-sided at the frame; voids count as the frame does. Cells are taken as square. Distances between
//! distributions are earth mover's distances of the values themselves, without bins, relative to the truth's mean.

use super::{check_one, check_pair};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask, d8};

/// Mean slope of the output over mean slope of the truth: below 1 is too smooth.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, or the truth has no slope.
pub fn mean_slope_ratio(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let truth = slopes(truth, valid);
    Ok(mean(&slopes(output, valid)) / positive_mean("mean slope of the truth", &truth)?)
}

/// Mean slope of the valid cells, in the unit of the terrain a cell.
///
/// # Errors
/// When there is no slope.
pub(crate) fn mean_valid_slope(terrain: &Grid<f32>, valid: &Mask) -> Result<f64> {
    positive_mean("mean slope of the truth", &slopes(terrain, valid))
}

/// Earth mover's distance between the distributions of slopes, over the truth's mean slope: 0 for equal distributions,
/// wherever the slopes lie.
///
/// # Errors
/// As [`mean_slope_ratio`].
pub fn slope_distance(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let truth = slopes(truth, valid);
    let scale = positive_mean("mean slope of the truth", &truth)?;
    Ok(earth_movers_distance(slopes(output, valid), truth) / scale)
}

/// Earth mover's distance between the distributions of curvatures (mean of the four neighbours minus the cell), over the
/// truth's mean absolute curvature. Cells at the frame and beside voids have none.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, or the truth has no curvature.
pub fn curvature_distance(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let truth = curvatures(truth, valid);
    let sizes: Vec<f64> = truth.iter().map(|c| c.abs()).collect();
    let scale = positive_mean("mean curvature of the truth", &sizes)?;
    Ok(earth_movers_distance(curvatures(output, valid), truth) / scale)
}

/// Mean of the squared differences to the eastern and southern neighbour together, over the cells that have both.
#[must_use]
pub(crate) fn mean_square_slope(terrain: &Grid<f32>) -> f64 {
    let (rows, cols) = terrain.shape();
    let z = terrain.as_slice();
    let mut sum = 0.0;
    for row in 0..rows.saturating_sub(1) {
        for i in row * cols..(row + 1) * cols - 1 {
            sum += f64::from(z[i + 1] - z[i]).powi(2) + f64::from(z[i + cols] - z[i]).powi(2);
        }
    }
    sum / ((rows - 1) * (cols - 1)).max(1) as f64
}

/// Share of the cells with eight valid neighbours that lie strictly lower than all of them: water stays there.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, or no cell has eight valid neighbours.
pub(crate) fn pit_share(terrain: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_one("terrain", terrain, valid)?;
    let (rows, cols) = terrain.shape();
    let (mut pits, mut cells) = (0usize, 0usize);
    for (cell, &z) in terrain.cells().filter(|(cell, _)| valid[*cell]) {
        let around = (0..8).filter_map(|code| d8::neighbour(cell, code, rows, cols)).filter(|n| valid[*n]);
        let (mut higher, mut count) = (0, 0);
        for neighbour in around {
            count += 1;
            higher += usize::from(terrain[neighbour] > z);
        }
        if count == 8 {
            cells += 1;
            pits += usize::from(higher == 8);
        }
    }
    if cells == 0 {
        return Err(Error::value("number of cells with eight valid neighbours", 0, "pits need at least one"));
    }
    Ok(pits as f64 / cells as f64)
}

/// Slope at every valid cell that has a valid neighbour in both directions, row by row.
fn slopes(terrain: &Grid<f32>, valid: &Mask) -> Vec<f64> {
    let (rows, cols) = terrain.shape();
    let z = |cell: Cell| f64::from(terrain[cell]);
    let along = |cell: Cell, back: u8, ahead: u8| {
        let known = |code| d8::neighbour(cell, code, rows, cols).filter(|n| valid[*n]);
        match (known(back), known(ahead)) {
            (Some(b), Some(a)) => Some(0.5 * (z(a) - z(b))),
            (Some(b), None) => Some(z(cell) - z(b)),
            (None, Some(a)) => Some(z(a) - z(cell)),
            (None, None) => None,
        }
    };
    let cells = valid.cells().filter(|(_, ok)| **ok);
    cells.filter_map(|(cell, _)| Some(along(cell, 4, 0)?.hypot(along(cell, 2, 6)?))).collect()
}

/// Curvature at every valid cell with four valid neighbours, row by row.
fn curvatures(terrain: &Grid<f32>, valid: &Mask) -> Vec<f64> {
    let (rows, cols) = terrain.shape();
    let at = |cell: Cell| {
        let mut sum = 0.0;
        for code in [0, 2, 4, 6] {
            let neighbour = d8::neighbour(cell, code, rows, cols).filter(|n| valid[*n])?;
            sum += f64::from(terrain[neighbour]);
        }
        Some(0.25 * sum - f64::from(terrain[cell]))
    };
    valid.cells().filter(|(_, ok)| **ok).filter_map(|(cell, _)| at(cell)).collect()
}

/// Mean distance between two samples of one size after sorting: the Wasserstein-1 distance of their distributions.
fn earth_movers_distance(mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    assert_eq!(a.len(), b.len(), "both are measured at the same cells");
    a.sort_unstable_by(f64::total_cmp);
    b.sort_unstable_by(f64::total_cmp);
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn positive_mean(name: &str, values: &[f64]) -> Result<f64> {
    let mean = if values.is_empty() { 0.0 } else { mean(values) };
    if mean > 0.0 {
        Ok(mean)
    } else {
        Err(Error::value(name, mean, "flat ground has nothing to compare with"))
    }
}

/// Root mean square of a cell above the mean of its four neighbours, unit heights.
#[must_use]
pub(crate) fn roughness(output: &Grid<f32>) -> f64 {
    let (rows, cols) = output.shape();
    let z = |row: usize, col: usize| f64::from(output[Cell::new(row, col)]);
    let (mut sum, mut count) = (0.0, 0usize);
    for row in 1..rows.saturating_sub(1) {
        for col in 1..cols.saturating_sub(1) {
            let around = z(row - 1, col) + z(row + 1, col) + z(row, col - 1) + z(row, col + 1);
            sum += (z(row, col) - around / 4.0).powi(2);
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hills(rows: usize, cols: usize) -> Grid<f32> {
        Grid::from_fn(rows, cols, |c| ((c.row as f32 * 0.7).sin() + (c.col as f32 * 0.4).cos()) * 0.25 + 0.5)
    }

    #[test]
    fn a_ramp_has_one_slope_and_no_curvature() {
        let ramp = Grid::from_fn(8, 9, |c| 0.03 * c.row as f32 + 0.04 * c.col as f32);
        let valid = ramp.map(|_| true);
        assert!(slopes(&ramp, &valid).iter().all(|s| (s - 0.05).abs() < 1e-6));
        assert_eq!(slopes(&ramp, &valid).len(), 72);
        assert!(curvatures(&ramp, &valid).iter().all(|c| c.abs() < 1e-6));
        assert_eq!(curvatures(&ramp, &valid).len(), 42);
        let steep = ramp.map(|z| 3.0 * z);
        assert!((mean_slope_ratio(&steep, &ramp, &valid).unwrap() - 3.0).abs() < 1e-5);
        assert!((slope_distance(&steep, &ramp, &valid).unwrap() - 2.0).abs() < 1e-5);
    }

    #[test]
    fn distances_ignore_where_the_values_lie() {
        let truth = hills(20, 20);
        let valid = truth.map(|_| true);
        let mirrored = Grid::from_fn(20, 20, |c| truth[Cell::new(19 - c.row, c.col)]);
        assert!(slope_distance(&mirrored, &truth, &valid).unwrap() < 1e-9);
        assert!(curvature_distance(&mirrored, &truth, &valid).unwrap() < 1e-9);
        let half = truth.map(|z| 0.5 * z);
        assert!((slope_distance(&half, &truth, &valid).unwrap() - 0.5).abs() < 1e-5);
        assert!((curvature_distance(&half, &truth, &valid).unwrap() - 0.5).abs() < 1e-5);
        assert!(mean_slope_ratio(&truth, &Grid::filled(20, 20, 0.5), &valid).is_err());
    }

    #[test]
    fn voids_are_a_frame() {
        let truth = hills(12, 12);
        let mut valid = truth.map(|_| true);
        let mut holed = truth.clone();
        for row in 3..7 {
            for col in 4..9 {
                (holed[Cell::new(row, col)], valid[Cell::new(row, col)]) = (1e9, false);
            }
        }
        assert!(slopes(&holed, &valid).iter().chain(&curvatures(&holed, &valid)).all(|v| v.abs() < 2.0));
        assert!((mean_slope_ratio(&holed, &truth, &valid).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(slopes(&holed, &valid).len(), 144 - 20);
    }

    #[test]
    fn pits_are_strict_and_away_from_the_frame() {
        let mut terrain = Grid::filled(6, 6, 1.0);
        terrain[Cell::new(2, 2)] = 0.5;
        terrain[Cell::new(0, 4)] = 0.1;
        let valid = terrain.map(|_| true);
        assert_eq!(pit_share(&terrain, &valid).unwrap(), 1.0 / 16.0);
        terrain[Cell::new(3, 3)] = 0.5;
        assert_eq!(pit_share(&terrain, &valid).unwrap(), 0.0);
        assert!(pit_share(&Grid::filled(2, 9, 1.0), &Mask::filled(2, 9, true)).is_err());
    }

    #[test]
    fn roughness_is_that_of_a_saw() {
        let saw = Grid::from_fn(8, 8, |c| if (c.row + c.col) % 2 == 0 { 0.5f32 } else { 0.25 });
        assert!((roughness(&saw) - 0.25).abs() < 1e-9);
        assert!(roughness(&Grid::from_fn(8, 8, |c| c.row as f32 * 0.1 + c.col as f32 * 0.05)) < 1e-6);
    }
}
