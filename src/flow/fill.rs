//! Depressions filled to their spill level, and steepest descent over the result.
//!
//! [`Surface`] -> [`FilledDem`] -> [`FlowDirections`]. Priority-flood with a queue for pits (Barnes, Lehman and Mulla
//! 2014, algorithm 2), D8 (O'Callaghan and Mark 1984; Jenson and Domingue 1988). No height is nudged: where the filled
//! surface is level, a cell drains back the way the flood reached it, which leads to the outlet by the fewest steps.
//! n log n for ranking, then linear.

use super::Surface;
use super::directions::{FlowDirections, OUTLET, OUTSIDE};
use super::flood::{DONE, Flood, UNSEEN};
use crate::grid::{Grid, d8};
use std::collections::VecDeque;

/// Least depth of a pond, relative to the relief.
pub(crate) const POND_DEPTH: f32 = 1e-3;

/// A surface without pits: from every valid cell a path that never rises leads to an outlet.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledDem {
    heights: Grid<f32>,
    /// The direction from which the flood came.
    ways_back: Grid<u8>,
}

impl FilledDem {
    /// Heights, nowhere below those of the surface; meaningless at voids.
    #[must_use]
    pub(crate) fn heights(&self) -> &Grid<f32> {
        &self.heights
    }
}

/// Raises every pit to the height at which it spills.
#[must_use]
pub fn fill(surface: &Surface) -> FilledDem {
    let mut flood = Flood::new(surface, |_| false);
    let Flood { steps, nodes, cells, state, queue, .. } = &mut flood;
    let mut pit = VecDeque::new();
    let mut level = 0;
    while let Some(here) = pit.pop_front().or_else(|| {
        level = queue.pop()?;
        Some(cells[level as usize] as usize)
    }) {
        let height = nodes[here].height;
        state[here] |= DONE;
        for code in 0..8u8 {
            let there = here.wrapping_add_signed(steps[code as usize]);
            if state[there] != UNSEEN {
                continue;
            }
            state[there] = d8::opposite(code);
            if nodes[there].rank < level {
                nodes[there].height = height;
                pit.push_back(there);
            } else {
                queue.insert(nodes[there].rank);
            }
        }
    }
    let ways_back = flood.directions();
    FilledDem { heights: flood.inner(|i| flood.nodes[i].height), ways_back }
}

/// Share of the valid cells that lie in ponds: those that filling raises by more than a thousandth of the relief.
#[must_use]
pub(crate) fn ponded_share(surface: &Surface) -> f64 {
    let filled = fill(surface);
    let cells = surface.heights().as_slice().iter().zip(filled.heights.as_slice());
    let cells = cells.zip(surface.valid().as_slice()).filter(|(_, ok)| **ok).map(|(heights, _)| heights);
    let (low, high) =
        cells.clone().fold((f32::MAX, f32::MIN), |(low, high), (&z, _)| (low.min(z), high.max(z)));
    let (mut ponded, mut count) = (0usize, 0usize);
    for (z, filled) in cells {
        ponded += usize::from(filled - z > POND_DEPTH * (high - low));
        count += 1;
    }
    ponded as f64 / count as f64
}

/// Steepest descent; on level ground the way to the outlet by which the flood came.
#[must_use]
pub fn d8(filled: &FilledDem) -> FlowDirections {
    let (rows, cols) = filled.heights.shape();
    let back = &filled.ways_back;
    let codes = Grid::from_fn(rows, cols, |cell| {
        let way_back = back[cell];
        if way_back >= OUTLET {
            return way_back;
        }
        // Not an outlet: all eight neighbours exist and are valid.
        let height = f64::from(filled.heights[cell]);
        let slopes = (0..8u8).filter_map(|code| {
            let there = d8::neighbour(cell, code, rows, cols).filter(|&n| back[n] != OUTSIDE)?;
            Some((code, (height - f64::from(filled.heights[there])) / d8::DISTANCES[code as usize]))
        });
        let start = (way_back, 0.0);
        slopes.fold(start, |best, next| if next.1 > best.1 { next } else { best }).0
    });
    FlowDirections::from_codes(codes)
}
