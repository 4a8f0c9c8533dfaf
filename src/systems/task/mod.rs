//! The promises that systems can make, what models of detail share, and random lines around a drawing.

mod calibration;
mod detail;
mod random_lines;
mod sampling;

pub use detail::{DetailModel, DetailUse, Residual, combined, gain_of, gap};
pub use random_lines::{Ground, RandomHeights, with_random_lines};
pub use sampling::SampleUse;

use crate::error::Result;
use crate::grid::Grid;
use crate::seed::Seed;
use crate::sketch::LineMap;
use std::sync::Arc;

/// Turns lines with heights into terrain.
pub trait SketchToTerrain: Send + Sync {
    /// Heights at every cell, in the unit of the heights of `lines`. (rows, cols) as `lines`.
    ///
    /// Every finite answer is allowed; heights of the lines may be kept exactly or not, as the system says.
    ///
    /// # Errors
    /// When the lines are not enough for the system (for example none at all).
    fn generate(&self, lines: &LineMap, seed: Seed) -> Result<Grid<f32>>;

    /// For a system that only finishes the terrain of another one, from the same lines and seed: who wants both makes the
    /// first one once. None for all others.
    fn finishing(&self) -> Option<&Finishing> {
        None
    }
}

/// A system that goes on where another one ends.
pub struct Finishing {
    /// Makes the terrain.
    pub start: Arc<dyn SketchToTerrain>,
    /// The rest: (terrain, lines, seed).
    pub finish: Box<FinishFn>,
}

/// The second half of a [`Finishing`] system.
pub type FinishFn = dyn Fn(&Grid<f32>, &LineMap, Seed) -> Result<Grid<f32>> + Send + Sync;

impl SketchToTerrain for Finishing {
    fn generate(&self, lines: &LineMap, seed: Seed) -> Result<Grid<f32>> {
        (self.finish)(&self.start.generate(lines, seed)?, lines, seed)
    }

    fn finishing(&self) -> Option<&Finishing> {
        Some(self)
    }
}
