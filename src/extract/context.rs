//! Lines of a window, found with the terrain around it.

use super::{ExtractionConfig, ridges_and_valleys};
use crate::error::Result;
use crate::grid::{Cell, Components, Grid, Mask, thinning};
use crate::sketch::{LineMap, StrokeKind};

/// Lines of the window of `rows` x `cols` at `origin`, extracted from the whole of `heights` and then cut out.
///
/// Lines reach the window's frame and are placed by water from outside, unlike those that
/// [`ridges_and_valleys`] finds from the window alone; pieces that the cut leaves shorter than the configured length are
/// dropped. For many windows of one DEM extract once and call [`crop_lines`].
///
/// # Errors
/// As [`extract`](super::extract), or when the window is empty or reaches past the frame.
pub fn with_context(
    heights: &Grid<f32>,
    valid: &Mask,
    config: &ExtractionConfig,
    origin: Cell,
    rows: usize,
    cols: usize,
) -> Result<LineMap> {
    valid.crop(origin, rows, cols)?;
    crop_lines(&ridges_and_valleys(heights, valid, config)?, origin, rows, cols, config.min_length)
}

/// The lines in a window, without connected pieces of fewer than `min_length` cells.
///
/// # Errors
/// When the window is empty or reaches past the frame.
pub fn crop_lines(
    lines: &LineMap,
    origin: Cell,
    rows: usize,
    cols: usize,
    min_length: usize,
) -> Result<LineMap> {
    let kinds = lines.kinds().crop(origin, rows, cols)?;
    let heights = lines.heights().crop(origin, rows, cols)?;
    let mut cut = LineMap::empty(rows, cols);
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let pieces = Components::of(&thinning::thin(&kinds.map(|&k| k == Some(kind))));
        let long = pieces.select(|label| pieces.sizes()[label] >= min_length);
        for (cell, _) in long.cells().filter(|(_, on)| **on) {
            cut.set(cell, kind, heights[cell]);
        }
    }
    Ok(cut)
}
