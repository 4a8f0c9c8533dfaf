//! Terrain from a few strokes, by analogy: what the exemplar's own main lines are to the exemplar, the strokes are to the answer.
//!
//! DEM -> [`Synthesis`] (once); lines + seed -> [`Synthesized`]. Nothing is trained. Image analogies (Hertzmann et al. 2001)
//! give the frame: A is the exemplar as few strokes show it (`exemplar`), A' the exemplar, B the drawing. The layout is
//! quilted (Efros & Freeman 2001; `quilting`), then refined from coarse to fine (`generate`) by PatchMatch (Barnes et al. 2009; `search`) whose
//! patches vote on gradients (`votes`); a screened Poisson equation (Perez et al. 2003, Bhat et al. 2008) makes a surface of them that
//! meets the strokes. Where rivers made the exemplar the landscape model guides both; equations and departures:
//! `docs/papers/synthesis.md`. Linear in the cells of the map.

mod config;
mod exemplar;
mod generate;
mod patch;
mod provenance;
mod quilting;
mod search;
mod source;
mod strokes;
mod symmetry;
mod system;
mod votes;
#[cfg(test)]
mod tests;

pub use config::SynthesisConfig;
pub use exemplar::Synthesis;
pub(crate) use generate::Synthesized;
pub(crate) use system::SynthesisSystem;

use super::task::SketchToTerrain;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::seed::Seed;
use crate::sketch::LineMap;

impl SketchToTerrain for Synthesis {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        Ok(self.synthesize(lines, seed, stop)?.heights)
    }
}
