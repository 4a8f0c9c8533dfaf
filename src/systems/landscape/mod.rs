//! The steady-state landscape as a system: a fit, a cell size and what is done about water.
//!
//! [`landscape::solve`](crate::landscape::solve) -> [`pin`] -> [`breach`]: lines are kept to the bit, and the terrain between them
//! drains about as the exemplar does. Nothing is trained; learning is the fit, of the whole terrain around the exemplar's
//! window. Source, equations, departures: `docs/papers/landscape.md`.

use super::task::{Account, Exemplar, Part, SketchToTerrain, System};
use crate::arrays::Arrays;
use crate::checked::{Checked, Settings};
use crate::control::{Control, Progress, Stage, Stop};
use crate::dem::{Dem, Normalization};
use crate::error::Result;
use crate::grid::Grid;
use crate::landscape::{BreachConfig, LandscapeConfig, LandscapeFit, breach, pin, solve_until};
use crate::seed::Seed;
use crate::sketch::LineMap;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// How the landscape is solved and what is done about water.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct LandscapeSystemConfig {
    /// The solver.
    pub(crate) solver: LandscapeConfig,
    /// Whether dams between the lines are cut until no more of the terrain lies in ponds than of the exemplar. Absent: where
    /// rivers made the exemplar.
    pub(crate) drain: Option<bool>,
}

impl Settings for LandscapeSystemConfig {
    fn validate(&self) -> Result<()> {
        self.solver.validate()
    }
}

/// What a style file says of the system: all of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LandscapeInfo {
    /// The exemplar's laws.
    pub(crate) fit: LandscapeFit,
    /// The settings.
    pub(crate) config: LandscapeSystemConfig,
    /// Metres of the unit in which lines come and terrain goes.
    pub(crate) unit: Normalization,
    /// Side of the map's cells, metres.
    pub(crate) cell_size: f64,
    /// Seconds that the fit took.
    pub(crate) seconds: f64,
}

/// Terrain by the laws of an exemplar. Heights of lines and terrain are in the unit interval of its [`LandscapeInfo::unit`].
#[derive(Clone, Debug)]
pub(crate) struct LandscapeSystem(pub(crate) LandscapeInfo);

impl SketchToTerrain for LandscapeSystem {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        let LandscapeInfo { fit, config, unit, cell_size, .. } = &self.0;
        let metres = lines.to_metres(*unit);
        let landscape = solve_until(fit, &metres, *cell_size, &config.solver, seed, stop)?;
        let mut terrain = pin(&landscape.heights(1)?, &metres)?;
        if config.drain.unwrap_or_else(|| fit.is_fluvial()) {
            terrain = breach(&terrain, &metres, &BreachConfig::like(fit), stop)?.heights;
        }
        // Lines take their height itself: there and back again would round.
        let drawn = lines.kinds().as_slice().iter().zip(lines.heights().as_slice());
        for (z, (kind, &height)) in terrain.as_mut_slice().iter_mut().zip(drawn) {
            *z = if kind.is_some() { height } else { unit.to_unit(f64::from(*z)) as f32 };
        }
        Ok(terrain)
    }
}

impl Part for LandscapeSystem {
    const NAME: &'static str = "landscape";
    type Config = LandscapeSystemConfig;
    type Description = LandscapeInfo;

    /// Fits the laws to the terrain around the window; nothing is random.
    fn learn(exemplar: &Exemplar, config: &Checked<Self::Config>, control: Control<'_>) -> Result<Self> {
        let start = Instant::now();
        control.stop.check()?;
        let terrain = exemplar.terrain();
        let cell_size = terrain.cell_size().mean();
        let fit = LandscapeFit::of(terrain.heights(), terrain.valid(), cell_size)?;
        let seconds = start.elapsed().as_secs_f64();
        let figures = [("theta", fit.slope_area.theta)];
        let stage = Stage::Coarse(Self::NAME);
        (control.progress)(&Progress { stage, step: 1, steps: 1, share: 1.0, seconds, figures: &figures });
        let config = (**config).clone();
        Ok(Self(LandscapeInfo { fit, config, unit: exemplar.normalization, cell_size, seconds }))
    }

