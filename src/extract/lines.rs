//! Ridges and valleys of a DEM.
//!
//! Heights and mask -> [`LineMap`]. Ridges are the valleys of -z (Liu & Benes 2025, 4.1). Steps: unit heights, margin,
//! Gaussian; for both kinds at once (two threads): routing, accumulation, threshold, Strahler order, closing, thinning; then
//! a cell claimed by both kinds goes to the one that drains more ground, and short or flat lines are dropped.
//!
//! Departures from the paper: everything that [`ExtractionConfig`] says is not in it. n log n, about 60 bytes a cell.

use super::ExtractionConfig;
use super::network::{Network, Traced};
use super::relief::Relief;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::{Cell, Components, Grid, Mask, thinning};
use crate::sketch::{LineMap, StrokeKind};

/// With up to this many lines of a kind none is dropped for its gradient: the lowest 1 % of them means nothing.
const TOO_FEW_FOR_QUANTILE: usize = 20;

/// Lines with what the flow knows about them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Extraction {
    /// The lines, with the heights that were given (not the smoothed ones).
    pub(crate) lines: LineMap,
    /// Strahler order of each line cell in its own network (of valleys, or of ridges upside down); 0 off the lines.
    pub(crate) orders: Grid<u8>,
}

/// Ridges and valleys of `heights` (any unit) where `valid` is true, one cell wide.
///
/// Lines are 8-connected, and no cell is both ridge and valley. They do not depend on the unit or the
/// zero of the heights. Level terrain has no lines.
///
/// ```
/// # fn main() -> monadnock::Result<()> {
/// use monadnock::{Cell, ExtractionConfig, Normalization, StrokeKind, Window, dem::bundled, ridges_and_valleys};
///
/// let patch = bundled::load("sierra")?.crop(Window::square(Cell::new(64, 64), 96))?;
/// let unit = Normalization::of(&patch).normalize(&patch);
/// let lines = ridges_and_valleys(&unit, patch.valid(), &ExtractionConfig::default())?;
/// let share = lines.line_count() as f64 / (96.0 * 96.0);
/// assert!(share > 0.05 && share < 0.3);
/// assert!(lines.mask_of(StrokeKind::Valley).as_slice().contains(&true));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// When `config` is out of range, shapes differ, a valid height is not finite, or no cell is valid.
pub fn ridges_and_valleys(heights: &Grid<f32>, valid: &Mask, config: &ExtractionConfig) -> Result<LineMap> {
    ridges_and_valleys_until(heights, valid, config, &Stop::new())
}

/// As [`ridges_and_valleys`], unless it is stopped.
///
/// # Errors
/// As there, and when it is stopped.
pub fn ridges_and_valleys_until(
    heights: &Grid<f32>,
    valid: &Mask,
    config: &ExtractionConfig,
    stop: &Stop,
) -> Result<LineMap> {
    let drained = Drained::new(heights, valid, config, stop)?;
    Ok(drained.lines(heights, config, stop)?.lines)
}

/// As [`ridges_and_valleys`], with what the flow knows about the lines.
#[cfg(test)]
pub(crate) fn extract(heights: &Grid<f32>, valid: &Mask, config: &ExtractionConfig) -> Result<Extraction> {
    let stop = &Stop::new();
    Drained::new(heights, valid, config, stop)?.lines(heights, config, stop)
}

/// Drainage of a DEM right way up and upside down: what extractions with different limits share.
pub(super) struct Drained {
    relief: Relief,
    ridges: Network,
    valleys: Network,
}

impl Drained {
    /// # Errors
    /// As [`extract`].
    pub(super) fn new(
        heights: &Grid<f32>,
        valid: &Mask,
        config: &ExtractionConfig,
        stop: &Stop,
    ) -> Result<Self> {
        config.validate()?;
        let relief = Relief::new(heights, valid, config)?;
        stop.check()?;
        let surface = relief.surface();
        let (valleys, ridges) = rayon::join(
            || Network::of(surface, config.routing, stop),
            || Network::of(&surface.inverted(), config.routing, stop),
        );
        Ok(Self { relief, ridges: ridges?, valleys: valleys? })
    }

    /// The lines within the limits of `config` (its smoothing, margin and routing are those of `new`).
    ///
    /// # Errors
    /// When it is stopped.
    pub(super) fn lines(
        &self,
        heights: &Grid<f32>,
        config: &ExtractionConfig,
        stop: &Stop,
    ) -> Result<Extraction> {
        let trace = |network: &Network| network.trace(&self.relief, config);
        let (mut valleys, mut ridges) = rayon::join(|| trace(&self.valleys), || trace(&self.ridges));
        stop.check()?;
        settle(&mut ridges, &mut valleys);
        let gradient = |cell| self.relief.gradient(cell);
        let finish = |traced: &Traced| drop_weak(&thinning::thin(&traced.lines), config, gradient);
        let (valley_lines, ridge_lines) = rayon::join(|| finish(&valleys), || finish(&ridges));

        stop.check()?;
        let (rows, cols) = heights.shape();
        let mut extraction =
            Extraction { lines: LineMap::empty(rows, cols), orders: Grid::filled(rows, cols, 0) };
        let kinds = [(StrokeKind::Ridge, ridge_lines, ridges), (StrokeKind::Valley, valley_lines, valleys)];
        for (kind, lines, traced) in kinds {
            for (cell, _) in lines.cells().filter(|(_, on)| **on) {
                extraction.lines.set(cell, kind, heights[cell]);
                extraction.orders[cell] = traced.orders[cell];
            }
        }
        Ok(extraction)
    }
}

/// Gives each cell that both kinds claim to the one that drains more ground there; ridges win ties.
fn settle(ridges: &mut Traced, valleys: &mut Traced) {
    let claims = ridges.lines.as_mut_slice().iter_mut().zip(valleys.lines.as_mut_slice());
    let counts = ridges.counts.as_slice().iter().zip(valleys.counts.as_slice());
    for ((ridge, valley), (up, down)) in claims.zip(counts) {
        if *ridge && *valley {
            let ridge_wins = up >= down;
            *ridge = ridge_wins;
            *valley = !ridge_wins;
        }
    }
}

/// Drops connected lines that are short, or whose mean gradient is among the lowest (paper 4.1, filtering).
fn drop_weak(lines: &Mask, config: &ExtractionConfig, gradient: impl Fn(Cell) -> f64) -> Mask {
    let pieces = Components::of(lines);
    let mut sums = vec![0.0; pieces.count()];
    for (cell, label) in pieces.labels().cells() {
        if let Some(label) = label {
            sums[*label as usize] += gradient(cell);
        }
    }
    let means: Vec<f64> = sums.iter().zip(pieces.sizes()).map(|(sum, &n)| sum / n as f64).collect();
    let limit = if means.len() > TOO_FEW_FOR_QUANTILE && config.gradient_quantile > 0.0 {
        quantile(&means, config.gradient_quantile)
    } else {
        f64::NEG_INFINITY
    };
    pieces.select(|label| pieces.sizes()[label] >= config.min_length && means[label] > limit)
}

/// The quantile `q` of `values`, linear between neighbours (numpy's default). Not empty.
fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let position = q * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}
