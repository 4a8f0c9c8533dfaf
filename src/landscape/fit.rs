//! The laws of an exemplar.
//!
//! Heights, mask and cell size -> [`LandscapeFit`]. Water is routed over the exemplar; slopes are binned by drained area
//! (hillslopes by their gradient, channels by the slope to their receiver), and what is left by height. Cells in pits, at
//! the frame and beside voids are left out. n log n for routing, then linear.

use super::slope_area::{HeightLaw, SlopeArea};
use crate::error::{Error, Result};
use crate::flow::{POND_DEPTH, Surface, accumulate, fill, route};
use crate::grid::{Cell, Grid, Mask, Window, gaussian};
use serde::{Deserialize, Serialize};

/// Knots of the slope-area curve, from one cell to a fifth of the map.
const AREA_BINS: usize = 14;
/// Cells in which this many cells drain count as channels in the fit.
const CHANNEL: f64 = 12.0;
/// Classes of height.
const HEIGHT_BINS: usize = 40;
/// Cells that a bin needs to have a say.
const FEWEST_CELLS: usize = 30;
/// Cells left out along the frame.
const MARGIN: usize = 4;
/// Share of all slope that lies in pits beyond which terrain was not made by rivers: .11 and .33 in dunes and craters, at
/// most .007 in eight ranges, canyons and basins.
const MOST_SLOPE_IN_PITS: f64 = 0.05;
/// Side of the windows in which pits are looked for, cells.
const PIT_WINDOW: usize = 256;
/// Side of the windows whose relief is measured, cells.
const RELIEF_WINDOW: usize = 128;
/// Standard deviation of the smoothing before the spread of the slope factor is measured, cells.
const FACTOR_SMOOTHING: f64 = 8.0;

/// What a landscape model knows of an exemplar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandscapeFit {
    /// Side of the exemplar's cells, metres.
    pub(crate) cell_size: f64,
    /// Slope by drained area.
    pub(crate) slope_area: SlopeArea,
    /// Factor on the slope by height, weakened where height explains little.
    pub(crate) height_law: HeightLaw,
    /// Standard deviation of ln(slope / its law), smoothed over 8 cells.
    pub(crate) factor_spread: f64,
    /// Mean relief of windows of 128 x 128 cells, metres.
    pub(crate) relief: f64,
    /// Relief grows with the side of a window to this power.
    pub(crate) relief_exponent: f64,
    /// Share of all slope that lies in pits.
    pub(crate) slope_in_pits: f64,
    /// Share of the cells that filling raises by more than a thousandth of the relief.
    pub(crate) pit_share: f64,
}

impl LandscapeFit {
    /// Fits the laws to `heights` (metres) where `valid`, on square cells of `cell_size` metres.
    ///
    /// # Errors
    /// When the shapes differ, a valid height is not finite, the cell size is not positive, or the exemplar is level, smaller
    /// than 16 x 16 cells, or void but for a few cells.
    pub fn of(heights: &Grid<f32>, valid: &Mask, cell_size: f64) -> Result<Self> {
        if !(cell_size.is_finite() && cell_size > 0.0) {
            return Err(Error::value("cell size of the exemplar", cell_size, "allowed: positive and finite"));
        }
        let surface = Surface::new(heights.clone(), valid.clone())?;
        let (rows, cols) = surface.shape();
        if rows.min(cols) < 16 {
            return Err(Error::value(
                "size of the exemplar",
                format!("{rows}x{cols}"),
                "allowed: at least 16x16",
            ));
        }
        let (lowest, highest) = range(heights, valid);
        if highest <= lowest {
            return Err(Error::value(
                "relief of the exemplar",
                0,
                "a landscape is fitted to terrain with relief",
            ));
        }
        let samples = Samples::of(&surface, cell_size, POND_DEPTH * (highest - lowest))?;
        let slope_area = samples.slope_area(heights.len())?;
        let ratios = samples.ratios(&slope_area);
        let height_law = height_law(&ratios, heights, f64::from(lowest), f64::from(highest));
        let (relief, relief_exponent) = relief(heights, valid);
        let (slope_in_pits, pit_share) = pits(heights, valid)?;
        Ok(Self {
            cell_size,
            factor_spread: factor_spread(&ratios),
            slope_area,
            height_law,
            relief,
            relief_exponent,
            slope_in_pits,
            pit_share,
        })
    }

    /// Whether rivers made the exemplar, so that the model applies: dunes and craters keep their slopes in pits.
    #[must_use]
    pub(crate) fn is_fluvial(&self) -> bool {
        self.slope_in_pits <= MOST_SLOPE_IN_PITS
    }

    /// Relief of windows of 128 x 128 cells of `cell_size` metres.
    #[must_use]
    pub(crate) fn relief_at(&self, cell_size: f64) -> f64 {
        self.relief * (cell_size / self.cell_size).powf(self.relief_exponent)
    }
}

fn range(heights: &Grid<f32>, valid: &Mask) -> (f32, f32) {
    let known = heights.as_slice().iter().zip(valid.as_slice()).filter(|(_, ok)| **ok);
    known.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), (&z, _)| (low.min(z), high.max(z)))
}