    fn config(&self) -> &Self::Config {
        &self.0.config
    }

    fn account(&self) -> Account {
        let LandscapeInfo { fit, seconds, .. } = &self.0;
        let theta = fit.slope_area.theta;
        let origin = if fit.is_fluvial() { "" } else { ", in terrain that rivers did not make" };
        let text = format!(
            "slope falls with drained area to the power {theta:.2}{origin}; relief {:.0} m in 128 cells; fitted in {seconds:.1} s",
            fit.relief
        );
        Account { text, seconds: *seconds, figures: vec![("theta", theta), ("relief", fit.relief)] }
    }

    fn save(&self) -> Result<(Self::Description, Arrays)> {
        Ok((self.0.clone(), Arrays::default()))
    }

    fn load(info: Self::Description, _: &mut Arrays, _: Option<&Arc<Dem>>) -> Result<Self> {
        info.config.validate()?;
        Ok(Self(info))
    }
}

impl System for LandscapeSystem {
    fn meets_lines(_: &Self::Config) -> bool {
        true
    }

    fn check(_: &Self::Config, terrain: &Dem) -> Result<()> {
        LandscapeFit::of(terrain.heights(), terrain.valid(), terrain.cell_size().mean()).map(drop)
    }

    fn is_complete(_: &Self::Config) -> bool {
        true
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
        LandscapeSystem(LandscapeInfo {
            fit: LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap(),
            config: LandscapeSystemConfig::default(),
            unit: Normalization::new(0.0, 1000.0).unwrap(),
            cell_size: 30.0,
            seconds: 0.0,
        })
    }

    #[test]
    fn lines_are_kept_and_seeds_vary_what_lies_between() {
        let mut lines = LineMap::empty(40, 56);
        for i in 4..36 {
            lines.set(Cell::new(i, 14), StrokeKind::Ridge, 0.3 + 0.001 * i as f32);
            lines.set(Cell::new(i, 40), StrokeKind::Valley, 0.06 - 0.001 * i as f32);
        }
        let system = system();
        let (one, two) = (
            system.generate(&lines, Seed(1), &Stop::new()).unwrap(),
            system.generate(&lines, Seed(2), &Stop::new()).unwrap(),
        );
        assert_eq!(one.shape(), (40, 56));
        assert_ne!(one, two);
        assert_eq!(one, system.generate(&lines, Seed(1), &Stop::new()).unwrap());
        for (cell, _) in lines.kinds().cells().filter(|(_, kind)| kind.is_some()) {
            assert_eq!(one[cell].to_bits(), lines.heights()[cell].to_bits());
        }
        // Between the lowest and highest of what the style knows, not metres.
        assert!(one.as_slice().iter().all(|z| (-1.0..2.0).contains(z)));
        let stopped = Stop::new();
        stopped.raise();
        assert!(system.generate(&lines, Seed(1), &stopped).is_err());
        assert!(system.generate(&LineMap::empty(8, 8), Seed(1), &Stop::new()).is_err());
    }

    #[test]
    fn what_is_stored_is_what_was_learned() {
        let system = system();
        let (info, mut arrays) = system.save().unwrap();
        let text = serde_json::to_string(&info).unwrap();
        let info = serde_json::from_str(&text).unwrap();
        assert_eq!(LandscapeSystem::load(info, &mut arrays, None).unwrap().0, system.0);
    }

    #[test]
    fn guides_come_at_the_cells_of_the_map_too() {
        let mut lines = LineMap::empty(33, 47);
        lines.set(Cell::new(16, 20), StrokeKind::Ridge, 0.3);
        let mut guide = system();
        guide.0.config.solver = LandscapeConfig::guide();
        let terrain = guide.generate(&lines, Seed(1), &Stop::new()).unwrap();
        assert_eq!((terrain.shape(), terrain[Cell::new(16, 20)]), ((33, 47), 0.3));
    }
}
