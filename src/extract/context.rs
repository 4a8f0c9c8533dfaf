//! Lines of a window, found with the terrain around it.

use crate::error::Result;
use crate::grid::{Components, Window, thinning};
use crate::sketch::{LineMap, StrokeKind};

/// The lines in a window, without connected pieces of fewer than `min_length` cells.
///
/// Found in the terrain around it and then cut out, lines reach the window's frame and are placed by water from outside, unlike
/// those that [`ridges_and_valleys`](super::ridges_and_valleys) finds from the window alone.
///
/// # Errors
/// When the window is empty or reaches past the frame.
pub(crate) fn crop_lines(lines: &LineMap, window: Window, min_length: usize) -> Result<LineMap> {
    let kinds = lines.kinds().crop(window)?;
    let heights = lines.heights().crop(window)?;
    let mut cut = LineMap::empty(window.rows, window.cols);
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let pieces = Components::of(&thinning::thin(&kinds.map(|&k| k == Some(kind))));
        let long = pieces.select(|label| pieces.sizes()[label] >= min_length);
        for (cell, _) in long.cells().filter(|(_, on)| **on) {
            cut.set(cell, kind, heights[cell]);
        }
    }
    Ok(cut)
}
