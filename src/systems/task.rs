//! The promise that a system can make.

use crate::error::Result;
use crate::grid::Grid;
use crate::seed::Seed;
use crate::sketch::LineMap;

/// Turns lines with heights into terrain.
pub trait SketchToTerrain: Send + Sync {
    /// Heights at every cell, in the unit of the heights of `lines`. (rows, cols) as `lines`.
    ///
    /// Every finite answer is allowed; heights of the lines may be kept exactly or not, as the system says.
    ///
    /// # Errors
    /// When the lines are not enough for the system (for example none at all).
    fn generate(&self, lines: &LineMap, seed: Seed) -> Result<Grid<f32>>;
}
