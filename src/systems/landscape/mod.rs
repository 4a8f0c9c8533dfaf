//! The steady-state landscape as a system: a fit, a cell size and what is done about water.
//!
//! [`landscape::solve`](crate::landscape::solve) -> [`pin`] -> [`breach`]: lines are kept to the bit, and the terrain between them
//! drains about as the exemplar does. Nothing is trained. Source, equations, departures: `docs/papers/landscape.md`.

use super::task::SketchToTerrain;
use crate::error::Result;
use crate::grid::Grid;
use crate::landscape::{BreachConfig, LandscapeConfig, LandscapeFit, breach, pin, solve};
use crate::seed::Seed;
use crate::sketch::LineMap;

/// Terrain by the laws of an exemplar. Heights of lines and terrain are metres.
#[derive(Clone, Debug)]
pub struct LandscapeSystem {
    /// The exemplar's laws.
    pub fit: LandscapeFit,
    /// Side of the map's cells, metres.
    pub cell_size: f64,
    /// How it is solved.
    pub config: LandscapeConfig,
    /// Whether dams between the lines are cut until no more of the terrain lies in pits than of the exemplar.
    pub drain: bool,
}

impl LandscapeSystem {
    /// The system for maps with the cells of the exemplar, drained where the exemplar drains.
    #[must_use]
    pub fn new(fit: LandscapeFit) -> Self {
        let (cell_size, drain) = (fit.cell_size, fit.is_fluvial());
        Self { fit, cell_size, config: LandscapeConfig::default(), drain }
    }
}

impl SketchToTerrain for LandscapeSystem {
    fn generate(&self, lines: &LineMap, seed: Seed) -> Result<Grid<f32>> {
        let landscape = solve(&self.fit, lines, self.cell_size, &self.config, seed)?;
        let pinned = pin(&landscape.heights(1)?, lines)?;
        if !self.drain {
            return Ok(pinned);
        }
        Ok(breach(&pinned, lines, &BreachConfig::like(&self.fit))?.heights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::sketch::StrokeKind;

    fn exemplar() -> Grid<f32> {
        Grid::from_fn(64, 64, |c| {
            let inward = c.row.min(63 - c.row).min(c.col).min(63 - c.col) as f32;
            12.0 * inward + ((c.row * 37 + c.col * 61 + c.row * c.col) % 17) as f32
        })
    }

    fn system() -> LandscapeSystem {
        let z = exemplar();
        LandscapeSystem::new(LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap())
    }

    #[test]
    fn lines_are_kept_and_seeds_vary_what_lies_between() {
        let mut lines = LineMap::empty(40, 56);
        for i in 4..36 {
            lines.set(Cell::new(i, 14), StrokeKind::Ridge, 300.0 + i as f32);
            lines.set(Cell::new(i, 40), StrokeKind::Valley, 60.0 - i as f32);
        }
        let system = system();
        let (one, two) =
            (system.generate(&lines, Seed(1)).unwrap(), system.generate(&lines, Seed(2)).unwrap());
        assert_eq!(one.shape(), (40, 56));
        assert_ne!(one, two);
        assert_eq!(one, system.generate(&lines, Seed(1)).unwrap());
        for (cell, _) in lines.kinds().cells().filter(|(_, kind)| kind.is_some()) {
            assert_eq!(one[cell].to_bits(), lines.heights()[cell].to_bits());
        }
        assert!(system.generate(&LineMap::empty(8, 8), Seed(1)).is_err());
    }

    #[test]
    fn guides_come_at_the_cells_of_the_map_too() {
        let mut lines = LineMap::empty(33, 47);
        lines.set(Cell::new(16, 20), StrokeKind::Ridge, 300.0);
        let guide = LandscapeSystem { config: LandscapeConfig::guide(), ..system() };
        let terrain = guide.generate(&lines, Seed(1)).unwrap();
        assert_eq!((terrain.shape(), terrain[Cell::new(16, 20)]), ((33, 47), 300.0));
    }
}
