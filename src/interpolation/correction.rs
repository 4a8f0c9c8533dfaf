//! The correction after a model: terrain + the smooth extension of what the terrain misses on the lines.
//!
//! Terrain y, sketch heights s -> y + E(s - y), with E a linear extension of values on line cells to the raster: the
//! harmonic surface, or natural-neighbour weights. At line cells the answer is the sketch height itself, to the bit.
//!
//! Not in the paper: it took the paper's literal model from 19.4 to 24.6 dB (Jacksboro). Cost: one Laplace solve, or one
//! pass of natural-neighbour interpolation.

use super::{NaturalNeighbours, harmonic};
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::sketch::LineMap;

/// How what is missing on the lines is carried into the plane between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CorrectionKind {
    /// By the solution of Laplace's equation.
    Harmonic,
    /// By natural-neighbour (Sibson) weights.
    #[default]
    NaturalNeighbour,
}

/// The correction for one sketch, ready for any number of terrains.
#[derive(Clone, Debug)]
pub struct Correction {
    lines: Mask,
    heights: Grid<f32>,
    extension: Extension,
}

#[derive(Clone, Debug)]
enum Extension {
    Harmonic,
    NaturalNeighbour(Box<NaturalNeighbours>),
}

impl Correction {
    /// Prepares the correction towards the heights of `lines`.
    ///
    /// # Errors
    /// When there is no line cell.
    pub fn new(kind: CorrectionKind, lines: &LineMap) -> Result<Self> {
        let mask = lines.mask();
        if lines.line_count() == 0 {
            return Err(Error::value("number of line cells", 0, "the correction needs at least one"));
        }
        let extension = match kind {
            CorrectionKind::Harmonic => Extension::Harmonic,
            CorrectionKind::NaturalNeighbour => {
                Extension::NaturalNeighbour(Box::new(NaturalNeighbours::new(&mask)?))
            }
        };
        Ok(Self { lines: mask, heights: lines.heights().clone(), extension })
    }

    /// The terrain that passes through the sketch. (rows, cols), in the unit of the sketch's heights.
    ///
    /// # Errors
    /// When the shapes differ or a height of `terrain` is not finite.
    pub fn apply(&self, terrain: &Grid<f32>) -> Result<Grid<f32>> {
        if terrain.shape() != self.lines.shape() {
            return Err(Error::value(
                "terrain to correct",
                format!("{:?}", terrain.shape()),
                format!("the sketch is {:?}", self.lines.shape()),
            ));
        }
        if let Some((cell, z)) = terrain.cells().find(|(_, z)| !z.is_finite()) {
            return Err(Error::value(
                format!("height to correct at row {}, column {}", cell.row, cell.col),
                z,
                "allowed: finite",
            ));
        }
        let missing = self.heights.as_slice().iter().zip(terrain.as_slice());
        let missing = missing.map(|(&s, &y)| f64::from(s) - f64::from(y));
        let extended = match &self.extension {
            Extension::Harmonic => {
                let values = Grid::from_vec(terrain.rows(), terrain.cols(), missing.collect())?;
                harmonic(&self.lines, &values)?
            }
            Extension::NaturalNeighbour(diagram) => {
                let on_lines = missing.zip(self.lines.as_slice()).filter(|(_, line)| **line);
                diagram.interpolate(&on_lines.map(|(m, _)| m).collect::<Vec<_>>())
            }
        };
        let mut corrected = terrain.clone();
        let lines = self.lines.as_slice().iter().zip(self.heights.as_slice());
        for ((y, e), (&line, &s)) in corrected.as_mut_slice().iter_mut().zip(extended.as_slice()).zip(lines) {
            // The sum alone would round: lines take their height itself.
            *y = if line { s } else { (f64::from(*y) + e) as f32 };
        }
        Ok(corrected)
    }
}
