//! The smallest system: all a new paper has to write. It learns the exemplar's mean height and puts a plateau of it between lines.

use monadnock::arrays::Arrays;
use monadnock::checked::{Checked, Settings};
use monadnock::control::{Control, Progress, Stage, Stop};
use monadnock::dem::Dem;
use monadnock::grid::Grid;
use monadnock::seed::Seed;
use monadnock::sketch::LineMap;
use monadnock::systems::task::{Exemplar, Part, Reach, SketchToTerrain, System};
use monadnock::{Error, Result};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PlateauConfig {
    pub(crate) steps: usize,
}

impl Default for PlateauConfig {
    fn default() -> Self {
        Self { steps: 5 }
    }
}

impl Settings for PlateauConfig {
    fn validate(&self) -> Result<()> {
        if self.steps > 0 { Ok(()) } else { Err(Error::value("plateau.steps", 0, "allowed: at least 1")) }
    }
}

#[derive(Debug)]
pub(crate) struct Plateau {
    config: PlateauConfig,
    mean: f32,
}

impl Part for Plateau {
    const NAME: &'static str = "plateau";
    const NEEDS_TERRAIN: bool = true;
    type Config = PlateauConfig;
    type Description = Checked<PlateauConfig>;

    fn learn(exemplar: &Exemplar, config: &Checked<PlateauConfig>, control: Control<'_>) -> Result<Self> {
        for step in 1..=config.steps {
            control.stop.check()?;
            let (stage, share) = (Stage::Coarse(Self::NAME), step as f64 / config.steps as f64);
            let steps = config.steps;
            (control.progress)(&Progress { stage, step, steps, share, seconds: 0.0, figures: &[] });
        }
        let mean = exemplar.heights.as_slice().iter().sum::<f32>() / exemplar.heights.len() as f32;
        Ok(Self { config: (**config).clone(), mean })
    }

    fn config(&self) -> &PlateauConfig {
        &self.config
    }

    fn save(&self) -> Result<(Self::Description, Arrays)> {
        let mut arrays = Arrays::default();
        arrays.put_f32("mean", &[1], &[self.mean]);
        Ok((Checked::new(self.config.clone())?, arrays))
    }

    fn load(config: Self::Description, arrays: &mut Arrays, terrain: Option<&Arc<Dem>>) -> Result<Self> {
        terrain.ok_or_else(|| Error::value("terrain of the style", "left out", "plateau needs it"))?;
        let mean = arrays.take_f32("mean")?.iter().sum();
        Ok(Self { config: config.into_inner(), mean })
    }
}

impl SketchToTerrain for Plateau {
    fn generate(&self, lines: &LineMap, _: Seed, _: &Stop) -> Result<Grid<f32>> {
        let kinds = lines.kinds();
        Ok(Grid::from_fn(kinds.rows(), kinds.cols(), |c| kinds[c].map_or(self.mean, |_| lines.heights()[c])))
    }

    fn reach(&self) -> Reach {
        Reach::Cells(0)
    }
}

impl System for Plateau {}