/// Area and slopes of every cell that the laws are read from.
struct Samples {
    counts: Grid<u32>,
    /// Length of the gradient, metres a metre; none at cells that do not count.
    gradients: Grid<Option<f32>>,
    /// Slope to the receiver.
    descents: Grid<f32>,
}

impl Samples {
    fn of(surface: &Surface, cell_size: f64, pit_depth: f32) -> Result<Self> {
        let (heights, valid) = (surface.heights(), surface.valid());
        let (rows, cols) = surface.shape();
        let directions = route(surface);
        let filled = fill(surface);
        let inside = |i: usize, side: usize| (MARGIN..side - MARGIN).contains(&i);
        let gradients = Grid::from_fn(rows, cols, |c| {
            let counts = inside(c.row, rows)
                && inside(c.col, cols)
                && directions.receiver(c).is_some()
                && filled.heights()[c] - heights[c] <= pit_depth;
            counts.then(|| gradient(heights, valid, c, cell_size)).flatten()
        });
        let descents = Grid::from_fn(rows, cols, |c| {
            directions.receiver(c).map_or(0.0, |r| {
                let distance = (c.distance_squared(r) as f64).sqrt() * cell_size;
                (f64::from(heights[c] - heights[r]).max(0.0) / distance) as f32
            })
        });
        let found = gradients.as_slice().iter().flatten().count();
        if found < FEWEST_CELLS {
            return Err(Error::value(
                "cells of the exemplar that drain to its frame",
                found,
                format!("a landscape is fitted to at least {FEWEST_CELLS}"),
            ));
        }
        Ok(Self { counts: accumulate(&directions).counts().clone(), gradients, descents })
    }

    fn slope_area(&self, cells: usize) -> Result<SlopeArea> {
        let log_step = (0.2 * cells as f64).ln() / (AREA_BINS - 1) as f64;
        let mut sums = [(0.0, 0.0, 0usize); AREA_BINS];
        for (i, gradient) in self.gradients.as_slice().iter().enumerate() {
            let Some(gradient) = gradient else { continue };
            let bin = (f64::from(self.counts.as_slice()[i]).ln() / log_step).round() as usize;
            let (gradients, descents, count) = &mut sums[bin.min(AREA_BINS - 1)];
            *gradients += f64::from(*gradient);
            *descents += f64::from(self.descents.as_slice()[i]);
            *count += 1;
        }
        let is_channel = |bin: usize| bin as f64 * log_step >= CHANNEL.ln();
        let means = sums.iter().enumerate().map(|(bin, &(gradients, descents, count))| {
            let mean = if is_channel(bin) { descents } else { gradients } / count.max(1) as f64;
            (count > FEWEST_CELLS && mean > 0.0).then_some(mean)
        });
        let means: Vec<Option<f64>> = means.collect();
        let knots = |channels: bool| {
            let known = means.iter().enumerate().filter_map(|(bin, mean)| Some((bin, (*mean)?)));
            let known = known.filter(|(bin, _)| !channels || is_channel(*bin));
            known.map(|(bin, mean)| (bin as f64 * log_step, mean.ln())).collect::<Vec<_>>()
        };
        let line = match (line_through(&knots(true)), line_through(&knots(false))) {
            (Some(line), _) | (None, Some(line)) => line,
            (None, None) => {
                return Err(Error::value(
                    "slopes of the exemplar",
                    "too few",
                    "a landscape is fitted to slopes of at least two classes of drained area",
                ));
            }
        };
        let slopes = means.iter().enumerate();
        let slopes =
            slopes.map(|(bin, mean)| mean.unwrap_or_else(|| (line.0 + line.1 * bin as f64 * log_step).exp()));
        Ok(SlopeArea { log_step, slopes: slopes.collect(), theta: -line.1 })
    }

    /// Slope over its law, at every cell that counts.
    fn ratios(&self, law: &SlopeArea) -> Grid<Option<f64>> {
        let (rows, cols) = self.counts.shape();
        Grid::from_fn(rows, cols, |c| {
            let area = f64::from(self.counts[c]);
            let gradient = self.gradients[c]?;
            let slope = if area < CHANNEL { gradient } else { self.descents[c] };
            Some(f64::from(slope) / law.slope(area))
        })
    }
}

/// Central differences; none where a neighbour is missing.
fn gradient(heights: &Grid<f32>, valid: &Mask, c: Cell, cell_size: f64) -> Option<f32> {
    let at = |row, col| {
        let cell = Cell::new(row, col);
        valid[cell].then(|| f64::from(heights[cell]))
    };
    let south = at(c.row + 1, c.col)? - at(c.row - 1, c.col)?;
    let east = at(c.row, c.col + 1)? - at(c.row, c.col - 1)?;
    Some((0.5 * south.hypot(east) / cell_size) as f32)
}

/// Intercept and slope of the least-squares line; none with fewer than two points.
fn line_through(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let bend: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / bend;
    (points.len() > 1).then_some((my - slope * mx, slope))
}

