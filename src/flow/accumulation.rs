//! How much ground drains through each cell.

use super::FlowDirections;
use crate::grid::{Grid, Mask};

/// Number of cells that drain through each cell, itself included; 0 at voids.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulation(Grid<u32>);

impl Accumulation {
    /// Counts of cells.
    #[must_use]
    pub fn counts(&self) -> &Grid<u32> {
        &self.0
    }

    /// The channels: cells through which at least `threshold` cells drain.
    #[must_use]
    pub fn channels(&self, threshold: u32) -> Mask {
        self.0.map(|&count| count >= threshold.max(1))
    }
}

/// Counts every valid cell. Linear.
#[must_use]
pub fn accumulate(directions: &FlowDirections) -> Accumulation {
    count(directions, |_| true)
}

/// Counts only the cells of `sources` (and whatever drains through others). Linear.
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub(crate) fn accumulate_from(directions: &FlowDirections, sources: &Mask) -> Accumulation {
    assert_eq!(directions.shape(), sources.shape(), "one source cell for each direction");
    let sources = sources.as_slice();
    count(directions, |i| sources[i])
}

fn count(directions: &FlowDirections, is_source: impl Fn(usize) -> bool) -> Accumulation {
    let (rows, cols) = directions.shape();
    let mut counts = Grid::filled(rows, cols, 0u32);
    let flat = counts.as_mut_slice();
    directions.visit_downstream(
        |_| true,
        |cell, receiver| {
            flat[cell] += u32::from(is_source(cell));
            if let Some(r) = receiver {
                flat[r] += flat[cell];
            }
        },
    );
    Accumulation(counts)
}
