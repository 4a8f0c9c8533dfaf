//! The interpolating surfaces: [`interpolation`](crate::interpolation) as systems.

use super::super::task::SketchToTerrain;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::interpolation::{NaturalNeighbours, biharmonic, delaunay_linear, harmonic};
use crate::seed::Seed;
use crate::sketch::LineMap;

/// The membrane through the lines: Laplace's equation ([`harmonic`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct Laplace;

/// The thin plate through the lines: the biharmonic equation ([`biharmonic`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct Biharmonic;

/// Planes over the Delaunay triangles of the line cells ([`delaunay_linear`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct DelaunayLinear;

/// Sibson's natural-neighbour interpolation ([`NaturalNeighbours`]): the strongest of the classical systems.
#[derive(Clone, Copy, Debug, Default)]
pub struct NaturalNeighbour;

impl SketchToTerrain for Laplace {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        require_lines(lines)?;
        Ok(harmonic(&lines.mask(), &lines.heights().map(|&z| f64::from(z)))?.map(|&z| z as f32))
    }
}

impl SketchToTerrain for Biharmonic {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        require_lines(lines)?;
        Ok(biharmonic(&lines.mask(), &lines.heights().map(|&z| f64::from(z)))?.map(|&z| z as f32))
    }
}

impl SketchToTerrain for DelaunayLinear {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        delaunay_linear(lines)
    }
}

impl SketchToTerrain for NaturalNeighbour {
    fn generate(&self, lines: &LineMap, _seed: Seed, _stop: &Stop) -> Result<Grid<f32>> {
        let heights = lines.heights().cells().filter(|(cell, _)| lines.kinds()[*cell].is_some());
        let heights: Vec<f64> = heights.map(|(_, &z)| f64::from(z)).collect();
        Ok(NaturalNeighbours::new(&lines.mask())?.interpolate(&heights).map(|&z| z as f32))
    }
}

fn require_lines(lines: &LineMap) -> Result<()> {
    if lines.line_count() == 0 {
        return Err(crate::Error::value("number of line cells", 0, "interpolation needs at least one"));
    }
    Ok(())
}
