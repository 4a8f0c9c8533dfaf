//! From lines to a landscape, coarse to fine.

use super::config::LandscapeConfig;
use super::domain::{COARSEST, Domain, PAD};
use super::envelope::first_surface;
use super::fit::LandscapeFit;
use super::noise::octaves;
use super::steady::{Stage, State};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Window};
use crate::interpolation::harmonic;
use crate::seed::Seed;
use crate::sketch::LineMap;

/// Exponent of the spectrum of ln k.
const FACTOR_EXPONENT: f64 = 3.0;
/// Longest wavelength of ln k, cells of the map.
const FACTOR_LONGEST: f64 = 128.0;

/// A landscape through lines, on the map and a little beyond it.
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
    padded: Grid<f32>,
    pub(super) factor: usize,
    shape: (usize, usize),
}

impl Landscape {
    /// Heights in metres on cells `factor` times as large as the map's: box means of finer ones, cubic between coarser ones.
    /// Both sides are those of the map over `factor`, rounded up; the last cells may reach past the map.
    ///
    /// # Errors
    /// When `factor` is not 1, 2, 4, 8, 16 or 32.
    pub fn heights(&self, factor: usize) -> Result<Grid<f32>> {
        if !factor.is_power_of_two() || factor > PAD {
            return Err(Error::value("factor of a landscape's cells", factor, "allowed: 1, 2, 4, 8, 16, 32"));
        }
        let (rows, cols) = (self.shape.0.div_ceil(factor), self.shape.1.div_ceil(factor));
        let corner = PAD / factor;
        if factor <= self.factor {
            let times = self.factor / factor;
            let (r, c) = self.padded.shape();
            let fine = if times == 1 { None } else { Some(resample(&self.padded, r * times, c * times)) };
            return fine.as_ref().unwrap_or(&self.padded).crop(Window::new(
                Cell::new(corner, corner),
                rows,
                cols,
            ));
        }
        let side = factor / self.factor;
        let mean = |c: Cell| {
            let (row, col) = ((corner + c.row) * side, (corner + c.col) * side);
            let cells = (0..side * side).map(|k| self.padded[Cell::new(row + k / side, col + k % side)]);
            cells.map(f64::from).sum::<f64>() / (side * side) as f64
        };
        Ok(Grid::from_fn(rows, cols, |c| mean(c) as f32))
    }
}

/// The steady state of the fitted law under `lines` (metres), on a map whose cells measure `cell_size` metres.
///
/// Lines are met to about a hundredth of the relief; `pin` makes them exact. Other seeds give other networks between them.
/// The same bytes on any number of threads.
///
/// # Errors
/// When there is no line, a setting is out of range, or the cell size is not positive.
pub fn solve(
    fit: &LandscapeFit,
    lines: &LineMap,
    cell_size: f64,
    config: &LandscapeConfig,
    seed: Seed,
) -> Result<Landscape> {
    solve_until(fit, lines, cell_size, config, seed, &Stop::new())
}

/// As [`solve`], unless it is stopped: `stop` is asked in every step.
///
/// # Errors
/// As [`solve`], and when it is stopped.
pub(crate) fn solve_until(
    fit: &LandscapeFit,
    lines: &LineMap,
    cell_size: f64,
    config: &LandscapeConfig,
    seed: Seed,
    stop: &Stop,
) -> Result<Landscape> {
    config.validate()?;
    if !(cell_size.is_finite() && cell_size > 0.0) {
        return Err(Error::value("cell size of the map", cell_size, "allowed: positive and finite"));
    }
    let seed = seed.derive("landscape");
    let relief = fit.relief_at(cell_size);
    let domain = Domain::new(lines);
    let first = first_surface(&domain.ground(COARSEST), COARSEST, relief, config.amplitude, seed)?;
    let wavelength = FACTOR_LONGEST / COARSEST as f64;
    let spread = (config.variety * fit.factor_spread) as f32;
    let log_factor = octaves(first.shape(), FACTOR_EXPONENT, wavelength, seed.derive("slope factor"));
    let log_factor = log_factor.map(|k| spread * k);
    let mut state =
        State { heights: first.clone(), shore: first, first_log_factor: log_factor.clone(), log_factor };
    let mut factor = COARSEST;
    for level in &config.levels {
        factor = level.factor;
        let (rows, cols) = domain.shape(factor);
        if state.heights.shape() != (rows, cols) {
            state.heights = resample(&state.heights, rows, cols);
            state.shore = resample(&state.shore, rows, cols);
        }
        let stage = Stage::new(fit, config, factor, cell_size, domain.ground(factor), seed);
        stage.draw(&mut state.heights);
        for iteration in 1..=level.iterations {
            stop.check()?;
            let by_law = stage.step(&mut state, stop)?;
            if iteration == level.iterations && factor == config.levels[config.levels.len() - 1].factor {
                // What is still missed, a hundredth of the relief or so, is added smoothly.
                let (known, misses) = stage.misses(&by_law);
                let missing = harmonic(&known, &misses)?;
                state.heights = by_law;
                let heights = state.heights.as_mut_slice();
                heights.iter_mut().zip(missing.as_slice()).for_each(|(z, m)| *z += *m as f32);
            }
        }
    }
    Ok(Landscape { padded: state.heights, factor, shape: lines.shape() })
}
