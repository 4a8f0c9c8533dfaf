//! The promises that systems make ([`Part`] is the card), what they learn from, what models of detail share, and random lines
//! around a drawing.

mod calibration;
mod detail;
mod exemplar;
mod part;
mod random_lines;
mod sampling;

pub use detail::{DetailModel, DetailUse, Residual};
pub(crate) use detail::{combined, gain_of, gap};
pub(crate) use exemplar::fingerprint;
pub use exemplar::{Exemplar, ExemplarInfo, Source};
pub use part::{Account, Part, System, Use};
pub(crate) use random_lines::{Ground, RandomHeights, with_random_lines};
pub use sampling::SampleUse;

use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::metrics::Provenance;
use crate::seed::Seed;
use crate::sketch::LineMap;
use std::sync::Arc;

/// How far a change of a line can be felt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Up to so many cells.
    Cells(usize),
    /// Everywhere.
    WholeMap,
}

/// Turns lines with heights into terrain.
pub trait SketchToTerrain: Send + Sync {
    /// Heights at every cell, in the unit of the heights of `lines`. (rows, cols) as `lines`.
    ///
    /// Every finite answer is allowed; heights of the lines may be kept exactly or not, as the system says.
    ///
    /// # Errors
    /// When the lines are not enough for the system (for example none at all), or when it is stopped.
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>>;

    /// As [`generate`](Self::generate), for lines that a hand has drawn: their heights say what is wanted, and are no evidence of
    /// what is there.
    ///
    /// # Errors
    /// As there.
    fn draw(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        self.generate(lines, seed, stop)
    }

    /// The same terrain with where every cell comes from, of systems that lay it from places of an exemplar and for which
    /// [`generate`](Self::generate) and [`draw`](Self::draw) are one. None, before any work, of all others.
    fn traced(&self, _lines: &LineMap, _seed: Seed, _stop: &Stop) -> Option<Result<(Grid<f32>, Provenance)>> {
        None
    }

    /// As [`generate`](Self::generate), for the exemplar's own lines: how well a system fits what it has learned.
    ///
    /// # Errors
    /// As there.
    fn rebuild(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        self.generate(lines, seed, stop)
    }

    /// How far a change of a line can be felt.
    fn reach(&self) -> Reach {
        Reach::WholeMap
    }

    /// For a system that only finishes the terrain of another one, from the same lines and seed: who wants both makes the
    /// first one once. None for all others.
    fn finishing(&self) -> Option<&Finishing> {
        None
    }
}

/// A system that goes on where another one ends.
pub struct Finishing {
    /// Makes the terrain.
    pub(crate) start: Arc<dyn SketchToTerrain>,
    /// The rest: (terrain, lines, seed, stop).
    pub(crate) finish: Box<FinishFn>,
}

/// The second half of a [`Finishing`] system.
pub(crate) type FinishFn = dyn Fn(&Grid<f32>, &LineMap, Seed, &Stop) -> Result<Grid<f32>> + Send + Sync;

impl SketchToTerrain for Finishing {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        (self.finish)(&self.start.generate(lines, seed, stop)?, lines, seed, stop)
    }

    fn draw(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        (self.finish)(&self.start.draw(lines, seed, stop)?, lines, seed, stop)
    }

    fn finishing(&self) -> Option<&Finishing> {
        Some(self)
    }
}
