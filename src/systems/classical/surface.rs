//! The interpolating surfaces: [`interpolation`](crate::interpolation) as systems.

use super::super::task::SketchToTerrain;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::interpolation::{NaturalNeighbours, biharmonic_until, delaunay_linear, harmonic_until};
use crate::seed::Seed;
use crate::sketch::LineMap;

/// The membrane through the lines: Laplace's equation ([`harmonic`](crate::interpolation::harmonic)).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Laplace;

/// The thin plate through the lines: the biharmonic equation ([`biharmonic`](crate::interpolation::biharmonic)).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Biharmonic;

/// Planes over the Delaunay triangles of the line cells ([`delaunay_linear`]).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DelaunayLinear;

/// Sibson's natural-neighbour interpolation ([`NaturalNeighbours`]): the strongest of the classical systems.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NaturalNeighbour;

impl SketchToTerrain for Laplace {
    fn generate(&self, lines: &LineMap, _seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        require_lines(lines)?;
        Ok(harmonic_until(&lines.mask(), &lines.heights().map(|&z| f64::from(z)), stop)?.map(|&z| z as f32))
    }
}

impl SketchToTerrain for Biharmonic {
    fn generate(&self, lines: &LineMap, _seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        require_lines(lines)?;
        Ok(biharmonic_until(&lines.mask(), &lines.heights().map(|&z| f64::from(z)), stop)?.map(|&z| z as f32))
    }
}

impl SketchToTerrain for DelaunayLinear {
    fn generate(&self, lines: &LineMap, _seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        stop.check()?;
        delaunay_linear(lines)
    }
}

impl SketchToTerrain for NaturalNeighbour {
    fn generate(&self, lines: &LineMap, _seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        let heights = lines.heights().cells().filter(|(cell, _)| lines.kinds()[*cell].is_some());
        let heights: Vec<f64> = heights.map(|(_, &z)| f64::from(z)).collect();
        Ok(NaturalNeighbours::new(&lines.mask())?.interpolate_until(&heights, stop)?.map(|&z| z as f32))
    }
}

fn require_lines(lines: &LineMap) -> Result<()> {
    if lines.line_count() == 0 {
        return Err(crate::Error::value("number of line cells", 0, "interpolation needs at least one"));
    }
    Ok(())
}
