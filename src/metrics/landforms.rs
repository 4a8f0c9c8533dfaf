//! Which way slopes face and which landforms there are: distributions by direction and by geomorphon.
//!
//! Geomorphons (Jasiewicz & Stepinski 2013): from every cell eight lines of sight; each sees higher ground, lower ground or
//! neither, and the numbers of both decide one of ten landforms (their Fig. 4). Relief is taken relative to the truth's own
//! range: their flatness threshold of one degree has no meaning in the unit interval, so it is a share of the truth's mean
//! slope. Cost: of geomorphons 8 lines of [`SIGHT`] cells per cell.

use super::check_pair;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask, d8};
use rayon::prelude::*;

/// Length of a line of sight, cells.
const SIGHT: usize = 10;
/// Difference of zenith and nadir angle, as slope over the truth's mean slope, below which a direction is level.
const FLAT: f64 = 0.2;
/// Classes of direction, of 30 degrees.
const DIRECTIONS: usize = 12;
/// Landforms: flat, summit, ridge, shoulder, spur, slope, hollow, footslope, valley, depression.
pub(crate) const LANDFORMS: usize = 10;

/// The landform by the number of higher directions (row) and lower ones (column), as in the order of [`LANDFORMS`]
/// (Jasiewicz & Stepinski 2013, Fig. 4: rows by minuses, columns by pluses).
const FORMS: [[usize; 9]; 9] = {
    const FL: usize = 0;
    const PK: usize = 1;
    const RI: usize = 2;
    const SH: usize = 3;
    const SP: usize = 4;
    const SL: usize = 5;
    const HL: usize = 6;
    const FS: usize = 7;
    const VL: usize = 8;
    const PT: usize = 9;
    // FORMS[lower][higher]
    [
        [FL, FL, FL, FS, FS, VL, VL, VL, PT],
        [FL, FL, FS, FS, FS, VL, VL, VL, 0],
        [FL, SH, SL, SL, HL, HL, VL, 0, 0],
        [SH, SH, SL, SL, SL, HL, 0, 0, 0],
        [SH, SH, SP, SL, SL, 0, 0, 0, 0],
        [RI, RI, SP, SP, 0, 0, 0, 0, 0],
        [RI, RI, RI, 0, 0, 0, 0, 0, 0],
        [RI, RI, 0, 0, 0, 0, 0, 0, 0],
        [PK, 0, 0, 0, 0, 0, 0, 0, 0],
    ]
};