fn height_law(ratios: &Grid<Option<f64>>, heights: &Grid<f32>, lowest: f64, highest: f64) -> HeightLaw {
    let step = (highest - lowest) / (HEIGHT_BINS - 1) as f64;
    let class = |z: f32| (((f64::from(z) - lowest) / step).round() as usize).min(HEIGHT_BINS - 1);
    let samples = || {
        let all = ratios.as_slice().iter().zip(heights.as_slice());
        all.filter_map(|(ratio, &z)| Some(((*ratio)?, class(z))))
    };
    let mut sums = [(0.0, 0usize); HEIGHT_BINS];
    for (ratio, class) in samples() {
        sums[class].0 += ratio;
        sums[class].1 += 1;
    }
    let means =
        sums.map(
            |(sum, count)| {
                if count > 2 * FEWEST_CELLS { (sum / count as f64).max(0.1).ln() as f32 } else { 0.0 }
            },
        );
    let means = Grid::from_fn(1, HEIGHT_BINS, |c| means[c.col]);
    let logs = gaussian::smooth(&means, &means.map(|_| true), 0.7);
    let (mut left, mut all) = (0.0, 0.0);
    for (ratio, class) in samples() {
        left += (ratio - f64::from(logs.as_slice()[class]).exp()).powi(2);
        all += (ratio - 1.0f64).powi(2);
    }
    let explained = if all > 0.0 { 1.0 - left / all } else { 0.0 };
    let weight = ((explained - 0.03) / 0.1).clamp(0.0, 1.0);
    let factors = logs.as_slice().iter().map(|&log| (weight * f64::from(log)).exp()).collect();
    HeightLaw { lowest, step, factors, explained }
}

fn factor_spread(ratios: &Grid<Option<f64>>) -> f64 {
    let known = ratios.map(Option::is_some);
    let smooth = gaussian::smooth(&ratios.map(|r| r.unwrap_or(0.0) as f32), &known, FACTOR_SMOOTHING);
    let logs = smooth.as_slice().iter().zip(known.as_slice()).filter(|(_, known)| **known);
    let logs: Vec<f64> = logs.map(|(r, _)| f64::from(r.clamp(0.05, 10.0)).ln()).collect();
    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
    (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt()
}

/// Corners of windows of at most `side`, overlapping by at least half.
fn windows(shape: (usize, usize), side: usize, step: usize) -> impl Iterator<Item = Window> {
    let (rows, cols) = (side.min(shape.0), side.min(shape.1));
    let along = move |len: usize, side: usize| (0..=len - side).step_by(step);
    along(shape.0, rows).flat_map(move |row| {
        along(shape.1, cols).map(move |col| Window::new(Cell::new(row, col), rows, cols))
    })
}

/// Mean relief of windows of 128 cells, and the power to which it grows with their side.
fn relief(heights: &Grid<f32>, valid: &Mask) -> (f64, f64) {
    let side = RELIEF_WINDOW.min(heights.rows()).min(heights.cols());
    let mean = |side: usize| {
        let found = windows(heights.shape(), side, (side / 2).max(1)).filter_map(|window| {
            let (low, high) = range(&heights.crop(window).ok()?, &valid.crop(window).ok()?);
            (high >= low).then(|| f64::from(high - low))
        });
        let (sum, count) = found.fold((0.0, 0), |(sum, count), relief| (sum + relief, count + 1));
        sum / f64::from(count.max(1))
    };
    let (whole, half) = (mean(side), mean(side / 2));
    let exponent = if half > 0.0 { (whole / half).log2().clamp(0.2, 1.0) } else { 1.0 };
    (whole * (RELIEF_WINDOW as f64 / side as f64).powf(exponent), exponent)
}

/// Share of all slope that lies in pits, and share of the cells; means over windows.
fn pits(heights: &Grid<f32>, valid: &Mask) -> Result<(f64, f64)> {
    let (mut slopes, mut cells, mut count) = (0.0, 0.0, 0.0);
    for window in windows(heights.shape(), PIT_WINDOW, PIT_WINDOW / 2) {
        let (z, ok) = (heights.crop(window)?, valid.crop(window)?);
        let (low, high) = range(&z, &ok);
        if high <= low {
            continue;
        }
        let filled = fill(&Surface::new(z.clone(), ok.clone())?);
        let (mut in_pits, mut all, mut raised, mut known) = (0.0, 0.0, 0usize, 0usize);
        for row in 1..window.rows - 1 {
            for col in 1..window.cols - 1 {
                let c = Cell::new(row, col);
                let Some(slope) = ok[c].then(|| gradient(&z, &ok, c, 1.0)).flatten() else { continue };
                let is_pit = filled.heights()[c] - z[c] > POND_DEPTH * (high - low);
                all += f64::from(slope);
                in_pits += if is_pit { f64::from(slope) } else { 0.0 };
                raised += usize::from(is_pit);
                known += 1;
            }
        }
        if all > 0.0 {
            slopes += in_pits / all;
            cells += raised as f64 / known as f64;
            count += 1.0;
        }
    }
    Ok(if count > 0.0 { (slopes / count, cells / count) } else { (0.0, 0.0) })
}