/// Half the sum of the differences of the shares of twelve slope directions: 0 for equal distributions, 1 for disjoint ones.
/// Every direction counts by its slopes, since level ground faces nowhere.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, or one of both is level.
pub(crate) fn aspect_distance(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let shares = |name: &str, terrain: &Grid<f32>| -> Result<[f64; DIRECTIONS]> {
        let mut shares = [0.0; DIRECTIONS];
        let (rows, cols) = terrain.shape();
        for (cell, _) in valid.cells().filter(|(_, ok)| **ok) {
            let at = |code| {
                d8::neighbour(cell, code, rows, cols).filter(|n| valid[*n]).map(|n| f64::from(terrain[n]))
            };
            let (Some(east), Some(north), Some(west), Some(south)) = (at(0), at(2), at(4), at(6)) else {
                continue;
            };
            let (x, y) = (0.5 * (east - west), 0.5 * (north - south));
            let turns = y.atan2(x) / std::f64::consts::TAU + 0.5;
            shares[((turns * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1)] += x.hypot(y);
        }
        let sum: f64 = shares.iter().sum();
        if sum <= 0.0 {
            return Err(Error::value(format!("slopes of the {name}"), sum, "level ground faces nowhere"));
        }
        Ok(shares.map(|s| s / sum))
    };
    Ok(apart(&shares("output", output)?, &shares("truth", truth)?))
}

/// Half the sum of the differences of the shares of the ten landforms: 0 for equal distributions, 1 for disjoint ones.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, or the truth is level.
pub(crate) fn geomorphon_distance(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let slope = super::relief::mean_valid_slope(truth, valid)?;
    let shares = |terrain: &Grid<f32>| landform_shares(terrain, valid, FLAT * slope);
    Ok(apart(&shares(output), &shares(truth)))
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
}

/// Share of the valid cells in each landform; `flat`: slope below which a direction is level, heights per cell.
fn landform_shares(terrain: &Grid<f32>, valid: &Mask, flat: f64) -> Vec<f64> {
    let rows: Vec<[usize; LANDFORMS]> = (0..terrain.rows())
        .into_par_iter()
        .map(|row| {
            let mut counts = [0; LANDFORMS];
            for cell in (0..terrain.cols()).map(|col| Cell::new(row, col)).filter(|cell| valid[*cell]) {
                counts[landform(terrain, valid, cell, flat)] += 1;
            }
            counts
        })
        .collect();
    let cells: usize = rows.iter().flatten().sum();
    (0..LANDFORMS).map(|k| rows.iter().map(|r| r[k]).sum::<usize>() as f64 / cells as f64).collect()
}

/// The landform at a cell.
fn landform(terrain: &Grid<f32>, valid: &Mask, cell: Cell, flat: f64) -> usize {
    let (higher, lower) = sight(terrain, valid, cell, flat);
    FORMS[usize::from(lower)][usize::from(higher)]
}

/// How many of the eight lines of sight at every valid cell see higher ground and how many lower; 0 and 0 at voids. `flat` as in
/// [`landform_shares`].
pub(super) fn sights(terrain: &Grid<f32>, valid: &Mask, flat: f64) -> Grid<(u8, u8)> {
    let (rows, cols) = terrain.shape();
    let mut views = Grid::filled(rows, cols, (0, 0));
    views.as_mut_slice().par_iter_mut().enumerate().for_each(|(i, view)| {
        let cell = Cell::new(i / cols, i % cols);
        if valid[cell] {
            *view = sight(terrain, valid, cell, flat);
        }
    });
    views
}

/// Lines of sight end at the frame and at voids: (higher, lower).
fn sight(terrain: &Grid<f32>, valid: &Mask, cell: Cell, flat: f64) -> (u8, u8) {
    let (rows, cols) = terrain.shape();
    let here = f64::from(terrain[cell]);
    let (mut higher, mut lower) = (0, 0);
    for code in 0..8 {
        let step = if code % 2 == 1 { std::f64::consts::SQRT_2 } else { 1.0 };
        let (mut up, mut down) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        let mut at = cell;
        for distance in 1..=SIGHT {
            let Some(next) = d8::neighbour(at, code, rows, cols).filter(|n| valid[*n]) else { break };
            at = next;
            let slope = (f64::from(terrain[at]) - here) / (distance as f64 * step);
            (up, down) = (up.max(slope), down.max(-slope));
        }
        // Zenith against nadir: the steeper of looking up and looking down decides.
        if up - down > flat {
            higher += 1;
        } else if down - up > flat {
            lower += 1;
        }
    }
    (higher, lower)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(height: impl Fn(f32, f32) -> f32) -> usize {
        let terrain = Grid::from_fn(25, 25, |c| height(c.col as f32 - 12.0, 12.0 - c.row as f32));
        landform(&terrain, &terrain.map(|_| true), Cell::new(12, 12), 0.01)
    }

    #[test]
    fn plain_landforms_have_their_names() {
        assert_eq!(form(|_, _| 3.0), 0, "flat");
        assert_eq!(form(|x, y| -(x * x + y * y)), 1, "summit");
        assert_eq!(form(|x, _| -x.abs()), 2, "ridge");
        assert_eq!(form(|x, _| x), 5, "slope");
        assert_eq!(form(|x, _| x.abs()), 8, "valley");
        assert_eq!(form(|x, y| x * x + y * y), 9, "depression");
        assert_eq!(form(|x, _| x.min(0.0)), 3, "shoulder");
        assert_eq!(form(|x, _| x.max(0.0)), 7, "footslope");
        assert_eq!(form(|x, y| x - 0.8 * y.abs()), 4, "spur");
        assert_eq!(form(|x, y| x + 0.8 * y.abs()), 6, "hollow");
    }

    #[test]
    fn distances_are_of_distributions() {
        let truth = Grid::from_fn(40, 40, |c| (c.row as f32 * 0.4).sin() + 0.7 * (c.col as f32 * 0.3).cos());
        let valid = truth.map(|_| true);
        assert_eq!(aspect_distance(&truth, &truth, &valid).unwrap(), 0.0);
        assert_eq!(geomorphon_distance(&truth, &truth, &valid).unwrap(), 0.0);
        let (east, north) =
            (Grid::from_fn(20, 20, |c| c.col as f32), Grid::from_fn(20, 20, |c| c.row as f32));
        let valid = east.map(|_| true);
        assert!((aspect_distance(&east, &north, &valid).unwrap() - 1.0).abs() < 1e-9);
        // Both are slopes everywhere but at the frame.
        assert!(geomorphon_distance(&east, &north, &valid).unwrap() < 0.3);
        let level = Grid::filled(20, 20, 1.0);
        // Of a ramp only the four corners of 400 cells, which see too little, count as flat.
        assert!((geomorphon_distance(&level, &north, &valid).unwrap() - 0.99).abs() < 1e-9);
        assert!(aspect_distance(&level, &north, &valid).is_err());
        assert!(geomorphon_distance(&north, &level, &valid).is_err());
    }

    #[test]
    fn voids_are_not_looked_at() {
        let truth = Grid::from_fn(30, 30, |c| (c.row as f32 * 0.4).sin() + (c.col as f32 * 0.3).cos());
        let (mut holed, mut valid) = (truth.clone(), truth.map(|_| true));
        for cell in [Cell::new(10, 10), Cell::new(10, 11)] {
            (holed[cell], valid[cell]) = (1e9, false);
        }
        assert_eq!(aspect_distance(&holed, &truth, &valid).unwrap(), 0.0);
        assert_eq!(geomorphon_distance(&holed, &truth, &valid).unwrap(), 0.0);
    }
}
